//! Where panel pixels come to lie on the sensor: the panel's pose, perspective, and the lens's
//! distortion.
//!
//! Places are pixel coordinates with (0, 0) in the centre of the first pixel.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::point_spread::Radial;
use crate::config::Pose;
use crate::frame::Size;

/// The map between panel and sensor in the green channel's geometry.
#[derive(Debug, Clone)]
pub(super) struct PanelMap {
    pub(super) panel_centre: [f64; 2],
    pub(super) axis: [f64; 2],
    to_panel: Matrix3<f64>,
    to_sensor: Matrix3<f64>,
    distortion: Option<(Radial, f64)>,
    /// Sensor pixels that one panel pixel covers at the centre.
    pub(super) scale: f64,
    distance_px: f64,
}

impl PanelMap {
    /// The map of `pose`. `distortion` is the lens's radial table and the sensor pitch in mm;
    /// `distance_px` is the object distance in sensor pixels' worth of object (infinite: no
    /// perspective).
    pub(super) fn new(
        pose: &Pose,
        panel: Size,
        sensor: Size,
        distance_px: f64,
        distortion: Option<(Radial, f64)>,
    ) -> PanelMap {
        let centre =
            |size: Size| [(size.width as f64 - 1.0) / 2.0, (size.height as f64 - 1.0) / 2.0];
        // Columns: where one panel pixel to the right, and one down, leads in space; units of
        // sensor pixels.
        let turn = Rotation3::from_euler_angles(
            pose.tilt_x_deg.to_radians(),
            pose.tilt_y_deg.to_radians(),
            pose.rotation_deg.to_radians(),
        );
        let scale = pose.sensor_px_per_panel_px;
        let right = turn * Vector3::new(scale, 0.0, 0.0);
        let down = turn * Vector3::new(0.0, scale, 0.0);
        // Seen from the lens: divide by the depth, 1 + z/distance.
        let to_sensor = Matrix3::new(
            right.x,
            down.x,
            pose.shift_x_px,
            right.y,
            down.y,
            pose.shift_y_px,
            right.z / distance_px,
            down.z / distance_px,
            1.0,
        );
        // Turned by at most 5° about each axis, so it always has an inverse.
        let to_panel = to_sensor.try_inverse().unwrap_or_else(Matrix3::identity);
        let (panel_centre, axis) = (centre(panel), centre(sensor));
        PanelMap { panel_centre, axis, to_panel, to_sensor, distortion, scale, distance_px }
    }

    /// How far from its normal, in degrees, the lens sees the panel at panel place `at`; 0 of a
    /// panel that is infinitely far away.
    pub(super) fn angle_deg(&self, at: [f64; 2]) -> f64 {
        if self.distance_px.is_infinite() {
            return 0.0;
        }
        let in_space = |v: Vector3<f64>| Vector3::new(v.x, v.y, v.z * self.distance_px);
        let column = |n: usize| in_space(self.to_sensor.column(n).into_owned());
        let normal = column(0).cross(&column(1));
        let [x, y] = [at[0] - self.panel_centre[0], at[1] - self.panel_centre[1]];
        // The third row is 1 + z/distance: from the lens, not from the panel's middle.
        let seen = in_space(self.to_sensor * Vector3::new(x, y, 1.0));
        (normal.dot(&seen) / normal.norm() / seen.norm()).abs().min(1.0).acos().to_degrees()
    }

    /// The panel place seen at sensor place `at`.
    pub(super) fn to_panel(&self, at: [f64; 2]) -> [f64; 2] {
        let mut seen = [at[0] - self.axis[0], at[1] - self.axis[1]];
        if let Some((radial, pitch)) = &self.distortion {
            let radius = seen[0].hypot(seen[1]);
            if radius > 0.0 {
                let ideal = radial.object_mm(radius * pitch) * radial.magnification() / pitch;
                seen = seen.map(|v| v * ideal / radius);
            }
        }
        let [x, y] = project(&self.to_panel, seen);
        [x + self.panel_centre[0], y + self.panel_centre[1]]
    }

    /// Where on the sensor panel place `at` is seen.
    pub(super) fn to_sensor(&self, at: [f64; 2]) -> [f64; 2] {
        let mut seen =
            project(&self.to_sensor, [at[0] - self.panel_centre[0], at[1] - self.panel_centre[1]]);
        if let Some((radial, pitch)) = &self.distortion {
            let ideal = seen[0].hypot(seen[1]);
            if ideal > 0.0 {
                let radius = radial.sensor_mm(ideal * pitch / radial.magnification()) / pitch;
                seen = seen.map(|v| v * radius / ideal);
            }
        }
        [seen[0] + self.axis[0], seen[1] + self.axis[1]]
    }
}

fn project(matrix: &Matrix3<f64>, [x, y]: [f64; 2]) -> [f64; 2] {
    let v = matrix * Vector3::new(x, y, 1.0);
    [v.x / v.z, v.y / v.z]
}
