//! Where on the panel the lens sees each place of the Work grid, channel by channel, and back.
//!
//! Work coordinates are the photo's: pixel (0, 0) is the photo's first pixel, centre of a pixel at whole
//! numbers; the canvas margin has negative coordinates. Panel coordinates likewise.

use serde::{Deserialize, Serialize};

use super::surface::{Domain, Sample, Surface, SurfaceError};

/// A smooth map of the plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Map {
    /// Horizontal coordinate of the image point.
    pub x: Surface,
    /// Vertical coordinate of the image point.
    pub y: Surface,
}

impl Map {
    /// The image of (`x`, `y`).
    pub fn at(&self, x: f64, y: f64) -> (f64, f64) {
        (self.x.at(x, y), self.y.at(x, y))
    }

    /// The map (x, y) ↦ (x + `dx`, y + `dy`).
    pub fn shift(domain: Domain, dx: f64, dy: f64) -> Map {
        Map { x: Surface::plane(domain, dx, 1.0, 0.0), y: Surface::plane(domain, dy, 0.0, 1.0) }
    }

    /// The smooth map nearest to `pairs` of (from, to).
    ///
    /// # Errors
    /// When the pairs do not determine a map.
    pub fn fit(
        domain: Domain,
        intervals: (usize, usize),
        pairs: &[Pair],
        bending: f64,
    ) -> Result<Map, SurfaceError> {
        let one = |value: fn(&Pair) -> f64| {
            let samples = pairs.iter().map(|p| Sample { x: p.from.0, y: p.from.1, value: value(p) });
            Surface::fit(domain, intervals.0, intervals.1, samples, bending)
        };
        Ok(Map { x: one(|p| p.to.0)?, y: one(|p| p.to.1)? })
    }
}

/// Two points that belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// The point mapped.
    pub from: (f64, f64),
    /// Its image.
    pub to: (f64, f64),
}

/// Work ↔ panel for one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Geometry {
    /// Where to show what shall be seen at a Work place.
    pub work_to_panel: Map,
    /// Where in Work a panel place is seen.
    pub panel_to_work: Map,
}
