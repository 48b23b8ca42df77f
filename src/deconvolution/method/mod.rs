//! The methods, one file each.
//!
//! | name | captures per photo | what it is |
//! |---|---|---|
//! | [`paper`] | 4 + 5·n | Eqs. 4–7 as printed, flip–FC–flip backward |
//! | [`hybrid`] | 1 to 1 + corrections | lens model, certified and corrected by captures; default |
//! | block-matching | 1 + corrections | [`hybrid`] with block matching as the prior: [`blocks`] |
//! | [`digital`] | 0 | lens model only |
//! | [`wiener`], [`richardson_lucy`], [`total_variation`] | 0 | baselines |
//!
//! Choices that the paper leaves open (each checked by a test in `tests/rigs/method.rs`):
//!
//! * **Factor 2 of Eq. 7** is kept in `paper`: the step on Kᵀ(KL − B) is 2τ, stable for τ < 1/‖K‖².
//! * **Threshold λτ/2** of Eq. 6 is kept as printed, although the proximal step of Eq. 4 would be
//!   λτ.
//! * **Levels**: four, approximation untouched; borders of the transform periodised, hence
//!   orthonormal.
//! * **Boundary**: the canvas is larger than the photo and solved with it; residuals are zero where
//!   B has no data.
//! * **Margin and border patches**: see [`super::patches`].

pub mod blocks;
pub mod digital;
pub mod hybrid;
pub mod paper;
pub mod richardson_lucy;
pub mod total_variation;
pub mod wiener;

mod binned;
mod brake;
mod candidate;
mod channel_solve;
mod colour_prior;
mod momentum;
mod problem;
mod record;

pub use momentum::Momentum;
pub use problem::{Certificate, Hopeless, MethodError, Problem, Solution};
pub use record::{IterationRecord, ResidualOf, Step, Watch};

use super::data_term::NOISE_MIN;
use super::forward_convolution::{ForwardConvolution, Seen};
use crate::frame::{Frame, Size, Work};
use crate::remedy::AnyFailure;

/// Properties of a method that do not depend on its parameters, for rig files, lists and the judge.
#[derive(Debug, PartialEq, Eq)]
pub struct About {
    /// Name in rig files, tables and reports.
    pub name: &'static str,
    /// Whether the method starts from the lens model and its prior. Its result is then near the
    /// solution by the lens alone, unless captures change it.
    pub starts_from_lens: bool,
}

/// A method with its parameters.
pub trait Method {
    /// Properties of the method.
    fn about(&self) -> &'static About;

    /// Name in rig files, tables and reports.
    fn name(&self) -> &'static str {
        self.about().name
    }

    /// Maximum number of captures per photo.
    fn captures_max(&self) -> u32 {
        0
    }

    /// Solves `problem` with captures by `optics`; `watch` is called after each step.
    ///
    /// # Errors
    /// When a capture fails.
    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError>;
}

/// Number of wavelet levels of the priors; the coarsest details are wider than any blur to be
/// undone.
pub const WAVELET_LEVELS: usize = 4;
/// Soft threshold at one grey level of noise for a step of length 1, grey levels. Chosen on the
/// study's scenes.
const STRENGTH: f32 = 0.09;
/// Exponent of the law threshold ∝ noise^EXPONENT. The study's best thresholds at noise 0.5, 1, 2
/// and 4 are 0.06, 0.1, 0.3 and 0.75 to 1.5: in logarithms a line of slope 1.3 to 1.5.
const EXPONENT: f32 = 1.4;

/// Soft threshold at a noise σ of `noise` grey levels, given the threshold `strength` at one grey
/// level.
fn soft_threshold(strength: f32, noise: f32) -> f32 {
    strength * noise.max(NOISE_MIN).powf(EXPONENT)
}

/// Optics of a solve without captures: every capture fails.
#[derive(Debug, Clone, Copy)]
pub struct NoOptics {
    /// Size of the Work grid.
    pub size: Size,
}

/// The error of a capture that was requested without a camera.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("a capture was requested, but there is no camera")]
pub struct NoCamera;

impl crate::remedy::Remediable for NoCamera {
    fn remedy(&self) -> crate::remedy::Remedy {
        crate::remedy::Remedy::ReopenRig
    }
}

impl ForwardConvolution for NoOptics {
    fn size(&self) -> Size {
        self.size
    }
    fn forward(&mut self, _: &Frame<Work>) -> Result<Seen, AnyFailure> {
        Err(Box::new(NoCamera))
    }
    fn captures(&self) -> usize {
        0
    }
    fn seconds(&self) -> f64 {
        0.0
    }
}
