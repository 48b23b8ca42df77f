//! Forward convolution by a rig: the candidate is shown on the panel and captured.
//!
//! The candidate L is resampled once, to the panel; captures are cropped and corrected pixel by
//! pixel, never resampled. The detail that L loses on the panel's square pixels
//! ([`Correction::take_by_perfect_lens`]) is passed through the lens model and added to the
//! capture.

use crate::calibration::correction::{Correction, ShownLight};
use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::panel_beat::ColumnWave;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};
use crate::remedy::{AnyFailure, Remediable, Remedy};
use crate::rig::exposure::Devices;

/// Smallest RMS of lost detail that is added to a capture, grey levels: far below a code's
/// rounding.
const LOST_MIN: f64 = 1e-3;

/// A calibrated rig as an operator on Work frames.
pub struct LightPath<'a> {
    rig: &'a mut Devices,
    correction: &'a Correction,
    /// The lens model at the panel's focus.
    panel: &'a LensModel,
    /// The lens model at the photo's focus, if that is not the panel's.
    photo: Option<&'a LensModel>,
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
        (correction, panel): (&'a Correction, &'a LensModel),
        stopwatch: &'a (dyn Fn() -> f64 + Sync),
    ) -> Self {
        LightPath {
            rig,
            correction,
            panel,
            photo: None,
            stopwatch,
            waited_seconds: 0.0,
            interrupted: None,
        }
    }

    /// Converts captures to the focus of the lens model `photo`. A capture is K L at the panel's
    /// focus, since the panel does not move; adding (K̂_photo − K̂_panel) L converts it. Errors
    /// common to both models cancel.
    #[must_use]
    pub fn at_focus_of(mut self, photo: &'a LensModel) -> Self {
        self.photo = Some(photo);
        self
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
    /// Captures `picture`, light 0..255, and adds the detail that the panel cannot show, blurred by
    /// the lens model. Given `predicted`, K̂_photo of the picture, it converts the capture to the
    /// photo's focus.
    ///
    /// # Errors
    /// [`Interrupted`]; the failure of the capture.
    fn capture(
        &mut self,
        picture: &Frame<Work>,
        predicted: Option<&Frame<Work>>,
    ) -> Result<Seen, AnyFailure> {
        if self.interrupted.is_some_and(|asked| asked()) {
            return Err(Interrupted.into());
        }
        if let Some(lens) = self.photo {
            // Computed again after the capture, which needs the memory.
            Channel::ALL.iter().for_each(|&c| lens.release_spectra(c));
        }
        let on_panel = self.correction.light_on_panel(picture);
        let codes = self.correction.show_light(&on_panel);
        let lost = self.lost_detail(on_panel, predicted.is_none().then_some(picture));
        let begun = (self.stopwatch)();
        let exposed = self.rig.capture(&codes)?;
        self.waited_seconds += (self.stopwatch)() - begun;
        drop(codes);
        let mut seen = self.correction.see(&exposed.counts);
        for (c, light) in Channel::ALL.into_iter().zip(seen.light.planes_mut()) {
            if let Some(lost) = &lost[c.index()] {
                light.add_scaled(1.0, lost);
            }
            if let Some(predicted) = predicted {
                light.add_scaled(1.0, predicted.plane(c));
            }
        }
        Ok(seen)
    }

    /// Lost detail of each channel, K (L − S), for the lens model K at the panel's focus, the light
    /// L of `picture` and the panel's light S, `shown`; −K S without a picture. `None` if nothing
    /// is lost because panel and sensor pixels coincide.
    fn lost_detail(
        &self,
        mut shown: ShownLight,
        picture: Option<&Frame<Work>>,
    ) -> [Option<Plane>; 3] {
        // One channel after the other: the convolution keeps all cores busy by itself.
        Channel::ALL.map(|c| {
            let mut lacking = self.correction.take_by_perfect_lens(c, &mut shown);
            lacking.scale(-1.0);
            if let Some(picture) = picture {
                lacking.add_scaled(1.0, picture.plane(c));
            }
            (lacking.rms() > LOST_MIN).then(|| {
                let mut lost = Plane::zeros(lacking.size());
                self.panel.forward(c, &lacking, &mut lost);
                if self.photo.is_some() {
                    // The solver uses the photo's own lens model.
                    self.panel.release_spectra(c);
                }
                lost
            })
        })
    }
}

impl ForwardConvolution for LightPath<'_> {
    fn size(&self) -> Size {
        self.correction.layout().canvas()
    }

    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure> {
        let picture = Frame::from_fn(|c| shown.plane(c).map(|v: f32| v.clamp(0.0, FULL_SCALE)));
        let predicted = self.photo.map(|lens| lens.seen(&Channel::ALL, &picture));
        self.capture(&picture, predicted.as_ref())
    }

    fn forward_predicted(
        &mut self,
        shown: &Frame<Work>,
        predicted: &Frame<Work>,
    ) -> Result<Seen, AnyFailure> {
        self.capture(shown, Some(predicted))
    }

    fn column_wave(&self) -> Option<ColumnWave> {
        Some(self.correction.column_wave())
    }

    fn captures(&self) -> usize {
        self.rig.captures()
    }

    fn seconds(&self) -> f64 {
        self.rig.seconds()
    }
}
