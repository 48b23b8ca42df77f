//! Point spread functions over the field, from a fan of traced field heights.
//!
//! The lens is rotationally symmetric, so object points are traced along one radius and their spots
//! are rotated. A function is a histogram of rays over sensor pixels for a point in a pixel's
//! centre.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;
use rustfft::num_complex::Complex;

use super::prescription::Focused;
use crate::config::{LensGeometry, Prescription, Primaries};
use crate::frame::Channel;

/// Rays per function over all wavelengths: about 30 per pixel in a spot 30 pixels wide.
const RAYS: usize = 20_000;
/// Number of traced field heights; spots in between are interpolated.
const HEIGHTS: usize = 33;

/// Spot of a point at one object height, in one channel.
#[derive(Debug, Clone)]
struct Spot {
    /// Places of the rays relative to the centroid, across and outwards, in mm, and their light.
    rays: Vec<[f32; 3]>,
    /// Distance of the centroid from the axis, in mm.
    centroid_mm: f64,
    /// Total light, relative to an unclipped spot on the axis.
    total: f64,
}

/// Sensor height as a function of object height: the green channel's geometry in a scene's light.
#[derive(Debug, Clone)]
pub(super) struct Radial {
    object_step_mm: f64,
    sensor_mm: Vec<f64>,
}

impl Radial {
    /// Traces the heights of the green centroid; they are proportional for centred functions.
    pub(super) fn new(
        lens: &Focused,
        prescription: &Prescription,
        scene: &Primaries,
        reach_mm: f64,
    ) -> Radial {
        let green = scene.lists()[Channel::Green.index()];
        let magnification = lens.magnification(green);
        // Beyond the corner, so that every point is inside the table.
        let object_step_mm = 1.1 * reach_mm / magnification / (HEIGHTS - 1) as f64;
        let heights = (0..HEIGHTS).into_par_iter().map(|n| {
            let object = n as f64 * object_step_mm;
            match prescription.geometry {
                LensGeometry::Centred => object * magnification,
                LensGeometry::Traced => spot(lens, object, green).centroid_mm,
            }
        });
        Radial { object_step_mm, sensor_mm: heights.collect() }
    }

    /// Sensor height of an object height, both in mm; extrapolated beyond the table.
    pub(super) fn sensor_mm(&self, object_mm: f64) -> f64 {
        let place = object_mm / self.object_step_mm;
        let n = (place.max(0.0) as usize).min(HEIGHTS - 2);
        self.sensor_mm[n] + (place - n as f64) * (self.sensor_mm[n + 1] - self.sensor_mm[n])
    }

    /// Object height of a sensor height, both in mm.
    pub(super) fn object_mm(&self, sensor_mm: f64) -> f64 {
        let n = self.sensor_mm.partition_point(|&s| s <= sensor_mm).clamp(1, HEIGHTS - 1) - 1;
        let (low, high) = (self.sensor_mm[n], self.sensor_mm[n + 1]);
        (n as f64 + (sensor_mm - low) / (high - low)) * self.object_step_mm
    }

    /// Magnification on the axis.
    pub(super) fn magnification(&self) -> f64 {
        self.sensor_mm[1] / self.object_step_mm
    }
}

/// Spots of the three channels over the field.
#[derive(Debug, Clone)]
pub(super) struct Fan {
    radial: Radial,
    spots: [Vec<Spot>; 3],
    pitch_mm: f64,
    centred: bool,
    dark_corner: bool,
}

impl Fan {
    /// Traces the fan in the light of `primaries`.
    pub(super) fn new(
        lens: &Focused,
        prescription: &Prescription,
        radial: &Radial,
        primaries: &Primaries,
    ) -> Fan {
        let spots = primaries.lists().map(|list| {
            let heights = (0..HEIGHTS).into_par_iter();
            heights.map(|n| spot(lens, n as f64 * radial.object_step_mm, list)).collect()
        });
        Fan {
            radial: radial.clone(),
            spots,
            pitch_mm: prescription.pixel_pitch_um / 1000.0,
            centred: prescription.geometry == LensGeometry::Centred,
            dark_corner: prescription.dark_corner,
        }
    }

    /// Index of the traced height below `radius_px` on the sensor, and position between that height
    /// and the next, 0..1.
    fn around(&self, radius_px: f64) -> (usize, f64) {
        let place = self.radial.object_mm(radius_px * self.pitch_mm) / self.radial.object_step_mm;
        let n = (place as usize).min(HEIGHTS - 2);
        (n, place - n as f64)
    }

    /// Lateral colour: radial offset of the centroid of `channel` from the green geometry at
    /// `radius_px`, in pixels.
    pub(super) fn offset_px(&self, channel: Channel, radius_px: f64) -> f64 {
        if self.centred {
            return 0.0;
        }
        let (n, t) = self.around(radius_px);
        let spots = &self.spots[channel.index()];
        let off = |n: usize| spots[n].centroid_mm - self.radial.sensor_mm[n];
        (off(n) + t * (off(n + 1) - off(n))) / self.pitch_mm
    }

    /// Illumination at `radius_px` relative to the axis: cos⁴, clipped rays, and the object area
    /// seen by a pixel.
    pub(super) fn relative_light(&self, channel: Channel, radius_px: f64) -> f64 {
        if !self.dark_corner {
            return 1.0;
        }
        let (n, t) = self.around(radius_px);
        let spots = &self.spots[channel.index()];
        let total = |n: usize| spots[n].total / spots[0].total;
        let sensor = radius_px * self.pitch_mm;
        let object = self.radial.object_mm(sensor);
        let magnification = self.radial.magnification();
        // Object area per sensor area, relative to the axis: (H/h)·(dH/dh)·M².
        let nearby = self.radial.object_step_mm;
        let (low, high) = ((object - nearby).max(0.0), object + nearby);
        let slope = (high - low) / (self.radial.sensor_mm(high) - self.radial.sensor_mm(low));
        let stretch = if sensor > 0.0 { object / sensor } else { 1.0 / magnification };
        (total(n) + t * (total(n + 1) - total(n))) * stretch * slope * magnification * magnification
    }

    /// Rays of `channel` from a point seen at (`x_px`, `y_px`) from the axis: where each arrives,
    /// in pixels to the right and down of that point in the green geometry, and its light.
    fn rays(
        &self,
        channel: Channel,
        [x_px, y_px]: [f64; 2],
    ) -> impl Iterator<Item = ([f32; 2], f32)> {
        let radius = x_px.hypot(y_px);
        let (n, t) = self.around(radius);
        let (a, b) = (&self.spots[channel.index()][n], &self.spots[channel.index()][n + 1]);
        let centroid = a.centroid_mm + t * (b.centroid_mm - a.centroid_mm);
        let origin = if self.centred {
            centroid
        } else {
            self.radial.sensor_mm[n] + t * (self.radial.sensor_mm[n + 1] - self.radial.sensor_mm[n])
        };
        let (cosine, sine) = if radius > 0.0 { (x_px / radius, y_px / radius) } else { (1.0, 0.0) };
        let (cosine, sine) = ((cosine / self.pitch_mm) as f32, (sine / self.pitch_mm) as f32);
        let (t, shift) = (t as f32, (a.centroid_mm - origin) as f32);
        let drift = (b.centroid_mm - a.centroid_mm) as f32;
        a.rays.iter().zip(&b.rays).map(move |(a, b)| {
            // Interpolation between two traced heights.
            let [across, out, light] = [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]));
            let out = out + shift + t * drift;
            ([out * cosine - across * sine, out * sine + across * cosine], light)
        })
    }

    /// Optical transfer function at `at`, pixels from the axis, for `frequency` lines per pixel.
    pub(super) fn transfer(
        &self,
        channel: Channel,
        at: [f64; 2],
        frequency: [f64; 2],
    ) -> Complex<f64> {
        let (mut sum, mut all) = (Complex::default(), 0.0);
        for ([right, down], light) in self.rays(channel, at) {
            let lines = f64::from(right) * frequency[0] + f64::from(down) * frequency[1];
            sum += Complex::cis(-TAU * lines) * f64::from(light);
            all += f64::from(light);
        }
        sum / all
    }

    /// Function of `channel` for a point seen at `at`, pixels from the axis: `support_px`² values
    /// with sum 1, placed on the green geometry, and the share of light outside.
    pub(super) fn function(
        &self,
        channel: Channel,
        at: [f64; 2],
        support_px: usize,
    ) -> (Vec<f32>, f64) {
        let mut function = vec![0.0f32; support_px * support_px];
        let (half, mut lost) = (support_px as f32 / 2.0, 0.0f64);
        for ([right, down], light) in self.rays(channel, at) {
            let (column, row) = ((right + half).floor(), (down + half).floor());
            let inside = column >= 0.0 && row >= 0.0 && column < 2.0 * half && row < 2.0 * half;
            if inside {
                function[row as usize * support_px + column as usize] += light;
            } else {
                lost += f64::from(light);
            }
        }
        let kept: f64 = function.iter().map(|&v| f64::from(v)).sum();
        let scale = (1.0 / kept) as f32;
        function.iter_mut().for_each(|v| *v *= scale);
        (function, lost / (kept + lost))
    }
}

/// Traces the spot of an object height in all `wavelengths`, with rays on a sunflower spiral over
/// the stop.
fn spot(lens: &Focused, object_mm: f64, wavelengths: &[crate::config::Wavelength]) -> Spot {
    let count = RAYS / wavelengths.len();
    let golden = PI * (3.0 - 5f64.sqrt());
    let weights: f64 = wavelengths.iter().map(|w| w.1).sum();
    let (mut centroid_mm, mut total) = (0.0, 0.0);
    let mut arrivals = Vec::with_capacity(count * wavelengths.len());
    for wavelength in wavelengths {
        let indices = lens.lens.indices(wavelength.0);
        for n in 0..count {
            let (radius, angle) = (((n as f64 + 0.5) / count as f64).sqrt(), n as f64 * golden);
            let arrival =
                lens.arrival(object_mm, [radius * angle.cos(), radius * angle.sin()], &indices);
            // A ray that misses the glass carries no light.
            let (across, out, light) =
                arrival.map_or((0.0, 0.0, 0.0), |a| (a.across_mm, a.out_mm, a.light));
            let light = light * wavelength.1 / weights / count as f64;
            centroid_mm += light * out;
            total += light;
            arrivals.push([across, out, light]);
        }
    }
    centroid_mm /= total;
    let about =
        |[across, out, light]: [f64; 3]| [across, out - centroid_mm, light].map(|v| v as f32);
    Spot { rays: arrivals.into_iter().map(about).collect(), centroid_mm, total }
}
