//! The colour filter mosaic of a sensor: which colour each of its sites sees.

use serde::{Deserialize, Serialize};

use super::{Channel, Frame, Plane};

/// Which colours the first two pixels of the first two rows have.
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

/// What is known of a picture whose data are a sensor's raw sites.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RawSites {
    /// The colours of its pixels.
    pub mosaic: Mosaic,
    /// Sensor counts that one grey level (of 255) is.
    pub counts_per_level: f32,
}

impl Mosaic {
    /// All of them.
    pub const ALL: [Mosaic; 4] = [Mosaic::Bggr, Mosaic::Gbrg, Mosaic::Grbg, Mosaic::Rggb];

    /// The colours of the first four sites, row by row.
    pub const fn name(self) -> &'static str {
        match self {
            Mosaic::Bggr => "BGGR",
            Mosaic::Gbrg => "GBRG",
            Mosaic::Grbg => "GRBG",
            Mosaic::Rggb => "RGGB",
        }
    }

    /// The column and row, each 0 or 1, of the red site of the first four.
    const fn red_at(self) -> (usize, usize) {
        match self {
            Mosaic::Rggb => (0, 0),
            Mosaic::Grbg => (1, 0),
            Mosaic::Gbrg => (0, 1),
            Mosaic::Bggr => (1, 1),
        }
    }

    /// The colour of the site in column `x`, row `y`.
    pub fn colour_at(self, x: usize, y: usize) -> Channel {
        let (red_x, red_y) = self.red_at();
        match ((x + red_x) % 2, (y + red_y) % 2) {
            (0, 0) => Channel::Red,
            (1, 1) => Channel::Blue,
            _ => Channel::Green,
        }
    }

    /// How many pixels each site of `channel` stands for: 2 of green, 4 of red and blue.
    pub const fn pixels_a_site(channel: Channel) -> f32 {
        match channel {
            Channel::Green => 2.0,
            Channel::Red | Channel::Blue => 4.0,
        }
    }

    /// Three planes of `sites`: a channel's own as they are, the others the mean of that channel's
    /// sites among the eight neighbours. Something to begin with and to look at; data are the
    /// sites.
    pub fn interpolated<S>(self, sites: &Plane) -> Frame<S> {
        Frame::from_fn(|channel| self.filled(channel, sites))
    }

    /// One channel of [`Mosaic::interpolated`].
    pub fn filled(self, channel: Channel, sites: &Plane) -> Plane {
        let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        Plane::from_fn(sites.size(), |x, y| {
            if self.colour_at(x, y) == channel {
                return sites.at(x, y);
            }
            let (mut sum, mut count) = (0.0f32, 0.0f32);
            for v in near(y, sites.height()) {
                for u in near(x, sites.width()).filter(|&u| self.colour_at(u, v) == channel) {
                    (sum, count) = (sum + sites.at(u, v), count + 1.0);
                }
            }
            sum / count.max(1.0)
        })
    }

    /// The mosaic that a camera's pixel format says, by its four-character code; none of a format
    /// that is not raw.
    pub fn of_format(code: &str) -> Option<Mosaic> {
        match code {
            "BA81" | "BG10" | "BG12" | "BYR2" => Some(Mosaic::Bggr),
            "GBRG" | "GB10" | "GB12" | "GB16" => Some(Mosaic::Gbrg),
            "GRBG" | "BA10" | "BA12" | "GR16" => Some(Mosaic::Grbg),
            "RGGB" | "RG10" | "RG12" | "RG16" => Some(Mosaic::Rggb),
            _ => None,
        }
    }

    /// The mosaic of the part of a sensor that begins in column `x`, row `y`.
    pub fn from_place(self, x: usize, y: usize) -> Mosaic {
        let (red_x, red_y) = self.red_at();
        match ((x + red_x) % 2, (y + red_y) % 2) {
            (0, 0) => Mosaic::Rggb,
            (1, 0) => Mosaic::Grbg,
            (0, _) => Mosaic::Gbrg,
            _ => Mosaic::Bggr,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
