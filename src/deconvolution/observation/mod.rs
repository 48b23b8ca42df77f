//! An observation: a photo's data on the solver's canvas, with weights and noise.
//!
//! What a photo's data *are* depends on the file: [`Developed`] light, [`Raw`] sites behind colour
//! filters, or the quantised coefficients of a [`Jpeg`]. Solver, judge, laboratory and charts see
//! the differences only through the trait [`Sampling`], which each kind implements in its own file.
//! A new kind of data needs one more file here, and a line in [`Pipeline::prepare`].
//!
//! [`Pipeline::prepare`]: crate::pipeline::Pipeline::prepare

mod binned;
mod developed;
mod jpeg;
mod raw;
mod sampling;

use std::sync::Arc;

pub use developed::Developed;
pub use jpeg::Jpeg;
pub use raw::Raw;
pub use sampling::{AxisStarts, DataKind, Sampling};

use super::data_term::{MISSING, residual_in_place, rms_over_data};
use super::detail_mask::{DetailMask, NoisyPlane, is_flat};
use super::lens_model::Density;
use crate::frame::{Channel, Channels, Frame, Mosaic, Plane, Rect, Size, Work};

/// A photo's data on the canvas.
#[derive(Clone)]
pub struct Observation {
    /// B, linear light 0..255. Extrapolated outside the photo and between a mosaic's sites.
    pub light: Frame<Work>,
    /// Weight class of each pixel of `light`, see [`data_term`](super::data_term).
    pub trust: Frame<Work, u8>,
    /// The photo's rectangle on the canvas.
    pub rect: Rect,
    /// The observed channels.
    pub channels: Channels,
    /// Noise σ of a pixel at the photo's mean light, per channel, grey levels; for a coded photo it
    /// includes coding errors.
    pub noise: [f32; 3],
    /// Light whose shot noise equals the noise without light, per channel, grey levels; infinite
    /// where σ does not follow the light.
    pub dark_light: [f32; 3],
    /// The kind of data.
    pub sampling: Arc<dyn Sampling>,
}

impl Observation {
    /// The canvas.
    pub fn size(&self) -> Size {
        self.light.size()
    }

    /// The same observation with other data, `light` on the canvas, of noise σ `noise`, grey
    /// levels.
    pub fn with_data(&self, light: Frame<Work>, noise: [f32; 3]) -> Observation {
        Observation {
            light,
            trust: self.trust.clone(),
            noise,
            sampling: Arc::clone(&self.sampling),
            ..*self
        }
    }

    /// Number of canvas pixels per datum of `channel`: the weight of its residual.
    pub fn weight(&self, channel: Channel) -> f32 {
        self.sampling.mosaic().map_or(1.0, |_| Mosaic::pixels_a_site(channel))
    }

    /// Number of pixels of `channel` that a camera interpolated from each datum, whose noise they
    /// share.
    pub fn pixels_a_datum(&self, channel: Channel) -> f32 {
        self.sampling.interpolated().map_or(1.0, |_| Mosaic::pixels_a_site(channel))
    }

    /// Density of the data of `channel`.
    pub fn density(&self, channel: Channel) -> Density {
        Density::of(channel, self.sampling.mosaic().is_some())
    }

    /// Noise σ of the data of `channel`, grey levels.
    pub fn data_noise(&self, channel: Channel) -> f32 {
        self.sampling.data_noise(channel, self.noise[channel.index()])
    }

    /// Noise σ of full-resolution pixels of `channel` with the same information, grey levels.
    pub fn pixel_noise(&self, channel: Channel) -> f32 {
        self.noise[channel.index()] * self.weight(channel).sqrt()
    }

    /// RMS over the observed channels of [`Observation::threshold_noise`], grey levels.
    pub fn mean_noise(&self) -> f32 {
        let channels = self.channels.list();
        let power: f32 = channels.iter().map(|&c| self.threshold_noise(c).powi(2)).sum();
        (power / channels.len() as f32).sqrt()
    }

    /// Noise σ from which the thresholds of `channel` are computed, grey levels: that of the data,
    /// converted to full resolution.
    pub fn threshold_noise(&self, channel: Channel) -> f32 {
        self.data_noise(channel) * self.weight(channel).sqrt()
    }

    /// Interpolates `plane`, which is valid at the data of `channel`, between them.
    pub fn interpolate(&self, channel: Channel, plane: Plane) -> Plane {
        match self.sampling.mosaic() {
            Some(mosaic) => mosaic.filled(channel, &plane),
            None => plane,
        }
    }

    /// Zeroes `plane` where `channel` has no data.
    pub fn mask(&self, channel: Channel, plane: &mut Plane) {
        let trust = self.trust.plane(channel);
        plane.update(trust, |v, trust| *v = if trust == MISSING { 0.0 } else { *v });
    }

    /// RMS of `prediction` − B over the data of one channel, grey levels.
    pub fn residual_rms(&self, channel: Channel, prediction: &Plane) -> f32 {
        let mut difference = prediction.clone();
        let trust = self.trust.plane(channel);
        residual_in_place(&mut difference, self.light.plane(channel), trust);
        rms_over_data(&difference, trust)
    }

    /// The observed planes with their noise.
    pub fn noisy_planes(&self) -> Vec<NoisyPlane<'_>> {
        let plane = |&c: &Channel| NoisyPlane {
            light: self.light.plane(c),
            trust: self.trust.plane(c),
            noise: self.noise[c.index()],
            dark_light: self.dark_light[c.index()],
        };
        self.channels.list().iter().map(plane).collect()
    }

    /// The detail mask for `levels` wavelet levels.
    pub fn detail_mask(&self, levels: usize) -> DetailMask {
        DetailMask::of(&self.noisy_planes(), levels, self.sampling.mosaic().is_some())
    }

    /// Whether the photo has no details above its noise; broad shading does not matter.
    pub fn is_blank(&self) -> bool {
        is_flat(&self.noisy_planes(), self.sampling.mosaic().is_some())
    }
}
