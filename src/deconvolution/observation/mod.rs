//! An observation: a photo's data on the solver's canvas, with weights and noise.
//!
//! What a photo's data *are* differs by the file: [`Developed`] light, [`Raw`] sites behind colour
//! filters, or the quantised coefficients of a [`Jpeg`]. Solver, judge, laboratory and charts ask
//! an observation the same questions, listed in [`Sampling`]; each kind answers in its own file. A
//! new kind of data is one more file here, and a line in [`Pipeline::prepare`].
//!
//! [`Pipeline::prepare`]: crate::pipeline::Pipeline::prepare

mod developed;
mod jpeg;
mod raw;

use std::sync::Arc;

pub use developed::Developed;
pub use jpeg::Jpeg;
pub use raw::Raw;

use super::data_term::{MISSING, residual_in_place, rms_over_data};
use super::detail_mask::{DetailMask, NoisyPlane};
use super::jpeg::AlongLuma;
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
    /// Noise σ of a pixel at the photo's mean light, per channel, grey levels. Of a coded photo
    /// with its coding errors.
    pub noise: [f32; 3],
    /// Light whose shot noise equals the noise without light, per channel, grey levels; infinite
    /// where σ does not follow the light.
    pub dark_light: [f32; 3],
    /// The kind of data.
    pub sampling: Arc<dyn Sampling>,
}

/// Kinds of data, for limits that differ between them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DataKind {
    /// Full-colour light.
    Developed,
    /// Sites behind colour filters.
    Raw,
    /// Quantised coefficients.
    Jpeg,
}

/// How the sensor and the file sampled the light; the defaults are those of full-colour pixels with
/// white noise.
pub trait Sampling: std::fmt::Debug + Send + Sync {
    /// The kind of data.
    fn kind(&self) -> DataKind;

    /// The filters over the canvas, where each pixel is data of its filter's channel only.
    fn mosaic(&self) -> Option<Mosaic> {
        None
    }

    /// The filters between whose sites the camera interpolated full-colour data. Their noise is not
    /// white.
    fn interpolated(&self) -> Option<Mosaic> {
        None
    }

    /// Whether the scene's colour axes can be estimated from the data.
    fn has_colour_axes(&self) -> bool {
        true
    }

    /// Noise σ of the data of `channel`, grey levels, where that of the pixels is `pixel_noise`.
    fn data_noise(&self, _channel: Channel, pixel_noise: f32) -> f32 {
        pixel_noise
    }

    /// Whether the data depend on the prediction, all channels together.
    fn follows_prediction(&self) -> bool {
        false
    }

    /// The data to expect where the forward model predicts `prediction` (on the canvas); `None`
    /// where the data do not depend on it.
    fn expected_data(&self, _prediction: &Frame<Work>) -> Option<Frame<Work>> {
        None
    }

    /// Whether a solve updates its [expected data](Sampling::expected_data) before step `step`,
    /// counted from 1.
    fn updates_data_at(&self, _step: u32) -> bool {
        false
    }

    /// Factor on the noise-to-signal ratio of Wiener's filter at the start of a solve.
    fn start_noise_factor(&self) -> f32 {
        1.0
    }

    /// Starts along the colour axes, for a lens whose functions are `lens_width_px` wide.
    fn axis_starts(&self, _lens_width_px: f32) -> AxisStarts {
        AxisStarts { count: 2, noise_to_signal: 0.05 }
    }

    /// Steps of a solve that starts along the colour axes, of the `steps` it takes otherwise.
    fn steps_along_axes(&self, steps: u32) -> u32 {
        (3 * steps).div_ceil(4)
    }

    /// Steps of a correction, of the `steps` that the method asks for.
    fn correction_steps(&self, steps: u32) -> u32 {
        steps
    }

    /// Factors on the thresholds of the two finest wavelet levels, for each opponent colour.
    fn finest_thresholds(&self) -> [[f32; 2]; 3] {
        [[1.0; 2]; 3]
    }

    /// A prior along the code's luma for planes of `size`, with the `thresholds` of each level,
    /// grey levels, finest first; `None` where the data have no such direction.
    fn luma_prior(&self, _size: Size, _thresholds: &[f32]) -> Option<AlongLuma> {
        None
    }

    /// Finishes a solved `picture`; `photo` is the observed light, both on the canvas.
    fn finish(&self, _picture: &mut Frame<Work>, _photo: &Frame<Work>) {}
}

/// Starts of a solve along the colour axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisStarts {
    /// Their number.
    pub count: usize,
    /// Noise-to-signal power at one grey level of noise.
    pub noise_to_signal: f32,
}

impl Observation {
    /// The canvas.
    pub fn size(&self) -> Size {
        self.light.size()
    }

    /// The same observation with other data `light` on the canvas, of noise σ `noise`, grey levels.
    pub fn with_data(&self, light: Frame<Work>, noise: [f32; 3]) -> Observation {
        Observation {
            light,
            trust: self.trust.clone(),
            noise,
            sampling: Arc::clone(&self.sampling),
            ..*self
        }
    }

    /// Pixels of the canvas for each datum of `channel`: the weight of its residual.
    pub fn weight(&self, channel: Channel) -> f32 {
        self.sampling.mosaic().map_or(1.0, |_| Mosaic::pixels_a_site(channel))
    }

    /// Noise σ of the data of `channel`, grey levels.
    pub fn data_noise(&self, channel: Channel) -> f32 {
        self.sampling.data_noise(channel, self.noise[channel.index()])
    }

    /// Noise σ of full-resolution pixels of `channel` with the same information, grey levels.
    pub fn pixel_noise(&self, channel: Channel) -> f32 {
        self.noise[channel.index()] * self.weight(channel).sqrt()
    }

    /// RMS over the observed channels of the σ that thresholds follow, grey levels.
    pub fn mean_noise(&self) -> f32 {
        let channels = self.channels.list();
        let power: f32 = channels.iter().map(|&c| self.threshold_noise(c).powi(2)).sum();
        (power / channels.len() as f32).sqrt()
    }

    /// Noise σ that the thresholds of `channel` follow, grey levels: that of the data, at full
    /// resolution.
    pub fn threshold_noise(&self, channel: Channel) -> f32 {
        self.data_noise(channel) * self.weight(channel).sqrt()
    }

    /// Weight of a site of `channel` along a colour axis, where a site of any channel counts alike,
    /// relative to green's.
    pub fn axis_weight(&self, channel: Channel) -> f32 {
        self.weight(Channel::Green) / self.weight(channel)
    }

    /// `plane`, valid at the data of `channel`, interpolated between them.
    pub fn interpolate(&self, channel: Channel, plane: Plane) -> Plane {
        match self.sampling.mosaic() {
            Some(mosaic) => mosaic.filled(channel, &plane),
            None => plane,
        }
    }

    /// Zeroes `plane` where `channel` has no data.
    pub fn mask(&self, channel: Channel, plane: &mut Plane) {
        for (v, &t) in plane.data_mut().iter_mut().zip(self.trust.plane(channel).data()) {
            if t == MISSING {
                *v = 0.0;
            }
        }
    }

    /// RMS over the data of `prediction − B` in one channel, grey levels.
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

    /// Whether nothing in the photo rises above its noise: flat everywhere, whatever its broad
    /// shading.
    pub fn is_blank(&self) -> bool {
        self.detail_mask(1).is_flat()
    }
}
