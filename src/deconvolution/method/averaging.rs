//! Repeated captures of one picture, averaged: less noise for more time.

use super::{About, Method, MethodError, Problem, Solution, Watch};
use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::frame::{Channel, Frame, Size, Work};
use crate::remedy::AnyFailure;

/// Optics that look `times` times at every picture and return the mean. A pixel is trusted when
/// every look trusted it.
pub struct Averaging<'a> {
    optics: &'a mut dyn ForwardConvolution,
    times: u32,
}

impl<'a> Averaging<'a> {
    /// `times` looks at each picture; 0 counts as 1.
    pub fn new(optics: &'a mut dyn ForwardConvolution, times: u32) -> Self {
        Averaging { optics, times: times.max(1) }
    }
}

impl ForwardConvolution for Averaging<'_> {
    fn size(&self) -> Size {
        self.optics.size()
    }

    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure> {
        let mut mean = self.optics.forward(shown)?;
        for _ in 1..self.times {
            let seen = self.optics.forward(shown)?;
            for channel in Channel::ALL {
                mean.light.plane_mut(channel).add_scaled(1.0, seen.light.plane(channel));
                let trusted = mean.trusted.plane_mut(channel).data_mut();
                for (t, &other) in trusted.iter_mut().zip(seen.trusted.plane(channel).data()) {
                    *t = (*t).min(other);
                }
            }
        }
        if self.times > 1 {
            let share = 1.0 / self.times as f32;
            for plane in mean.light.planes_mut() {
                plane.data_mut().iter_mut().for_each(|v| *v *= share);
            }
        }
        Ok(mean)
    }

    fn panel_columns(&self) -> Option<&Frame<Work>> {
        self.optics.panel_columns()
    }

    fn captures(&self) -> usize {
        self.optics.captures()
    }

    fn seconds(&self) -> f64 {
        self.optics.seconds()
    }
}

/// A method whose captures are each the mean of several: slower, and less noisy.
pub struct Averaged {
    /// The method.
    pub method: Box<dyn Method + Send + Sync>,
    /// Captures averaged for each it asks for, at least 1.
    pub times: u32,
}

impl Method for Averaged {
    fn about(&self) -> &'static About {
        self.method.about()
    }

    fn captures_max(&self) -> u32 {
        self.times.max(1) * self.method.captures_max()
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let quieter = 1.0 / (self.times.max(1) as f32).sqrt();
        let problem =
            Problem { capture_noise: problem.capture_noise.map(|n| n * quieter), ..*problem };
        self.method.solve(&problem, &mut Averaging::new(optics, self.times), watch)
    }
}
