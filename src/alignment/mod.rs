//! Measurements for assembling a rig (`relens align`): sharpness at nine places, position of the
//! panel on the sensor, brightness, and advice.

mod advice;
mod dots;
mod pose;
mod report;
mod sharpness;
mod sites;
#[cfg(test)]
mod tests;

use crate::config::RigFile;
use crate::frame::{Codes, Counts};
use crate::rig::RigError;
use crate::rig::exposure::Devices;
use crate::rig::shoot::clipped_share;

pub use advice::{Action, Advice, FocusTurn};
pub use pose::Aim;
pub use report::AlignmentReport;
pub use sharpness::{FocusHistory, Sharpness};
pub use sites::{GreenSites, PLACES};

/// One reading of the focus pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocusReading {
    /// Sharpness at nine places.
    pub sharpness: Sharpness,
    /// Mean counts over black.
    pub light: f64,
}

/// Brightness of the white panel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brightness {
    /// Share of saturated sites.
    pub clipped_share: f64,
    /// White at the brightest place, as a share of the camera's range over black.
    pub white: f64,
    /// Light of each place relative to the brightest place.
    pub places: [f64; PLACES],
    /// Exposure time, ms.
    pub exposed_ms: f64,
}

/// A rig under alignment.
pub struct RigView<'a> {
    devices: &'a mut Devices,
    sites: GreenSites,
    black: f64,
    count_max: u16,
    /// The last exposure of the focus pattern, while the panel shows it.
    last: Option<Counts>,
}

impl<'a> RigView<'a> {
    /// Opens the view of `rig`, whose devices need no marks, and captures the camera's black.
    pub fn new(devices: &'a mut Devices, rig: &RigFile) -> Result<RigView<'a>, RigError> {
        let panel = devices.panel.size();
        let sites = GreenSites::behind(rig.mosaic());
        let count_max = rig.camera.count_max();
        let mut view = RigView { devices, sites, black: 0.0, count_max, last: None };
        let dark = view.capture(&Codes::filled(panel, 0))?;
        view.black = sites.light(&dark, 0.0).mean();
        Ok(view)
    }

    /// Exposes the focus pattern once more; if the panel showed another picture, shows the pattern,
    /// waits until it has settled, and exposes it twice.
    pub fn measure_focus(&mut self) -> Result<FocusReading, RigError> {
        let first = match self.last.take() {
            Some(counts) => counts,
            None => self.capture(&sharpness::pattern(self.devices.panel.size()))?,
        };
        let second = self.devices.expose()?.counts;
        let (sharpness, light) = Sharpness::of(&first, &second, self.sites, self.black);
        self.devices.camera.give_back(first);
        self.last = Some(second);
        Ok(FocusReading { sharpness, light })
    }

    /// Captures white and measures its brightness.
    pub fn measure_brightness(&mut self) -> Result<Brightness, RigError> {
        let white = Codes::filled(self.devices.panel.size(), 255);
        let counts = self.capture(&white)?;
        let clipped_share = clipped_share(&counts, self.sites.mosaic, self.count_max);
        let light = self.sites.light(&counts, self.black);
        self.devices.camera.give_back(counts);
        let means = sites::means(&light);
        let brightest = means.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        Ok(Brightness {
            clipped_share,
            white: brightest / self.range(),
            places: means.map(|mean| (mean / brightest).max(0.0)),
            exposed_ms: self.devices.timing.exposure_ms,
        })
    }

    /// Captures the dots and measures the panel's position; `None` if its middle is not in view.
    pub fn measure_aim(&mut self) -> Result<Option<Aim>, RigError> {
        let panel = self.devices.panel.size();
        let counts = self.capture(&dots::picture(panel))?;
        let light = self.sites.light(&counts, self.black);
        let found = dots::find(&light, self.sites, self.range(), panel);
        let aim = found.and_then(|dots| Aim::of(&dots.pairs, dots.mirrored, panel, counts.size()));
        self.devices.camera.give_back(counts);
        Ok(aim)
    }

    /// Counts between black and saturation.
    fn range(&self) -> f64 {
        (f64::from(self.count_max) - self.black).max(1.0)
    }

    /// Captures `codes` in place of the focus pattern.
    fn capture(&mut self, codes: &Codes) -> Result<Counts, RigError> {
        self.last = None;
        Ok(self.devices.capture(codes)?.counts)
    }
}
