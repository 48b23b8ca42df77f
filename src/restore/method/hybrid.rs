//! The default: solve with the lens model, let one capture certify the result, and correct what the model
//! missed while captures show that it missed something (defect correction, Böhmer & Stetter 1984).
//!
//! A capture y of the candidate L shows the model's *defect* at L: d = y − K̂L, which is (K − K̂)L plus the
//! capture's noise. The corrected problem is K̂L = B − d. The noise of d is known, so d is shrunk by it
//! first: what light cannot tell from noise is not corrected, and a right model stays untouched. Defects of
//! successive captures are averaged, since L hardly changes between them.

use super::digital::{Digital, model_residual, solve_all};
use super::problem::Certificate;
use super::{IterationRecord, Method, MethodError, Problem, ResidualOf, Solution, Step, Watch};
use crate::frame::{Channel, Frame, Plane, Work};
use crate::restore::data_term::{self, TRUSTED};
use crate::restore::forward_convolution::{ForwardConvolution, Seen};
use crate::restore::lens_model::LensModel;
use crate::restore::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hybrid {
    /// The solve with the lens model.
    pub digital: Digital,
    /// Proximal steps after each capture.
    pub correction_steps: u32,
    /// Captures a photo may cost, at least 1.
    pub captures_max: u32,
    /// Soft threshold of the defect, in standard deviations of its noise.
    pub defect_threshold: f32,
    /// Defect, as a share of the noise floor, below which the model counts as right.
    pub defect_floor: f32,
}

impl Method for Hybrid {
    fn name(&self) -> &'static str {
        "hybrid"
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let model = problem.needs_model("hybrid")?;
        let begun = (problem.stopwatch)();
        let captures_before = optics.captures();
        let (mut picture, mut record) =
            solve_all(&self.digital, problem, model, problem.photo, problem.photo);
        let mut certificate = Certificate::uncertified(problem);
        let mut defects = DefectMean::new(problem);
        let mut best: Option<(f32, Frame<Work>)> = None;
        for capture in 1..=self.captures_max.max(1) {
            let seen = optics.forward(&picture)?;
            let optical = problem.residual_rms(Channel::Green, seen.light.plane(Channel::Green));
            let step = Step {
                iteration: record.steps().len() as u32 + 1,
                residual: optical,
                of: ResidualOf::Optics,
                captures: (optics.captures() - captures_before) as u32,
                seconds: (problem.stopwatch)() - begun,
            };
            record.push(step);
            watch(&step, &picture);
            certificate.optical_residual = Some(optical);
            // A correction that the light does not confirm is taken back.
            if let Some((before, untouched)) = best.take()
                && optical > before
            {
                picture = untouched;
                certificate.optical_residual = Some(before);
                certificate.corrections -= 1;
                break;
            }
            defects.add(problem, model, &picture, &seen);
            let defect = defects.shrunk(problem, self.defect_threshold);
            let size = defect.plane(Channel::Green).rms() as f32;
            if size <= self.defect_floor * certificate.noise_floor {
                break;
            }
            let mut data: Frame<Work> = problem.photo.clone();
            for &channel in problem.channels.list() {
                data.plane_mut(channel).add_scaled(-1.0, defect.plane(channel));
            }
            let correction = Digital { steps: self.correction_steps, ..self.digital };
            let (corrected, steps) = solve_all(&correction, problem, model, &data, &picture);
            extend(&mut record, &steps, capture, begun, problem);
            certificate.corrections += 1;
            best = Some((optical, std::mem::replace(&mut picture, corrected)));
        }
        certificate.model_residual = Some(model_residual(problem, model, &picture));
        Ok(Solution { picture, record, certificate })
    }
}

/// Appends the steps of a correction, numbered on.
fn extend(
    record: &mut IterationRecord,
    steps: &IterationRecord,
    captures: u32,
    begun: f64,
    problem: &Problem<'_>,
) {
    let seconds = (problem.stopwatch)() - begun;
    let before = record.steps().len() as u32;
    for step in steps.steps() {
        record.push(Step { iteration: before + step.iteration, captures, seconds, ..*step });
    }
}

/// Levels of the defect's shrinkage: what stays unshrunk is averaged over 16×16 pixels, far below its noise.
const DEFECT_LEVELS: usize = 4;
/// Shifts over which the defect's shrinkage is averaged: an even spread over those levels' periods.
const DEFECT_SHIFTS: [(usize, usize); 4] = [(0, 0), (8, 4), (4, 8), (12, 12)];

/// The mean defect of the captures so far.
struct DefectMean {
    sum: Frame<Work>,
    count: u32,
}

impl DefectMean {
    fn new(problem: &Problem<'_>) -> Self {
        DefectMean { sum: Frame::zeros(problem.size()), count: 0 }
    }

    /// Adds y − K̂L where the capture can be trusted.
    fn add(&mut self, problem: &Problem<'_>, model: &LensModel, shown: &Frame<Work>, seen: &Seen) {
        let mut predicted = Plane::zeros(problem.size());
        for &c in problem.channels.list() {
            model.forward(c, shown.plane(c), &mut predicted);
            let pairs = seen.light.plane(c).data().iter().zip(seen.trusted.plane(c).data());
            let sum = self.sum.plane_mut(c).data_mut().iter_mut();
            for ((s, p), (&y, &t)) in sum.zip(predicted.data()).zip(pairs) {
                if t == TRUSTED {
                    *s += y - p;
                }
            }
        }
        self.count += 1;
    }

    /// The mean defect with its noise shrunk away, zero where the photo says nothing anyway.
    fn shrunk(&self, problem: &Problem<'_>, deviations: f32) -> Frame<Work> {
        let shrinkage = Shrinkage::new(problem.size(), DEFECT_LEVELS);
        let mut scratch = ShrinkageScratch::default();
        let mut mean = self.sum.clone();
        for &c in problem.channels.list() {
            let plane = mean.plane_mut(c);
            plane.data_mut().iter_mut().for_each(|v| *v /= self.count as f32);
            let noise = data_term::noise_of(plane);
            shrinkage.shrink_spun(plane, deviations * noise, &DEFECT_SHIFTS, &mut scratch);
            problem.mask(c, plane);
        }
        mean
    }
}
