//! What people use today, with the measured lens: Richardson–Lucy. No capture.

use rayon::prelude::*;

use super::digital::model_residual;
use super::problem::Certificate;
use super::{
    About, IterationRecord, Method, MethodError, Problem, ResidualOf, Solution, Step, Watch,
};
use crate::deconvolution::data_term::{self, MISSING};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Work};

/// Richardson (1972) and Lucy (1974): multiplicative steps, light stays positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RichardsonLucy {
    /// Steps; noise grows with them.
    pub steps: u32,
}

/// What it is.
pub const ABOUT: About =
    About { name: "richardson-lucy", starts_from_lens: false, by_patches: false, by_steps: false };

impl Method for RichardsonLucy {
    fn about(&self) -> &'static About {
        &ABOUT
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        _optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let model = problem.needs_model("richardson-lucy")?;
        let begun = (problem.stopwatch)();
        let size = problem.size();
        let solved: Vec<(Plane, IterationRecord)> = problem
            .channels
            .list()
            .par_iter()
            .map(|&c| {
                let trust = problem.trust.plane(c);
                let data = problem.photo.plane(c);
                let mut record = IterationRecord::default();
                // Kᵀ of the mask: what share of each pixel's light the photo saw.
                let mask = trust.map(|t| if t == MISSING { 0.0 } else { 1.0 });
                let (mut share, mut predicted, mut ratio) =
                    (Plane::zeros(size), Plane::zeros(size), Plane::zeros(size));
                model.adjoint(c, &mask, &mut share);
                let mut picture = data.map(|v: f32| v.max(0.5));
                for iteration in 1..=self.steps {
                    model.forward(c, &picture, &mut predicted);
                    let values = predicted.data().iter().zip(data.data()).zip(mask.data());
                    for (r, ((&p, &b), &m)) in ratio.data_mut().iter_mut().zip(values) {
                        *r = m * b.max(0.0) / p.max(0.5);
                    }
                    data_term::residual_in_place(&mut predicted, data, trust);
                    let residual = data_term::rms_over_data(&predicted, trust);
                    model.adjoint(c, &ratio, &mut predicted);
                    let factors = predicted.data().iter().zip(share.data());
                    for (x, (&f, &s)) in picture.data_mut().iter_mut().zip(factors) {
                        if s > 0.05 {
                            *x = (*x * (f / s).max(0.0)).clamp(0.0, FULL_SCALE);
                        }
                    }
                    let seconds = (problem.stopwatch)() - begun;
                    record.push(Step {
                        iteration,
                        residual,
                        of: ResidualOf::Model,
                        captures: 0,
                        seconds,
                    });
                }
                (picture, record)
            })
            .collect();
        Ok(finish(problem, solved, watch))
    }
}

/// Puts the channels together and measures what they have become.
pub(super) fn finish(
    problem: &Problem<'_>,
    solved: Vec<(Plane, IterationRecord)>,
    watch: &mut Watch<'_>,
) -> Solution {
    let mut picture: Frame<Work> = Frame::zeros(problem.size());
    let mut record = IterationRecord::default();
    for (&c, (plane, steps)) in problem.channels.list().iter().zip(solved) {
        *picture.plane_mut(c) = plane;
        if c == Channel::Green {
            record = steps;
        }
    }
    if let Some(last) = record.steps().last() {
        watch(last, Some(&picture));
    }
    let mut certificate = Certificate::uncertified(problem);
    certificate.model_residual =
        problem.model.map(|model| model_residual(problem, model, &picture));
    Solution::of(picture, record, certificate)
}
