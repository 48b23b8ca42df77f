//! What someone who bolts a rig together wants to see: how sharp the panel is at nine places, where
//! it lies on the sensor, how bright it is, and what to do about it: `relens align`.

mod advice;
mod dots;
pub mod plan;
mod pose;
mod report;
mod sharpness;
mod sites;
mod steadiness;
#[cfg(test)]
mod tests;

use crate::config::RigFile;
use crate::frame::{Codes, Counts, Plane};
use crate::patterns::{self, Trial};
use crate::rig::RigError;
use crate::rig::exposure::Devices;

pub use advice::{Adjustment, Because, FocusTurn, PictureSide, flickers, leaks};
pub use pose::Aim;
pub use report::AlignmentReport;
pub use sharpness::{FocusHistory, Sharpness};
pub use sites::{GreenSites, Histogram, PLACES};
pub use steadiness::{GREYS, Linearity, Steadiness};

/// One look at the focus pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocusLook {
    /// How sharp it is.
    pub sharpness: Sharpness,
    /// Its mean counts over black.
    pub light: f64,
}

/// How bright the white panel is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brightness {
    /// Share of the data that is full.
    pub clipped_share: f64,
    /// White at the brightest place, as a share of the camera's range over black.
    pub white: f64,
    /// Light of each place over the brightest's.
    pub places: [f64; PLACES],
    /// How many of the data are how bright.
    pub histogram: Histogram,
    /// How long it was exposed.
    pub exposed_ms: f64,
}

/// A rig that is being aligned.
pub struct RigView<'a> {
    devices: &'a mut Devices,
    sites: GreenSites,
    black: f64,
    count_max: u16,
    pattern: Codes,
    dots: Codes,
    /// The last exposure of the focus pattern, while that is on the panel.
    last: Option<Counts>,
    /// Black is on the panel.
    is_black: bool,
}

impl<'a> RigView<'a> {
    /// Of `rig`, whose devices need no marks. Takes the camera's black by one capture.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn new(devices: &'a mut Devices, rig: &RigFile) -> Result<RigView<'a>, RigError> {
        let panel = devices.panel.size();
        let sites = GreenSites::behind(rig.mosaic());
        let count_max = rig.camera.count_max();
        let (pattern, dots) = (sharpness::pattern(panel), dots::picture(panel));
        let mut view = RigView {
            devices,
            sites,
            black: 0.0,
            count_max,
            pattern,
            dots,
            last: None,
            is_black: false,
        };
        let dark = view.capture(&patterns::trial(panel, Trial::Black))?;
        view.black = sites.light(&dark, 0.0).mean();
        Ok(view)
    }

    /// One more exposure of the focus pattern; two, and the time a picture takes to settle, when
    /// something else was shown before.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn look(&mut self) -> Result<FocusLook, RigError> {
        let first = match self.last.take() {
            Some(counts) => counts,
            None => {
                self.is_black = false;
                self.devices.capture(&self.pattern)?.counts
            }
        };
        let second = self.devices.expose()?.counts;
        let (sharpness, light) = Sharpness::of(&first, &second, self.sites, self.black);
        self.devices.camera.give_back(first);
        self.last = Some(second);
        Ok(FocusLook { sharpness, light })
    }

    /// One capture of white.
    ///
    /// # Errors
    /// When it fails.
    pub fn brightness(&mut self) -> Result<Brightness, RigError> {
        let white = patterns::trial(self.devices.panel.size(), Trial::White);
        let counts = self.capture(&white)?;
        let (histogram, clipped_share) = self.sites.histogram(&counts, self.count_max);
        let light = self.sites.light(&counts, self.black);
        self.devices.camera.give_back(counts);
        let means = sites::means(&light);
        let brightest = means.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        Ok(Brightness {
            clipped_share,
            white: brightest / self.range(),
            places: means.map(|mean| (mean / brightest).max(0.0)),
            histogram,
            exposed_ms: self.devices.timing.exposure_ms,
        })
    }

    /// One capture of dots: where the panel lies, `None` when its middle is not seen; and what the
    /// camera sees, as light from 0 to 1.
    ///
    /// # Errors
    /// When the capture fails.
    pub fn aim(&mut self) -> Result<(Option<Aim>, Plane), RigError> {
        let panel = self.devices.panel.size();
        (self.last, self.is_black) = (None, false);
        let counts = self.devices.capture(&self.dots)?.counts;
        let mut light = self.sites.light(&counts, self.black);
        let found = dots::find(&light, self.sites, self.range(), panel);
        let aim = found.and_then(|dots| Aim::of(&dots.pairs, dots.mirrored, panel, counts.size()));
        self.devices.camera.give_back(counts);
        light.scale(1.0 / self.range() as f32);
        Ok((aim, light))
    }

    /// One more exposure of black: what each place sees, as a share of the range.
    ///
    /// # Errors
    /// When it fails.
    pub fn darkness(&mut self) -> Result<[f64; PLACES], RigError> {
        let counts = match self.is_black {
            true => self.devices.expose()?.counts,
            false => self.capture(&patterns::trial(self.devices.panel.size(), Trial::Black))?,
        };
        self.is_black = true;
        let light = self.sites.light(&counts, 0.0);
        self.devices.camera.give_back(counts);
        Ok(sites::means(&light).map(|mean| mean / self.range()))
    }

    /// The rig's clock, in seconds.
    pub fn now_s(&self) -> f64 {
        self.devices.clock.now().0
    }

    /// Counts that light can add to black.
    fn range(&self) -> f64 {
        (f64::from(self.count_max) - self.black).max(1.0)
    }

    /// One capture of `codes` in place of the focus pattern.
    fn capture(&mut self, codes: &Codes) -> Result<Counts, RigError> {
        (self.last, self.is_black) = (None, false);
        Ok(self.devices.capture(codes)?.counts)
    }
}
