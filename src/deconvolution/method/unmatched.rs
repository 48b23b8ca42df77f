//! The lens model backward, the optics forward: one capture an iteration.
//!
//! The model's adjoint low-passes the residual, noise included, which is why this beats both
//! optical backward convolutions under noise. The adjoint need not match the optics exactly (Zeng &
//! Gullberg 2000): the fixed point is where K̂ᵀ(KL − B) vanishes.

use super::light_loop::LightLoop;
use super::record::Course;
use super::{About, Method, MethodError, Problem, Solution, Strength, Watch};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::frame::{Frame, Plane, Work};

/// Iterations of a rig file's `unmatched`: 11 captures, where the study compares it.
pub const ITERATIONS: u32 = 11;

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unmatched {
    /// Iterations, each one capture.
    pub iterations: u32,
    /// Soft threshold of each step.
    pub strength: Strength,
    /// Wavelet levels.
    pub levels: usize,
    /// Whether the shrinkage is shifted from step to step (cycle spinning).
    pub cycle_spun: bool,
}

/// The method's properties.
pub const ABOUT: About =
    About { name: "unmatched", starts_from_lens: false, by_patches: false, by_steps: true };

impl Method for Unmatched {
    fn about(&self) -> &'static About {
        &ABOUT
    }

    fn captures_max(&self) -> u32 {
        self.iterations
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let model = problem.model;
        let backward = |_: &mut dyn ForwardConvolution, signed: &Frame<Work>| {
            Ok(problem.frame_of(|c| {
                let mut back = Plane::zeros(problem.size());
                model.adjoint(c, signed.plane(c), &mut back);
                back
            }))
        };
        let shrinkage = super::shrinkage(problem.size(), self.levels, self.cycle_spun);
        let course = Course::by(problem.stopwatch, optics);
        LightLoop { iterations: self.iterations, strength: self.strength, shrinkage }
            .solve(problem, optics, course, &backward, watch)
    }
}
