//! Properties of a kind of data on which solver and judge depend.

use super::Developed;
use crate::deconvolution::jpeg::AlongLuma;
use crate::frame::{Channel, Frame, Mosaic, Size, Work};

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

    /// Colour-filter mosaic over the canvas, if each pixel holds data of its filter's channel only.
    fn mosaic(&self) -> Option<Mosaic> {
        None
    }

    /// Colour-filter mosaic over the canvas from whose sites the camera interpolated full-colour
    /// data, if it did. The noise of such data is not white.
    fn interpolated(&self) -> Option<Mosaic> {
        None
    }

    /// Whether the scene's colour axes can be estimated from the data.
    fn has_colour_axes(&self) -> bool {
        true
    }

    /// Noise σ of the data of `channel`, grey levels, given the σ `pixel_noise` of its pixels.
    fn data_noise(&self, _channel: Channel, pixel_noise: f32) -> f32 {
        pixel_noise
    }

    /// Expected data, given the forward model's `prediction` on the canvas; `None` if the data do
    /// not depend on it.
    fn expected_data(&self, _prediction: &Frame<Work>) -> Option<Frame<Work>> {
        None
    }

    /// Whether a solve updates its [expected data](Sampling::expected_data) before step `step`,
    /// counted from 1.
    fn updates_data_at(&self, _step: u32) -> bool {
        false
    }

    /// Kind of the means over the data in squares of two by two pixels; `None` if the data have no
    /// such means.
    fn binned(&self) -> Option<Developed> {
        Some(Developed { interpolated: None, has_blocks: !self.has_colour_axes() })
    }

    /// Factor on the noise-to-signal ratio of Wiener's filter at the start of a solve.
    fn start_noise_factor(&self) -> f32 {
        1.0
    }

    /// Parameters of a start along the colour axes, for a lens whose functions are `lens_width_px`
    /// wide.
    fn axis_starts(&self, _lens_width_px: f32) -> AxisStarts {
        AxisStarts { count: 2, noise_to_signal: 0.05 }
    }

    /// Number of steps of a solve, given the method's `steps`; fewer for a start along the colour
    /// axes.
    fn solve_steps(&self, steps: u32, has_axes: bool) -> u32 {
        if has_axes { (3 * steps).div_ceil(4) } else { steps }
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

/// Parameters of a start along the colour axes, which is refined several times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisStarts {
    /// Number of refinements.
    pub count: usize,
    /// Noise-to-signal power of Wiener's filter at one grey level of noise.
    pub noise_to_signal: f32,
}
