//! Forward convolution through a rig: the candidate goes out to the panel, its photograph comes
//! back.
//!
//! L is resampled once, to the finer panel; captures are cropped and corrected pixel by pixel,
//! never resampled.

use crate::calibration::correction::Correction;
use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::frame::{Frame, Size, Work};
use crate::remedy::{AnyFailure, Remediable, Remedy};
use crate::rig::exposure::Devices;

/// A calibrated rig as an operator on Work frames.
pub struct LightPath<'a> {
    rig: &'a mut Devices,
    correction: &'a Correction,
    stopwatch: &'a (dyn Fn() -> f64 + Sync),
    waited_seconds: f64,
    pedestal: Option<(Frame<Work>, Seen)>,
    interrupted: Option<&'a (dyn Fn() -> bool + Send + Sync)>,
}

/// Somebody asked that no more captures be made for this photo.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("given up when asked to")]
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
    /// The light path of `rig` under `correction`, which must have been made for it. `stopwatch`
    /// tells how long captures keep the caller waiting.
    pub fn new(
        rig: &'a mut Devices,
        correction: &'a Correction,
        stopwatch: &'a (dyn Fn() -> f64 + Sync),
    ) -> Self {
        LightPath {
            rig,
            correction,
            stopwatch,
            waited_seconds: 0.0,
            pedestal: None,
            interrupted: None,
        }
    }

    /// The same path, which makes no capture once `interrupted` says so.
    #[must_use]
    pub fn interruptible(
        mut self,
        interrupted: Option<&'a (dyn Fn() -> bool + Send + Sync)>,
    ) -> Self {
        self.interrupted = interrupted;
        self
    }

    /// Seconds on the stopwatch between giving the panel a picture and having its frame, so far.
    pub fn waited_seconds(&self) -> f64 {
        self.waited_seconds
    }
}

impl ForwardConvolution for LightPath<'_> {
    fn size(&self) -> Size {
        self.correction.layout().canvas()
    }

    fn forward(&mut self, shown: &Frame<Work>) -> Result<Seen, AnyFailure> {
        if self.interrupted.is_some_and(|asked| asked()) {
            return Err(Box::new(Interrupted));
        }
        let codes = self.correction.show(shown);
        let begun = (self.stopwatch)();
        let exposed = self.rig.capture(&codes).map_err(|e| Box::new(e) as AnyFailure)?;
        self.waited_seconds += (self.stopwatch)() - begun;
        let corrected = self.correction.see(&exposed.counts);
        Ok(Seen { light: corrected.light, trusted: corrected.trusted })
    }

    fn pedestal(&mut self, flat: &Frame<Work>) -> Result<Seen, AnyFailure> {
        if let Some((shown, seen)) = &self.pedestal
            && shown == flat
        {
            return Ok(seen.clone());
        }
        let seen = self.forward(flat)?;
        self.pedestal = Some((flat.clone(), seen.clone()));
        Ok(seen)
    }

    fn panel_columns(&self) -> Option<&Frame<Work>> {
        Some(self.correction.panel_columns())
    }

    fn captures(&self) -> usize {
        self.rig.captures()
    }

    fn seconds(&self) -> f64 {
        self.rig.seconds()
    }
}
