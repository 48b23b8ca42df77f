//! Proximal steps with momentum on what the light shows: the loop of [`residual`](super::residual)
//! and [`unmatched`](super::unmatched), which send the signed residual FC(L) − B backward each in
//! its own way.

use super::brake::Brake;
use super::problem::{Certificate, MethodError, Problem, Solution};
use super::record::Course;
use super::{Momentum, ResidualOf, Strength, Watch};
use crate::deconvolution::data_term;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, FULL_SCALE, Frame, Work};

/// The loop's parameters.
pub(super) struct LightLoop {
    /// Iterations, each at least one capture.
    pub(super) iterations: u32,
    /// Soft threshold of each step.
    pub(super) strength: Strength,
    /// The prior.
    pub(super) shrinkage: Shrinkage,
}

/// Kᵀ of a signed frame, by a lens or by computing.
pub(super) type AdjointBy<'a> =
    dyn Fn(&mut dyn ForwardConvolution, &Frame<Work>) -> Result<Frame<Work>, MethodError> + 'a;

impl LightLoop {
    /// `problem` solved, its steps taken down in `course`; `backward` is Kᵀ of a signed residual.
    pub(super) fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        mut course: Course<'_>,
        backward: &AdjointBy<'_>,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let observation = problem.observation;
        let channels = observation.channels.list();
        let momenta = |start: &Frame<Work>| -> Vec<Momentum> {
            channels.iter().map(|&c| Momentum::new(start.plane(c))).collect()
        };
        let (mut scratch, mut brake) = (ShrinkageScratch::default(), Brake::new());
        let (mut picture, mut looked_at) = (observation.light.clone(), observation.light.clone());
        let mut momentum = momenta(&observation.light);
        for iteration in 1..=self.iterations {
            let prediction = problem.predict(&looked_at);
            let seen = problem.capture(optics, &prediction, &looked_at)?.light;
            let mut signed = problem.frame_of(|c| {
                let mut plane = seen.plane(c).clone();
                let (photo, trust) = (observation.light.plane(c), observation.trust.plane(c));
                data_term::residual_in_place(&mut plane, photo, trust);
                plane
            });
            let green = Channel::Green;
            let residual =
                data_term::rms_over_data(signed.plane(green), observation.trust.plane(green));
            if brake.has_diverged(residual, &mut looked_at) {
                momentum = momenta(&looked_at);
            } else {
                for &c in channels {
                    data_term::scale(signed.plane_mut(c), observation.weight(c));
                }
                let gradient = backward(optics, &signed)?;
                for (&c, momentum) in channels.iter().zip(&mut momentum) {
                    let stepped = picture.plane_mut(c);
                    stepped.clone_from(looked_at.plane(c));
                    let step = brake.step() / problem.norm_squared[c.index()];
                    stepped.add_scaled(-step, gradient.plane(c));
                    let noise = observation.pixel_noise(c);
                    let threshold = brake.step() * self.strength.threshold(noise);
                    self.shrinkage.apply(stepped, threshold, iteration as usize, &mut scratch);
                    stepped.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
                    momentum.next(looked_at.plane_mut(c), stepped);
                }
            }
            let captures = optics.captures();
            watch(&course.step(residual, ResidualOf::Optics, captures), Some(&picture));
        }
        Ok(Solution::of(picture, course.record, Certificate::uncertified(problem)))
    }
}
