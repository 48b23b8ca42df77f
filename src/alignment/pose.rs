//! Where the panel lies on the sensor, of dots that were found: shift, turn, size, keystone, and
//! how far the panel reaches beyond the sensor.

use nalgebra::{DMatrix, DVector};

use crate::frame::Size;

/// A panel place and the sensor place that it is seen at, in pixels.
pub(super) type SeenDot = ([f64; 2], [f64; 2]);

/// With fewer dots a lens's distortion is not told from keystone, and taken to be none.
const FOR_DISTORTION: usize = 12;
const STEPS: usize = 8;
/// Dots lie this near to where the pose puts them, in sensor pixels; else it is none.
const OFF_MAX_PX: f64 = 5.0;

/// Where the panel lies on the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// The panel's centre from the sensor's, sensor pixels, right and down.
    pub offset_px: [f64; 2],
    /// By how much the panel is turned clockwise in the picture, degrees.
    pub turned_deg: f64,
    /// Sensor pixels a panel pixel, in the sensor's middle.
    pub magnification: f64,
    /// Whether left and right are swapped.
    pub mirrored: bool,
    /// By which share of the middle's size the panel looks larger at the sensor's right edge than
    /// at its left one, and at its lower edge than at its upper: that side is so much nearer.
    pub keystone: [f64; 2],
    /// Panel pixels that the sensor spans, across and down.
    pub span_px: [f64; 2],
    /// Panel pixels beyond what the sensor sees, at the panel's left, right, top and bottom; less
    /// than nothing where the sensor sees past the panel.
    pub spare_px: [f64; 4],
}

impl Aim {
    /// Whether every pixel of the sensor sees panel.
    pub fn covers(&self) -> bool {
        self.spare_px.iter().all(|&spare| spare >= 0.0)
    }

    /// Angles by which the panel's right and lower sides are nearer, in degrees, behind a lens
    /// whose image is `image_distance_px` sensor pixels away, on a sensor of `size`.
    pub fn tilt_deg(&self, image_distance_px: f64, size: Size) -> [f64; 2] {
        let across = [size.width, size.height].map(|pixels| pixels as f64);
        [0, 1].map(|k| (self.keystone[k] * image_distance_px / across[k]).atan().to_degrees())
    }

    /// The pose in which `pairs` of a `panel` are seen on a `sensor`; `None` when there is none.
    pub(super) fn of(pairs: &[SeenDot], mirrored: bool, panel: Size, sensor: Size) -> Option<Aim> {
        let map = Perspective::fit(pairs, panel, sensor)?;
        let [sx, sy, a, b, c, d, px, py, _] = map.parameters;
        let unit = map.unit;
        // Lengths are in `unit`s there, places in panel pixels over it too.
        let determinant = a * d - b * c;
        let flip = if mirrored { -1.0 } else { 1.0 };
        // w = 1 + p·q; q = A⁻¹(seen − s): how w grows over the sensor's sides. Sizes go with 1/w.
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
            turned_deg: (c - flip * b).atan2(flip * a + d).to_degrees(),
            magnification: determinant.abs().sqrt(),
            mirrored,
            keystone: [0, 1].map(|k| -gradient[k] * sides[k]),
            span_px: [wide, high],
            spare_px: [left, right, top, bottom],
        })
    }
}

/// Panel places to sensor places: affine, perspective, and a lens's distortion by the third order.
/// Places are from the middles, over `unit`, half of the sensor's diagonal.
struct Perspective {
    /// Shift (2), the matrix by rows (4), perspective (2), distortion.
    parameters: [f64; 9],
    panel: Size,
    sensor: Size,
    unit: f64,
}

impl Perspective {
    /// Least squares by Gauss and Newton, from the affine map on.
    fn fit(pairs: &[SeenDot], panel: Size, sensor: Size) -> Option<Perspective> {
        let unit = 0.5 * (sensor.width as f64).hypot(sensor.height as f64);
        let mut map = Perspective { parameters: [0.0; 9], panel, sensor, unit };
        map.parameters[2] = 1.0;
        map.parameters[5] = 1.0;
        let free = if pairs.len() < FOR_DISTORTION { 8 } else { 9 };
        for step in 0..STEPS {
            // The affine part alone first.
            let free = if step == 0 { 6 } else { free };
            let mut slopes = DMatrix::zeros(2 * pairs.len(), free);
            let mut off = DVector::zeros(2 * pairs.len());
            for (n, &(shown, seen)) in pairs.iter().enumerate() {
                let (shown, seen) =
                    (map.about_middle(shown, panel), map.about_middle(seen, sensor));
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
        let off = |&(shown, seen): &SeenDot| {
            let (there, seen) =
                (map.at(map.about_middle(shown, panel)), map.about_middle(seen, sensor));
            (there[0] - seen[0]).hypot(there[1] - seen[1]) * unit
        };
        pairs.iter().all(|pair| off(pair) < OFF_MAX_PX).then_some(map)
    }

    fn about_middle(&self, place: [f64; 2], size: Size) -> [f64; 2] {
        let middle = [size.width, size.height].map(|pixels| 0.5 * (pixels as f64 - 1.0));
        [0, 1].map(|k| (place[k] - middle[k]) / self.unit)
    }

    /// Where the panel's place `[x, y]` is seen.
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [sx, sy, a, b, c, d, px, py, distortion] = self.parameters;
        let w = 1.0 + px * x + py * y;
        let ideal = [(a * x + b * y) / w + sx, (c * x + d * y) / w + sy];
        let further = 1.0 + distortion * (ideal[0] * ideal[0] + ideal[1] * ideal[1]);
        ideal.map(|v| v * further)
    }

    /// The panel pixels that the sensor's corners see.
    fn corners(&self) -> Option<[[f64; 2]; 4]> {
        let (width, height) = (self.sensor.width as f64, self.sensor.height as f64);
        let (right, bottom) = (width - 0.5, height - 0.5);
        let mut all = [[-0.5, -0.5], [right, -0.5], [-0.5, bottom], [right, bottom]];
        for corner in &mut all {
            *corner = self.seen_at(*corner)?;
        }
        Some(all)
    }

    /// The panel pixel that the sensor's place sees, by Newton's method.
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
