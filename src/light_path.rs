//! Forward convolution by a rig: the candidate is shown on the panel and captured.
//!
//! L is resampled once, to the panel; captures are cropped and corrected pixel by pixel, never
//! resampled. The detail that L loses on the panel's square pixels
//! ([`Correction::light_by_perfect_lens`]) is passed through the lens model and added to the
//! capture.

use rayon::prelude::*;

use crate::calibration::correction::{Correction, ShownLight};
use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::panel_beat::ColumnWave;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};
use crate::remedy::{AnyFailure, Remediable, Remedy};
use crate::rig::exposure::Devices;

/// Least RMS of lost detail that is added, grey levels: far below the rounding of a code.
const LOST_MIN: f64 = 1e-3;

/// A calibrated rig as an operator on Work frames.
pub struct LightPath<'a> {
    rig: &'a mut Devices,
    correction: &'a Correction,
    model: &'a LensModel,
    stopwatch: &'a (dyn Fn() -> f64 + Sync),
    waited_seconds: f64,
    interrupted: Option<&'a (dyn Fn() -> bool + Send + Sync)>,
}

/// The photo was cancelled.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("cancelled")]
pub struct Interrupted;

impl Remediable for Interrupted {
    fn remedy(&self) -> Remedy {
        Remedy::RetryLater
    }

    fn was_asked_for(&self) -> bool {
        true
    }
}

impl<'a> LightPath<'a> {
    /// The light path of `rig` with its correction and lens model. `stopwatch` returns seconds, to
    /// time captures.
    pub fn new(
        rig: &'a mut Devices,
        (correction, model): (&'a Correction, &'a LensModel),
        stopwatch: &'a (dyn Fn() -> f64 + Sync),
    ) -> Self {
        LightPath { rig, correction, model, stopwatch, waited_seconds: 0.0, interrupted: None }
    }

    /// Makes captures fail once `interrupted` returns true.
    #[must_use]
    pub fn interruptible(
        mut self,
        interrupted: Option<&'a (dyn Fn() -> bool + Send + Sync)>,
    ) -> Self {
        self.interrupted = interrupted;
        self
    }

    /// Total seconds from showing pictures to having their frames.
    pub fn waited_seconds(&self) -> f64 {
        self.waited_seconds
    }
}

impl LightPath<'_> {
    /// Adds to the capture `seen` of `picture` the detail that the panel's `light` lacks, by the
    /// lens model.
    fn add_lost_detail(&self, picture: &Frame<Work>, light: &ShownLight, seen: &mut Seen) {
        let by_perfect_lens = self.correction.light_by_perfect_lens(light);
        let pairs = Channel::ALL.into_iter().zip(seen.light.planes_mut());
        pairs.collect::<Vec<_>>().into_par_iter().for_each(|(c, light)| {
            let mut lost = picture.plane(c).clone();
            lost.add_scaled(-1.0, by_perfect_lens.plane(c));
            // Nothing is lost where panel and sensor pixels coincide.
            if lost.rms() > LOST_MIN {
                let mut seen = Plane::zeros(lost.size());
                self.model.forward(c, &lost, &mut seen);
                light.add_scaled(1.0, &seen);
            }
        });
    }
}

impl ForwardConvolution for LightPath<'_> {
    fn size(&self) -> Size {
        self.correction.layout().canvas()
    }

    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure> {
        if self.interrupted.is_some_and(|asked| asked()) {
            return Err(Interrupted.into());
        }
        let clamp = |v: f32| v.clamp(0.0, FULL_SCALE);
        let picture: Frame<Work> = Frame::from_fn(|c| shown.plane(c).map(clamp));
        let on_panel = self.correction.light_on_panel(&picture);
        let codes = self.correction.show_light(&on_panel);
        let begun = (self.stopwatch)();
        let exposed = self.rig.capture(&codes)?;
        self.waited_seconds += (self.stopwatch)() - begun;
        let mut seen = self.correction.see(&exposed.counts);
        self.add_lost_detail(&picture, &on_panel, &mut seen);
        Ok(seen)
    }

    fn column_wave(&self) -> Option<&ColumnWave> {
        Some(self.correction.column_wave())
    }

    fn captures(&self) -> usize {
        self.rig.captures()
    }

    fn seconds(&self) -> f64 {
        self.rig.seconds()
    }
}
