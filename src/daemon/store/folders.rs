//! Paths of the five folders under one root.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::FolderError;
use crate::disk::Files;

/// Names of the folders, in the order of [`Folders`]' fields.
pub(super) const NAMES: [&str; 5] = ["inbox", "working", "outbox", "done", "failed"];

/// `inbox`, `working`, `outbox`, `done` and `failed` under one root. Each may be a link to a folder
/// elsewhere; links inside them are not followed.
#[derive(Clone)]
pub struct Folders {
    files: Files,
    root: PathBuf,
    inbox: PathBuf,
    working: PathBuf,
    outbox: PathBuf,
    done: PathBuf,
    failed: PathBuf,
    previews: PathBuf,
    /// Held for as long as a copy of this value lives.
    _lock: Option<Arc<File>>,
}

impl std::fmt::Debug for Folders {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Folders").field("root", &self.root).finish_non_exhaustive()
    }
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

    /// The disk.
    pub fn files(&self) -> &Files {
        &self.files
    }

    /// The root, absolute; it holds calibration and state.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Photos dropped.
    pub fn inbox(&self) -> &Path {
        &self.inbox
    }

    /// Photos being restored.
    pub fn working(&self) -> &Path {
        &self.working
    }

    /// Results, their reports and the gallery.
    pub fn outbox(&self) -> &Path {
        &self.outbox
    }

    /// Originals with a result in the outbox.
    pub fn done(&self) -> &Path {
        &self.done
    }

    /// Rejected originals, each with a note.
    pub fn failed(&self) -> &Path {
        &self.failed
    }

    /// Pictures of the gallery.
    pub fn previews(&self) -> &Path {
        &self.previews
    }

    /// All folders, each after its parent.
    pub(super) fn all(&self) -> [&Path; 6] {
        let Folders { inbox, working, outbox, done, failed, previews, .. } = self;
        [inbox, working, outbox, done, failed, previews]
    }

    /// Withdrawn results.
    pub(super) fn withdrawn(&self) -> PathBuf {
        self.outbox.join("withdrawn")
    }

    /// Checks that the disk of the results has at least `floor_bytes` free; passes where the free
    /// space is unknown.
    ///
    /// # Errors
    /// [`FolderError::Full`].
    pub(crate) fn check_free_space(&self, floor_bytes: u64) -> Result<(), FolderError> {
        const MIB: u64 = 1 << 20;
        for folder in [&self.outbox, &self.working] {
            match self.files.free_bytes(folder) {
                Ok(free) if free < floor_bytes => {
                    let (found_mib, floor_mib) = (free / MIB, floor_bytes.div_ceil(MIB));
                    return Err(FolderError::Full { path: folder.clone(), found_mib, floor_mib });
                }
                Ok(_) => {}
                Err(error) => log::debug!("{error}"),
            }
        }
        Ok(())
    }
}
