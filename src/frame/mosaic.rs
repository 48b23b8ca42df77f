//! The colour filter mosaic of a sensor.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Channel, Frame, Plane, Size};

/// A Bayer mosaic, named by its first two rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mosaic {
    /// Blue first, green to its right and below.
    Bggr,
    /// Green first, blue to its right.
    Gbrg,
    /// Green first, red to its right.
    Grbg,
    /// Red first, green to its right and below.
    Rggb,
}

/// Properties of a raw picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RawSites {
    /// Colour filters of its pixels.
    pub mosaic: Mosaic,
    /// Sensor counts per grey level (of 255).
    pub counts_per_level: f32,
    /// Stated noise of each channel, if any: variance without light, and variance per grey level,
    /// squared grey levels.
    pub noise: Option<[[f32; 2]; 3]>,
}

impl RawSites {
    /// Raw sites without a stated noise.
    pub const fn new(mosaic: Mosaic, counts_per_level: f32) -> RawSites {
        RawSites { mosaic, counts_per_level, noise: None }
    }

    /// The same sites in a camera's own unit of `counts_per_level`. Files shift a sensor's 10 bits
    /// to 16, so the units differ by a power of two; the remaining factor is kept, as it is due to
    /// the file's white.
    #[must_use]
    pub fn in_units_of(self, counts_per_level: f32) -> RawSites {
        let shift = (self.counts_per_level / counts_per_level).log2().round();
        RawSites { counts_per_level: self.counts_per_level / shift.exp2(), ..self }
    }
}

impl Mosaic {
    /// All mosaics.
    pub const ALL: [Mosaic; 4] = [Mosaic::Bggr, Mosaic::Gbrg, Mosaic::Grbg, Mosaic::Rggb];

    /// Colours of the first four sites, row by row.
    pub const fn name(self) -> &'static str {
        match self {
            Mosaic::Bggr => "BGGR",
            Mosaic::Gbrg => "GBRG",
            Mosaic::Grbg => "GRBG",
            Mosaic::Rggb => "RGGB",
        }
    }

    /// Column and row, each 0 or 1, of the first red site.
    const fn red_at(self) -> (usize, usize) {
        match self {
            Mosaic::Rggb => (0, 0),
            Mosaic::Grbg => (1, 0),
            Mosaic::Gbrg => (0, 1),
            Mosaic::Bggr => (1, 1),
        }
    }

    /// Colour of the site in column `x`, row `y`.
    pub fn colour_at(self, x: usize, y: usize) -> Channel {
        let (red_x, red_y) = self.red_at();
        match ((x + red_x) % 2, (y + red_y) % 2) {
            (0, 0) => Channel::Red,
            (1, 1) => Channel::Blue,
            _ => Channel::Green,
        }
    }

    /// Pixels per site of `channel`: 2 for green, 4 for red and blue.
    pub const fn pixels_a_site(channel: Channel) -> f32 {
        match channel {
            Channel::Green => 2.0,
            Channel::Red | Channel::Blue => 4.0,
        }
    }

    /// Bilinear demosaicing: each channel's missing pixels are the mean of its sites among the
    /// eight neighbours. Used for initial values and display; the data are the sites.
    pub fn interpolated<S>(self, sites: &Plane) -> Frame<S> {
        Frame::from_fn(|channel| self.filled(channel, sites))
    }

    /// One channel of [`Mosaic::interpolated`].
    pub fn filled(self, channel: Channel, sites: &Plane) -> Plane {
        let mut plane = Plane::zeros(sites.size());
        let rows = plane.data_mut().par_chunks_mut(sites.width().max(1)).enumerate();
        let mean = |near: &[f32]| near.iter().sum::<f32>() / near.len().max(1) as f32;
        rows.for_each(|(y, row)| self.fill_row(channel, sites, y, row, mean));
        plane
    }

    /// Fills row `y` of one channel with its own sites and, between them, the `mean` of its sites
    /// among the eight neighbours: four at most, fewer at the border.
    pub(crate) fn fill_row<T: Copy + Default>(
        self,
        channel: Channel,
        sites: &Plane<T>,
        y: usize,
        row: &mut [T],
        mean: impl Fn(&[T]) -> T,
    ) {
        let offsets = [0, 1].map(|x| self.nearest(channel, x, y));
        for (x, value) in row.iter_mut().enumerate() {
            let (mut near, mut count) = ([T::default(); 4], 0);
            for &(dx, dy) in offsets[x % 2] {
                let (column, line) = ((x + dx).wrapping_sub(1), (y + dy).wrapping_sub(1));
                if column < sites.width() && line < sites.height() {
                    near[count] = sites.at(column, line);
                    count += 1;
                }
            }
            *value = mean(&near[..count]);
        }
    }

    /// The sites of `channel` in `plane`, interpolated by Lanczos's kernel of three lobes: up to
    /// 0.6 of their Nyquist frequency they keep the contrast that [`Mosaic::filled`] attenuates.
    pub fn interpolated_finely(self, channel: Channel, plane: &Plane) -> Plane {
        let Size { width, height } = plane.size();
        let share = if channel == Channel::Green { 0.5 } else { 1.0 };
        let [mut along_x, mut both] = [(); 2].map(|()| Plane::zeros(plane.size()));
        let rows = along_x.data_mut().par_chunks_mut(width.max(1)).enumerate();
        rows.for_each(|(y, row)| {
            let is_site = [0, 1].map(|x| self.colour_at(x, y) == channel);
            let sites = plane.row(y).iter().enumerate();
            let sites = sites.map(|(x, v)| if is_site[x % 2] { share * v } else { 0.0 });
            let sites: Vec<f32> = sites.collect();
            let padded: Vec<f32> =
                (0..width + 2 * LOBES_PX).map(|x| sites[mirrored(x, width)]).collect();
            by_lanczos(row, |tap| &padded[tap..][..width]);
        });
        let rows = both.data_mut().par_chunks_mut(width.max(1)).enumerate();
        rows.for_each(|(y, row)| by_lanczos(row, |tap| along_x.row(mirrored(y + tap, height))));
        both
    }

    /// Nearest sites of `channel` around (`x`, `y`), as offsets 0..3 from the upper left neighbour.
    pub(super) fn nearest(self, channel: Channel, x: usize, y: usize) -> &'static [(usize, usize)] {
        const SELF: [(usize, usize); 1] = [(1, 1)];
        const SIDES: [(usize, usize); 2] = [(0, 1), (2, 1)];
        const ENDS: [(usize, usize); 2] = [(1, 0), (1, 2)];
        const CROSS: [(usize, usize); 4] = [(1, 0), (0, 1), (2, 1), (1, 2)];
        const CORNERS: [(usize, usize); 4] = [(0, 0), (2, 0), (0, 2), (2, 2)];
        if self.colour_at(x, y) == channel {
            &SELF
        } else if channel == Channel::Green {
            &CROSS
        } else if self.colour_at(x + 1, y) == channel {
            &SIDES
        } else if self.colour_at(x, y + 1) == channel {
            &ENDS
        } else {
            &CORNERS
        }
    }

    /// The mosaic of a camera's raw pixel format, given by its four-character code or its name in
    /// the Pixel Format Naming Convention; `None` if the format is not raw.
    pub fn of_format(code: &str) -> Option<Mosaic> {
        let code = code.strip_prefix("Bayer").and_then(|rest| rest.get(..2)).unwrap_or(code);
        match code {
            "BG" | "BA81" | "BG10" | "pBAA" | "BG12" | "pBCC" | "BYR2" => Some(Mosaic::Bggr),
            "GB" | "GBRG" | "GB10" | "pGAA" | "GB12" | "pGCC" | "GB16" => Some(Mosaic::Gbrg),
            "GR" | "GRBG" | "BA10" | "pgAA" | "BA12" | "pgCC" | "GR16" => Some(Mosaic::Grbg),
            "RG" | "RGGB" | "RG10" | "pRAA" | "RG12" | "pRCC" | "RG16" => Some(Mosaic::Rggb),
            _ => None,
        }
    }

    /// The mosaic of the part of a sensor that starts at column `x`, row `y`.
    pub fn from_place(self, x: usize, y: usize) -> Mosaic {
        let (red_x, red_y) = self.red_at();
        let red_at = ((x + red_x) % 2, (y + red_y) % 2);
        Mosaic::ALL.into_iter().find(|of| of.red_at() == red_at).unwrap_or(self)
    }
}

/// Reach of Lanczos's kernel of three lobes between sites two pixels apart.
const LOBES_PX: usize = 5;

/// Index of position `at` − [`LOBES_PX`] in a line of `length` values that is mirrored at its ends.
fn mirrored(at: usize, length: usize) -> usize {
    let at = at.abs_diff(LOBES_PX);
    if at < length { at } else { (2 * (length - 1)).saturating_sub(at) }
}

/// Adds to `out`, which holds zeros, the lines around it weighted by Lanczos's kernel of three
/// lobes for sites two pixels apart, with zeros between. `line`(n) lies n − [`LOBES_PX`] pixels
/// from `out`.
fn by_lanczos<'a>(out: &mut [f32], line: impl Fn(usize) -> &'a [f32]) {
    /// The kernel at ½, 1½ and 2½ between sites, normalised; it is 0 at all other sites.
    const WEIGHTS: [f32; 3] = [0.6114, -0.1359, 0.0245];
    for (by, weight) in [1, 3, 5].into_iter().zip(WEIGHTS) {
        let pairs = line(LOBES_PX - by).iter().zip(line(LOBES_PX + by));
        out.iter_mut().zip(pairs).for_each(|(sum, (a, b))| *sum += weight * (a + b));
    }
    out.iter_mut().zip(line(LOBES_PX)).for_each(|(sum, own)| *sum += own);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Work;

    /// One pixel of [`Mosaic::interpolated`], computed from its definition.
    fn mean_by_definition(mosaic: Mosaic, c: Channel, sites: &Plane, x: usize, y: usize) -> f32 {
        if mosaic.colour_at(x, y) == c {
            return sites.at(x, y);
        }
        let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        let (mut sum, mut count) = (0.0f32, 0.0f32);
        for v in near(y, sites.height()) {
            for u in near(x, sites.width()).filter(|&u| mosaic.colour_at(u, v) == c) {
                (sum, count) = (sum + sites.at(u, v), count + 1.0);
            }
        }
        sum / count.max(1.0)
    }

    #[test]
    fn fine_interpolation_keeps_waves_of_seven_pixels() {
        let wave = |x: usize, y: usize| (0.9 * (x as f32 + 0.3 * y as f32)).cos();
        let plane: Plane = Plane::from_fn(Size::new(60, 44), wave);
        for channel in Channel::ALL {
            let fine = Mosaic::Gbrg.interpolated_finely(channel, &plane);
            let inside = (8..36).flat_map(|y| (8..52).map(move |x| (x, y)));
            let worst = inside.map(|(x, y)| (fine.at(x, y) - wave(x, y)).abs()).fold(0.0, f32::max);
            assert!(worst < 0.06, "{channel:?}: {worst}");
        }
    }

    #[test]
    fn tables_agree_with_the_definition() {
        for size in [Size::new(9, 7), Size::new(8, 6), Size::new(2, 2), Size::new(1, 3)] {
            let sites =
                Plane::from_fn(size, |x, y| ((x * 977 + y * 3571 + x * y * 31) % 256) as f32);
            for mosaic in Mosaic::ALL {
                let all: Frame<Work> = mosaic.interpolated(&sites);
                for c in Channel::ALL {
                    let plain =
                        Plane::from_fn(size, |x, y| mean_by_definition(mosaic, c, &sites, x, y));
                    let off = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-4;
                    assert!(!all.plane(c).data().iter().zip(plain.data()).any(off), "{mosaic:?}");
                }
            }
        }
    }

    #[test]
    fn a_part_of_a_sensor_has_the_sensor_s_colours() {
        for mosaic in Mosaic::ALL {
            for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1), (16, 17), (7, 4)] {
                let part = mosaic.from_place(x, y);
                for (column, row) in [(0, 0), (1, 0), (0, 1), (5, 3)] {
                    let whole = mosaic.colour_at(x + column, y + row);
                    assert_eq!(part.colour_at(column, row), whole, "{mosaic:?} {x} {y}");
                }
            }
        }
    }
}
