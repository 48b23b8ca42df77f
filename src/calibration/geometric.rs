//! Geometric maps between the Work grid and the panel, per channel.
//!
//! Work coordinates are the photo's: (0, 0) is the centre of its first pixel, and the canvas margin
//! has negative coordinates. Panel coordinates likewise.

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

    /// Fits a smooth map to `pairs` of (from, to).
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
            let samples =
                pairs.iter().map(|p| Sample { x: p.from.0, y: p.from.1, value: value(p) });
            Surface::fit(domain, intervals.0, intervals.1, samples, bending)
        };
        Ok(Map { x: one(|p| p.to.0)?, y: one(|p| p.to.1)? })
    }
}

/// Two corresponding points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// The point mapped.
    pub from: (f64, f64),
    /// Its image.
    pub to: (f64, f64),
}

/// Work ↔ panel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Geometry {
    /// Panel position seen at a Work position.
    pub work_to_panel: Map,
    /// Work position of a panel position.
    pub panel_to_work: Map,
}

/// Largest misfit of a pair of corners, relative to the median misfit. A corner in a reflection is
/// off by much more, a good one never (guess).
const OUTLIER: f64 = 5.0;
/// Knot intervals of the maps. A cheap lens's distortion is cubic over the field, which eight by
/// six intervals follow (0.05 to 0.12 px RMS on `ideal.toml`).
const INTERVALS: (usize, usize) = (8, 6);
/// Penalty on bending of the maps; small, as corners are accurate to a few hundredths of a pixel
/// (guess).
const BENDING: f64 = 1e-4;

impl Geometry {
    /// The geometry of a rig with one sensor pixel per panel pixel: Work (x, y) maps to the panel's
    /// (x + `dx`, y + `dy`).
    pub fn one_to_one(canvas: Domain, dx: f64, dy: f64) -> Geometry {
        let on_panel = Domain {
            left: canvas.left + dx,
            top: canvas.top + dy,
            right: canvas.right + dx,
            bottom: canvas.bottom + dy,
        };
        Geometry {
            work_to_panel: Map::shift(canvas, dx, dy),
            panel_to_work: Map::shift(on_panel, -dx, -dy),
        }
    }

    /// Fits the geometry over `canvas` to `pairs` of (Work, panel) without outliers.
    ///
    /// # Errors
    /// When the pairs do not determine a map.
    pub fn fit(canvas: Domain, pairs: &[Pair]) -> Result<Geometry, SurfaceError> {
        let first = Map::fit(canvas, INTERVALS, pairs, BENDING)?;
        let misfit = |map: &Map, p: &Pair| {
            let (x, y) = map.at(p.from.0, p.from.1);
            (x - p.to.0).hypot(y - p.to.1)
        };
        let mut misfits: Vec<f64> = pairs.iter().map(|p| misfit(&first, p)).collect();
        misfits.sort_by(f64::total_cmp);
        let limit = OUTLIER * misfits[misfits.len() / 2].max(1e-9);
        let kept: Vec<Pair> =
            pairs.iter().copied().filter(|p| misfit(&first, p) <= limit).collect();
        let work_to_panel = Map::fit(canvas, INTERVALS, &kept, BENDING)?;
        Geometry::from_map(canvas, |x, y| work_to_panel.at(x, y))
    }

    /// Corrects the geometry for lens functions that centre the light of Work position q at q +
    /// `displacement`(q): afterwards it is centred at q.
    ///
    /// # Errors
    /// When the moved points do not determine a map.
    pub fn recentred(&self, displacement: &Map) -> Result<Geometry, SurfaceError> {
        Geometry::from_map(self.work_to_panel.x.domain(), |x, y| {
            // Solves q + displacement(q) = (x, y). Displacements are small and vary slowly: each
            // round gains two digits.
            let (mut qx, mut qy) = (x, y);
            for _ in 0..4 {
                let (dx, dy) = displacement.at(qx, qy);
                (qx, qy) = (x - dx, y - dy);
            }
            self.work_to_panel.at(qx, qy)
        })
    }

    /// Fits both maps to the function `to_panel`, which maps Work to the panel.
    fn from_map(
        canvas: Domain,
        to_panel: impl Fn(f64, f64) -> (f64, f64),
    ) -> Result<Geometry, SurfaceError> {
        // Eight samples per knot interval in each direction make the fit error negligible.
        let (across, down) = (8 * INTERVALS.0, 8 * INTERVALS.1);
        let mut pairs = Vec::with_capacity((across + 1) * (down + 1));
        for j in 0..=down {
            for i in 0..=across {
                let x = canvas.left + (canvas.right - canvas.left) * i as f64 / across as f64;
                let y = canvas.top + (canvas.bottom - canvas.top) * j as f64 / down as f64;
                pairs.push(Pair { from: (x, y), to: to_panel(x, y) });
            }
        }
        let (mut left, mut top, mut right, mut bottom) = (f64::MAX, f64::MAX, f64::MIN, f64::MIN);
        for Pair { to: (u, v), .. } in &pairs {
            (left, right) = (left.min(*u), right.max(*u));
            (top, bottom) = (top.min(*v), bottom.max(*v));
        }
        let on_panel = Domain { left, top, right, bottom };
        let back: Vec<Pair> = pairs.iter().map(|p| Pair { from: p.to, to: p.from }).collect();
        // The samples have no noise; the penalty only guards against rounding.
        let bending = 1e-9;
        Ok(Geometry {
            work_to_panel: Map::fit(canvas, INTERVALS, &pairs, bending)?,
            panel_to_work: Map::fit(on_panel, INTERVALS, &back, bending)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CANVAS: Domain = Domain { left: -32.0, top: -32.0, right: 1055.0, bottom: 799.0 };

    fn truth(x: f64, y: f64) -> (f64, f64) {
        let (u, v) = (x - 511.5, y - 383.5);
        let bend = 1.0 + 2e-8 * (u * u + v * v);
        let far = 1.0 + 1e-5 * u;
        (960.0 + 1.2 * u * bend / far + 0.02 * v, 540.0 + 1.2 * v * bend / far - 0.02 * u)
    }

    fn pairs() -> Vec<Pair> {
        let mut pairs = Vec::new();
        for j in 0..24 {
            for i in 0..31 {
                let from = (-20.0 + 35.0 * f64::from(i), -20.0 + 35.0 * f64::from(j));
                // Errors of a few hundredths of a pixel, like real corners.
                let wrong = 0.03 * f64::from((i * 7 + j * 13) % 11 - 5) / 3.0;
                let (x, y) = truth(from.0, from.1);
                pairs.push(Pair { from, to: (x + wrong, y - wrong) });
            }
        }
        pairs[40].to.0 += 30.0; // a corner seen in a reflection
        pairs
    }

    #[test]
    fn a_distorted_tilted_board_is_fitted_without_its_outlier() {
        let geometry = Geometry::fit(CANVAS, &pairs()).unwrap();
        let (mut worst, mut squared) = (0.0f64, 0.0f64);
        for j in 0..20 {
            for i in 0..20 {
                let (x, y) = (-32.0 + 57.0 * f64::from(i), -32.0 + 43.0 * f64::from(j));
                let (u, v) = geometry.work_to_panel.at(x, y);
                let (tu, tv) = truth(x, y);
                worst = worst.max((u - tu).hypot(v - tv));
                squared += (u - tu).powi(2) + (v - tv).powi(2);
                let (bx, by) = geometry.panel_to_work.at(u, v);
                assert!((bx - x).hypot(by - y) < 2e-3, "there and back: {} {}", bx - x, by - y);
            }
        }
        let rms = (squared / 400.0).sqrt();
        println!("map {rms:.4} px RMS, worst {worst:.3} (beyond the last corners)");
        assert!(rms < 0.05 && worst < 0.15, "{rms} {worst}");
    }

    #[test]
    fn recentring_removes_the_displacement() {
        let geometry = Geometry::fit(CANVAS, &pairs()).unwrap();
        let displacement = Map {
            x: Surface::plane(CANVAS, 0.3, 1e-3, 0.0),
            y: Surface::plane(CANVAS, -0.2, 0.0, -5e-4),
        };
        let moved = geometry.recentred(&displacement).unwrap();
        for (x, y) in [(0.0, 0.0), (700.0, 300.0)] {
            let (dx, dy) = displacement.at(x, y);
            let (old, new) =
                (geometry.work_to_panel.at(x, y), moved.work_to_panel.at(x + dx, y + dy));
            assert!((old.0 - new.0).abs() < 1e-3 && (old.1 - new.1).abs() < 1e-3);
        }
    }
}
