//! Position of the panel on the sensor from the dots found: shift, rotation, size, keystone, and
//! the panel's reach beyond the sensor.

use nalgebra::{DMatrix, DVector};

use crate::frame::Size;

/// Position of a dot on the panel and on the sensor, pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenDot {
    pub(super) panel: [f64; 2],
    pub(super) sensor: [f64; 2],
}

/// Fewest dots to fit the lens's distortion with; fewer do not separate it from keystone.
const FOR_DISTORTION: usize = 12;
/// Gauss–Newton steps.
const STEPS: usize = 8;
/// Largest misfit of a dot, sensor pixels.
const OFF_MAX_PX: f64 = 5.0;

/// Position of the panel on the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Offset of the panel's centre from the sensor's, sensor pixels, right and down.
    pub offset_px: [f64; 2],
    /// Clockwise rotation of the panel in the picture, degrees.
    pub rotation_deg: f64,
    /// Sensor pixels per panel pixel, in the sensor's middle.
    pub magnification: f64,
    /// Whether left and right are swapped.
    pub mirrored: bool,
    /// Relative difference in the panel's scale between the sensor's right and left edges, and
    /// between its lower and upper ones; positive where the right or lower side is nearer.
    pub keystone: [f64; 2],
    /// Panel pixels that the sensor spans, across and down.
    pub span_px: [f64; 2],
    /// Panel pixels beyond the sensor's view at the panel's left, right, top and bottom; negative
    /// where the sensor sees past the panel.
    pub reserve_px: [f64; 4],
}

impl Aim {
    /// Whether every sensor pixel sees the panel.
    pub fn covers(&self) -> bool {
        self.reserve_px.iter().all(|&reserve| reserve >= 0.0)
    }

    /// Fits the position of a `panel` on a `sensor` to `pairs`; `None` if none fits.
    pub(super) fn of(pairs: &[SeenDot], mirrored: bool, panel: Size, sensor: Size) -> Option<Aim> {
        let map = Perspective::fit(pairs, panel, sensor)?;
        let [sx, sy, a, b, c, d, px, py, _] = map.parameters;
        let unit = map.unit;
        // The parameters are in units of `unit`.
        let determinant = a * d - b * c;
        let flip = if mirrored { -1.0 } else { 1.0 };
        // w = 1 + p·q with q = A⁻¹(seen − s): the gradient of w over the sensor. Scale is 1/w.
        let gradient = [(px * d - py * c) / determinant, (py * a - px * b) / determinant];
        let sides = [sensor.width, sensor.height].map(|pixels| pixels as f64 / unit);
        let corners = map.corners()?;
        let reach = |axis: usize, pixels: usize| {
            let along = corners.map(|corner| corner[axis]);
            let least = along.into_iter().fold(f64::INFINITY, f64::min);
            let most = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
            (least + 0.5, pixels as f64 - 0.5 - most, most - least)
        };
        let (left, right, wide) = reach(0, panel.width);
        let (top, bottom, high) = reach(1, panel.height);
        Some(Aim {
            offset_px: [sx * unit, sy * unit],
            rotation_deg: (c - flip * b).atan2(flip * a + d).to_degrees(),
            magnification: determinant.abs().sqrt(),
            mirrored,
            keystone: [0, 1].map(|k| -gradient[k] * sides[k]),
            span_px: [wide, high],
            reserve_px: [left, right, top, bottom],
        })
    }
}

/// Map from panel to sensor: affine, perspective, and third-order distortion. Coordinates are
/// relative to the middles, in units of half the sensor's diagonal.
struct Perspective {
    /// Shift (2), the matrix by rows (4), perspective (2), distortion.
    parameters: [f64; 9],
    panel: Size,
    sensor: Size,
    unit: f64,
}

impl Perspective {
    /// Least squares by the Gauss–Newton method, starting from the affine map.
    fn fit(pairs: &[SeenDot], panel: Size, sensor: Size) -> Option<Perspective> {
        let unit = 0.5 * (sensor.width as f64).hypot(sensor.height as f64);
        let mut map = Perspective { parameters: [0.0; 9], panel, sensor, unit };
        map.parameters[2] = 1.0;
        map.parameters[5] = 1.0;
        let free = if pairs.len() < FOR_DISTORTION { 8 } else { 9 };
        for step in 0..STEPS {
            // The first step fits the affine part alone.
            let free = if step == 0 { 6 } else { free };
            let mut slopes = DMatrix::zeros(2 * pairs.len(), free);
            let mut off = DVector::zeros(2 * pairs.len());
            for (n, dot) in pairs.iter().enumerate() {
                let (shown, seen) =
                    (map.about_middle(dot.panel, panel), map.about_middle(dot.sensor, sensor));
                let here = map.at(shown);
                for k in 0..2 {
                    off[2 * n + k] = seen[k] - here[k];
                }
                for p in 0..free {
                    const STEP: f64 = 1e-6;
                    let mut moved = Perspective { parameters: map.parameters, panel, sensor, unit };
                    moved.parameters[p] += STEP;
                    let there = moved.at(shown);
                    for k in 0..2 {
                        slopes[(2 * n + k, p)] = (there[k] - here[k]) / STEP;
                    }
                }
            }
            let change = slopes.svd(true, true).solve(&off, 1e-12).ok()?;
            for p in 0..free {
                map.parameters[p] += change[p];
            }
        }
        let off = |dot: &SeenDot| {
            let there = map.at(map.about_middle(dot.panel, panel));
            let seen = map.about_middle(dot.sensor, sensor);
            (there[0] - seen[0]).hypot(there[1] - seen[1]) * unit
        };
        pairs.iter().all(|pair| off(pair) < OFF_MAX_PX).then_some(map)
    }

    fn about_middle(&self, place: [f64; 2], size: Size) -> [f64; 2] {
        let middle = [size.width, size.height].map(|pixels| 0.5 * (pixels as f64 - 1.0));
        [0, 1].map(|k| (place[k] - middle[k]) / self.unit)
    }

    /// Maps a position on the panel to the sensor.
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [sx, sy, a, b, c, d, px, py, distortion] = self.parameters;
        let w = 1.0 + px * x + py * y;
        let ideal = [(a * x + b * y) / w + sx, (c * x + d * y) / w + sy];
        let further = 1.0 + distortion * (ideal[0] * ideal[0] + ideal[1] * ideal[1]);
        ideal.map(|v| v * further)
    }

    /// The panel positions seen by the sensor's corners.
    fn corners(&self) -> Option<[[f64; 2]; 4]> {
        let (width, height) = (self.sensor.width as f64, self.sensor.height as f64);
        let (right, bottom) = (width - 0.5, height - 0.5);
        let mut all = [[-0.5, -0.5], [right, -0.5], [-0.5, bottom], [right, bottom]];
        for corner in &mut all {
            *corner = self.seen_at(*corner)?;
        }
        Some(all)
    }

    /// Maps a position on the sensor to the panel, by Newton's method.
    fn seen_at(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        const STEP: f64 = 1e-6;
        let wanted = self.about_middle(place, self.sensor);
        let mut at = [0.0; 2];
        for _ in 0..20 {
            let here = self.at(at);
            let [right, down] = [[STEP, 0.0], [0.0, STEP]].map(|[x, y]| {
                let there = self.at([at[0] + x, at[1] + y]);
                [0, 1].map(|k| (there[k] - here[k]) / STEP)
            });
            let off = [wanted[0] - here[0], wanted[1] - here[1]];
            let determinant = right[0] * down[1] - down[0] * right[1];
            at[0] += (off[0] * down[1] - down[0] * off[1]) / determinant;
            at[1] += (right[0] * off[1] - off[0] * right[1]) / determinant;
        }
        let middle = [self.panel.width, self.panel.height].map(|n| 0.5 * (n as f64 - 1.0));
        let found = [0, 1].map(|k| at[k] * self.unit + middle[k]);
        found.iter().all(|v| v.is_finite()).then_some(found)
    }
}
