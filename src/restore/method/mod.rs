//! The named ways to solve, one file each.
//!
//! | name | captures a photo | what it is |
//! |---|---|---|
//! | [`paper`] | 4 + 5·n | Eqs. 4–7 as printed, flip–FC–flip backward |
//! | [`residual`] | 5·n | optics only: signed residual on a pedestal, momentum with restart |
//! | [`unmatched`] | n | lens model backward, optics forward |
//! | [`hybrid`] | 1 to 1 + corrections | lens model, certified and corrected by captures; the default |
//! | [`digital`] | 0 | lens model only |
//! | [`baselines`] | 0 | Wiener and Richardson–Lucy, what people use today |
//!
//! Where the paper leaves a choice, and what is done here (each held by a test in `tests/method.rs`):
//!
//! * **Factor 2 of Eq. 7** is kept in `paper`: the step on Kᵀ(KL − B) is 2τ, stable for τ < 1/‖K‖².
//! * **Threshold λτ/2** of Eq. 6 is kept as printed, although the proximal step of Eq. 4 would be λτ.
//! * **Levels**: four, approximation untouched; borders of the transform periodised, hence orthonormal.
//! * **Boundary**: the canvas is larger than the photo and solved with it; B counts only where it exists.
//! * **Margin and border patches**: see [`super::patches`].

pub mod averaging;
pub mod baselines;
pub mod digital;
pub mod hybrid;
pub mod paper;
pub mod residual;
pub mod unmatched;

mod momentum;
mod problem;
mod record;
mod strength;

pub use momentum::Momentum;
pub use problem::{Certificate, MethodError, Problem, Solution};
pub use strength::Strength;
pub use record::{IterationRecord, ResidualOf, Step};

use super::forward_convolution::ForwardConvolution;
use crate::frame::{Frame, Work};
use crate::remedy::AnyFailure;

/// Called after each step with the step's record and the picture as it is now.
pub type Watch<'a> = dyn FnMut(&Step, &Frame<Work>) + 'a;

/// A named way to solve, with its parameters.
pub trait Method {
    /// The word used in rig files, tables and reports.
    fn name(&self) -> &'static str;

    /// Solves `problem`, asking `optics` for captures.
    ///
    /// # Errors
    /// A failed capture, or a model that the method needs and the problem lacks.
    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError>;
}

/// The shift of the shrinkage in step `iteration`: none, or one that visits the shifts of a 16×16 block
/// (four levels) evenly.
fn spin(cycle_spun: bool, iteration: u32) -> (usize, usize) {
    if !cycle_spun {
        return (0, 0);
    }
    // 7 and 11 are coprime to 16, so rows and columns both go through all sixteen shifts out of step.
    let k = iteration as usize;
    ((7 * k) % 16, (11 * k + 5 * (k / 16)) % 16)
}

/// The optics when there are none: every capture fails.
#[derive(Debug, Clone, Copy)]
pub struct NoOptics {
    /// The Work grid.
    pub size: crate::frame::Size,
}

/// A capture was asked for where no camera is.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("a capture was asked for, and there is no camera")]
pub struct NoCamera;

impl crate::remedy::Remediable for NoCamera {
    fn remedy(&self) -> crate::remedy::Remedy {
        crate::remedy::Remedy::ReopenRig
    }
}

impl ForwardConvolution for NoOptics {
    fn size(&self) -> crate::frame::Size {
        self.size
    }
    fn forward(&mut self, _: &Frame<Work>) -> Result<super::forward_convolution::Seen, AnyFailure> {
        Err(Box::new(NoCamera))
    }
    fn captures(&self) -> usize {
        0
    }
    fn seconds(&self) -> f64 {
        0.0
    }
}
