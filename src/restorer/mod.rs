//! The restorer: the daemon's interface to restorations, and its implementation on a rig.
//!
//! | file | content |
//! |---|---|
//! | [`diffuser`] | vignetting of the lens alone, kept on flash |
//! | [`focus`] | the lens at focuses other than the panel's |
//! | [`on_rig`] | a rig with its [`Pipeline`](crate::pipeline::Pipeline) and its files |
//! | [`operating_point`] | the method and its settings chosen for the rig, kept on flash |
//! | [`photo_file`] | a photo that the rig takes, as a file |
//! | `binned` | a photo binned to the solver's coarser grid |
//! | `baseline` | the pilot's reading from which drift is measured, kept on flash |
//! | `progress` | progress of a restoration |
//! | `provenance` | which camera took a raw photo |

mod baseline;
mod binned;
pub mod diffuser;
pub mod focus;
pub mod on_rig;
pub mod operating_point;
pub mod photo_file;
mod progress;
mod provenance;

use std::path::Path;

use crate::config::RigFile;
use crate::disk::{FileError, Files};
use crate::kiosk::screen::Screen;
use crate::nights::pilot::Drift;
use crate::picture::Photo;
use crate::pipeline::Outcome;
use crate::remedy::{AnyFailure, Remedy};

use photo_file::TakenPhoto;

/// Restores photos with one rig.
pub trait Restorer {
    /// Restores `photo`, and reports `progress`.
    ///
    /// # Errors
    /// Any failure of the photo or the rig, with its remedy.
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure>;

    /// Carries out a failure's remedy: [`Remedy::Recalibrate`] or [`Remedy::ReopenRig`].
    ///
    /// # Errors
    /// When the remedy fails; the daemon then calls the operator with this error's message.
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure>;

    /// Shows `screen` until the next capture. A failure of the panel is reported by that capture.
    fn show(&mut self, screen: &Screen) {
        let _ = screen;
    }

    /// Takes a photo of the scene before the lens; `None` if the restorer takes none.
    ///
    /// # Errors
    /// When an exposure yields no frame.
    fn take(&mut self) -> Result<Option<TakenPhoto>, AnyFailure> {
        Ok(None)
    }

    /// Looks whether the panel is before the lens, as captures need it.
    ///
    /// # Errors
    /// When a capture yields no frame.
    fn look_for_panel(&mut self) -> Result<PanelView, AnyFailure> {
        Ok(PanelView::There)
    }

    /// Measures the drift of the rig since its calibration with the pilot picture; `None` if the
    /// restorer has none.
    ///
    /// # Errors
    /// When a capture fails.
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        Ok(None)
    }
}

/// The panel as the camera sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PanelView {
    /// Not in view.
    Absent,
    /// In view, but its frame marks are not found; holds the reason.
    Askew(String),
    /// In place for captures.
    There,
}

/// Progress of a restoration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Share done, 0..1.
    pub done: f32,
    /// The present activity, one or two words.
    pub doing: &'static str,
    /// Captures so far.
    pub captures: usize,
}

/// Identity of `rig` in text files, in hexadecimal because JSON numbers have only 53 bits.
fn identity(rig: &RigFile) -> String {
    format!("{:016x}", rig.identity)
}

/// Limit of the length of a file beside the calibration's slots, bytes.
const BYTES_MAX: u64 = 16 << 20;

/// The file `name` beside the calibration's slots; `None` if there is none.
fn kept(slots: &Path, name: &str) -> Result<Option<Vec<u8>>, FileError> {
    Files::beneath(vec![slots.to_owned()]).read(&slots.join(name), BYTES_MAX)
}

/// Replaces the file `name` beside the calibration's slots, whole or not at all.
fn keep(slots: &Path, name: &str, bytes: &[u8]) -> Result<(), FileError> {
    let files = Files::beneath(vec![slots.to_owned()]);
    files.sweep(slots)?;
    files.replace_for_good(&slots.join(name), bytes)
}
