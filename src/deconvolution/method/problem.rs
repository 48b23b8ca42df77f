//! Input and output of a method: problem, solution and error.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::record::{IterationRecord, Watch};
use crate::deconvolution::colour_axis::ColourAxes;
use crate::deconvolution::data_term::{MISSING, NOISE_MIN, residual_in_place, rms_over_data};
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::observation::Observation;
use crate::deconvolution::panel_beat;
use crate::deconvolution::registration::{Comparison, Registration, common_mask};
use crate::frame::{Channel, Frame, Mosaic, Plane, Size, Work};
use crate::remedy::{AnyFailure, Remediable, Remedy};

/// Test of whether no scene can explain the photo through the measured lens, given K̂L of a
/// candidate; further captures are then useless.
pub type Hopeless<'a> = &'a (dyn Fn(&Frame<Work>) -> bool + Sync);

/// One photo to be solved.
pub struct Problem<'a> {
    /// The photo's data.
    pub observation: &'a Observation,
    /// The measured lens, K̂.
    pub model: &'a LensModel,
    /// Upper bound on ‖K‖² of each channel, which limits the step lengths. For raw sites it is the
    /// norm of √weight · K at the sites; so are the level norms.
    pub norm_squared: [f32; 3],
    /// Share of each wavelet level's power that the lens passes, per channel: the step lengths of
    /// solves with the lens model.
    pub level_norms: &'a [LevelNorms; 3],
    /// Level norms of K at all pixels, for solves on binned pixels.
    pub pixel_norms: &'a [LevelNorms; 3],
    /// Colour-filter mosaic over the canvas, if captures are valid at a sensor's raw sites only.
    pub capture_mosaic: Option<Mosaic>,
    /// Noise σ of one capture per channel, grey levels.
    pub capture_noise: [f32; 3],
    /// Tests whether captures are useless; `None` without a judge.
    pub is_hopeless: Option<Hopeless<'a>>,
    /// Seconds on the caller's clock.
    pub stopwatch: &'a (dyn Fn() -> f64 + Sync),
}

impl<'a> Problem<'a> {
    /// The canvas.
    pub fn size(&self) -> Size {
        self.observation.size()
    }

    /// Captures `shown`, registers the capture to its `prediction` ([`Registration`]) and removes
    /// its panel beat.
    ///
    /// # Errors
    /// When the capture fails.
    pub fn capture(
        &self,
        optics: &mut dyn ForwardConvolution,
        prediction: &Frame<Work>,
        shown: &Frame<Work>,
    ) -> Result<Seen, MethodError> {
        let mut seen = optics.forward_predicted(shown, prediction)?;
        let Observation { trust, rect, channels, .. } = self.observation;
        let (rect, channels) = (*rect, channels.list());
        let blur_px = self.model.functions().support_px;
        let mask = &common_mask(trust, &seen.trusted);
        let (light, area) = (&seen.light, rect);
        let comparison = Comparison { seen: light, predicted: prediction, mask, area, channels };
        let found = Registration::fit(&comparison, blur_px);
        log::debug!("capture registered: {found:?}");
        found.undo(&mut seen, prediction, channels);
        if let Some(wave) = optics.column_wave() {
            let (valid, mosaic) = ((trust, rect), self.capture_mosaic);
            panel_beat::remove_beats(&mut seen, prediction, valid, &wave, mosaic, channels);
        }
        Ok(seen)
    }

    /// RMS of FC(L) − B in one channel due to noise alone: √(photo² + capture²), grey levels.
    pub fn noise_floor(&self, channel: Channel) -> f32 {
        let least = |noise: [f32; 3]| noise[channel.index()].max(NOISE_MIN);
        least(self.observation.noise).hypot(least(self.capture_noise))
    }

    /// RMS of a capture's residual in one channel over the sites where it is valid, grey levels.
    pub fn capture_rms(&self, channel: Channel, seen: &Plane) -> f32 {
        let Some(mosaic) = self.capture_mosaic else {
            return self.observation.residual_rms(channel, seen);
        };
        let photo = self.observation.trust.plane(channel);
        let trust = Plane::from_fn(photo.size(), |x, y| {
            if mosaic.colour_at(x, y) == channel { photo.at(x, y) } else { MISSING }
        });
        let mut difference = seen.clone();
        residual_in_place(&mut difference, self.observation.light.plane(channel), &trust);
        rms_over_data(&difference, &trust)
    }

    /// Prediction K̂ of `picture` in the solved channels.
    pub fn predict(&self, picture: &Frame<Work>) -> Frame<Work> {
        self.model.seen(self.observation.channels.list(), picture)
    }

    /// RMS(K̂L − B) of a `prediction` in σ of the photo's noise, over the solved channels.
    pub(super) fn residual_over_noise(&self, prediction: &Frame<Work>) -> f32 {
        let observation = self.observation;
        let channels = observation.channels.list();
        let power = |&c: &Channel| {
            let noise = observation.noise[c.index()].max(NOISE_MIN);
            (observation.residual_rms(c, prediction.plane(c)) / noise).powi(2)
        };
        (channels.iter().map(power).sum::<f32>() / channels.len() as f32).sqrt()
    }

    /// RMS(K̂L − B) of a `prediction` in the green channel, grey levels.
    pub(super) fn model_residual(&self, prediction: &Frame<Work>) -> f32 {
        self.observation.residual_rms(Channel::Green, prediction.plane(Channel::Green))
    }

    /// argmin ‖K̂L − B‖² + `ratio` ‖L − `near`‖² in `channel` by the lens's local inverse, from the
    /// `residual` K̂ near − B; planes on the canvas, grey levels.
    pub fn data_step(
        &self,
        channel: Channel,
        near: &Plane,
        mut residual: Plane,
        ratio: f32,
    ) -> Plane {
        let (observation, model) = (self.observation, self.model);
        let inverse = model.local_inverse(channel, ratio, observation.density(channel));
        residual.scale(observation.weight(channel));
        let mut picture = Plane::zeros(near.size());
        model.invert(&inverse, &residual, &mut picture);
        picture.update(near, |v, near| *v = near - *v);
        picture
    }

    /// A frame of the planes that `make` gives for the solved channels, black in others.
    pub fn frame_of(&self, make: impl Fn(Channel) -> Plane + Sync) -> Frame<Work> {
        let channels = self.observation.channels.list();
        let planes: Vec<Plane> = channels.par_iter().map(|&c| make(c)).collect();
        let mut frame = Frame::zeros(self.size());
        channels.iter().zip(planes).for_each(|(&c, plane)| *frame.plane_mut(c) = plane);
        frame
    }

    /// Solves each channel by itself with `solve`; the record is the green channel's.
    pub(super) fn solve_by_channel(
        &self,
        solve: impl Fn(Channel) -> (Plane, IterationRecord) + Sync,
        watch: &mut Watch<'_>,
    ) -> Solution {
        let channels = self.observation.channels.list();
        let solved: Vec<_> = channels.par_iter().map(|&c| solve(c)).collect();
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
        let prediction = self.predict(&picture);
        let certificate = Certificate::of_model(self, &prediction);
        Solution { prediction: Some(prediction), ..Solution::of(picture, record, certificate) }
    }
}

/// One solve of a problem with the lens model, possibly for corrected data.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    /// The problem.
    pub(super) problem: &'a Problem<'a>,
    /// Data to solve for in place of B.
    pub(super) data: &'a Frame<Work>,
    /// The photo's detail mask.
    pub(super) mask: &'a DetailMask,
    /// The photo's colour axes, if it is solved along them.
    pub(super) axes: Option<&'a ColourAxes>,
    /// The level norms that set the step lengths.
    pub(super) norms: &'a [LevelNorms; 3],
}

/// Result of a solve.
#[derive(Debug, Clone)]
pub struct Solution {
    /// L on the canvas, linear light.
    pub picture: Frame<Work>,
    /// K̂L in the solved channels, if the method computed it.
    pub prediction: Option<Frame<Work>>,
    /// Record of the iterations.
    pub record: IterationRecord,
    /// Measured residuals of the picture.
    pub certificate: Certificate,
}

impl Solution {
    /// A solution without a prediction.
    pub fn of(picture: Frame<Work>, record: IterationRecord, certificate: Certificate) -> Solution {
        Solution { picture, prediction: None, record, certificate }
    }
}

/// Residuals of the picture's photograph and prediction against the photo, grey levels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Certificate {
    /// RMS(FC(L) − B) of the returned picture, in the channel with the largest ratio to its noise
    /// floor; `None` if the picture was not photographed.
    pub optical_residual: Option<f32>,
    /// RMS(K̂L − B) of the returned picture in the green channel; `None` if it was not computed.
    pub model_residual: Option<f32>,
    /// RMS residual of noise alone, √(photo² + capture²), in the channel of the optical residual,
    /// or in green if there is none.
    pub noise_floor: f32,
    /// Number of corrections by captures that the picture contains.
    pub corrections: u32,
}

impl Certificate {
    /// The certificate of a picture before any measurement: the noise floor alone.
    pub fn uncertified(problem: &Problem<'_>) -> Self {
        Certificate { noise_floor: problem.noise_floor(Channel::Green), ..Certificate::default() }
    }

    /// The certificate of a picture by its `prediction` alone.
    pub(super) fn of_model(problem: &Problem<'_>, prediction: &Frame<Work>) -> Self {
        let model_residual = Some(problem.model_residual(prediction));
        Certificate { model_residual, ..Certificate::uncertified(problem) }
    }

    /// Sets the optical residual from a capture of the picture, linear light on the canvas.
    pub fn measure(&mut self, problem: &Problem<'_>, seen: &Frame<Work>) {
        let worst = problem.observation.channels.list().par_iter().map(|&c| {
            let residual = problem.capture_rms(c, seen.plane(c));
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

/// Why a method returned no picture.
#[derive(Debug, thiserror::Error)]
pub enum MethodError {
    /// A capture failed, or was cancelled.
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
        let MethodError::Optics(failure) = self;
        failure.remedy()
    }

    fn was_asked_for(&self) -> bool {
        let MethodError::Optics(failure) = self;
        failure.was_asked_for()
    }
}
