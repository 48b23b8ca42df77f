//! Steadiness of the panel's light and linearity of the camera: too many captures for live updates.

use super::RigView;
use super::sites::GreenSites;
use crate::config::RigFile;
use crate::frame::{Channel, Codes, Counts};
use crate::measurement::{self, CalibrateError, Linearity};
use crate::rig::RigError;

/// Captures of grey.
pub const GREYS: usize = 200;
/// Bands across the picture: a pulsed backlight read out row by row shows in them.
const BANDS: usize = 16;

/// Steadiness of grey over [`GREYS`] captures, as shares of its light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steadiness {
    /// RMS change from one capture to the next.
    pub flicker: f64,
    /// The same for the least steady band, relative to the whole picture.
    pub bands: f64,
    /// Change from the first tenth of the captures to the last.
    pub drift: f64,
}

impl Steadiness {
    /// Computes the steadiness from the mean light of each band in each capture.
    fn of(captures: &[[f64; BANDS]]) -> Steadiness {
        let whole: Vec<f64> =
            captures.iter().map(|bands| bands.iter().sum::<f64>() / BANDS as f64).collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let light = mean(&whole).max(f64::MIN_POSITIVE);
        let band_changes = |band: usize| {
            let relative = captures.iter().zip(&whole).map(|(bands, whole)| bands[band] - whole);
            rms_change(&relative.collect::<Vec<f64>>())
        };
        let tenth = (captures.len() / 10).max(1).min(whole.len());
        Steadiness {
            flicker: rms_change(&whole) / light,
            bands: (0..BANDS).map(band_changes).fold(0.0, f64::max) / light,
            drift: (mean(&whole[whole.len() - tenth..]) - mean(&whole[..tenth])) / light,
        }
    }
}

/// Standard deviation of independent values from their successive differences; slow drift adds
/// nothing.
fn rms_change(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
    (steps.sum::<f64>() / (2 * values.len().saturating_sub(1).max(1)) as f64).sqrt()
}

/// Mean light of the green sites of each band.
fn bands(counts: &Counts, sites: GreenSites, black: f64) -> [f64; BANDS] {
    let plane = counts.plane(Channel::Green);
    let size = plane.size();
    let mut sums = [(0u64, 0u64); BANDS];
    for y in sites.rows(size) {
        let band = &mut sums[y * BANDS / size.height];
        for &count in plane.row(y).iter().skip(sites.first_column()).step_by(sites.step()) {
            *band = (band.0 + u64::from(count), band.1 + 1);
        }
    }
    sums.map(|(sum, count)| sum as f64 / count.max(1) as f64 - black)
}

impl RigView<'_> {
    /// Measures the steadiness of grey; calls `progress` with the number of captures so far.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn measure_steadiness(
        &mut self,
        progress: &mut dyn FnMut(usize),
    ) -> Result<Steadiness, RigError> {
        let mut captures = Vec::with_capacity(GREYS);
        let grey = Codes::filled(self.devices.panel.size(), 128);
        for n in 0..GREYS {
            let counts = if n == 0 { self.capture(&grey)? } else { self.devices.expose()?.counts };
            captures.push(bands(&counts, self.sites, self.black));
            self.devices.camera.give_back(counts);
            progress(n + 1);
        }
        Ok(Steadiness::of(&captures))
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
