//! Richardson–Lucy deconvolution with the measured lens: a baseline. No capture.

use super::record::Course;
use super::{About, Method, MethodError, Problem, ResidualOf, Solution, Watch};
use crate::deconvolution::data_term::{self, MISSING};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::frame::{Channel, FULL_SCALE, Plane};

/// Steps of the baseline: the study's best at one grey level of noise.
pub const STEPS: u32 = 20;

/// Richardson (1972) and Lucy (1974): multiplicative steps, which keep the light positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RichardsonLucy {
    /// Number of steps; noise grows with it.
    pub steps: u32,
}

/// The method's properties.
pub const ABOUT: About = About { name: "richardson-lucy", starts_from_lens: false };

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
        let (size, model) = (problem.size(), problem.model);
        let solve = |c: Channel| {
            let observation = problem.observation;
            let (data, trust) = (observation.light.plane(c), observation.trust.plane(c));
            let mut course = Course::new(problem.stopwatch);
            // Kᵀ of the mask: the share of each pixel's light that reaches the photo.
            let mask = trust.map(|t| if t == MISSING { 0.0 } else { 1.0 });
            let (mut share, mut predicted, mut ratio) =
                (Plane::zeros(size), Plane::zeros(size), Plane::zeros(size));
            model.adjoint(c, &mask, &mut share);
            let mut picture = data.map(|v: f32| v.max(0.5));
            for _ in 0..self.steps {
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
                course.step(residual, ResidualOf::Model, 0);
            }
            (picture, course.record)
        };
        Ok(problem.solve_by_channel(solve, watch))
    }
}
