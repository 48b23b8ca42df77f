//! What someone who bolts a rig together wants to see: how sharp the panel is at nine places, where
//! it lies on the sensor, and how bright it is: `relens align`.

mod advice;
pub mod plan;
#[cfg(test)]
mod tests;

use crate::config::RigFile;
use crate::frame::{Channel, Codes, Counts, Frame, Mosaic, Plane, Size};
use crate::patterns::{self, Trial};
use crate::rig::exposure::Devices;
use crate::rig::{RigError, shoot};

/// Places along each side of the sensor.
const SIDE: usize = 3;
/// How many places are looked at.
pub const PLACES: usize = SIDE * SIDE;
/// Panel pixels of the focus pattern's squares: finer ones drown in noise, coarser ones stay sharp
/// out of focus.
const SQUARE_PX: usize = 2;
const PATTERN_SEED: u64 = 29;
/// Light of a spot that counts, as a share of the brightest site's.
const SPOT_SHARE: f64 = 0.5;

/// Contrast of a fine pattern at nine places, row by row from the upper left, as the camera sees
/// it: RMS of the differences between neighbouring sites of one colour over their mean. Two
/// exposures are multiplied, so that noise adds nothing on average.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sharpness(pub [f64; PLACES]);

impl Sharpness {
    /// The mean of the nine.
    pub fn mean(&self) -> f64 {
        self.0.iter().sum::<f64>() / PLACES as f64
    }
}

/// Where the panel lies on the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// The panel's centre from the sensor's, sensor pixels, right and down.
    pub offset_px: [f64; 2],
    /// By how much the panel is turned clockwise in the picture, degrees.
    pub turned_deg: f64,
    /// Sensor pixels a panel pixel.
    pub magnification: f64,
    /// Whether left and right are swapped.
    pub mirrored: bool,
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
    /// RMS change of the white panel's light from one exposure to the next, as a share of it.
    pub flicker: f64,
}

/// A rig that is being aligned.
pub struct RigView<'a> {
    devices: &'a mut Devices,
    mosaic: Option<Mosaic>,
    black: f64,
    count_max: u16,
    pattern: Codes,
}

impl<'a> RigView<'a> {
    /// Of `rig`, whose devices need no marks. Takes the camera's black by one capture.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn new(devices: &'a mut Devices, rig: &RigFile) -> Result<RigView<'a>, RigError> {
        let panel = devices.panel.size();
        let squares = Size::new(panel.width.div_ceil(SQUARE_PX), panel.height.div_ceil(SQUARE_PX));
        let random = patterns::pseudo_random(squares, PATTERN_SEED);
        let code = |x: usize, y: usize| {
            if random.at(x / SQUARE_PX, y / SQUARE_PX) > 0.0 { 255 } else { 0 }
        };
        let plane = Plane::from_fn(panel, code);
        let pattern = Frame::from_fn(|_| plane.clone());
        let (mosaic, count_max) = (rig.mosaic(), rig.camera.count_max());
        let mut alignment = RigView { devices, mosaic, black: 0.0, count_max, pattern };
        let dark = alignment.seen(&patterns::trial(panel, Trial::Black))?;
        let sites = alignment.green_sites(&dark);
        alignment.black = sites.iter().map(|site| site.2).sum::<f64>() / sites.len().max(1) as f64;
        Ok(alignment)
    }

    /// Two captures of the focus pattern.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn sharpness(&mut self) -> Result<Sharpness, RigError> {
        let pattern = std::mem::replace(&mut self.pattern, Frame::zeros(Size::new(0, 0)));
        let both = self.seen(&pattern).and_then(|first| Ok((first, self.seen(&pattern)?)));
        self.pattern = pattern;
        let (first, second) = both?;
        let size = first.plane(Channel::Green).size();
        let (mut power, mut light) = ([0.0; PLACES], [0.0; PLACES]);
        for (x, y, a) in self.green_sites(&first) {
            // The next green site: the pixel to the right, or, behind filters, the diagonal one.
            let (x1, y1) = if self.mosaic.is_some() { (x + 1, y + 1) } else { (x + 1, y) };
            if x1 >= size.width || y1 >= size.height {
                continue;
            }
            let of = |counts: &Counts, x, y| f64::from(counts.plane(Channel::Green).at(x, y));
            let b = of(&second, x, y);
            let (da, db) = (a - of(&first, x1, y1), b - of(&second, x1, y1));
            let place = place_of(x, y, size);
            power[place] += da * db;
            light[place] += (a - self.black) * (b - self.black);
        }
        let contrast =
            |place: usize| (power[place].max(0.0) / light[place].max(f64::MIN_POSITIVE)).sqrt();
        Ok(Sharpness(std::array::from_fn(contrast)))
    }

    /// Two captures of white.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn brightness(&mut self) -> Result<Brightness, RigError> {
        let white = patterns::trial(self.devices.panel.size(), Trial::White);
        let [first, second] = [self.seen(&white)?, self.seen(&white)?];
        let size = first.plane(Channel::Green).size();
        let of = |counts: &Counts| {
            let (mut sums, mut sites) = ([0.0; PLACES], [0.0f64; PLACES]);
            for (x, y, count) in self.green_sites(counts) {
                let place = place_of(x, y, size);
                sums[place] += count - self.black;
                sites[place] += 1.0;
            }
            let mean = |place: usize| sums[place] / sites[place].max(1.0);
            std::array::from_fn::<f64, PLACES, _>(mean)
        };
        let (light, again) = (of(&first), of(&second));
        let brightest = light.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let total = |light: &[f64; PLACES]| light.iter().sum::<f64>();
        let change = total(&again) / total(&light).max(f64::MIN_POSITIVE) - 1.0;
        Ok(Brightness {
            clipped_share: shoot::clipped_share(&first, self.mosaic, self.count_max),
            white: brightest / (f64::from(self.count_max) - self.black).max(1.0),
            places: light.map(|v| (v / brightest).max(0.0)),
            flicker: change.abs() / 2.0f64.sqrt(),
        })
    }

    /// One capture of three spots; `None` when one of them is not seen.
    ///
    /// # Errors
    /// When the capture fails.
    pub fn aim(&mut self) -> Result<Option<Aim>, RigError> {
        let panel = self.devices.panel.size();
        let counts = self.seen(&patterns::trial(panel, Trial::Locator))?;
        let mut found = [[0.0; 2]; 3];
        for c in Channel::ALL {
            let Some(place) = self.spot(&counts, c) else { return Ok(None) };
            found[c.index()] = place;
        }
        let sensor = counts.plane(Channel::Green).size();
        let shown = patterns::locator_spots(panel).map(|(x, y)| [x, y]);
        let across = |spots: &[[f64; 2]; 3]| [spots[1][0] - spots[0][0], spots[1][1] - spots[0][1]];
        let (wide, seen) = (across(&shown), across(&found));
        let magnification = seen[0].hypot(seen[1]) / wide[0].hypot(wide[1]);
        let down = [0, 1].map(|k| found[2][k] - 0.5 * (found[0][k] + found[1][k]));
        // Blue lies below the line from red to green, seen from the front.
        let mirrored = seen[0] * down[1] - seen[1] * down[0] < 0.0;
        let middle = |size: usize| 0.5 * (size as f64 - 1.0);
        // The spots' mean is not the panel's centre, but lies on its middle line.
        let below = shown[0][1] - middle(panel.height);
        let along = [down[0], down[1]].map(|v| v / (shown[2][1] - shown[0][1]));
        let centre = [0, 1].map(|k| 0.5 * (found[0][k] + found[1][k]) - below * along[k]);
        Ok(Some(Aim {
            offset_px: [centre[0] - middle(sensor.width), centre[1] - middle(sensor.height)],
            turned_deg: seen[1].atan2(seen[0]).to_degrees(),
            magnification,
            mirrored,
        }))
    }

    /// The middle of `channel`'s spot on the sensor.
    fn spot(&self, counts: &Counts, channel: Channel) -> Option<[f64; 2]> {
        let plane = counts.plane(channel);
        let own =
            |x: usize, y: usize| self.mosaic.is_none_or(|mosaic| mosaic.colour_at(x, y) == channel);
        let size = plane.size();
        let places = || (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y)));
        let light = |x, y| f64::from(plane.at(x, y)) - self.black;
        let mut bright: Vec<f64> =
            places().filter(|&(x, y)| own(x, y)).map(|(x, y)| light(x, y)).collect();
        // Hot sites are fewer than a spot's.
        let rank = bright.len() * 999 / 1000;
        let peak = *bright.select_nth_unstable_by(rank, f64::total_cmp).1;
        if peak < 0.02 * (f64::from(self.count_max) - self.black) {
            return None;
        }
        let lit = places().filter(|&(x, y)| own(x, y) && light(x, y) > SPOT_SHARE * peak);
        let (mut count, mut sums) = (0.0, [0.0; 2]);
        lit.for_each(|(x, y)| {
            count += 1.0;
            sums[0] += x as f64;
            sums[1] += y as f64;
        });
        (count > 0.0).then(|| sums.map(|sum| sum / count))
    }

    fn seen(&mut self, codes: &Codes) -> Result<Counts, RigError> {
        Ok(self.devices.capture(codes)?.counts)
    }

    /// Column, row and count of the green sites; behind filters those of one of their two phases.
    fn green_sites(&self, counts: &Counts) -> Vec<(usize, usize, f64)> {
        let plane = counts.plane(Channel::Green);
        let own = |x: usize, y: usize| {
            self.mosaic.is_none_or(|m| y.is_multiple_of(2) && m.colour_at(x, y) == Channel::Green)
        };
        let rows = 0..plane.height();
        rows.flat_map(|y| (0..plane.width()).map(move |x| (x, y)))
            .filter(|&(x, y)| own(x, y))
            .map(|(x, y)| (x, y, f64::from(plane.at(x, y))))
            .collect()
    }
}

fn place_of(x: usize, y: usize, size: Size) -> usize {
    (y * SIDE / size.height.max(1)) * SIDE + x * SIDE / size.width.max(1)
}
