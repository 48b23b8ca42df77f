//! What is delivered for a photo, and why.

use serde::{Deserialize, Serialize};

use super::Pipeline;
use super::judging::Evidence;
use super::judging::limits::{ANOTHER_SENSOR, NOT_CONFIRMED, NOTHING_BUT_NOISE, SHARPER, UNPLACED};
use super::optical_residual::{CertifiedFocus, Confirmation, OpticalResidual};
use super::outliers::Outliers;
use super::stages::{Prepared, Solved, TakenBy};
use crate::deconvolution::focus::NOISE_MAX;
use crate::deconvolution::method::{Certificate, Method, MethodError, Watch};
use crate::deconvolution::stage::ResultStage;
use crate::frame::{Channel, CoarseResult, DeliveredPicture, Frame, Work};
use crate::picture::Photo;
use crate::rig::exposure::Devices;

/// The source of the delivered picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The method's result.
    Sound,
    /// A solution of the measured lens alone, in place of a harmful result.
    Replaced,
    /// The photo itself.
    Untouched,
}

/// What is delivered for a photo. All but captures and seconds describe the delivered picture.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The picture, linear light 0..255, in the photo's stored orientation; of the photo's size,
    /// or of the solving grid's where the photo was binned.
    pub picture: Frame<Work>,
    /// The coarse result of a binned photo, for [`Outcome::delivered`]; `None` if it is untouched.
    pub coarse: Option<CoarseResult>,
    /// Source of the picture.
    pub verdict: Verdict,
    /// Name of the method that made the picture; `none` for the photo itself.
    pub method: &'static str,
    /// Stage that produced the picture.
    pub stage: ResultStage,
    /// Sentence for the user on why this picture is delivered.
    pub reason: String,
    /// Evidence about the picture without knowing the scene; for a refused photo, the residuals by
    /// which it was refused.
    pub evidence: Option<Evidence>,
    /// Optical residual of the picture, if it was photographed.
    pub certificate: Option<OpticalResidual>,
    /// Captures made for this photo, those of a rejected result included.
    pub captures: usize,
    /// Seconds spent, captures included.
    pub seconds: f64,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// Steps of the method that made the picture.
    pub iterations: Vec<Iteration>,
    /// Parts of the photo that are delivered as they were.
    pub outliers: Option<Outliers>,
}

/// One step of a method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Iteration {
    /// RMS residual after the step, grey levels of 255.
    pub residual_grey_levels: f64,
    /// Captures so far.
    pub captures: usize,
    /// Seconds so far.
    pub seconds: f64,
}

/// A photo after the whole pipeline.
#[derive(Debug)]
pub struct Restoration {
    /// What is delivered.
    pub outcome: Outcome,
    /// The method's result, delivered or not; `None` for a photo returned before solving.
    pub solved: Option<Solved>,
}

impl Pipeline {
    /// Restores `photo` on `rig` by `method` and judges the result; `watch` is called after every
    /// step. The laboratory measures its rates with this function.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn restore(
        &self,
        rig: &mut Devices,
        photo: &Prepared<'_>,
        method: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<Restoration, MethodError> {
        let begun = (self.stopwatch)();
        let (mut outcome, solved) = match self.refusal(photo) {
            Some(reason) => (Outcome::untouched(photo.photo.as_ref().clone(), reason), None),
            None => {
                let (outcome, solved) = self.restore_at_focus(rig, photo, method, watch)?;
                (self.unless_rejected(photo, outcome), Some(solved))
            }
        };
        outcome.seconds = (self.stopwatch)() - begun;
        Ok(Restoration { outcome, solved })
    }

    /// The reason, if any, to return `photo` as it is before any method is tried.
    fn refusal(&self, photo: &Prepared<'_>) -> Option<&'static str> {
        let is_noisier = |&c: &Channel| {
            let camera = self.noise[c.index()].sigma(photo.photo.plane(c).mean() as f32);
            photo.observation.noise[c.index()] > NOISE_MAX * camera
        };
        if photo.observation.is_blank() {
            let is_noise = photo.observation.channels.list().iter().any(is_noisier);
            return Some(if is_noise { NOTHING_BUT_NOISE } else { ResultStage::Photo.reason() });
        }
        if photo.taken_by() == Some(TakenBy::Another) {
            return Some(ANOTHER_SENSOR);
        }
        if !photo.is_placed(self.lens.model.field()) {
            return Some(UNPLACED);
        }
        photo.is_of_sharper_lens.then_some(SHARPER)
    }

    /// `outcome`, or `photo` itself if another sensor may have taken it and the photograph of the
    /// result is not the photo.
    pub(super) fn unless_rejected(&self, photo: &Prepared<'_>, mut outcome: Outcome) -> Outcome {
        if photo.taken_by() != Some(TakenBy::Either) {
            return outcome;
        }
        if outcome.confirmation() == Some(Confirmation::Not) {
            let untouched = Outcome::untouched(photo.photo.as_ref().clone(), NOT_CONFIRMED);
            return Outcome { captures: outcome.captures, ..untouched };
        }
        outcome.certificate.iter_mut().for_each(|certificate| certificate.of_any_sensor = true);
        outcome
    }

    /// Restores `photo` at its own focus. If no scene gives it there, its spectrum has misled the
    /// search for the focus, and it is restored at the panel's.
    fn restore_at_focus(
        &self,
        rig: &mut Devices,
        photo: &Prepared<'_>,
        method: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<(Outcome, Solved), MethodError> {
        let (mut outcome, solved) = self.restore_explained(rig, photo, method, watch)?;
        if let Some(certificate) = &mut outcome.certificate
            && !self.focuses.0.is_empty()
        {
            certificate.focus = CertifiedFocus::Photo;
        }
        let Some(focus) = &photo.focus else { return Ok((outcome, solved)) };
        if outcome.verdict != Verdict::Untouched {
            outcome.notes.push(focus.note());
            return Ok((outcome, solved));
        }
        let (outcome, again) = self.restore_explained(rig, &photo.at_panel(), method, watch)?;
        Ok((outcome, again.with_captures_of(&solved)))
    }

    /// Restores `photo` at its focus. If no scene gives the whole photo, restores it without its
    /// outliers, unless a capture contradicts that result.
    fn restore_explained(
        &self,
        rig: &mut Devices,
        photo: &Prepared<'_>,
        method: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<(Outcome, Solved), MethodError> {
        let solved = self.solve(rig, photo, method, watch)?;
        let outcome = self.judge(photo, &solved, watch)?;
        if outcome.verdict != Verdict::Untouched {
            return Ok((outcome, solved));
        }
        let Some(rest) = self.without_outliers(photo, &solved) else {
            return Ok((outcome, solved));
        };
        let again = self.solve(rig, &rest, method, watch)?;
        let judged = self.judge(&rest, &again, watch)?;
        let captures = solved.captures + again.captures;
        let is_contradicted = judged.confirmation() == Some(Confirmation::Not);
        if judged.verdict == Verdict::Untouched || is_contradicted {
            return Ok((Outcome { captures, ..outcome }, solved.with_captures_of(&again)));
        }
        let notes = rest.outliers.iter().map(Outliers::note).collect();
        let outcome = Outcome { outliers: rest.outliers, notes, captures, ..judged };
        Ok((outcome, again.with_captures_of(&solved)))
    }
}

impl Outcome {
    /// The outcome that returns `photo` itself, with the sentence `reason` for the user.
    pub fn untouched(photo: Frame<Work>, reason: impl Into<String>) -> Outcome {
        Outcome {
            picture: photo,
            coarse: None,
            verdict: Verdict::Untouched,
            method: "none",
            stage: ResultStage::Photo,
            reason: reason.into(),
            evidence: None,
            certificate: None,
            captures: 0,
            seconds: 0.0,
            notes: Vec::new(),
            iterations: Vec::new(),
            outliers: None,
        }
    }

    /// The picture at the size of its `photo`.
    pub fn delivered<'a>(&'a self, photo: &'a Photo) -> DeliveredPicture<'a> {
        // If a binned photo is returned, `picture` holds only its means.
        let is_returned =
            self.verdict == Verdict::Untouched && self.picture.size() != photo.light.size();
        let is_photo = is_returned || self.coarse.is_some();
        let light = if is_photo { &photo.light } else { &self.picture };
        DeliveredPicture { light, coarse: self.coarse.as_ref() }
    }

    /// Rotates all that is delivered by half a turn.
    pub fn turn_by_half(&mut self) {
        self.picture.turn_by_half();
        self.coarse.iter_mut().for_each(|coarse| coarse.is_turned ^= true);
        self.outliers.iter_mut().for_each(|outliers| outliers.weight.turn_by_half());
    }

    /// What the photograph of the result confirms; `None` if it was not photographed.
    pub fn confirmation(&self) -> Option<Confirmation> {
        self.certificate.as_ref().map(OpticalResidual::confirmation)
    }

    /// The outcome that delivers the result `solved`, with its `evidence`.
    pub(super) fn of(solved: &Solved, evidence: Evidence) -> Outcome {
        let Certificate { optical_residual, noise_floor, .. } = solved.solution.certificate;
        let (stage, reason) = stage_of(solved);
        Outcome {
            picture: solved.picture.clone(),
            coarse: None,
            verdict: Verdict::Sound,
            method: solved.about.name,
            stage,
            reason,
            evidence: Some(evidence),
            certificate: optical_residual.map(|residual| OpticalResidual {
                residual_grey_levels: residual.into(),
                floor_grey_levels: noise_floor.into(),
                focus: CertifiedFocus::Panel,
                of_any_sensor: false,
            }),
            captures: solved.captures,
            seconds: 0.0,
            notes: Vec::new(),
            iterations: iterations(solved),
            outliers: None,
        }
    }
}

fn iterations(solved: &Solved) -> Vec<Iteration> {
    let steps = solved.solution.record.steps().iter();
    let of = steps.map(|step| Iteration {
        residual_grey_levels: step.residual.into(),
        captures: step.captures as usize,
        seconds: step.seconds,
    });
    of.collect()
}

/// The stage that produced a result, and a sentence on it for the user.
fn stage_of(solved: &Solved) -> (ResultStage, String) {
    let Certificate { corrections, optical_residual, .. } = solved.solution.certificate;
    match (corrections, optical_residual, solved.captures) {
        (1.., _, _) => (ResultStage::Captures, ResultStage::Captures.reason().to_owned()),
        (0, Some(_), _) => (ResultStage::LensModel, ResultStage::LensModel.reason().to_owned()),
        (0, None, 0) => {
            let reason = "the measured lens alone was used; the result was not photographed";
            (ResultStage::LensModel, reason.to_owned())
        }
        (0, None, captures) => {
            let name = solved.about.name;
            let reason = format!(
                "the method `{name}` worked from {captures} captures; its result was not \
                 photographed"
            );
            (ResultStage::Captures, reason)
        }
    }
}
