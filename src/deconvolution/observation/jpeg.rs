//! The quantised coefficients of a JPEG of the rig's size ([`crate::deconvolution::jpeg`]).

use super::Developed;
use super::sampling::{DataKind, Sampling};
use crate::deconvolution::jpeg::{AlongLuma, JpegTerm};
use crate::frame::{Channel, Frame, Mosaic, Size, Work};

/// Factor on the noise-to-signal ratio of the start. Coding errors surround edges, and those that a
/// start amplifies remain where the coefficients do not determine the picture. Set on coffee and
/// rocket; between 3 and 8 it hardly matters.
const START_NOISE_FACTOR: f32 = 6.0;

/// A JPEG's coefficients.
#[derive(Debug, Clone)]
pub struct Jpeg {
    /// The coefficients with their intervals.
    pub term: JpegTerm,
    /// Colour-filter mosaic over the canvas from whose sites the camera interpolated, if it did.
    pub interpolated: Option<Mosaic>,
}

impl Sampling for Jpeg {
    fn kind(&self) -> DataKind {
        DataKind::Jpeg
    }

    fn interpolated(&self) -> Option<Mosaic> {
        self.interpolated
    }

    fn has_colour_axes(&self) -> bool {
        false
    }

    fn data_noise(&self, channel: Channel, _pixel_noise: f32) -> f32 {
        self.term.noise(channel)
    }

    fn binned(&self) -> Option<Developed> {
        (!self.term.is_data()).then_some(Developed { interpolated: None, has_blocks: true })
    }

    fn expected_data(&self, prediction: &Frame<Work>) -> Option<Frame<Work>> {
        self.term.is_data().then(|| self.term.redecoded(prediction))
    }

    /// Before steps 1 and 2, in which the prediction changes most, and then before every third
    /// step.
    fn updates_data_at(&self, step: u32) -> bool {
        self.term.is_data() && (step == 2 || step % 3 == 1)
    }

    fn start_noise_factor(&self) -> f32 {
        START_NOISE_FACTOR
    }

    /// Coefficients determine the picture less than pixels do: 1.5 times the steps gain 0.005 SSIM
    /// and 0.33 dB at quality 90 (`tests/tables/constants.md`).
    fn solve_steps(&self, steps: u32, _has_axes: bool) -> u32 {
        if self.term.is_data() { 3 * steps / 2 } else { steps }
    }

    fn luma_prior(&self, size: Size, thresholds: &[f32]) -> Option<AlongLuma> {
        Some(self.term.along_luma(size, thresholds))
    }

    fn finish(&self, picture: &mut Frame<Work>, photo: &Frame<Work>) {
        self.term.mix_colours(picture, photo);
    }
}
