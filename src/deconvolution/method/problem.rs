//! What a method is given and what it gives back.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::record::{IterationRecord, Watch};
use crate::deconvolution::colour_axis::ColourAxes;
use crate::deconvolution::data_term::{
    MISSING, NOISE_MIN, residual, residual_in_place, rms_over_data,
};
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::jpeg::JpegTerm;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::panel_beat;
use crate::deconvolution::refinement::RefinedLens;
use crate::deconvolution::registration::Registration;
use crate::frame::{Channel, Channels, Frame, Mosaic, Plane, Rect, Size, Work};
use crate::remedy::{AnyFailure, Remediable, Remedy};

/// Says of K̂L of a picture whether more captures are for nothing.
pub type Hopeless<'a> = &'a (dyn Fn(&Frame<Work>) -> bool + Sync);

/// One photo to be solved.
pub struct Problem<'a> {
    /// B: the photo on its canvas, linear light 0..255; outside the photo a guess (repeated edges).
    pub photo: &'a Frame<Work>,
    /// What each pixel of `photo` is worth, see [`crate::deconvolution::data_term`].
    pub trust: &'a Frame<Work, u8>,
    /// Where the photo lies on the canvas.
    pub rect: Rect,
    /// The colours of the canvas's pixels where the photo is a sensor's raw sites: its data are
    /// those, and `trust` says so.
    pub mosaic: Option<Mosaic>,
    /// Whether a JPEG's coding, which keeps colours coarser than brightness, is seen in the photo.
    pub coded: bool,
    /// Whether its noise is each pixel's own: not where a camera filled in what is between its
    /// filters, or coding took part of it.
    pub white_noise: bool,
    /// What the photo's file states of it, where that is known: then the data, in place of `photo`.
    pub stated: Option<&'a JpegTerm>,
    /// Which channels are solved.
    pub channels: Channels,
    /// The measured lens, when there is one.
    pub model: Option<&'a LensModel>,
    /// ‖K‖² of each channel, an upper estimate; bounds the steps. Of raw sites, of √weight · K at
    /// the sites, as the level norms are.
    pub norm_squared: [f32; 3],
    /// How much of each wavelet level arrives, per channel; sets the steps of solves with the
    /// model.
    pub level_norms: &'a [LevelNorms; 3],
    /// Standard deviation of the photo's noise per channel, grey levels, at its mean light.
    pub photo_noise: [f32; 3],
    /// The light that adds as much noise as the photo has without light, per channel, grey levels;
    /// infinite where its noise is the same everywhere.
    pub dark_light: [f32; 3],
    /// The colours of the canvas's pixels where captures are known at a sensor's raw sites.
    pub capture_mosaic: Option<Mosaic>,
    /// Standard deviation of one capture's noise per channel, grey levels.
    pub capture_noise: [f32; 3],
    /// Whether no scene gives the photo through the measured lens, asked with K̂L of what that lens
    /// alone makes of it: captures are for nothing then. `None` where nobody says.
    pub is_hopeless: Option<Hopeless<'a>>,
    /// Seconds on the caller's clock.
    pub stopwatch: &'a (dyn Fn() -> f64 + Sync),
}

impl<'a> Problem<'a> {
    /// The canvas.
    pub fn size(&self) -> Size {
        self.photo.size()
    }

    /// The measured lens.
    ///
    /// # Errors
    /// When the method needs a lens model and there is none.
    pub fn needs_model(&self, method: &'static str) -> Result<&'a LensModel, MethodError> {
        self.model.ok_or(MethodError::NoModel { method })
    }

    /// What a residual counts in its channel: how many pixels each of the photo's stands for.
    pub fn weight(&self, channel: Channel) -> f32 {
        self.mosaic.map_or(1.0, |_| Mosaic::pixels_a_site(channel))
    }

    /// Standard deviation of the noise of a photo that has data everywhere and says as much.
    pub fn solving_noise(&self, channel: Channel) -> f32 {
        self.photo_noise[channel.index()] * self.weight(channel).sqrt()
    }

    /// The same where the data are what the photo's file states: what coding added is no noise to
    /// one who reads the file.
    pub(super) fn noise_of_data(&self, channel: Channel) -> f32 {
        match self.stated {
            Some(stated) => stated.noise(channel),
            None => self.solving_noise(channel),
        }
    }

    /// Zero where the photo has no data.
    pub fn mask(&self, channel: Channel, plane: &mut Plane) {
        for (v, &t) in plane.data_mut().iter_mut().zip(self.trust.plane(channel).data()) {
            if t == MISSING {
                *v = 0.0;
            }
        }
    }

    /// What `optics` let be seen of `shown`, brought to where a lens model `predicted` it
    /// ([`Registration`]); as it came where none did.
    ///
    /// # Errors
    /// When the capture fails.
    pub(super) fn seen(
        &self,
        optics: &mut dyn ForwardConvolution,
        predicted: Option<&Frame<Work>>,
        shown: &Frame<Work>,
    ) -> Result<Seen, MethodError> {
        let mut seen = optics.forward(shown)?;
        if let (Some(predicted), Some(model)) = (predicted, self.model) {
            let blur_px = model.functions().support_px;
            let channels = self.channels.list();
            let (trust, rect) = (self.trust, self.rect);
            let found = Registration::of(&seen, predicted, trust, rect, channels, blur_px);
            log::debug!("capture registered: {found:?}");
            found.undo(&mut seen, predicted, channels);
            if let Some(columns) = optics.panel_columns() {
                let (known, mosaic) = ((trust, rect), self.capture_mosaic);
                panel_beat::take_out(&mut seen, predicted, known, columns, mosaic, channels);
            }
        }
        Ok(seen)
    }

    /// What noise alone leaves of FC(L) − B in one channel: √(photo² + capture²), grey levels.
    pub fn noise_floor(&self, channel: Channel) -> f32 {
        let least = |noise: [f32; 3]| noise[channel.index()].max(NOISE_MIN);
        least(self.photo_noise).hypot(least(self.capture_noise))
    }

    /// RMS over the photo of `predicted − B` in one channel, grey levels.
    pub fn residual_rms(&self, channel: Channel, predicted: &Plane) -> f32 {
        let mut difference = Plane::zeros(self.size());
        let trust = self.trust.plane(channel);
        residual(predicted, self.photo.plane(channel), trust, &mut difference);
        rms_over_data(&difference, trust)
    }

    /// [`Problem::residual_rms`] of a capture: where it is known.
    pub fn seen_rms(&self, channel: Channel, seen: &Plane) -> f32 {
        let Some(mosaic) = self.capture_mosaic else { return self.residual_rms(channel, seen) };
        let photo = self.trust.plane(channel);
        let trust = Plane::from_fn(photo.size(), |x, y| {
            if mosaic.colour_at(x, y) == channel { photo.at(x, y) } else { MISSING }
        });
        let mut difference = seen.clone();
        residual_in_place(&mut difference, self.photo.plane(channel), &trust);
        rms_over_data(&difference, &trust)
    }

    /// K̂ of `picture` in the channels that are solved; none without a lens model.
    pub(super) fn predicted(&self, picture: &Frame<Work>) -> Option<Frame<Work>> {
        Some(self.model?.seen(self.channels.list(), picture))
    }

    /// RMS(K̂L − B) of a picture that was `predicted` to be seen so, in the green channel, grey
    /// levels.
    pub(super) fn model_residual(&self, predicted: &Frame<Work>) -> f32 {
        self.residual_rms(Channel::Green, predicted.plane(Channel::Green))
    }

    /// A frame whose solved channels are `of` them, black in others.
    pub(super) fn frame_of(&self, of: impl Fn(Channel) -> Plane + Sync) -> Frame<Work> {
        let channels = self.channels.list();
        let planes: Vec<Plane> = channels.par_iter().map(|&c| of(c)).collect();
        let mut frame = Frame::zeros(self.size());
        channels.iter().zip(planes).for_each(|(&c, plane)| *frame.plane_mut(c) = plane);
        frame
    }

    /// The solution of a method that solves each channel by itself; the record is green's.
    pub(super) fn solved_by_channel(
        &self,
        of: impl Fn(Channel) -> (Plane, IterationRecord) + Sync,
        watch: &mut Watch<'_>,
    ) -> Solution {
        let channels = self.channels.list();
        let solved: Vec<_> = channels.par_iter().map(|&c| of(c)).collect();
        let (mut picture, mut record) = (Frame::zeros(self.size()), IterationRecord::default());
        for (&c, (plane, steps)) in channels.iter().zip(solved) {
            *picture.plane_mut(c) = plane;
            if c == Channel::Green {
                record = steps;
            }
        }
        if let Some(last) = record.steps().last() {
            watch(last, Some(&picture));
        }
        let predicted = self.predicted(&picture);
        let model_residual = predicted.as_ref().map(|predicted| self.model_residual(predicted));
        let certificate = Certificate { model_residual, ..Certificate::uncertified(self) };
        Solution { predicted, ..Solution::of(picture, record, certificate) }
    }
}

/// A solve with the lens model, which may be of another photo with another lens than the problem's.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    /// The problem that it is part of.
    pub(super) problem: &'a Problem<'a>,
    /// The lens.
    pub(super) model: &'a LensModel,
    /// In place of B.
    pub(super) data: &'a Frame<Work>,
    /// Where the photo is calm, and no detail is looked for.
    pub(super) mask: &'a DetailMask,
    /// Along which axes its colours lie, where they are solved so.
    pub(super) axes: Option<&'a ColourAxes>,
    /// What steps are allowed.
    pub(super) norms: &'a [LevelNorms; 3],
}

/// A finished picture.
#[derive(Debug, Clone)]
pub struct Solution {
    /// L on the canvas, linear light.
    pub picture: Frame<Work>,
    /// K̂L in the channels that are solved, where the method had it: by the measured lens, or by the
    /// refined one.
    pub predicted: Option<Frame<Work>>,
    /// The iterations.
    pub record: IterationRecord,
    /// What was measured of the result.
    pub certificate: Certificate,
    /// The lens refined by the photo's captures, where they show another than was measured.
    pub refined: Option<RefinedLens>,
}

impl Solution {
    /// A solution by the measured lens.
    pub fn of(picture: Frame<Work>, record: IterationRecord, certificate: Certificate) -> Solution {
        Solution { picture, predicted: None, record, certificate, refined: None }
    }
}

/// Is the picture's photograph the photo? Residuals in grey levels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Certificate {
    /// RMS(FC(L) − B) of the returned picture, when it was photographed; of the channel that is
    /// worst over its floor.
    pub optical_residual: Option<f32>,
    /// RMS(K̂L − B) of the returned picture, when there is a lens model; green channel.
    pub model_residual: Option<f32>,
    /// What the optical residual would be from noise alone, √(photo² + capture²), in that channel;
    /// green before any was measured.
    pub noise_floor: f32,
    /// Corrections from captures that went into the picture.
    pub corrections: u32,
}

impl Certificate {
    /// Nothing measured but what noise alone would leave.
    pub fn uncertified(problem: &Problem<'_>) -> Self {
        Certificate { noise_floor: problem.noise_floor(Channel::Green), ..Certificate::default() }
    }

    /// Takes down what is `seen` of the picture, in light.
    pub fn look(&mut self, problem: &Problem<'_>, seen: &Frame<Work>) {
        let worst = problem.channels.list().par_iter().map(|&c| {
            let residual = problem.seen_rms(c, seen.plane(c));
            (residual, problem.noise_floor(c))
        });
        let worst: Vec<(f32, f32)> = worst.collect();
        if let Some((residual, floor)) =
            worst.into_iter().max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)))
        {
            (self.optical_residual, self.noise_floor) = (Some(residual), floor);
        }
    }

    /// Optical residual over the noise floor; 1 is perfect.
    pub fn ratio(&self) -> Option<f32> {
        self.optical_residual.map(|r| r / self.noise_floor.max(f32::MIN_POSITIVE))
    }
}

/// Why a method gave no picture.
#[derive(Debug, thiserror::Error)]
pub enum MethodError {
    /// The method computes with the measured lens, and there is none.
    #[error("method {method} needs a measured lens, and the calibration holds none")]
    NoModel {
        /// The method's name.
        method: &'static str,
    },
    /// A capture failed, or nobody wanted it any more.
    #[error("{what}{0}", what = if _0.was_asked_for() { "" } else { "a capture failed: " })]
    Optics(AnyFailure),
}

impl From<AnyFailure> for MethodError {
    fn from(failure: AnyFailure) -> Self {
        MethodError::Optics(failure)
    }
}

impl Remediable for MethodError {
    fn remedy(&self) -> Remedy {
        match self {
            MethodError::NoModel { .. } => Remedy::Recalibrate,
            MethodError::Optics(failure) => failure.remedy(),
        }
    }

    fn was_asked_for(&self) -> bool {
        matches!(self, MethodError::Optics(failure) if failure.was_asked_for())
    }
}
