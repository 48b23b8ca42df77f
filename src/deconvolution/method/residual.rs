//! Optics only, but the *signed residual* goes backward: FC(L) − B on a grey pedestal, with as much
//! gain as the panel allows, instead of BC(FC(L)) and BC(B) one by one.
//!
//! The gain grows as the residual shrinks, so the noise of the backward captures shrinks with it.
//! 5·n captures, and one of the bare pedestal, which does not depend on the photo.

use super::light_loop::LightLoop;
use super::record::Course;
use super::{About, Method, MethodError, Problem, Solution, Strength, Watch};
use crate::deconvolution::backward_convolution::{Sign, backward_convolution};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::patches::{PatchGrid, PatchShape};
use crate::frame::{Frame, Plane, Work};

/// The pedestal: half of full scale, so that both signs have the same room.
const PEDESTAL_LEVEL: f32 = 127.5;
/// Panel levels used for the residual's bulk; the rest of the room is for its tail.
const RESIDUAL_SPAN: f32 = 110.0;
/// Share of residual pixels that may be clipped by the panel. Guess; their error comes back next
/// iteration.
const CLIPPED_SHARE: f64 = 0.001;
/// Gain beyond which 8-bit steps and noise of the backward captures no longer matter. Guess.
const GAIN_MAX: f32 = 32.0;

/// Iterations of a rig file's `residual`: 25 captures, where the study compares it.
pub const ITERATIONS: u32 = 5;
/// Its strength against the lens model's: it steps with a noisy backward convolution.
pub const STRENGTH_FACTOR: f32 = 3.0;

/// The residual method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Iterations.
    pub iterations: u32,
    /// Soft threshold of each step.
    pub strength: Strength,
    /// Patches of backward convolution.
    pub patches: PatchShape,
    /// Wavelet levels.
    pub levels: usize,
    /// Whether the shrinkage is shifted from step to step (cycle spinning).
    pub cycle_spun: bool,
}

/// The method's properties.
pub const ABOUT: About =
    About { name: "residual", starts_from_lens: false, by_patches: true, by_steps: true };

impl Method for Residual {
    fn about(&self) -> &'static About {
        &ABOUT
    }

    fn captures_max(&self) -> u32 {
        1 + 5 * self.iterations
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let (size, channels) = (problem.size(), problem.observation.channels);
        let mut course = Course::by(problem.stopwatch, optics);
        let pedestal = problem.frame_of(|_| Plane::filled(size, PEDESTAL_LEVEL));
        let pedestal = optics.pedestal(&pedestal)?.light;
        course.captures_before = optics.captures();
        let grid = PatchGrid::new(size, problem.observation.rect, self.patches);
        let backward = |optics: &mut dyn ForwardConvolution, signed: &Frame<Work>| {
            let spans = channels.list().iter().map(|&c| high_quantile(signed.plane(c)).max(1e-3));
            let gain = spans.fold(GAIN_MAX, |gain, span| gain.min(RESIDUAL_SPAN / span));
            let sign = Sign::Pedestal { level: PEDESTAL_LEVEL, gain };
            Ok(backward_convolution(optics, signed, &grid, channels, sign, Some(&pedestal))?)
        };
        let shrinkage = super::shrinkage(size, self.levels, self.cycle_spun);
        LightLoop { iterations: self.iterations, strength: self.strength, shrinkage }
            .solve(problem, optics, course, &backward, watch)
    }
}

/// The magnitude that all but [`CLIPPED_SHARE`] of the pixels stay below.
fn high_quantile(plane: &Plane) -> f32 {
    let mut magnitudes: Vec<f32> = plane.data().iter().map(|v| v.abs()).collect();
    let rank =
        ((magnitudes.len() as f64 * (1.0 - CLIPPED_SHARE)) as usize).min(magnitudes.len() - 1);
    *magnitudes.select_nth_unstable_by(rank, f32::total_cmp).1
}
