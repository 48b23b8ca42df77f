//! What became of a photo: the picture that is delivered, whose it is, and why.

use serde::{Deserialize, Serialize};

use super::Pipeline;
use super::judge::SHARPER;
use super::stages::{Evidence, Prepared, Solved};
use crate::deconvolution::method::{Certificate, Method, MethodError, Watch};
use crate::deconvolution::stage::ResultStage;
use crate::frame::{Channel, Frame, Work};
use crate::rig::exposure::Devices;

/// Whose picture is delivered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The method's.
    Sound,
    /// What the measured lens alone makes of the photo, in place of a result that harms.
    Replaced,
    /// The photo itself.
    Untouched,
}

/// What is delivered for a photo. Everything but the cost is said of the picture delivered.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The picture, photo-sized, linear light 0..255, the photo's stored orientation.
    pub picture: Frame<Work>,
    /// Whose it is.
    pub verdict: Verdict,
    /// The method that made it; `none` for the photo itself.
    pub method: &'static str,
    /// The stage that produced it.
    pub stage: ResultStage,
    /// Why this picture and this stage, in words.
    pub reason: String,
    /// What is known of it without knowing the scene; of a photo returned as it is, what the lens
    /// alone leaves of the channels that spoke against restoring it.
    pub evidence: Option<Evidence>,
    /// Its optical residual, if it was photographed.
    pub certificate: Option<OpticalResidual>,
    /// Captures made for this photo, those of a result that was not delivered among them.
    pub captures: usize,
    /// Seconds it took, captures included.
    pub seconds: f64,
    /// Sentences for the customer.
    pub notes: Vec<String>,
    /// The record of the method that made it.
    pub iterations: Vec<Iteration>,
}

/// The optical residual of a finished picture: is its photograph the photo?
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "WrittenResidual", into = "WrittenResidual")]
pub struct OpticalResidual {
    /// RMS difference between the picture's photograph and the photo, grey levels of 255.
    pub residual_grey_levels: f64,
    /// What noise alone would leave, grey levels of 255.
    pub floor_grey_levels: f64,
    /// The focus it is of.
    pub focus: CertifiedFocus,
}

/// The same in a report: one number of which the smaller is the better, and what it counts in.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
struct WrittenResidual {
    times_noise: Option<f64>,
    #[serde(alias = "floor-grey-levels")]
    noise_grey_levels: f64,
    /// Of a report from before `times-noise`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    residual_grey_levels: Option<f64>,
    #[serde(default)]
    focus: CertifiedFocus,
}

impl From<OpticalResidual> for WrittenResidual {
    fn from(of: OpticalResidual) -> WrittenResidual {
        WrittenResidual {
            times_noise: Some(of.ratio()),
            noise_grey_levels: of.floor_grey_levels,
            residual_grey_levels: None,
            focus: of.focus,
        }
    }
}

impl From<WrittenResidual> for OpticalResidual {
    fn from(of: WrittenResidual) -> OpticalResidual {
        let floor_grey_levels = of.noise_grey_levels;
        let by_times = of.times_noise.map(|times| times * floor_grey_levels);
        let residual_grey_levels = by_times.or(of.residual_grey_levels).unwrap_or_default();
        OpticalResidual { residual_grey_levels, floor_grey_levels, focus: of.focus }
    }
}

/// The focus at which the photograph of a finished picture is compared with the photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CertifiedFocus {
    /// The panel's: of a scene nearer or farther it says nothing.
    #[default]
    Panel,
    /// The photo's own, as far as it told which of those measured that is.
    Photo,
}

/// One step of a method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Iteration {
    /// RMS residual after the step, grey levels of 255.
    pub residual_grey_levels: f64,
    /// Captures made by then.
    pub captures: usize,
    /// Seconds passed by then.
    pub seconds: f64,
}

/// A photo that went through the whole pipeline.
#[derive(Debug)]
pub struct Restoration {
    /// What is delivered.
    pub outcome: Outcome,
    /// What the method made of it, delivered or not; nothing for a blank photo.
    pub solved: Option<Solved>,
}

impl Pipeline {
    /// `photo` restored on `rig` by `method` and judged, from the blank check to the [`Outcome`];
    /// `watch` is called after every step.
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
        let (mut outcome, solved) = if photo.observation.is_blank() {
            (Outcome::untouched(photo.photo.as_ref().clone(), self.why_blank(photo)), None)
        } else if photo.is_of_sharper_lens {
            (Outcome::untouched(photo.photo.as_ref().clone(), SHARPER), None)
        } else {
            let (outcome, solved) = self.restore_at_focus(rig, photo, method, watch)?;
            (outcome, Some(solved))
        };
        outcome.seconds = (self.stopwatch)() - begun;
        Ok(Restoration { outcome, solved })
    }

    /// A `photo` that is not blank, restored at its own focus; at the panel's where it turns out
    /// that no scene gives it at its own: its spectrum was none that scenes have.
    fn restore_at_focus(
        &self,
        rig: &mut Devices,
        photo: &Prepared<'_>,
        method: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<(Outcome, Solved), MethodError> {
        let solved = self.solve(rig, photo, method, watch)?;
        let mut outcome = self.judge(photo, &solved, watch)?;
        if let Some(certificate) = &mut outcome.certificate
            && !self.focuses.is_panel_alone()
        {
            certificate.focus = CertifiedFocus::Photo;
        }
        let Some(focus) = &photo.focus else { return Ok((outcome, solved)) };
        if outcome.verdict != Verdict::Untouched {
            outcome.notes.push(focus.told());
            return Ok((outcome, solved));
        }
        let at_panel = photo.at_panel();
        let mut again = self.solve(rig, &at_panel, method, watch)?;
        again.captures += solved.captures;
        again.capture_seconds += solved.capture_seconds;
        again.waited_seconds += solved.waited_seconds;
        let outcome = self.judge(&at_panel, &again, watch)?;
        Ok((outcome, again))
    }
}

impl Outcome {
    /// The `photo` itself, for a `reason`.
    pub fn untouched(photo: Frame<Work>, reason: impl Into<String>) -> Outcome {
        Outcome {
            picture: photo,
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
        }
    }

    /// What was `solved`, with the `evidence` for it.
    pub(super) fn of(solved: &Solved, evidence: Evidence) -> Outcome {
        let Certificate { optical_residual, noise_floor, .. } = solved.solution.certificate;
        let (stage, reason) = stage_of(solved);
        Outcome {
            picture: solved.picture.clone(),
            verdict: Verdict::Sound,
            method: solved.about.name,
            stage,
            reason,
            evidence: Some(evidence),
            certificate: optical_residual.map(|residual| OpticalResidual {
                residual_grey_levels: residual.into(),
                floor_grey_levels: noise_floor.into(),
                focus: CertifiedFocus::Panel,
            }),
            captures: solved.captures,
            seconds: 0.0,
            notes: Vec::new(),
            iterations: iterations(solved),
        }
    }
}

/// Noise over the camera's own above which a photo of nothing but noise is no blank one. Guess: the
/// noise at 64 times the gain.
const NOISE_OVER_CAMERA: f32 = 8.0;
/// Why a photo of nothing but noise is returned as it is.
const NOTHING_BUT_NOISE: &str = "from pixel to pixel the photo changes as much as anywhere, which \
                                 no lens lets through; it is dithered, screened as in print, or \
                                 hardly anything but noise";

impl Pipeline {
    /// Why a blank photo is returned as it is.
    fn why_blank(&self, photo: &Prepared<'_>) -> &'static str {
        let is_noisier = |&c: &Channel| {
            let camera = self.noise[c.index()].sigma(photo.photo.plane(c).mean() as f32);
            photo.observation.noise[c.index()] > NOISE_OVER_CAMERA * camera
        };
        match photo.observation.channels.list().iter().any(is_noisier) {
            true => NOTHING_BUT_NOISE,
            false => ResultStage::Photo.reason(),
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

/// The stage that produced a result, and why.
fn stage_of(solved: &Solved) -> (ResultStage, String) {
    let Certificate { corrections, optical_residual, .. } = solved.solution.certificate;
    match (corrections, optical_residual, solved.captures) {
        (1.., _, _) => (ResultStage::Captures, ResultStage::Captures.reason().to_owned()),
        (0, Some(_), _) => (ResultStage::LensModel, ResultStage::LensModel.reason().to_owned()),
        (0, None, 0) => {
            let reason = "the measured lens alone was used; no capture looked at the result";
            (ResultStage::LensModel, reason.to_owned())
        }
        (0, None, captures) => {
            let name = solved.about.name;
            let reason = format!(
                "the method `{name}` solves by captures, {captures} of them; none looked at the \
                 result"
            );
            (ResultStage::Captures, reason)
        }
    }
}

/// What the photograph of a finished picture says of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Confirmation {
    /// It is the photo.
    Full,
    /// It is, as far as strong noise lets one see.
    Noisy,
    /// It is nearly the photo.
    Nearly,
    /// It is another picture.
    Not,
}

/// Noise alone above which agreement says little, grey levels of 255. Guess: three times what a
/// photo at a sensor's highest useful gain has.
const NOISY_GREY_LEVELS: f64 = 12.0;

impl OpticalResidual {
    /// Residual over floor; 1 is perfect.
    pub fn ratio(&self) -> f64 {
        self.residual_grey_levels / self.floor_grey_levels.max(1e-9)
    }

    /// How large the residual is, in one number of which the smaller is the better.
    pub fn words(&self) -> String {
        match self.ratio() {
            r if r <= 1.0 => "no more than noise alone would leave".to_owned(),
            r => format!("{r:.2} times what noise alone would leave"),
        }
    }

    /// What it says of the picture. The steps are guesses: 1.25 is about what the spread of a noise
    /// estimate explains, 2 is three parts of unexplained light to one of noise.
    pub fn confirmation(&self) -> Confirmation {
        match self.ratio() {
            r if r <= 1.25 && self.floor_grey_levels > NOISY_GREY_LEVELS => Confirmation::Noisy,
            r if r <= 1.25 => Confirmation::Full,
            r if r <= 2.0 => Confirmation::Nearly,
            _ => Confirmation::Not,
        }
    }

    /// The same for one who drops photos and picks results up.
    pub fn meaning(&self) -> String {
        let said = match self.confirmation() {
            Confirmation::Full => "is your photo",
            Confirmation::Noisy => "is your photo as far as its strong noise lets one see",
            Confirmation::Nearly => "is nearly your photo",
            Confirmation::Not => "still differs from your photo",
        };
        let proviso = self.proviso();
        format!("Photographed through the lens again, this picture {said}{proviso}.")
    }

    /// On what it holds, to be added to what is said of it.
    pub fn proviso(&self) -> &'static str {
        match (self.confirmation(), self.focus) {
            (Confirmation::Not, _) | (_, CertifiedFocus::Photo) => "",
            (_, CertifiedFocus::Panel) => ", if the scene was as far away as the panel",
        }
    }
}
