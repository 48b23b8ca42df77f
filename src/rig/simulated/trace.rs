//! Sequential ray tracing through spherical surfaces, in millimetres, with light towards +z.

use super::glass;
use crate::config::{Glass, Prescription};

/// A point and a direction (unit vector).
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    pub(super) at: [f64; 3],
    pub(super) along: [f64; 3],
}

impl Ray {
    /// Ray from `from` towards `to`.
    pub(super) fn between(from: [f64; 3], to: [f64; 3]) -> Ray {
        let d = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let length = dot(d, d).sqrt();
        Ray { at: from, along: d.map(|v| v / length) }
    }

    /// Intersection with the plane z = `z`.
    pub(super) fn on_plane(&self, z: f64) -> [f64; 2] {
        let t = (z - self.at[2]) / self.along[2];
        [self.at[0] + t * self.along[0], self.at[1] + t * self.along[1]]
    }
}

/// A surface ready for tracing.
#[derive(Debug, Clone)]
pub(super) struct RefractingSurface {
    pub(super) vertex_z: f64,
    /// Curvature in 1/mm, 0 for a flat surface.
    curvature: f64,
    clear_radius: f64,
    glass: Glass,
}

/// A lens ready for tracing. z = 0 is the first refracting vertex.
#[derive(Debug, Clone)]
pub(super) struct TracedLens {
    pub(super) surfaces: Vec<RefractingSurface>,
    pub(super) stop_z: f64,
    pub(super) stop_radius: f64,
    pub(super) object_z: f64,
}

/// A ray behind the last surface, and whether it passed all clear diameters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Traced {
    pub(super) ray: Ray,
    pub(super) passed: bool,
}

impl TracedLens {
    /// Places the surfaces along the axis.
    pub(super) fn new(prescription: &Prescription) -> TracedLens {
        let mut z = 0.0;
        let mut surfaces = Vec::new();
        for written in &prescription.surfaces {
            surfaces.push(RefractingSurface {
                vertex_z: z,
                curvature: 1.0 / written.radius_mm,
                clear_radius: written.clear_diameter_mm / 2.0,
                glass: written.glass,
            });
            z += written.thickness_mm;
        }
        let first = surfaces.iter().position(|s| s.glass != Glass::Air).unwrap_or(0);
        let origin = surfaces[first].vertex_z;
        for surface in &mut surfaces {
            surface.vertex_z -= origin;
        }
        TracedLens {
            stop_z: surfaces[prescription.stop_at_surface].vertex_z,
            stop_radius: prescription.stop_diameter_mm / 2.0,
            object_z: -prescription.object_distance_mm,
            surfaces,
        }
    }

    /// Refractive indices behind each surface at one wavelength.
    pub(super) fn indices(&self, wavelength_nm: f64) -> Vec<f64> {
        self.surfaces.iter().map(|surface| glass::index(surface.glass, wavelength_nm)).collect()
    }

    /// Traces `ray`; `None` if it misses a surface or is totally reflected.
    pub(super) fn trace(&self, mut ray: Ray, indices: &[f64]) -> Option<Traced> {
        let (mut n, mut passed) = (1.0, true);
        for (surface, &next) in self.surfaces.iter().zip(indices) {
            // Intersection with the sphere, in a form that is stable for weak curvatures.
            let t0 = (surface.vertex_z - ray.at[2]) / ray.along[2];
            let p = [ray.at[0] + t0 * ray.along[0], ray.at[1] + t0 * ray.along[1], 0.0];
            let c = surface.curvature;
            let f = c * (p[0] * p[0] + p[1] * p[1]);
            let g = ray.along[2] - c * (p[0] * ray.along[0] + p[1] * ray.along[1]);
            let root = g * g - c * f;
            if root < 0.0 {
                return None;
            }
            let t = f / (g + root.sqrt());
            let q = [p[0] + t * ray.along[0], p[1] + t * ray.along[1], t * ray.along[2]];
            passed &= q[0] * q[0] + q[1] * q[1] <= surface.clear_radius * surface.clear_radius;
            // Refraction; the normal points along the light.
            let normal = [-c * q[0], -c * q[1], 1.0 - c * q[2]];
            let cosine = dot(ray.along, normal);
            let ratio = n / next;
            let transmitted = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
            if transmitted < 0.0 {
                return None;
            }
            let bend = transmitted.sqrt() - ratio * cosine;
            let mut along = [0.0; 3];
            for i in 0..3 {
                along[i] = ratio * ray.along[i] + bend * normal[i];
            }
            ray = Ray { at: [q[0], q[1], q[2] + surface.vertex_z], along };
            n = next;
        }
        Some(Traced { ray, passed })
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
