//! No harm: a result is judged before it is delivered. What harms is replaced by the second
//! opinion, what total variation makes of the photo with the measured lens, and where that harms
//! too, by the photo itself.
//!
//! The limits were set on 2026-11-21 and 22 on `small.toml`: faults of the laboratory's sweep on the
//! scenes coffee and chart, seed 1, and astronaut and rocket without a fault. `tests/lab stability`
//! measures the rates of false alarms and of harm caught, on quarters of astronaut and
//! rocket with other seeds.

use super::evidence::{Evidence, distance};
use super::{Bench, Request, Restored};
use crate::deconvolution::method::{Method, MethodError, Watch};
use crate::rig::exposure::Rig;

/// Unexplained by any scene: the reference solution's model residual over the photo's noise times the
/// same over the untouched photo's residual, in the worst channel. Set 2026-11-22 on coffee and
/// chart, whole and in quarters: healthy 0.64 at most; from a lens a fifth sharper (f/5) and more,
/// where results harm, 0.80 and more;
const FOREIGN: f32 = 0.72;
/// of the channels that have so many noises of the first: healthy, where the share below is
/// reached, 1.22 at most, from a sharper lens 2.1 and more (a noisy photo has nothing but its
/// noise, once),
const FOREIGN_NOISES: f32 = 1.6;
/// and this share of the second: healthy, where more than noise is left, 0.29 at most, from a
/// sharper lens 0.36 and more. A contrasty photo solved with a coarse lens model has less, and
/// gains.
const FOREIGN_SHARE: f32 = 0.32;
/// Distance from the reference solution at which a result harms. Without a fault results that gain are
/// at 0.23 to 1.26 (the latter where captures take out glare that no model holds), those that harm
/// at 1.13 to 6.7.
const APART: f64 = 1.3;
/// The same for a method that does not begin with the lens model: past 1 the photo itself is nearer
/// to the reference solution; the little more is a guess. Without a fault on coffee and chart,
/// 2026-11-22: 0.67 at most where there is gain, harm of more than 0.002 from 0.996 on.
const APART_OF_OTHERS: f64 = 1.05;
/// The same for a result whose photograph is the photo, its certificate at most
/// [`CERTIFIED_RATIO`]: where the model misses much, captures rightly lead far from it (the virtual
/// rig's photo, past 1.3, gains 0.11 SSIM more than the reference solution). Guess: with glare that no
/// model holds 0.91 at most; a panel with a hundredth of its pixels dead harms at 1.87, and is let
/// through.
const APART_CERTIFIED: f64 = 2.0;
/// The same for a result whose photograph is not the photo, its certificate past [`SUSPECT_RATIO`]:
/// where there is gain 0.69 at most, harm from 1.24 on (2026-11-22).
const APART_DOUBTED: f64 = 1.0;
/// Optical residual over its floor; the virtual rig's photo is at 1.3.
const CERTIFIED_RATIO: f32 = 1.5;
/// How much rougher than the photo's the quiet parts of a result may be. Without a fault results
/// that gain are at 0.1 to 2.3, but one of 4.3; those that harm at 1.8 to 9.
const ROUGHER: f32 = 2.7;
/// A method that begins with the lens model is compared with the reference solution only when it leaves
/// more than this unexplained, measured as [`FOREIGN`] is: healthy 0.46 at most;
const SUSPECT_UNEXPLAINED: f32 = 0.55;
/// or its certificate is this far above its floor: without a fault 2.1 at most;
const SUSPECT_RATIO: f32 = 3.0;
/// or its quiet parts are this much rougher: where there is gain 1.6 at most, harm 1.8 and more.
const SUSPECT_ROUGHER: f32 = 1.7;

/// Whether the method called `method` begins with the lens model and its prior.
fn begins_with_the_lens(method: &str) -> bool {
    matches!(method, "hybrid" | "block-matching" | "digital")
}

/// What became of a result.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// It is delivered.
    Sound,
    /// The reference solution is delivered in its place; why.
    Repaired(String),
    /// The photo itself is delivered; why.
    Untouched(String),
}

impl Verdict {
    /// Whether the box noticed something.
    pub fn noticed(&self) -> bool {
        *self != Verdict::Sound
    }
}

/// A result as it may be delivered.
#[derive(Debug, Clone)]
pub struct Judged {
    /// What is delivered; the method's own result where the photo itself is.
    pub restored: Restored,
    /// Whose it is.
    pub verdict: Verdict,
}

/// Whether no scene gives this photo through the lens, as the `second` opinion tells; in words.
fn foreign(second: &Evidence) -> Option<String> {
    let (noises, share) = second.unexplained(FOREIGN_NOISES, FOREIGN_SHARE);
    // Not a number is past every limit.
    let fine = noises * share <= FOREIGN;
    (!fine).then(|| {
        let (left, allowed) = (100.0 * share, FOREIGN / share);
        format!(
            "the measured lens does not explain the photo: {noises:.1} times its noise is left, \
             {left:.0} % of what it leaves of the \
             photo as it is, allowed {allowed:.1} times; it may come from another lens, have been \
             sharpened or compressed: the photo is returned untouched"
        )
    })
}

/// What is wrong with a result that lies `apart` from the reference solution and is so much `rougher`;
/// in words.
fn harmful(apart: f64, allowed: f64, rougher: f32) -> Option<String> {
    if apart > allowed || apart.is_nan() {
        return Some(format!(
            "the result is {:.0} % as far from what the measured lens alone makes of the photo as \
             the photo itself is, \
             allowed {:.0}: that is returned in its place",
            100.0 * apart,
            100.0 * allowed
        ));
    }
    (rougher > ROUGHER || rougher.is_nan()).then(|| {
        format!(
            "the quiet parts of the result are {rougher:.1} times as noisy as the photo's, \
             allowed {ROUGHER}: what the \
             measured lens alone makes of the photo is returned in its place"
        )
    })
}

impl Bench {
    /// Whether what became of a request calls for a reference solution. What began with the lens model
    /// is believed while light and model say nothing against it.
    pub fn is_suspect(&self, request: &Request<'_>, restored: &Restored) -> bool {
        let evidence = self.evidence(request.photo, request.channels, restored);
        let (noises, share) = evidence.unexplained(FOREIGN_NOISES, FOREIGN_SHARE);
        let believed = begins_with_the_lens(request.method.name())
            && noises * share <= SUSPECT_UNEXPLAINED
            && restored.solution.certificate.ratio().is_none_or(|ratio| ratio <= SUSPECT_RATIO)
            && evidence.rougher <= SUSPECT_ROUGHER;
        !believed
    }

    /// Judges what became of a request by the `second` opinion.
    pub fn judge(&self, request: &Request<'_>, restored: &Restored, second: &Restored) -> Verdict {
        let &Request { photo, channels, method, .. } = request;
        if let Some(reason) = foreign(&self.evidence(photo, channels, second)) {
            return Verdict::Untouched(reason);
        }
        let rougher = self.evidence(photo, channels, restored).rougher;
        let apart = distance(photo, &restored.picture, &second.picture, channels);
        // A loop of light alone fits its captures' noise, and is certified all the same. And where
        // captures changed the lens, the reference solution has it, too: what misses it then is where
        // they lie.
        let ratio = restored.solution.certificate.ratio();
        let as_measured = restored.solution.look.refined.is_none();
        let allowed = match ratio {
            _ if !begins_with_the_lens(method.name()) => APART_OF_OTHERS,
            Some(ratio) if ratio <= CERTIFIED_RATIO && as_measured => APART_CERTIFIED,
            Some(ratio) if ratio > SUSPECT_RATIO || ratio.is_nan() => APART_DOUBTED,
            _ => APART,
        };
        harmful(apart, allowed, rougher).map_or(Verdict::Sound, Verdict::Repaired)
    }

    /// [`Bench::restore`] and judged; `lens_alone` makes the reference solution, where one is needed.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn restore_judged(
        &self,
        rig: &mut Rig,
        request: &Request<'_>,
        lens_alone: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<Judged, MethodError> {
        let restored = self.restore(rig, request, watch)?;
        if !self.is_suspect(request, &restored) {
            return Ok(Judged { restored, verdict: Verdict::Sound });
        }
        let again = Request { method: lens_alone, ..*request };
        let second = self.restore_through(&restored.lens, rig, &again, watch)?;
        let verdict = self.judge(request, &restored, &second);
        let restored = match verdict {
            // What the first result cost was spent all the same.
            Verdict::Repaired(_) => Restored {
                captures: restored.captures,
                capture_seconds: restored.capture_seconds,
                waited_seconds: restored.waited_seconds,
                ..second
            },
            Verdict::Sound | Verdict::Untouched(_) => restored,
        };
        Ok(Judged { restored, verdict })
    }
}
