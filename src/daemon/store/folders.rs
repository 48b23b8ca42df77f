//! The five folders under one root, and where each thing lies in them.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::FolderError;
use crate::disk::Files;

/// The folders of a root, in the order of [`Folders`]' fields.
pub(super) const NAMES: [&str; 5] = ["inbox", "working", "outbox", "done", "failed"];

/// `inbox/ working/ outbox/ done/ failed/` under one root. Each may be a link to a folder elsewhere
/// on the same disk; within them no link is followed.
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

    /// The files of the disk they are on.
    pub fn files(&self) -> &Files {
        &self.files
    }

    /// The root, absolute: calibration and state are there.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where photos are dropped.
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

    /// Originals whose result is in the outbox.
    pub fn done(&self) -> &Path {
        &self.done
    }

    /// Originals that could not be restored, each with its reason.
    pub fn failed(&self) -> &Path {
        &self.failed
    }

    /// Pictures the gallery shows.
    pub fn previews(&self) -> &Path {
        &self.previews
    }

    /// All of them, each after the one it lies in.
    pub(super) fn all(&self) -> [&Path; 6] {
        let Folders { inbox, working, outbox, done, failed, previews, .. } = self;
        [inbox, working, outbox, done, failed, previews]
    }

    /// Where results that were withdrawn lie.
    pub(super) fn withdrawn(&self) -> PathBuf {
        self.outbox.join("withdrawn")
    }

    /// Whether the disk of the results has more than `floor_bytes` free. A disk that does not tell
    /// has.
    pub(super) fn room(&self, floor_bytes: u64) -> Result<(), FolderError> {
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
