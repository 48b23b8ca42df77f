//! A photo in `working`: claimed, and in the end closed or set aside.

use std::ffi::{OsStr, OsString};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::folders::Folders;
use super::ledger::Ledger;
use super::report_file::{Delivered, Failed};
use crate::disk::files::numbered;
use crate::disk::{FileError, FileKind, Look};

/// The steps of a job at which the disk has changed. Between any two the power may fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum JobStep {
    /// The photo is in `working`.
    Claimed,
    /// The attempt is written down.
    Recorded,
    /// The picture is restored and held in memory.
    Restored,
    /// The result's name is written down.
    Named,
    /// The gallery's pictures and the report are in the outbox.
    Reported,
    /// The result is in the outbox.
    Delivered,
    /// The original is in `done`.
    Moved,
    /// The record of the job is removed.
    Closed,
}

impl JobStep {
    /// All steps in order.
    pub const ALL: [JobStep; 8] = [
        JobStep::Claimed,
        JobStep::Recorded,
        JobStep::Restored,
        JobStep::Named,
        JobStep::Reported,
        JobStep::Delivered,
        JobStep::Moved,
        JobStep::Closed,
    ];
}

/// What became of a claim.
pub(crate) enum Claim {
    /// The photo's new path.
    Path(PathBuf),
    /// It was gone before.
    Gone,
    /// It cannot be moved, though others may be.
    Refused(FileError),
}

/// Moves the photo at `way` from the inbox to `working`.
pub(crate) fn claim(folders: &Folders, way: &Path) -> Result<Claim, FileError> {
    // The names of the folders it lies in become part of its own.
    let flat = way.iter().collect::<Vec<&OsStr>>().join(OsStr::new("-"));
    let from = folders.inbox().join(way);
    match folders.files().move_to_own(&from, folders.working(), &flat) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Claim::Gone),
        Err(error) if error.is_about(&from) && !error.is_of_disk() => Ok(Claim::Refused(error)),
        moved => moved.map(Claim::Path),
    }
}

/// A photo in `working`.
pub(crate) struct Claimed {
    pub(crate) path: PathBuf,
    pub(crate) name: OsString,
    pub(crate) kind: FileKind,
    pub(crate) ledger: Ledger,
    /// Its result is in the outbox, and safe.
    pub(crate) delivered: bool,
}

impl Claimed {
    /// The photo at `path`, with the record there is of it.
    pub(crate) fn at(folders: &Folders, path: PathBuf) -> Result<Claimed, FileError> {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_owned();
        let look: Look = folders.files().look(&path)?;
        let ledger = Ledger::of(folders, &name, look)?;
        Ok(Claimed { path, name, kind: look.kind, ledger, delivered: false })
    }

    /// Its name, for people.
    pub(crate) fn shown(&self) -> String {
        self.name.to_string_lossy().into_owned()
    }

    /// Closes the job of a photo whose result is safe: so is the original, and only then the record
    /// goes.
    pub(crate) fn close(
        &self,
        folders: &Folders,
        step: &mut dyn FnMut(JobStep),
    ) -> Result<Delivered, FileError> {
        let (files, done) = (folders.files(), folders.done());
        let kept = files.move_to(&self.path, done, &self.name)?;
        step(JobStep::Moved);
        // Before the record goes: without it the photo would be restored a second time.
        files.sync_folder(done)?;
        let result = self.ledger.result().unwrap_or_default();
        self.ledger.close(folders)?;
        step(JobStep::Closed);
        Ok(Delivered { kept: kept.file_name().unwrap_or(&self.name).to_owned(), result })
    }

    /// Sets the photo aside with its reason.
    pub(crate) fn set_aside(&self, folders: &Folders, reason: String) -> Result<Failed, FileError> {
        let failed = Failed { photo: self.shown(), reason };
        let (files, folder) = (folders.files(), folders.failed());
        // A note without its photo is what a cut left of us, and is written anew.
        let taken = files.taken_names(folder)?;
        for name in numbered(&self.name).filter(|name| !taken.holds(name)) {
            let mut note = name.clone();
            note.push(".txt");
            // The reason first: a photo set aside without one would be a riddle.
            files.replace_for_good(folder, &note, failed.note().as_bytes())?;
            match files.rename_new(&self.path, &folder.join(&name)) {
                // The name was taken since the look.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                done => {
                    done?;
                    break;
                }
            }
        }
        files.sync_folder(folder)?;
        self.ledger.close(folders)?;
        Ok(failed)
    }
}
