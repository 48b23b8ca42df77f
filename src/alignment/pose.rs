//! Position of the panel on the sensor from the dots found: shift, rotation, size, keystone, and
//! the panel's reach beyond the sensor.

use crate::frame::Size;
use crate::rig::coarse_geometry::{CoarseGeometry, Place};

/// Position of a dot on the panel and on the sensor, pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenDot {
    pub(super) panel: Place,
    pub(super) sensor: Place,
}

/// Least number of dots to fit the lens's distortion; fewer do not separate it from keystone.
const FOR_DISTORTION: usize = 12;
/// Largest distortion searched for and precision of the search, as shares at the sensor's corners.
const DISTORTION_MAX: f64 = 0.3;
const DISTORTION_STEP: f64 = 1e-5;
/// Largest accepted misfit of a dot, sensor pixels.
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
    /// Panel pixels beyond the sensor's view, at the panel's left, right, top and bottom; negative
    /// where the sensor sees past the panel.
    pub reserve_px: [f64; 4],
}

impl Aim {
    /// Whether every sensor pixel sees the panel.
    pub fn covers(&self) -> bool {
        self.reserve_px.iter().all(|&reserve| reserve >= 0.0)
    }

    /// Fits the position of a `panel` on a `sensor` to `pairs`; `None` if the fit fails.
    pub(super) fn of(pairs: &[SeenDot], mirrored: bool, panel: Size, sensor: Size) -> Option<Aim> {
        let map = Perspective::fit(pairs, sensor)?;
        let middle = middle(panel);
        let flip = if mirrored { -1.0 } else { 1.0 };
        let [[a, c], [b, d]] = map.steps(middle);
        // Areas under a perspective map are proportional to the cube of its scale.
        let areas = |at: Place| {
            let [[a, c], [b, d]] = map.steps(at);
            a * d - b * c
        };
        let scale = |at: Place| (areas(map.geometry.panel_at(at)) / areas(middle)).cbrt();
        let [x, y] = [sensor.width, sensor.height].map(|pixels| 0.5 * pixels as f64);
        let corners = [[-x, -y], [x, -y], [-x, y], [x, y]].map(|corner| map.panel_at(corner));
        let reach = |axis: usize, pixels: usize| {
            let along = corners.map(|corner| corner[axis]);
            let least = along.into_iter().fold(f64::INFINITY, f64::min);
            let most = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
            (least + 0.5, pixels as f64 - 0.5 - most, most - least)
        };
        let (left, right, wide) = reach(0, panel.width);
        let (top, bottom, high) = reach(1, panel.height);
        Some(Aim {
            offset_px: map.geometry.sensor_at(middle),
            rotation_deg: (c - flip * b).atan2(flip * a + d).to_degrees(),
            magnification: areas(middle).abs().sqrt(),
            mirrored,
            keystone: [scale([x, 0.0]) - scale([-x, 0.0]), scale([0.0, y]) - scale([0.0, -y])],
            span_px: [wide, high],
            reserve_px: [left, right, top, bottom],
        })
        .filter(|_| corners.as_flattened().iter().all(|side| side.is_finite()))
    }
}

fn middle(size: Size) -> Place {
    [size.width, size.height].map(|pixels| 0.5 * (pixels as f64 - 1.0))
}

/// Perspective map from the panel to undistorted places on the sensor, relative to its middle.
struct Perspective {
    geometry: CoarseGeometry,
    /// Distortion by the division model (Fitzgibbon 2001), per squared sensor pixel.
    distortion: f64,
    /// Misfits of the dots, sensor pixels.
    off: Vec<f64>,
}

impl Perspective {
    /// Fits the map by least squares, and the distortion by ternary search.
    fn fit(pairs: &[SeenDot], sensor: Size) -> Option<Perspective> {
        let middle = middle(sensor);
        let radius_px = middle[0].hypot(middle[1]);
        let with = |share: f64| {
            let distortion = share / (radius_px * radius_px);
            let place = |dot: &SeenDot| [0, 1].map(|k| dot.sensor[k] - middle[k]);
            let pairs = pairs.iter().map(|dot| (dot.panel, straight(place(dot), distortion)));
            let pairs: Vec<(Place, Place)> = pairs.collect();
            let geometry = CoarseGeometry::least_squares(&pairs)?;
            let off = pairs.iter().map(|&(panel, sensor)| {
                let [x, y] = geometry.sensor_at(panel);
                (x - sensor[0]).hypot(y - sensor[1])
            });
            let off = off.collect();
            Some(Perspective { geometry, distortion, off })
        };
        let squares = |share: f64| {
            with(share).map_or(f64::INFINITY, |map| map.off.iter().map(|off| off * off).sum())
        };
        let (mut low, mut high) = (-DISTORTION_MAX, DISTORTION_MAX);
        if pairs.len() < FOR_DISTORTION {
            (low, high) = (0.0, 0.0);
        }
        while high - low > DISTORTION_STEP {
            let third = (high - low) / 3.0;
            if squares(low + third) < squares(high - third) { high -= third } else { low += third }
        }
        with(0.5 * (low + high)).filter(|map| map.off.iter().all(|&off| off < OFF_MAX_PX))
    }

    /// Panel place seen at sensor `place`, which is relative to the sensor's middle.
    fn panel_at(&self, place: Place) -> Place {
        self.geometry.panel_at(straight(place, self.distortion))
    }

    /// Steps on the sensor for one panel pixel right and one down, at panel place (`x`, `y`).
    fn steps(&self, [x, y]: Place) -> [Place; 2] {
        let apart = |from: Place, to: Place| {
            let (from, to) = (self.geometry.sensor_at(from), self.geometry.sensor_at(to));
            [0, 1].map(|k| to[k] - from[k])
        };
        [apart([x - 0.5, y], [x + 0.5, y]), apart([x, y - 0.5], [x, y + 0.5])]
    }
}

/// Removes `distortion` from a place on the sensor, given relative to the sensor's middle.
fn straight([x, y]: Place, distortion: f64) -> Place {
    let by = 1.0 / (1.0 + distortion * (x * x + y * y));
    [by * x, by * y]
}
