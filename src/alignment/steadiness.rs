//! What takes too many captures for a live look: whether the light is steady, and whether counts
//! follow it.

use super::RigView;
use super::sites::GreenSites;
use crate::frame::{Channel, Counts};
use crate::patterns::{self, Trial};
use crate::rig::RigError;

/// Captures of grey.
pub const GREYS: usize = 200;
/// Bands across the picture; a backlight that is dimmed by pulses, seen row by row, shows in them.
const BANDS: usize = 16;
/// Exposures compared: their multiples, and captures at each.
const TIMES: [f64; 3] = [1.0, 2.0, 3.0];
const CAPTURES_EACH: usize = 4;
/// Where the longest exposure puts grey, as a share of the range: where no sensor's knee bends yet.
const LONGEST_SHARE: f64 = 0.7;

/// How steady grey is over [`GREYS`] captures; all as shares of its light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steadiness {
    /// RMS change from one capture to the next.
    pub flicker: f64,
    /// The same of the most restless band across the picture, beside the whole.
    pub bands: f64,
    /// From the first tenth of the captures to the last.
    pub drift: f64,
}

/// How counts follow the exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linearity {
    /// So many times the counts, over black, at twice and three times the exposure.
    pub times: [f64; 2],
}

impl Steadiness {
    /// Of the mean light of the bands of each capture.
    fn of(captures: &[[f64; BANDS]]) -> Steadiness {
        let whole: Vec<f64> =
            captures.iter().map(|bands| bands.iter().sum::<f64>() / BANDS as f64).collect();
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
        let light = mean(&whole).max(f64::MIN_POSITIVE);
        let of_band = |band: usize| {
            let beside = captures.iter().zip(&whole).map(|(bands, whole)| bands[band] - whole);
            changes(&beside.collect::<Vec<f64>>())
        };
        let tenth = (captures.len() / 10).max(1).min(whole.len());
        Steadiness {
            flicker: changes(&whole) / light,
            bands: (0..BANDS).map(of_band).fold(0.0, f64::max) / light,
            drift: (mean(&whole[whole.len() - tenth..]) - mean(&whole[..tenth])) / light,
        }
    }
}

/// Standard deviation of what differs from one to the next; a slow drift is none of it.
fn changes(values: &[f64]) -> f64 {
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
    /// Measures how steady grey is; `taken` is told after each capture.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn steadiness(&mut self, taken: &mut dyn FnMut(usize)) -> Result<Steadiness, RigError> {
        let mut captures = Vec::with_capacity(GREYS);
        let grey = patterns::trial(self.devices.panel.size(), Trial::Grey);
        for n in 0..GREYS {
            let counts = if n == 0 { self.capture(&grey)? } else { self.devices.expose()?.counts };
            captures.push(bands(&counts, self.sites, self.black));
            self.devices.camera.give_back(counts);
            taken(n + 1);
        }
        Ok(Steadiness::of(&captures))
    }

    /// Measures how counts follow the exposure, which is as before in the end; `None` of a camera
    /// whose exposure cannot be set. `white` is what white brings, as a share of the range.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn linearity(&mut self, white: f64) -> Result<Option<Linearity>, RigError> {
        if !self.devices.expose_times(1.0)? {
            return Ok(None);
        }
        let light = LONGEST_SHARE / TIMES[2] / white.max(0.01);
        // A panel's response is about this power.
        let code = (255.0 * light.min(1.0).powf(1.0 / 2.2)).round() as u8;
        let counts = TIMES.map(|times| self.counts_at(times, code));
        self.devices.expose_times(1.0)?;
        let [once, twice, thrice] = counts;
        let (once, twice, thrice) = (once?, twice?, thrice?);
        Ok(Some(Linearity { times: [twice / once, thrice / once] }))
    }

    /// What `code` brings over black at `times` the exposure.
    fn counts_at(&mut self, times: f64, code: u8) -> Result<f64, RigError> {
        self.devices.expose_times(times)?;
        let panel = self.devices.panel.size();
        let (black, grey) = (patterns::flat(panel, [0; 3]), patterns::flat(panel, [code; 3]));
        let mut light = 0.0;
        for (codes, sign) in [(black, -1.0), (grey, 1.0)] {
            // The first frame after a change may still be exposed as before.
            let counts = self.capture(&codes)?;
            self.devices.camera.give_back(counts);
            for _ in 0..CAPTURES_EACH {
                let counts = self.devices.expose()?.counts;
                let of_bands = bands(&counts, self.sites, 0.0);
                light += sign * of_bands.iter().sum::<f64>() / (BANDS * CAPTURES_EACH) as f64;
                self.devices.camera.give_back(counts);
            }
        }
        Ok(light)
    }
}
