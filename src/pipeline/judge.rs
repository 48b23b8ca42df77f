//! No harm: a result is judged before it is delivered. What harms is replaced by what the measured
//! lens alone makes of the photo: `digital` where captures led astray, else the reference solution,
//! which is total variation's. Where no scene gives the photo through that lens, or noise hides
//! what the lens did, the photo itself is delivered.
//!
//! The limits were measured on `small.toml` under the laboratory's faults; what healthy and harmful
//! results have is in `tests/tables/README.md`.

use std::sync::Arc;

use super::distance::{colour_distance, distance, lightness};
use super::fine_colour::FineColour;
use super::grain::Grain;
use super::lens_alone::{Left, foreign, past};
use super::stages::{EXCESS_LIGHT, Evidence, LensAlone, Prepared, Solved};
use super::{Outcome, Pipeline, Verdict};
use crate::deconvolution::method::{Method, MethodError, NoOptics, Watch};
use crate::deconvolution::stage::ResultStage;
use crate::frame::{Frame, Work};

/// Distance from the reference solution past which a result harms.
const DISTANCE: f64 = 1.3;
/// The same for a method that does not start from the lens model: past 1 the photo itself is nearer
/// to the reference solution; the little more is a guess.
const DISTANCE_OF_OTHERS: f64 = 1.05;
/// The same for a result whose photograph is the photo, its certificate at most
/// [`CERTIFIED_RATIO`]: where the model misses much, captures rightly lead far from it. Guess; a
/// panel with a hundredth of its pixels dead harms below it.
const DISTANCE_CERTIFIED: f64 = 2.0;
/// The same for a result whose photograph is not the photo, its certificate past [`SUSPECT_RATIO`].
const DISTANCE_DOUBTED: f64 = 1.0;
/// Optical residual over its floor that certifies a result.
const CERTIFIED_RATIO: f32 = 1.5;
/// A method that starts from the lens model is compared with the reference solution only when it
/// leaves more than this share of what no scene leaves ([`super::lens_alone`]);
const SUSPECT_UNEXPLAINED: f32 = 0.764;
/// or its certificate is this far above its floor;
const SUSPECT_RATIO: f32 = 3.0;
/// or where the photo is flat its grain is past this share of what harms where the reference
/// solution is flat. Guess.
const SUSPECT_GRAIN: f32 = 0.9;
/// Why a photo of a sharper lens is left.
pub(super) const SHARPER: &str = "the photo is far sharper than the measured lens makes any, as a \
                                  lens stopped down or another one does, and a restoration would \
                                  overshoot; calibrate at the aperture that you photograph with";
/// Why a photo is left of which neither method nor reference solution makes more.
const NOTHING_GAINED: &str = "what the lens did to this photo cannot be told from the photo's \
                              noise; any restoration would be made of that noise";

impl Verdict {
    /// Whether something else than the method's result is delivered.
    pub fn noticed(self) -> bool {
        self != Verdict::Sound
    }
}

impl Pipeline {
    /// What is delivered of what was `solved` for `photo`; `watch` is called after every step of a
    /// reference solution, where one is needed.
    ///
    /// # Errors
    /// When there is no lens model.
    pub fn judge(
        &self,
        photo: &Prepared<'_>,
        solved: &Solved,
        watch: &mut Watch<'_>,
    ) -> Result<Outcome, MethodError> {
        let evidence = self.evidence(photo, solved);
        if photo.is_of_sharper_lens {
            let untouched = Outcome::untouched(photo.photo.as_ref().clone(), SHARPER);
            let grain = Grain { result: evidence.grain.photo, ..evidence.grain };
            let evidence = Some(Evidence { grain, ..evidence });
            return Ok(Outcome { evidence, captures: solved.captures, ..untouched });
        }
        if !is_suspect(solved, &evidence) {
            return Ok(Outcome::of(solved, evidence));
        }
        let as_measured = Arc::ptr_eq(&solved.lens, self.lens_of(photo));
        let by_lens_alone = (solved.about.starts_from_lens && solved.captures == 0)
            .then_some(solved.solution.prediction.as_ref())
            .flatten();
        let made;
        let said = match photo.lens_alone.get() {
            Some(before) if as_measured => before,
            _ => {
                let left = Left { channels: &evidence.channels, by_lens_alone };
                made = self.lens_alone(photo, &solved.lens, left, watch)?;
                if as_measured { photo.lens_alone.get_or_init(|| made) } else { &made }
            }
        };
        let captures = solved.captures;
        let reference = match said {
            LensAlone::Fitting(reference) => reference,
            LensAlone::Foreign(left) => {
                let untouched = Outcome::untouched(photo.photo.as_ref().clone(), foreign(left));
                let grain = Grain { result: evidence.grain.photo, ..evidence.grain };
                let evidence = Some(Evidence { channels: left.clone(), grain, ..evidence });
                return Ok(Outcome { evidence, captures, ..untouched });
            }
        };
        if evidence.gains_nothing() && reference.evidence.gains_nothing() {
            let untouched = Outcome::untouched(photo.photo.as_ref().clone(), NOTHING_GAINED);
            let grain = Grain { result: evidence.grain.photo, ..evidence.grain };
            let evidence = Some(Evidence { grain, ..reference.evidence.clone() });
            return Ok(Outcome { evidence, captures, ..untouched });
        }
        let Some(reason) = harmful(photo, solved, &evidence, &reference.solved) else {
            return Ok(Outcome::of(solved, evidence));
        };
        let replaced = match self.without_light(photo, solved, &reference.solved, watch)? {
            Some(outcome) => outcome,
            None => Outcome::of(&reference.solved, reference.evidence.clone()),
        };
        // The lens is the measured one, or the one that captures say it is.
        let stage = if as_measured { ResultStage::LensModel } else { ResultStage::Captures };
        Ok(Outcome { verdict: Verdict::Replaced, stage, reason, captures, ..replaced })
    }

    /// What `digital` makes of `photo` with the lens of a result that harms, where captures made
    /// that result and without them none does.
    fn without_light(
        &self,
        photo: &Prepared<'_>,
        harmful_result: &Solved,
        reference: &Solved,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Outcome>, MethodError> {
        if harmful_result.captures == 0 {
            return Ok(None);
        }
        let lens = &harmful_result.lens;
        let mut none = NoOptics { size: photo.observation.light.size() };
        let solution =
            self.pose(lens, photo, |problem| self.digital.solve(problem, &mut none, watch))?;
        let solved = self.finish(lens, photo, self.digital.about(), solution);
        let evidence = self.evidence(photo, &solved);
        let harms = harmful(photo, &solved, &evidence, reference).is_some();
        Ok((!harms).then(|| Outcome::of(&solved, evidence)))
    }

    /// Whether no scene gives `photo` through the measured lens, by which what a method makes of it
    /// with that lens alone is `seen` so: what [`Pipeline::judge`] would say after all captures.
    pub(super) fn is_hopeless(&self, photo: &Prepared<'_>, seen: &Frame<Work>) -> bool {
        let lens = self.lens_of(photo);
        let channels = self.residuals(photo, lens, seen);
        if past(&channels) <= SUSPECT_UNEXPLAINED {
            return false;
        }
        let before = photo.lens_alone.get();
        let left = Left { channels: &channels, by_lens_alone: Some(seen) };
        let made = match before {
            Some(_) => None,
            None => self.lens_alone(photo, lens, left, &mut |_, _| {}).ok(),
        };
        let kept = made.map(|made| photo.lens_alone.get_or_init(|| made));
        before.or(kept).is_some_and(|said| matches!(said, LensAlone::Foreign(_)))
    }
}

/// Whether a result calls for a reference solution. What started from the lens model is believed
/// while light and model say nothing against it.
fn is_suspect(solved: &Solved, evidence: &Evidence) -> bool {
    let believed = solved.about.starts_from_lens
        && past(&evidence.channels) <= SUSPECT_UNEXPLAINED
        && solved.solution.certificate.ratio().is_none_or(|ratio| ratio <= SUSPECT_RATIO)
        && !evidence.grain.harms(SUSPECT_GRAIN)
        && evidence.excess_light() <= EXCESS_LIGHT
        && !evidence.fine_colour.is_dotted()
        && !evidence.gains_nothing();
    !believed
}

/// What is wrong with a result, in words: its light, its distance from the reference solution, or
/// its grain.
fn harmful(
    photo: &Prepared<'_>,
    solved: &Solved,
    evidence: &Evidence,
    reference: &Solved,
) -> Option<String> {
    let excess = evidence.excess_light();
    if excess > EXCESS_LIGHT || excess.is_nan() {
        return Some(format!(
            "the light of the result was {:.0} % off the photo's, as captures of a panel that is \
             not as bright as when it was measured lead it, and what the measured lens alone makes \
             of the photo is returned in its place (allowed {:.0} %)",
            100.0 * excess,
            100.0 * EXCESS_LIGHT
        ));
    }
    let certified = solved.solution.certificate.ratio().is_some_and(|r| r <= CERTIFIED_RATIO);
    if evidence.gains_nothing() {
        return Some(
            "the photo's noise hides what the lens did to it, and the result explained the photo \
             less than the photo does itself; what the measured lens alone makes of it is returned \
             in its place"
                .to_owned(),
        );
    }
    if evidence.explains_less() && !certified {
        return Some(
            "the result explained the photo less than the photo does itself, and what the measured \
             lens alone makes of it is returned in its place"
                .to_owned(),
        );
    }
    let allowed = distance_limit(solved);
    let pictures = [&*photo.photo, &solved.picture, &reference.picture];
    let distances = [
        (Some(distance(pictures, photo.observation.channels)), ""),
        (colour_distance(pictures, photo.observation.channels), " in colour"),
    ];
    for (found, by) in distances {
        let Some(found) = found.filter(|found| *found > allowed || found.is_nan()) else {
            continue;
        };
        return Some(format!(
            "the result was too far{by} from what the measured lens alone makes of the photo, and \
             that is returned in its place ({:.0} % as far as the photo itself, allowed {:.0})",
            100.0 * found,
            100.0 * allowed
        ));
    }
    if evidence.fine_colour.harms(FineColour::of(&reference.picture, photo.observation.channels)) {
        return Some(
            "the result's colours alternated from pixel to pixel where its lightness did not, as \
             of a photo out of focus, and what the measured lens alone makes of the photo is \
             returned in its place"
                .to_owned(),
        );
    }
    let seen = |picture: &Frame<Work>| lightness(picture, photo.observation.channels);
    let grain = Grain::of(&seen(&solved.picture), &seen(&photo.photo), &seen(&reference.picture));
    grain.harms(1.0).then(|| {
        format!(
            "the flat parts of the result were grainier than the photo's, and what the measured \
             lens alone makes of the photo is returned in its place (grain of {:.1} grey levels \
             for {:.1})",
            grain.result, grain.photo
        )
    })
}

/// How far a result may be from the reference solution.
///
/// A loop of light alone fits its captures' noise, and is certified all the same.
fn distance_limit(solved: &Solved) -> f64 {
    match solved.solution.certificate.ratio() {
        _ if !solved.about.starts_from_lens => DISTANCE_OF_OTHERS,
        Some(ratio) if ratio <= CERTIFIED_RATIO => DISTANCE_CERTIFIED,
        Some(ratio) if ratio > SUSPECT_RATIO || ratio.is_nan() => DISTANCE_DOUBTED,
        _ => DISTANCE,
    }
}
