//! A focused lens, and the arrivals of rays from an object point.

use super::trace::{Ray, TracedLens};
use crate::config::{Prescription, Wavelength};
use crate::rig::RigError;

/// Cells across the pupil for focusing. With this number and [`SPOT_CELLS`], spot sizes agree with
/// the study in all digits; more cells change them by less than 0.2 %.
const FOCUS_CELLS: usize = 120;
/// Cells across the pupil for measuring a spot.
const SPOT_CELLS: usize = 200;

/// A focused lens and the distance of its object, which may be out of focus.
#[derive(Debug, Clone)]
pub(super) struct Focused {
    pub(super) lens: TracedLens,
    /// Place of the image plane on the axis, mm.
    pub(super) image_z: f64,
}

/// Arrival of a ray in an upright image, and its light.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival {
    /// Sagittal coordinate in mm.
    pub(super) across_mm: f64,
    /// Radial coordinate in mm.
    pub(super) out_mm: f64,
    /// Light relative to an unclipped ray on the axis; 0 for a clipped ray.
    pub(super) light: f64,
}

impl Focused {
    /// Focuses at the prescription's focus distance by the smallest RMS spot on the axis in
    /// `wavelengths`; the object is the panel. Fails without a real image.
    pub(super) fn new(
        prescription: &Prescription,
        wavelengths: &[Wavelength],
    ) -> Result<Focused, RigError> {
        let lens = TracedLens::new(prescription);
        let pupil = square_pupil(FOCUS_CELLS);
        let from = [0.0, 0.0, prescription.focus_distance_mm.map_or(lens.object_z, |mm| -mm)];
        // The spot's variance is a parabola in z: Σ|a + u·z|², centred by symmetry.
        let (mut au, mut uu) = (0.0, 0.0);
        for wavelength in wavelengths {
            let indices = lens.indices(wavelength.0);
            for &[px, py] in &pupil {
                let to = [px * lens.stop_radius, py * lens.stop_radius, lens.stop_z];
                let Some(traced) = lens.trace(Ray::between(from, to), &indices) else { continue };
                let [x, y] = traced.ray.on_plane(0.0);
                let along = traced.ray.along;
                let u = [along[0] / along[2], along[1] / along[2]];
                au += wavelength.1 * (x * u[0] + y * u[1]);
                uu += wavelength.1 * (u[0] * u[0] + u[1] * u[1]);
            }
        }
        let image_z = -au / uu;
        let last_z = lens.surfaces.last().map_or(0.0, |surface| surface.vertex_z);
        if !image_z.is_finite() || image_z <= last_z {
            let found = format!("a focus at z = {image_z:.1} mm");
            let allowed = "a real image behind the last surface";
            return Err(RigError::refused("simulated lens", found, allowed));
        }
        Ok(Focused { lens, image_z })
    }

    /// The lens with the same image plane and an object at `distance_mm`.
    pub(super) fn looking_at(mut self, distance_mm: f64) -> Focused {
        self.lens.object_z = -distance_mm;
        self
    }

    /// Arrival of a ray from object height `object_mm` through a pupil point of the unit disc, for
    /// the refractive `indices`. Lambert's law at the panel gives cos⁴ between object point and
    /// stop.
    pub(super) fn arrival(
        &self,
        object_mm: f64,
        pupil: [f64; 2],
        indices: &[f64],
    ) -> Option<Arrival> {
        let lens = &self.lens;
        let from = [0.0, object_mm, lens.object_z];
        let to = [pupil[0] * lens.stop_radius, pupil[1] * lens.stop_radius, lens.stop_z];
        let traced = lens.trace(Ray::between(from, to), indices)?;
        let [x, y] = traced.ray.on_plane(self.image_z);
        let depth = lens.stop_z - lens.object_z;
        let square = to[0].powi(2) + (to[1] - object_mm).powi(2) + depth.powi(2);
        let cos4 = (depth * depth / square).powi(2);
        Some(Arrival { across_mm: -x, out_mm: -y, light: if traced.passed { cos4 } else { 0.0 } })
    }

    /// Centroid height and RMS radius in mm of the spot of object height `object_mm` at one
    /// wavelength, with equal weights for all rays through the stop, as in the study.
    pub(super) fn spot(&self, object_mm: f64, wavelength_nm: f64) -> (f64, f64) {
        let indices = self.lens.indices(wavelength_nm);
        let pupil = square_pupil(SPOT_CELLS).into_iter();
        let arrivals: Vec<Arrival> =
            pupil.filter_map(|place| self.arrival(object_mm, place, &indices)).collect();
        let n = arrivals.len().max(1) as f64;
        let height = arrivals.iter().map(|a| a.out_mm).sum::<f64>() / n;
        let square: f64 =
            arrivals.iter().map(|a| a.across_mm.powi(2) + (a.out_mm - height).powi(2)).sum();
        (height, (square / n).sqrt())
    }

    /// Magnification on the axis.
    pub(super) fn magnification(&self, wavelengths: &[Wavelength]) -> f64 {
        // One thousandth of the object distance is paraxial.
        let small = -self.lens.object_z * 1e-3;
        let (mut height, mut weight) = (0.0, 0.0);
        for wavelength in wavelengths {
            height += wavelength.1 * self.spot(small, wavelength.0).0;
            weight += wavelength.1;
        }
        height / weight / small
    }
}

/// Centres of the cells of a `cells` × `cells` grid that lie within the unit disc.
fn square_pupil(cells: usize) -> Vec<[f64; 2]> {
    let place = |i: usize| (i as f64 + 0.5) / cells as f64 * 2.0 - 1.0;
    let all = (0..cells * cells).map(|n| [place(n % cells), place(n / cells)]);
    all.filter(|[x, y]| x * x + y * y <= 1.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::load;

    fn study(stop_diameter_mm: f64) -> Focused {
        let rig = load(std::path::Path::new("study.toml")).expect("built in");
        let mut prescription = rig.simulation().expect("simulated").lens.clone();
        prescription.stop_diameter_mm = stop_diameter_mm;
        Focused::new(&prescription, &[Wavelength(540.0, 1.0)]).expect("a good lens")
    }

    /// RMS spot where the green centroid is at `height_mm` on the sensor.
    fn spot_at(lens: &Focused, height_mm: f64, wavelength_nm: f64) -> f64 {
        let mut object = height_mm / 0.0189;
        for _ in 0..20 {
            object *= if height_mm > 0.0 { height_mm / lens.spot(object, 540.0).0 } else { 0.0 };
        }
        lens.spot(object, wavelength_nm).1
    }

    #[test]
    fn focal_length_agrees_with_the_independent_ray_tracer() {
        let lens = study(18.75).lens;
        // Parallel to the axis, and so close to it that aberrations do not matter.
        let ray = Ray { at: [0.0, 1e-3, -1.0], along: [0.0, 0.0, 1.0] };
        let [_, down, on] = lens.trace(ray, &lens.indices(540.0)).expect("a passing ray").ray.along;
        let found = -1e-3 * on / down;
        assert!((found - 74.680636).abs() < 1e-5, "{found}");
    }

    #[test]
    fn spots_agree_with_the_independent_ray_tracer_within_a_thousandth() {
        // numbers.md, "Lens": (stop diameter, height of the green centroid, [green, red, blue]) in
        // mm.
        let table = [
            (18.75, 0.0, [0.03876, 0.05569, 0.07517]),
            (18.75, 3.0, [0.04609, 0.05206, 0.08892]),
            (18.75, 6.4, [0.08496, 0.06457, 0.13733]),
            (37.5, 0.0, [0.350919, 0.358510, 0.380280]),
            (37.5, 6.4, [0.439152, 0.417816, 0.502646]),
        ];
        for (diameter, height, expected) in table {
            let lens = study(diameter);
            for (wavelength, expected) in [540.0, 610.0, 465.0].into_iter().zip(expected) {
                let found = spot_at(&lens, height, wavelength);
                let off = found / expected - 1.0;
                assert!(
                    off.abs() < 1e-3,
                    "{diameter} {height} {wavelength}: {found}, off by {off:.2e}"
                );
            }
        }
    }
}
