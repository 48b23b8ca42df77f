//! Paths of the five folders under one root.

use std::fs::File;
use std::io::ErrorKind::{StorageFull, Unsupported};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::daemon::error::DaemonError;
use crate::disk::Files;

/// Names of the folders, in the order of [`Folders`]' fields.
pub(super) const NAMES: [&str; 5] = ["inbox", "working", "outbox", "done", "failed"];

/// `inbox`, `working`, `outbox`, `done` and `failed` under one root. Each may be a link to a folder
/// elsewhere; links inside them are not followed.
#[derive(Clone)]
pub struct Folders {
    /// The disk.
    pub files: Files,
    /// The root, absolute; it holds calibration and state.
    pub root: PathBuf,
    /// Dropped photos, which wait to be restored.
    pub inbox: PathBuf,
    /// Photos being restored.
    pub working: PathBuf,
    /// Results, their reports and the gallery.
    pub outbox: PathBuf,
    /// Originals with a result in the outbox.
    pub done: PathBuf,
    /// Rejected originals, each with a note.
    pub failed: PathBuf,
    /// Pictures of the gallery.
    pub previews: PathBuf,
    /// Lock of the root, held for as long as a copy of this value lives.
    _lock: Option<Arc<File>>,
}

impl Folders {
    /// The folders at `places`, in the order of [`NAMES`], kept from other processes by `lock`.
    pub(super) fn at(
        files: Files,
        root: PathBuf,
        places: [PathBuf; 5],
        lock: Option<File>,
    ) -> Folders {
        let [inbox, working, outbox, done, failed] = places;
        let (previews, _lock) = (outbox.join("gallery"), lock.map(Arc::new));
        Folders { files, root, inbox, working, outbox, done, failed, previews, _lock }
    }

    /// All folders, each after its parent.
    pub(super) fn all(&self) -> [&Path; 6] {
        let Folders { inbox, working, outbox, done, failed, previews, .. } = self;
        [inbox, working, outbox, done, failed, previews]
    }

    pub(super) fn withdrawn(&self) -> PathBuf {
        self.outbox.join("withdrawn")
    }

    /// Checks that all five folders exist, and that all but the inbox have room for files and at
    /// least `floor_bytes` free. Unknown free space passes the check.
    pub(crate) fn check_space(&self, floor_bytes: u64) -> Result<(), DaemonError> {
        const MIB: u64 = 1 << 20;
        let Folders { files, inbox, working, outbox, done, failed, .. } = self;
        match files.free_bytes(inbox) {
            Err(error) if !matches!(error.kind(), Unsupported | StorageFull) => Err(error)?,
            _ => {}
        }
        for path in [outbox, working, done, failed] {
            match files.free_bytes(path) {
                Ok(free) if free < floor_bytes => {
                    let (found_mib, floor_mib) = (free / MIB, floor_bytes.div_ceil(MIB));
                    return Err(DaemonError::Full { path: path.clone(), found_mib, floor_mib });
                }
                Err(error) if error.kind() != Unsupported => return Err(error.into()),
                _ => {}
            }
        }
        Ok(())
    }
}
