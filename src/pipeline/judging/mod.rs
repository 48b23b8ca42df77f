//! Judging: a result that harms is not delivered.
//!
//! The witnesses of the [`table`] are evaluated twice: first for whether a result is suspect, which
//! costs little, and then, with the reference solution, for whether it harms. A harmful result is
//! replaced by a solution of the measured lens alone: by that of `digital` or, if that also harms,
//! by the reference solution. The photo itself is returned if no scene gives it through the
//! measured lens, even without its outliers, or if noise hides what the lens did.

mod distance;
mod evidence;
mod fine_colour;
mod grain;
pub(super) mod limits;
mod measures;
mod reference;
mod residuals;
mod table;
mod verdict;

use evidence::worst_unexplained;
pub use evidence::{Evidence, Residuals, unexplained_product};
pub use fine_colour::FineColour;
pub use grain::Grain;
use limits::FOREIGN_JPEG;
pub use limits::{FOREIGN, NO_GAIN};
pub use measures::Case;
pub(super) use residuals::valid_pixels;
pub use table::{Unit, WITNESSES, WitnessRow};
pub use verdict::{Measures, harm, is_suspect};

use super::stages::{LensAlone, Prepared, Solved};
use super::{Outcome, Pipeline, Verdict};
use crate::deconvolution::method::{Method, MethodError, NoOptics, Watch};
use crate::deconvolution::observation::DataKind;
use crate::deconvolution::stage::ResultStage;
use crate::frame::{Frame, Work};

impl Verdict {
    /// Whether something other than the method's result is delivered.
    pub fn noticed(self) -> bool {
        self != Verdict::Sound
    }
}

impl Pipeline {
    /// The [`Outcome`] of what was `solved` for `photo`; `watch` is called after every step of a
    /// reference solution.
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
        let alone = Case { photo, solved, evidence: &evidence, reference: None };
        let measures = alone.measures();
        if !is_suspect(&WITNESSES, &measures, solved.about.starts_from_lens) {
            return Ok(Outcome::of(solved, evidence));
        }
        let lens_alone = match photo.lens_alone.get() {
            Some(known) => known,
            None => {
                let made = self.lens_alone(photo, watch)?;
                photo.lens_alone.get_or_init(|| made)
            }
        };
        let reference = match lens_alone {
            LensAlone::Fitting(reference) => reference,
            LensAlone::Foreign(channels) => {
                let evidence = Evidence { channels: channels.clone(), ..evidence };
                return Ok(refused(photo, solved, evidence, foreign(channels)));
            }
        };
        if gains_nothing(&evidence) && gains_nothing(&reference.evidence) {
            let evidence = reference.evidence.clone();
            return Ok(refused(photo, solved, evidence, limits::NOTHING_GAINED.to_owned()));
        }
        let reference_solution = &reference.solved;
        let beside = Case { reference: Some(&reference_solution.picture), ..alone };
        let measures = beside.measures();
        let Some(reason) = verdict::harm_in_words(&WITNESSES, &measures) else {
            return Ok(Outcome::of(solved, evidence));
        };
        let replaced = match self.by_digital(photo, reference_solution, watch)? {
            Some(outcome) => outcome,
            None => Outcome::of(reference_solution, reference.evidence.clone()),
        };
        let captures = solved.captures;
        let stage = ResultStage::LensModel;
        Ok(Outcome { verdict: Verdict::Replaced, stage, reason, captures, ..replaced })
    }

    /// The outcome of `digital` in place of a harmful result; `None` if it also harms.
    fn by_digital(
        &self,
        photo: &Prepared<'_>,
        reference: &Solved,
        watch: &mut Watch<'_>,
    ) -> Result<Option<Outcome>, MethodError> {
        let solved = self.by_lens_alone(&self.digital, photo, watch)?;
        let evidence = self.evidence(photo, &solved);
        let reference = Some(&reference.picture);
        let case = Case { photo, solved: &solved, evidence: &evidence, reference };
        let harms = harm(&WITNESSES, &case.measures()).is_some();
        Ok((!harms).then(|| Outcome::of(&solved, evidence)))
    }

    /// Solves `photo` by `method` with the measured lens and no capture.
    ///
    /// # Errors
    /// When there is no lens model.
    pub fn by_lens_alone(
        &self,
        method: &dyn Method,
        photo: &Prepared<'_>,
        watch: &mut Watch<'_>,
    ) -> Result<Solved, MethodError> {
        let mut none = NoOptics { size: photo.observation.light.size() };
        let solution = self.pose(photo, |problem| method.solve(problem, &mut none, watch))?;
        Ok(self.finish(photo, method.about(), solution))
    }

    /// Whether no scene gives `photo` through the measured lens, as [`Pipeline::judge`] would find,
    /// but before any more captures; `seen` is a candidate of the lens alone, seen through it.
    pub(super) fn is_hopeless(&self, photo: &Prepared<'_>, seen: &Frame<Work>) -> bool {
        let channels = self.residuals(photo, seen);
        let is_own_jpeg =
            photo.shows_sensor() && photo.observation.sampling.kind() == DataKind::Jpeg;
        let limit = if is_own_jpeg { FOREIGN_JPEG } else { FOREIGN };
        if unexplained_product(&channels) <= limit {
            return false;
        }
        let known = photo.lens_alone.get().or_else(|| {
            let made = self.lens_alone(photo, &mut |_, _| {}).ok()?;
            Some(photo.lens_alone.get_or_init(|| made))
        });
        known.is_some_and(|of| matches!(of, LensAlone::Foreign(_)))
    }
}

/// Whether the result leaves as much of luma unexplained as the untouched photo does.
fn gains_nothing(evidence: &Evidence) -> bool {
    let found = evidence.luma_residual_over_photo();
    found.is_some_and(|found| found > NO_GAIN || found.is_nan())
}

/// The `photo` itself in place of what was `solved`.
fn refused(photo: &Prepared<'_>, solved: &Solved, evidence: Evidence, reason: String) -> Outcome {
    let grain = Grain { result: evidence.grain.photo, ..evidence.grain };
    let evidence = Some(Evidence { grain, ..evidence });
    let untouched = Outcome::untouched(photo.photo.as_ref().clone(), reason);
    Outcome { evidence, captures: solved.captures, ..untouched }
}

/// Sentence for the user on why a photo with these residuals is returned as it is.
fn foreign(channels: &[Residuals]) -> String {
    let (floors, share) =
        worst_unexplained(channels).map_or((0.0, 0.0), |of| (of.over_floor(), of.over_untouched()));
    format!(
        "the measured lens does not explain the photo; it may come from another lens, be sharp \
         already, or have been sharpened or compressed (residual: {floors:.1} times what noise and \
         the lens model leave, allowed {:.1} times; {:.0} % of the untouched photo's)",
        FOREIGN as f32 / share,
        100.0 * share
    )
}
