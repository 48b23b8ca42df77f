//! Flicker of the panel's light and linearity of the camera: too many captures for live updates.

use super::RigView;
use crate::config::RigFile;
use crate::frame::Codes;
use crate::measurement::{self, CalibrateError, Linearity};
use crate::rig::RigError;

/// Captures of grey.
pub const GREYS: usize = 200;

impl RigView<'_> {
    /// RMS change of grey from one capture to the next, over [`GREYS`] captures, as a share.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn measure_flicker(&mut self) -> Result<f64, RigError> {
        let grey = Codes::filled(self.devices.panel.size(), 128);
        let mut light = Vec::with_capacity(GREYS);
        for n in 0..GREYS {
            let counts = if n == 0 { self.capture(&grey)? } else { self.devices.expose()?.counts };
            light.push(self.sites.light(&counts, self.black).mean());
            self.devices.camera.give_back(counts);
        }
        // Slow drift adds nothing to successive differences.
        let squares: f64 = light.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
        let mean = light.iter().sum::<f64>() / GREYS as f64;
        Ok((squares / (2 * (GREYS - 1)) as f64).sqrt() / mean.max(f64::MIN_POSITIVE))
    }

    /// Measures the linearity of the camera on `rig` and restores the exposure; `None` if the
    /// exposure cannot be set.
    ///
    /// # Errors
    /// When a capture fails, or no part of the picture is evenly lit.
    pub fn measure_linearity(
        &mut self,
        rig: &RigFile,
    ) -> Result<Option<Linearity>, CalibrateError> {
        self.last = None;
        measurement::measure_linearity(self.devices, rig)
    }
}
