//! What restores photos for the daemon: the seam to it, and the restorer that stands on a rig.
//!
//! | file | what it holds |
//! |---|---|
//! | [`diffuser`] | the lens's own dark corner, on flash |
//! | [`on_rig`] | a rig, its [`Pipeline`](crate::pipeline::Pipeline) and what is kept beside it |
//! | [`operating_point`] | the method and numbers chosen for the rig, on flash |
//! | [`photo_file`] | a photo that the rig takes, as a file |
//! | `baseline` | the pilot's reading that drift is counted from, on flash |

mod baseline;
pub mod diffuser;
pub mod focus;
pub mod on_rig;
pub mod operating_point;
pub mod photo_file;
mod progress;
mod provenance;

use std::io::Read;
use std::path::Path;

use crate::disk::{Disk, LocalDisk, Unsynced};
use crate::kiosk::screen::Screen;
use crate::nights::pilot::Drift;
use crate::picture::Photo;
use crate::pipeline::Outcome;
use crate::remedy::{AnyFailure, Remedy};

use photo_file::TakenPhoto;

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
    ) -> Result<Outcome, AnyFailure>;

    /// Does what a failure asked for: [`Remedy::Recalibrate`] or [`Remedy::ReopenRig`].
    ///
    /// # Errors
    /// When that fails, too; the daemon then calls the operator with this error's words.
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure>;

    /// Shows `screen` until the next capture. A panel that cannot is told of by the next capture.
    fn show(&mut self, screen: &Screen) {
        let _ = screen;
    }

    /// Takes a photo of what is before the lens; `None` when it takes none.
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

    /// Shows the pilot picture and tells how far the rig has drifted since it was calibrated;
    /// `None` when it has no way to tell.
    ///
    /// # Errors
    /// When a capture fails.
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        Ok(None)
    }
}

/// What the camera sees of the panel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PanelView {
    /// Nothing.
    Absent,
    /// Its light, but not so that captures can be told apart: why.
    Askew(String),
    /// All that captures need.
    There,
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

/// What [`keep`] put there.
fn kept(folder: &Path, name: &str) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let disk = LocalDisk::new(vec![folder.to_owned()]);
    disk.open(&folder.join(name))?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Puts `bytes` into `folder/name` in place of what is there, whole or not at all.
fn keep(folder: &Path, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    let folder = folder.canonicalize()?;
    let disk = LocalDisk::new(vec![folder.clone()]);
    let fresh = folder.join(format!("{name}.new"));
    disk.write(&fresh, &mut &*bytes).and_then(Unsynced::sync)?;
    disk.rename(&fresh, &folder.join(name))?;
    disk.sync_folder(&folder)
}
