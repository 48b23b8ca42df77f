//! The lens model backward, the optics forward: one capture an iteration.
//!
//! The model's adjoint low-passes the residual, noise included, which is why this beats both
//! optical backward convolutions under noise. The adjoint need not match the optics exactly (Zeng &
//! Gullberg 2000): the fixed point is where K̂ᵀ(KL − B) vanishes.

use super::brake::Brake;
use super::problem::Certificate;
use super::{
    About, IterationRecord, Method, MethodError, Problem, ResidualOf, Solution, Step, Strength,
    Watch,
};
use crate::deconvolution::data_term;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::wavelet_shrinkage::{Prior, ShrinkageScratch};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Work};

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

/// What it is.
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
        let model = problem.needs_model("unmatched")?;
        let begun = (problem.stopwatch)();
        let captures_before = optics.captures();
        let size = problem.size();
        let channels = problem.channels.list();
        let shrinkage = super::shrinkage(size, self.levels, self.cycle_spun);
        let mut scratch = ShrinkageScratch::default();
        let (mut record, mut brake) = (IterationRecord::default(), Brake::new());
        let mut picture: Frame<Work> = problem.photo.clone();
        let mut looked_at = problem.photo.clone();
        let mut momenta = super::momenta(channels, problem.photo);
        let (mut signed, mut gradient) = (Plane::zeros(size), Plane::zeros(size));
        for iteration in 1..=self.iterations {
            let seen = optics.forward(&looked_at)?.light;
            let residual = problem.residual_rms(Channel::Green, seen.plane(Channel::Green));
            if brake.turned_up(residual, &mut looked_at) {
                momenta = super::momenta(channels, &looked_at);
            } else {
                for (&c, momentum) in channels.iter().zip(&mut momenta) {
                    let trust = problem.trust.plane(c);
                    data_term::residual(seen.plane(c), problem.photo.plane(c), trust, &mut signed);
                    model.adjoint(c, &signed, &mut gradient);
                    let stepped = picture.plane_mut(c);
                    stepped.clone_from(looked_at.plane(c));
                    stepped.add_scaled(-brake.step() / problem.norm_squared[c.index()], &gradient);
                    let threshold =
                        brake.step() * self.strength.threshold(problem.photo_noise[c.index()]);
                    shrinkage.apply(stepped, threshold, iteration as usize, &mut scratch);
                    stepped.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
                    momentum.next(looked_at.plane_mut(c), stepped);
                }
            }
            let step = Step {
                iteration,
                residual,
                of: ResidualOf::Optics,
                captures: (optics.captures() - captures_before) as u32,
                seconds: (problem.stopwatch)() - begun,
            };
            record.push(step);
            watch(&step, Some(&picture));
        }
        Ok(Solution::of(picture, record, Certificate::uncertified(problem)))
    }
}
