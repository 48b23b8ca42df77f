//! Krylov steps by light, the lens model backward: each capture shows one new direction, made
//! conjugate to all before.
//!
//! From the lens model's picture, what its photograph lacks of the photo is sent backward through
//! the model, shown on a pedestal, and the light says how it comes through. With the best step
//! along every direction this is the method of generalised conjugate residuals (Eisenstat, Elman &
//! Schultz 1983) with the model's adjoint in front, in exact arithmetic AB-GMRES with an unmatched
//! back projector (Hansen, Hayami & Morikuni 2022). Linear, so the prior has no say in the steps;
//! the noise of what they start from is shrunk, and few are taken.
//!
//! On the chart, where it loses: see `tests/tables/study-speed-accuracy.md`.

use super::digital::Digital;
use super::problem::Certificate;
use super::{Method, MethodError, Problem, ResidualOf, Solution, Step, Watch};
use crate::deconvolution::data_term::{self, TRUSTED};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Work};

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Krylov {
    /// The solve with the lens model that it starts from.
    pub digital: Digital,
    /// Steps, each one capture; one more looks at the start, and one, once, at the pedestal.
    pub steps: u32,
    /// Soft threshold of what is missing at the start, in standard deviations of its noise.
    pub threshold: f32,
}

/// Grey level that signed directions are shown around.
const PEDESTAL: f32 = FULL_SCALE / 2.0;

/// A direction and what the light makes of it, of unit length there.
struct Direction {
    channel: Channel,
    along: Plane,
    seen: Plane,
}

impl Method for Krylov {
    fn name(&self) -> &'static str {
        "krylov"
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let model = problem.needs_model(self.name())?;
        let (begun, captures_before) = ((problem.stopwatch)(), optics.captures());
        let channels = problem.channels.list();
        let mask = self.digital.mask(problem);
        let (mut picture, mut record) = self.digital.solve_photo(problem, model, &mask, watch);
        let seen = optics.forward(&picture)?.light;
        let mut missing = self.missing(problem, &seen);
        let flat = Frame::from_fn(|_| Plane::filled(problem.size(), PEDESTAL));
        let pedestal = optics.pedestal(&flat)?.light;
        let mut before: Vec<Direction> = Vec::new();
        for _ in 0..self.steps {
            let (mut alongs, mut shown) = (Frame::<Work>::zeros(problem.size()), flat.clone());
            let mut gains = [0.0f32; 3];
            for &c in channels {
                model.adjoint(c, missing.plane(c), alongs.plane_mut(c));
                let largest =
                    alongs.plane(c).data().iter().fold(0.0f32, |most, v| most.max(v.abs()));
                gains[c.index()] = PEDESTAL / largest.max(f32::MIN_POSITIVE);
                if largest > f32::MIN_POSITIVE {
                    shown.plane_mut(c).add_scaled(gains[c.index()], alongs.plane(c));
                }
            }
            let light = optics.forward(&shown)?.light;
            for &c in channels {
                let (mut along, mut seen) = (alongs.plane(c).clone(), light.plane(c).clone());
                let pairs = seen.data_mut().iter_mut().zip(pedestal.plane(c).data());
                pairs.for_each(|(v, p)| *v = (*v - p) / gains[c.index()]);
                only_trusted(problem, c, &mut seen);
                for known in before.iter().filter(|known| known.channel == c) {
                    let share = -seen.dot(&known.seen) as f32;
                    seen.add_scaled(share, &known.seen);
                    along.add_scaled(share, &known.along);
                }
                let length = seen.dot(&seen).sqrt() as f32;
                if length > f32::MIN_POSITIVE {
                    for plane in [&mut along, &mut seen] {
                        plane.data_mut().iter_mut().for_each(|v| *v /= length);
                    }
                    let step = missing.plane(c).dot(&seen) as f32;
                    picture.plane_mut(c).add_scaled(step, &along);
                    missing.plane_mut(c).add_scaled(-step, &seen);
                    before.push(Direction { channel: c, along, seen });
                }
            }
            let trust = problem.trust.plane(Channel::Green);
            let step = Step {
                iteration: record.steps().len() as u32 + 1,
                residual: data_term::rms_over_data(missing.plane(Channel::Green), trust),
                of: ResidualOf::Optics,
                captures: (optics.captures() - captures_before) as u32,
                seconds: (problem.stopwatch)() - begun,
            };
            record.push(step);
            watch(&step, Some(&picture));
        }
        for plane in picture.planes_mut() {
            plane.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
        }
        Ok(Solution::of(picture, record, Certificate::uncertified(problem)))
    }
}

impl Krylov {
    /// B − `seen`, its noise shrunk away; zero where the photo is not trusted.
    fn missing(&self, problem: &Problem<'_>, seen: &Frame<Work>) -> Frame<Work> {
        let mut missing = problem.photo.clone();
        let shrinkage = Shrinkage::new(problem.size(), self.digital.levels);
        let mut scratch = ShrinkageScratch::default();
        for &c in problem.channels.list() {
            let plane = missing.plane_mut(c);
            plane.add_scaled(-1.0, seen.plane(c));
            only_trusted(problem, c, plane);
            let threshold = self.threshold * data_term::noise_of(plane);
            shrinkage.shrink_everywhere(plane, &[threshold], None, 0, &mut scratch);
            only_trusted(problem, c, plane);
        }
        missing
    }
}

/// Zero where the photo's value is not what its sensor saw.
fn only_trusted(problem: &Problem<'_>, channel: Channel, plane: &mut Plane) {
    let pixels = plane.data_mut().iter_mut().zip(problem.trust.plane(channel).data());
    pixels.filter(|(_, trust)| **trust != TRUSTED).for_each(|(v, _)| *v = 0.0);
}
