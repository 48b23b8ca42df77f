//! Map between panel and sensor: pose of the panel, perspective and distortion.
//!
//! Places are pixel coordinates; (0, 0) is the centre of the first pixel.

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
    radial: Radial,
    pitch_mm: f64,
    /// Sensor pixels per panel pixel at the centre.
    pub(super) scale: f64,
    distance_px: f64,
}

impl PanelMap {
    /// The map for `pose`, given the lens's radial table and the sensor pitch in mm. `distance_px`
    /// is the object distance in units of a sensor pixel's footprint.
    pub(super) fn new(
        pose: &Pose,
        panel: Size,
        sensor: Size,
        distance_px: f64,
        (radial, pitch_mm): (Radial, f64),
    ) -> PanelMap {
        let centre =
            |size: Size| [(size.width as f64 - 1.0) / 2.0, (size.height as f64 - 1.0) / 2.0];
        // Columns: steps of one panel pixel right and down in space, in sensor pixels.
        let turn = Rotation3::from_euler_angles(
            pose.tilt_x_deg.to_radians(),
            pose.tilt_y_deg.to_radians(),
            pose.rotation_deg.to_radians(),
        );
        let scale = pose.sensor_px_per_panel_px;
        let right = turn * Vector3::new(scale, 0.0, 0.0);
        let down = turn * Vector3::new(0.0, scale, 0.0);
        // Perspective: division by the depth, 1 + z/distance.
        let seen = |step: Vector3<f64>| Vector3::new(step.x, step.y, step.z / distance_px);
        let shift = Vector3::new(pose.shift_x_px, pose.shift_y_px, 1.0);
        let to_sensor = Matrix3::from_columns(&[seen(right), seen(down), shift]);
        // Invertible, since each rotation is at most 5°.
        let to_panel = to_sensor.try_inverse().unwrap_or_else(Matrix3::identity);
        let (panel_centre, axis) = (centre(panel), centre(sensor));
        PanelMap { panel_centre, axis, to_panel, to_sensor, radial, pitch_mm, scale, distance_px }
    }

    /// Angle in degrees between the panel's normal and the line of sight to panel place `at`.
    pub(super) fn angle_deg(&self, at: [f64; 2]) -> f64 {
        let in_space = |v: Vector3<f64>| Vector3::new(v.x, v.y, v.z * self.distance_px);
        let column = |n: usize| in_space(self.to_sensor.column(n).into_owned());
        let normal = column(0).cross(&column(1));
        let [x, y] = [at[0] - self.panel_centre[0], at[1] - self.panel_centre[1]];
        // The third row is 1 + z/distance, measured from the lens.
        let seen = in_space(self.to_sensor * Vector3::new(x, y, 1.0));
        (normal.dot(&seen) / normal.norm() / seen.norm()).abs().min(1.0).acos().to_degrees()
    }

    /// Panel place seen at sensor place `at`.
    pub(super) fn to_panel(&self, at: [f64; 2]) -> [f64; 2] {
        let mut seen = [at[0] - self.axis[0], at[1] - self.axis[1]];
        let radius = seen[0].hypot(seen[1]);
        if radius > 0.0 {
            let object_mm = self.radial.object_mm(radius * self.pitch_mm);
            let ideal = object_mm * self.radial.magnification() / self.pitch_mm;
            seen = seen.map(|v| v * ideal / radius);
        }
        let [x, y] = project(&self.to_panel, seen);
        [x + self.panel_centre[0], y + self.panel_centre[1]]
    }

    /// Sensor place that sees panel place `at`.
    pub(super) fn to_sensor(&self, at: [f64; 2]) -> [f64; 2] {
        let mut seen =
            project(&self.to_sensor, [at[0] - self.panel_centre[0], at[1] - self.panel_centre[1]]);
        let ideal = seen[0].hypot(seen[1]);
        if ideal > 0.0 {
            let object_mm = ideal * self.pitch_mm / self.radial.magnification();
            let radius = self.radial.sensor_mm(object_mm) / self.pitch_mm;
            seen = seen.map(|v| v * radius / ideal);
        }
        [seen[0] + self.axis[0], seen[1] + self.axis[1]]
    }
}

fn project(matrix: &Matrix3<f64>, [x, y]: [f64; 2]) -> [f64; 2] {
    let v = matrix * Vector3::new(x, y, 1.0);
    [v.x / v.z, v.y / v.z]
}
