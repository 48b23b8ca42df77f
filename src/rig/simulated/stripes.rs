//! Striped subpixels: red, green and blue are a third of a panel pixel apart.
//!
//! The stripes add a grating of one line per panel pixel. Its fundamental is attenuated by the
//! lens's transfer function and beats with the sensor's pixels. The effect of their width on a
//! picture's sharpness is neglected.

use std::f64::consts::{PI, TAU};

use rustfft::num_complex::Complex;

use super::optics::Optics;
use super::panel::Projection;
use super::pose::PanelMap;
use crate::config::{PanelTable, Subpixels};
use crate::frame::{Channel, Plane};

/// Number of samples of the transfer function along each axis.
const PLACES: usize = 9;

/// Beat of the stripes with the sensor's pixels, as a share of the light: real and imaginary part
/// of a wave whose phase moves with the panel.
pub(super) struct Beat([[Plane; 2]; 3]);

impl Beat {
    /// Beat seen through `optics`; `None` for whole pixels.
    pub(super) fn new(
        panel: &PanelTable,
        optics: &Optics,
        map: &PanelMap,
        projection: &Projection,
    ) -> Option<Beat> {
        if panel.subpixels == Subpixels::Whole {
            return None;
        }
        // Lines per sensor pixel along columns and rows.
        let [right, down] = projection.steps;
        let frequency = [right[0], down[0]];
        let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
        let ground = 2.0 * sinc(1.0 / 3.0) * sinc(frequency[0]) * sinc(frequency[1]);
        let size = optics.sensor;
        let step = [size.width, size.height].map(|v| (v as f64 - 1.0) / (PLACES as f64 - 1.0));
        Some(Beat(Channel::ALL.map(|channel| {
            let transfer: Vec<Complex<f64>> = (0..PLACES * PLACES)
                .map(|n| {
                    let at = [(n % PLACES) as f64 * step[0], (n / PLACES) as f64 * step[1]];
                    optics.transfer(channel, at, frequency) * ground
                })
                .collect();
            let wave = |x: usize, y: usize| {
                let ([column, across], [row, along]) = (split(x, step[0]), split(y, step[1]));
                let at = |i: f64, j: f64| transfer[j as usize * PLACES + i as usize];
                let upper = at(column, row) * (1.0 - across) + at(column + 1.0, row) * across;
                let lower =
                    at(column, row + 1.0) * (1.0 - across) + at(column + 1.0, row + 1.0) * across;
                let place =
                    map.to_panel([x as f64, y as f64])[0] - panel.subpixels.offset_px(channel);
                (upper * (1.0 - along) + lower * along) * Complex::cis(TAU * place)
            };
            [
                Plane::from_fn(size, |x, y| wave(x, y).re as f32),
                Plane::from_fn(size, |x, y| wave(x, y).im as f32),
            ]
        })))
    }

    /// Applies the beat to `light` of `channel`, with the panel displaced by `offset_px`.
    pub(super) fn apply(&self, light: &mut Plane, channel: Channel, offset_px: f64) {
        let turned = Complex::cis(-TAU * offset_px);
        let (cosine, sine) = (turned.re as f32, turned.im as f32);
        let [real, imaginary] = &self.0[channel.index()];
        for ((value, re), im) in light.data_mut().iter_mut().zip(real.data()).zip(imaginary.data())
        {
            *value *= 1.0 + re * cosine - im * sine;
        }
    }
}

/// Index of the sample before pixel `n`, and position between it and the next, 0..1.
fn split(n: usize, step: f64) -> [f64; 2] {
    let place = n as f64 / step;
    let first = place.floor().min(PLACES as f64 - 2.0);
    [first, place - first]
}
