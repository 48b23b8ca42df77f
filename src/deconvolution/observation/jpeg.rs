//! The quantised coefficients of a JPEG of the rig's size ([`crate::deconvolution::jpeg`]).

use super::Developed;
use super::sampling::{DataKind, Sampling};
use crate::deconvolution::jpeg::{AlongLuma, JpegTerm};
use crate::frame::{Channel, Frame, Mosaic, Size, Work};

/// Steps before which a solve decodes the JPEG again: the independent study's.
const DECODED_BEFORE: [u32; 6] = [1, 2, 4, 7, 10, 13];
/// Factor on the noise-to-signal ratio of the start: coding errors lie about edges, and what a
/// start makes of them remains where the file leaves the picture open. Set on coffee and rocket;
/// between 3 and 8 it hardly matters.
const START_NOISE_FACTOR: f32 = 6.0;
/// Least steps of a correction, during which the data are decoded again. With five the demo's JPEG
/// loses 0.0007 SSIM, with two 0.0011.
const CORRECTION_STEPS_MIN: u32 = 10;

/// A JPEG's coefficients.
#[derive(Debug, Clone)]
pub struct Jpeg {
    /// The coefficients with their intervals.
    pub term: JpegTerm,
    /// The filters between whose sites the camera interpolated, over the canvas.
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

    fn updates_data_at(&self, step: u32) -> bool {
        self.term.is_data() && DECODED_BEFORE.contains(&step)
    }

    fn start_noise_factor(&self) -> f32 {
        START_NOISE_FACTOR
    }

    fn correction_steps(&self, steps: u32) -> u32 {
        steps.max(CORRECTION_STEPS_MIN)
    }

    fn luma_prior(&self, size: Size, thresholds: &[f32]) -> Option<AlongLuma> {
        Some(self.term.along_luma(size, thresholds))
    }

    fn finish(&self, picture: &mut Frame<Work>, photo: &Frame<Work>) {
        self.term.mix_colours(picture, photo);
    }
}
