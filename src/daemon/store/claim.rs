//! A photo in `working`: claimed, then closed or rejected.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use super::folders::Folders;
use super::ledger::Ledger;
use super::names::note_name;
use super::report_file::{Delivered, Failed};
use crate::disk::files::TakenNames;
use crate::disk::{FileError, Metadata};

/// The steps of a job that change the disk. The power may fail between any two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum JobStep {
    /// The photo is in `working`.
    Claimed,
    /// The attempt is recorded.
    Recorded,
    /// The picture is restored, in memory.
    Restored,
    /// The result's name is recorded.
    Named,
    /// The gallery's pictures and the report are in the outbox.
    Reported,
    /// The result is in the outbox.
    Delivered,
    /// The original is in `done`.
    Moved,
    /// The job's record is removed.
    Closed,
}

/// The name of the photo at `path`, relative to the inbox; names of folders become part of it.
pub(crate) fn flat_name(path: &Path) -> OsString {
    path.iter().collect::<Vec<&OsStr>>().join(OsStr::new("-"))
}

pub(crate) struct Claimed {
    pub(crate) path: PathBuf,
    pub(crate) name: OsString,
    /// Metadata when the photo was claimed.
    pub(crate) metadata: Metadata,
    pub(crate) ledger: Ledger,
    /// Whether its result is in the outbox, synchronised.
    pub(crate) delivered: bool,
}

impl Claimed {
    /// The photo at `path` with its record, if there is one.
    pub(crate) fn at(folders: &Folders, path: PathBuf) -> Result<Claimed, FileError> {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_owned();
        let metadata: Metadata = folders.files.metadata(&path)?;
        let ledger = Ledger::of(folders, &name, metadata)?;
        Ok(Claimed { path, name, metadata, ledger, delivered: false })
    }

    pub(crate) fn display_name(&self) -> String {
        self.name.to_string_lossy().into_owned()
    }

    /// Moves the original of a delivered photo to `done`, then removes the record.
    pub(crate) fn close(
        &self,
        folders: &Folders,
        step: &mut dyn FnMut(JobStep),
    ) -> Result<Delivered, FileError> {
        let (files, done) = (&folders.files, &folders.done);
        let kept = files.move_to(&self.path, done, &self.name)?;
        step(JobStep::Moved);
        // Before the record is removed: without it the photo would be restored a second time.
        files.sync_folder(done)?;
        let result = self.ledger.result().unwrap_or_default();
        self.ledger.close(folders)?;
        step(JobStep::Closed);
        Ok(Delivered { kept: kept.file_name().unwrap_or(&self.name).to_owned(), result })
    }

    /// Moves the photo to `failed`, with `reason` in a note beside it.
    pub(crate) fn reject(&self, folders: &Folders, reason: String) -> Result<Failed, FileError> {
        let failed = Failed { photo: self.display_name(), reason };
        let (files, folder) = (&folders.files, &folders.failed);
        // A note without its photo is left over from a power cut, and is overwritten.
        files.with_free_name(folder, &self.name, &TakenNames::holds, &mut |name| {
            // The note first: no photo may be in `failed` without its reason.
            files.replace_for_good(&folder.join(note_name(name)), failed.note().as_bytes())?;
            files.rename_new(&self.path, &folder.join(name))
        })?;
        // Before the record is removed: without it the photo would be tried again. And before the
        // next photo of this name is claimed, which a power cut could let replace this one.
        files.sync_folder(folder)?;
        self.ledger.close(folders)?;
        Ok(failed)
    }
}
