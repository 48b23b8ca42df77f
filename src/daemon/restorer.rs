//! The seam to what restores: the daemon hands over a photo and gets a picture and its story.

use serde::{Deserialize, Serialize};

use crate::frame::{Frame, Work};
use crate::kiosk::screen::Screen;
use crate::nights::pilot::Drift;
use crate::picture::Photo;
use crate::remedy::{AnyFailure, Remedy};

/// Restores photos with one rig.
pub trait Restorer {
    /// Restores `photo`, telling `progress` now and then.
    ///
    /// # Errors
    /// Whatever keeps this photo or the rig from it, with its remedy.
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Restored, AnyFailure>;

    /// Does what a failure asked for: [`Remedy::Recalibrate`] or [`Remedy::ReopenRig`].
    ///
    /// # Errors
    /// When that fails, too; the daemon then calls the operator with this error's words.
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure>;

    /// Shows `screen` until the next capture. A panel that cannot is told of by the next capture.
    fn show(&mut self, screen: &Screen) {
        let _ = screen;
    }

    /// Shows the pilot picture and tells how far the rig has drifted since it was calibrated;
    /// `None` when it has no way to tell.
    ///
    /// # Errors
    /// When a capture fails.
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        Ok(None)
    }
}

/// How far a restoration is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Share done, 0..1.
    pub done: f32,
    /// What is being done, one word or two.
    pub doing: &'static str,
    /// Captures so far.
    pub captures: usize,
}

/// A restored photo and what the report says about it.
#[derive(Debug, Clone)]
pub struct Restored {
    /// The picture, linear light 0..255, photo-size, the photo's stored orientation.
    pub picture: Frame<Work>,
    /// The photo itself is the best that can be given: its file goes out unchanged. The reason is
    /// in `notes`.
    pub untouched: bool,
    /// Name of the method.
    pub method: String,
    /// Rung of the ladder, 0..=3 (design: how much model the photo needed).
    pub rung: u8,
    /// Why this rung, in words.
    pub rung_reason: String,
    /// Captures made for this photo.
    pub captures: usize,
    /// Seconds it took, captures included.
    pub seconds: f64,
    /// The optical residual of the finished picture, if a capture was made of it.
    pub certificate: Option<Certificate>,
    /// Sentences for the customer.
    pub notes: Vec<String>,
    /// The method's record.
    pub iterations: Vec<Iteration>,
}

/// The optical residual of a finished picture: is its photograph the photo?
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Certificate {
    /// RMS difference between the picture's photograph and the photo, grey levels of 255.
    pub residual_grey_levels: f64,
    /// What noise alone would leave, grey levels of 255.
    pub floor_grey_levels: f64,
}

impl Certificate {
    /// Residual over floor; 1 is perfect.
    pub fn ratio(&self) -> f64 {
        self.residual_grey_levels / self.floor_grey_levels.max(1e-9)
    }

    /// What it means, for one who drops photos and picks results up. The steps are guesses: 1.25 is
    /// about what the spread of a noise estimate explains, 2 is three parts of unexplained light to
    /// one of noise.
    pub fn meaning(&self) -> &'static str {
        match self.ratio() {
            r if r <= 1.25 => "Photographed through the lens again, this picture is your photo.",
            r if r <= 2.0 => {
                "Photographed through the lens again, this picture is nearly your photo."
            }
            _ => "Photographed through the lens again, this picture still differs from your photo.",
        }
    }
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
