//! What the measured lens alone says of a photo: whether any scene gives it, by the reference
//! solution or by less where less says it.

use std::sync::Arc;

use super::Pipeline;
use super::evidence::residuals_on;
use super::stages::{LensAlone, Prepared, Reference, Residuals, product, unexplained};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::method::total_variation::TotalVariation;
use crate::deconvolution::method::{Method, MethodError, NoOptics, Problem, Watch};
use crate::deconvolution::observation::DataKind;
use crate::frame::{Channel, Frame, Plane, Work};

/// What is too much to be left unexplained of a photo.
struct UnexplainedLimit {
    /// The model residual over the photo's noise, times the same over the untouched photo's
    /// residual, in the worst channel,
    product: f32,
    /// of the channels that have more noises of the first
    noises: f32,
    /// and more than this share of the second.
    share: f32,
}

/// No scene gives a photo whose reference solution leaves more than this: a contrasty photo solved
/// with a coarse lens model has a smaller share, and gains.
const FOREIGN: UnexplainedLimit = UnexplainedLimit { product: 0.72, noises: 1.6, share: 0.32 };
/// The reference solution need not be asked where the lens model alone leaves more than this,
/// measured as [`FOREIGN`] is. With its prior it leaves .65 to 1.6 times as much: of 176 photos of
/// eight scenes on the small rigs all past 2.2 were foreign.
const CLEAR: f32 = 4.0 * FOREIGN.product;
/// The same of a JPEG: of 284 of eight scenes on the small rigs, of three qualities and eight kinds
/// of blur, all past 4.3 were foreign.
const CLEAR_OF_JPEG: f32 = 8.0 * FOREIGN.product;
/// Of the channels that have more noises
const CLEAR_NOISES: f32 = 2.0 * FOREIGN.noises;
/// and more than this share.
const CLEAR_SHARE: f32 = 1.25 * FOREIGN.share;
/// The whole reference solution of a JPEG need not be asked where so many steps of it
const FIRST_TRY_STEPS: u32 = 12;
/// leave more than this, measured as [`FOREIGN`] is; of the same 284 JPEGs all such were foreign,
/// and their number of steps is a guess.
const FIRST_TRY: f32 = 2.0 * FOREIGN.product;
/// of the channels that have more noises
const FIRST_TRY_NOISES: f32 = 1.25 * FOREIGN.noises;
/// and more than this share.
const FIRST_TRY_SHARE: f32 = 1.25 * FOREIGN.share;

/// What is left of a photo.
#[derive(Clone, Copy)]
pub(super) struct Left<'a> {
    /// Channel by channel.
    pub(super) channels: &'a [Residuals],
    /// How the candidate is seen through the lens, where a method that starts from the lens model
    /// made it before any capture.
    pub(super) by_lens_alone: Option<&'a Frame<Work>>,
}

impl Pipeline {
    /// What `lens` alone says of `photo`, of which something else has `left` so much.
    ///
    /// A refusal is to cost no more than a restoration. One channel is enough for it, so the worst
    /// is solved first; and none is solved where what was left says it clearly.
    pub(super) fn lens_alone(
        &self,
        photo: &Prepared<'_>,
        lens: &Arc<LensModel>,
        left: Left<'_>,
        watch: &mut Watch<'_>,
    ) -> Result<LensAlone, MethodError> {
        let clear = match photo.observation.sampling.kind() {
            // Not measured.
            DataKind::Raw => f32::INFINITY,
            DataKind::Jpeg => CLEAR_OF_JPEG,
            DataKind::Developed => CLEAR,
        };
        if left.by_lens_alone.is_some() && is_clearly_foreign(left.channels, clear) {
            return Ok(LensAlone::Foreign(left.channels.to_vec()));
        }
        let listed = photo.observation.channels.list().iter().zip(left.channels);
        let worst = listed.max_by(|a, b| product(a.1).total_cmp(&product(b.1)));
        let worst = worst.map_or(Channel::Green, |(&c, _)| c);
        if let Some(left) = self.first_try(photo, lens, left, worst) {
            return Ok(LensAlone::Foreign(vec![left]));
        }
        let said = std::cell::OnceCell::new();
        let is_enough = |plane: &Plane| {
            let mut seen = Plane::zeros(plane.size());
            lens.forward(worst, plane, &mut seen);
            let left = vec![self.residuals_of(photo, lens, worst, &seen)];
            is_foreign(&left) && said.set(left).is_ok()
        };
        // A JPEG's channels are coded together, and none decides alone.
        let together = photo.observation.sampling.follows_prediction();
        let mut none = NoOptics { size: photo.observation.light.size() };
        let solution = self.pose(lens, photo, |problem| match together {
            true => self.reference.solve(problem, &mut none, watch).map(Some),
            false => Ok(self.reference.solve_unless(problem, worst, &is_enough, watch)),
        })?;
        let Some(solution) = solution else {
            return Ok(LensAlone::Foreign(said.into_inner().unwrap_or_default()));
        };
        let solved = self.finish(lens, photo, self.reference.about(), solution);
        let evidence = self.evidence(photo, &solved);
        Ok(match is_foreign(&evidence.channels) {
            true => LensAlone::Foreign(evidence.channels),
            false => LensAlone::Fitting(Box::new(Reference { solved, evidence })),
        })
    }

    /// What a few steps of the reference solution leave of the `worst` channel of a JPEG, where
    /// that is so much that all of them would say the same. All of them, twice because a file may
    /// be read only once a picture is known, take longer than a method. Here it is read by what
    /// the method made.
    fn first_try(
        &self,
        photo: &Prepared<'_>,
        lens: &Arc<LensModel>,
        left: Left<'_>,
        worst: Channel,
    ) -> Option<Residuals> {
        let observation = &photo.observation;
        let Some(seen) = left.by_lens_alone else { return None };
        let data = observation.sampling.expected_data(seen)?;
        let channels = photo.observation.channels.list();
        let known = channels.iter().zip(left.channels).find(|&(&c, _)| c == worst);
        let (_, &known) = known?;
        let found = std::cell::OnceCell::new();
        let is_enough = |plane: &Plane| {
            found.get_or_init(|| {
                let mut seen = Plane::zeros(plane.size());
                lens.forward(worst, plane, &mut seen);
                residuals_on(photo, lens, worst, (&seen, data.plane(worst)), known)
            });
            true
        };
        let few = TotalVariation { steps: FIRST_TRY_STEPS, ..self.reference };
        self.pose(lens, photo, |problem| {
            let noise = Channel::ALL.map(|c| observation.data_noise(c));
            let observation = observation.with_data(data.clone(), noise);
            let problem = Problem { observation: &observation, ..*problem };
            few.solve_unless(&problem, worst, &is_enough, &mut |_, _| {})
        });
        let clear = |of: &Residuals| {
            let (noises, share) = unexplained(&[*of], FIRST_TRY_NOISES, FIRST_TRY_SHARE);
            noises * share > FIRST_TRY
        };
        found.into_inner().filter(clear)
    }
}

/// What is `left` of a photo, as a share of what no scene leaves.
pub(super) fn past(left: &[Residuals]) -> f32 {
    let (noises, share) = unexplained(left, FOREIGN.noises, FOREIGN.share);
    noises * share / FOREIGN.product
}

/// Whether no scene gives a photo of which the reference solution has so much `left`.
fn is_foreign(left: &[Residuals]) -> bool {
    // Not a number is past every limit.
    let fine = past(left) <= 1.0;
    !fine
}

/// Whether the reference solution would say so, where a method that starts from the lens model
/// alone has so much `left`, more than is `clear`.
fn is_clearly_foreign(left: &[Residuals], clear: f32) -> bool {
    let (noises, share) = unexplained(left, CLEAR_NOISES, CLEAR_SHARE);
    noises * share > clear
}

/// Why a photo of which so much is `left` is not restored.
pub(super) fn foreign(left: &[Residuals]) -> String {
    let (noises, share) = unexplained(left, FOREIGN.noises, FOREIGN.share);
    let (percent, allowed) = (100.0 * share, FOREIGN.product / share);
    format!(
        "the measured lens does not explain the photo; it may come from another lens, be sharp \
         already, or have been sharpened or compressed (what is left is {noises:.1} times what its \
         noise and the lens model leave, and {percent:.0} % of what is left of the photo as it is; \
         allowed {allowed:.1} times)"
    )
}
