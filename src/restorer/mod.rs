//! The restorer: the daemon's interface to restorations, and its implementation on a rig.
//!
//! | file | content |
//! |---|---|
//! | [`diffuser`] | the lens's own dark corner, on flash |
//! | [`on_rig`] | a rig with its [`Pipeline`](crate::pipeline::Pipeline) and its files |
//! | [`operating_point`] | the method and numbers chosen for the rig, on flash |
//! | [`photo_file`] | a photo that the rig takes, as a file |
//! | `binned` | a photo on a coarser grid of the solver |
//! | `baseline` | the pilot's reading from which drift is measured, on flash |
//! | `progress` | how far a restoration is |
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
    /// When that fails, too; the daemon then calls the operator with this error's message.
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure>;

    /// Shows `screen` until the next capture. A failure of the panel is reported by that capture.
    fn show(&mut self, screen: &Screen) {
        let _ = screen;
    }

    /// Takes a photo of the scene before the lens; `None` if the restorer takes none.
    ///
    /// # Errors
    /// When an exposure brings no frame.
    fn take(&mut self) -> Result<Option<TakenPhoto>, AnyFailure> {
        Ok(None)
    }

    /// Whether the panel is before the lens, so that captures can be made of it.
    ///
    /// # Errors
    /// When a capture brings no frame.
    fn look_for_panel(&mut self) -> Result<PanelView, AnyFailure> {
        Ok(PanelView::There)
    }

    /// Measures by the pilot picture how far the rig has drifted since its calibration; `None` if
    /// it cannot.
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
    /// In view, but its frame marks are not found: why.
    Askew(String),
    /// In place for captures.
    There,
}

/// How far a restoration is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Share done, 0..1.
    pub done: f32,
    /// The present activity, one or two words.
    pub doing: &'static str,
    /// Captures so far.
    pub captures: usize,
}

/// Longest file beside the calibration's slots.
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
