//! The reference solution of a photo, and whether any scene gives the photo through the measured
//! lens.

use super::evidence::{Residuals, unexplained_product};
use super::limits::{CLEARLY_FOREIGN, FOREIGN, SHORT_STEPS};
use super::residuals::Explained;
use crate::deconvolution::method::total_variation::TotalVariation;
use crate::deconvolution::method::{MethodError, Problem, Watch};
use crate::frame::{Channel, Frame, Plane, Work};
use crate::pipeline::Pipeline;
use crate::pipeline::stages::{LensAlone, Prepared, Reference};

/// A candidate whose residuals are known before the reference solution is solved.
#[derive(Clone, Copy)]
pub(in crate::pipeline) struct KnownCandidate<'a> {
    /// Residuals, channel by channel.
    pub(in crate::pipeline) channels: &'a [Residuals],
    /// The candidate through the lens.
    pub(in crate::pipeline) seen: &'a Frame<Work>,
}

impl Pipeline {
    /// Finding of the measured lens alone on `photo`, given a `candidate` of any method.
    ///
    /// A refusal should cost no more than a restoration. One foreign channel is enough, and for
    /// most foreign photos a few steps of the channel that the candidate explains worst suffice.
    pub(in crate::pipeline) fn lens_alone(
        &self,
        photo: &Prepared<'_>,
        candidate: KnownCandidate<'_>,
        watch: &mut Watch<'_>,
    ) -> Result<LensAlone, MethodError> {
        let first = self.short_residuals(photo, candidate);
        if unexplained_product(&[first]) > CLEARLY_FOREIGN {
            return Ok(LensAlone::Foreign(vec![first]));
        }
        let solved = self.by_lens_alone(&self.reference, photo, watch)?;
        let evidence = self.evidence(photo, &solved);
        Ok(match is_foreign(&evidence.channels) {
            true => LensAlone::Foreign(evidence.channels),
            false => LensAlone::Fitting(Box::new(Reference { solved, evidence })),
        })
    }

    /// Residuals of a short reference solution in the channel that `candidate` explains worst. A
    /// JPEG is decoded with the candidate, because decoding needs a picture.
    fn short_residuals(&self, photo: &Prepared<'_>, candidate: KnownCandidate<'_>) -> Residuals {
        let (observation, lens) = (&photo.observation, &self.lens_of(photo).model);
        let listed = observation.channels.list().iter().zip(candidate.channels);
        let worst = listed.max_by(|a, b| a.1.product().total_cmp(&b.1.product()));
        let worst = worst.map_or(Channel::Green, |(&c, _)| c);
        let expected = observation.sampling.expected_data(candidate.seen).map(|data| {
            let noise = Channel::ALL.map(|c| observation.data_noise(c));
            observation.with_data(data, noise)
        });
        let decoded = expected.as_ref().unwrap_or(observation);
        let short = TotalVariation { steps: SHORT_STEPS, ..self.reference };
        let light = self.pose(photo, |problem| {
            short.solve_channel(&Problem { observation: decoded, ..*problem }, worst).0
        });
        let mut seen = Plane::zeros(light.size());
        lens.forward(worst, &light, &mut seen);
        let (data, noise) = (decoded.light.plane(worst), observation.data_noise(worst));
        self.channel_residuals(photo, worst, &Explained { seen: &seen, data, noise })
    }
}

/// Whether no scene gives a photo whose reference solution leaves these residuals.
fn is_foreign(channels: &[Residuals]) -> bool {
    let product = unexplained_product(channels);
    product > FOREIGN || product.is_nan()
}
