//! The paper's loop as printed (Eqs. 4–7): iterative shrinkage with both convolutions by the lens.
//!
//! L⁰ = B; g = 2·BC(FC(L)) − 2·BC(B); L ← shrink(L − τ g, λτ/2). BC(B) is captured once, so a photo
//! costs 4 + 5·n captures. Without noise it works; with one grey level of noise in every capture it
//! does harm, because the noise of the backward captures enters L unfiltered, and that of BC(B) is
//! added again in each iteration (held by tests).

use super::brake::Brake;
use super::problem::Certificate;
use super::record::Course;
use super::{About, Method, MethodError, Problem, ResidualOf, Solution, Watch};
use crate::deconvolution::backward_convolution::backward_convolution;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::patches::{PatchGrid, PatchShape};
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, Frame, Plane, Work};

/// How the backward convolution is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Backward {
    /// By light: flip–FC–flip. The paper uses patches of 80 px at 1024×768.
    Light(PatchShape),
    /// By the lens model's exact adjoint: the paper's "accurate numerical calculation".
    Model,
}

/// The paper's loop and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paper {
    /// Iterations; the paper's experiments use 11.
    pub iterations: u32,
    /// τ of Eq. 5; the paper sets 0.8.
    pub tau: f32,
    /// λ of Eq. 4; the paper sets 3.
    pub lambda: f32,
    /// How the backward convolution is computed.
    pub backward: Backward,
    /// Wavelet levels.
    pub levels: usize,
    /// Whether τ is limited to 1/‖K‖², and steps are undone when the iteration diverges. The paper
    /// has neither; with its own τ and patches neither takes effect.
    pub bounded: bool,
}

/// Largest τ as a share of 1/‖K‖², the limit of stability with the factor 2 of Eq. 7.
const STABLE_SHARE: f32 = 0.95;

impl Paper {
    fn backward(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        picture: &Frame<Work>,
    ) -> Result<Frame<Work>, MethodError> {
        match self.backward {
            Backward::Light(shape) => {
                let grid = PatchGrid::new(problem.size(), problem.observation.rect, shape);
                Ok(backward_convolution(optics, picture, &grid, problem.observation.channels)?)
            }
            Backward::Model => Ok(problem.frame_of(|c| {
                let mut back = Plane::zeros(problem.size());
                problem.model.adjoint(c, picture.plane(c), &mut back);
                back
            })),
        }
    }
}

/// The method's properties.
pub const ABOUT: About = About { name: "paper", starts_from_lens: false };

impl Method for Paper {
    fn about(&self) -> &'static About {
        &ABOUT
    }

    fn captures_max(&self) -> u32 {
        match self.backward {
            Backward::Light(_) => 4 + 5 * self.iterations,
            Backward::Model => self.iterations,
        }
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let mut course = Course::by(problem.stopwatch, optics);
        let shrinkage = Shrinkage::new(problem.size(), self.levels);
        let mut scratch = ShrinkageScratch::default();
        let observation = problem.observation;
        let channels = observation.channels;
        let mut photo = observation.light.clone();
        channels.list().iter().for_each(|&c| observation.mask(c, photo.plane_mut(c)));

        let mut brake = Brake::new();
        let mut picture: Frame<Work> = observation.light.clone();
        let backward_photo = self.backward(problem, optics, &photo)?;
        for _ in 0..self.iterations {
            let mut seen = optics.forward(&picture)?.light;
            let green = Channel::Green;
            let residual = observation.residual_rms(green, seen.plane(green));
            if !(self.bounded && brake.has_diverged(residual, &mut picture)) {
                channels.list().iter().for_each(|&c| observation.mask(c, seen.plane_mut(c)));
                let backward = self.backward(problem, optics, &seen)?;
                for &channel in channels.list() {
                    let stable = STABLE_SHARE / problem.norm_squared[channel.index()];
                    let tau = if self.bounded { self.tau.min(stable) } else { self.tau };
                    let tau = brake.step() * tau;
                    let plane = picture.plane_mut(channel);
                    plane.add_scaled(-2.0 * tau, backward.plane(channel));
                    plane.add_scaled(2.0 * tau, backward_photo.plane(channel));
                    shrinkage.shrink(plane, self.lambda * tau / 2.0, (0, 0), &mut scratch);
                }
            }
            let captures = optics.captures();
            watch(&course.step(residual, ResidualOf::Optics, captures), Some(&picture));
        }
        Ok(Solution::of(picture, course.record, Certificate::uncertified(problem)))
    }
}
