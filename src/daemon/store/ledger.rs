//! The record of a photo under way, from which an interrupted job is recovered.
//!
//! It is one small file per photo, in `working`, with the identity of the photo's file, the number
//! of attempts and the name of the result. A photo that ends the program or its worker each time is
//! rejected after [`ATTEMPTS_MAX`] attempts; a delivered result is not made again; a later photo of
//! the same name is recognised as another.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::folders::Folders;
use super::names::{RECORD_PREFIX, record_name};
use crate::disk::files::json;
use crate::disk::{FileError, Metadata};

/// Number of attempts ending the program or its worker after which a photo is rejected. Guess.
pub(crate) const ATTEMPTS_MAX: u32 = 3;

#[derive(Debug)]
pub(crate) struct Ledger {
    path: PathBuf,
    entry: LedgerEntry,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct LedgerEntry {
    /// The photo's name; names are bytes.
    photo: Vec<u8>,
    file: FileIdentity,
    attempts: u32,
    result: Option<Vec<u8>>,
}

/// Identity of the file a record belongs to, which moving the file keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FileIdentity {
    inode: u64,
    size: u64,
    changed: (i64, i64),
}

impl From<Metadata> for FileIdentity {
    fn from(metadata: Metadata) -> FileIdentity {
        FileIdentity { inode: metadata.inode, size: metadata.size, changed: metadata.changed }
    }
}

impl Ledger {
    /// The record of the photo `name` with the identity in `metadata`, read from the disk or new.
    ///
    /// # Errors
    /// When the record cannot be read: nothing may be decided without it.
    pub(super) fn of(
        folders: &Folders,
        name: &OsStr,
        metadata: Metadata,
    ) -> Result<Ledger, FileError> {
        let path = folders.working.join(record_name(name));
        let found: Option<LedgerEntry> = folders.files.read_json(&path)?;
        let entry =
            found.filter(|e| e.photo == name.as_bytes() && e.file == FileIdentity::from(metadata));
        let photo = name.as_bytes().to_vec();
        let new = || LedgerEntry { photo, file: metadata.into(), attempts: 0, result: None };
        Ok(Ledger { path, entry: entry.unwrap_or_else(new) })
    }

    /// Removes the records of photos that are not in the inbox.
    pub(super) fn sweep(folders: &Folders) -> Result<(), FileError> {
        let (files, folder) = (&folders.files, &folders.working);
        for (name, _) in files.list(folder)? {
            if !name.as_bytes().starts_with(RECORD_PREFIX.as_bytes()) {
                continue;
            }
            let path = folder.join(name);
            let waits = files.read_json(&path)?.is_some_and(|entry: LedgerEntry| {
                let home = folders.inbox.join(OsString::from_vec(entry.photo));
                files.metadata(&home).is_ok_and(|l| FileIdentity::from(l) == entry.file)
            });
            if !waits {
                files.remove(&path)?;
            }
        }
        Ok(())
    }

    pub(crate) fn attempts(&self) -> u32 {
        self.entry.attempts
    }

    pub(super) fn result(&self) -> Option<OsString> {
        self.entry.result.clone().map(OsString::from_vec)
    }

    pub(crate) fn begin(&mut self, folders: &Folders) -> Result<(), FileError> {
        self.entry.attempts += 1;
        self.entry.result = None;
        self.write(folders)
    }

    pub(super) fn name_result(
        &mut self,
        folders: &Folders,
        result: &OsStr,
    ) -> Result<(), FileError> {
        self.entry.result = Some(result.as_bytes().to_vec());
        self.write(folders)
    }

    /// Records that the named result will not be delivered under this attempt. Not synchronised: a
    /// damaged record names no result either, and if the change is lost, the next start decides the
    /// same.
    pub(super) fn forget_result(&mut self, folders: &Folders) -> Result<(), FileError> {
        self.entry.result = None;
        folders.files.replace_for_now(&self.path, &json(&self.entry, &self.path)?)
    }

    pub(super) fn close(&self, folders: &Folders) -> Result<(), FileError> {
        folders.files.remove(&self.path)
    }

    fn write(&self, folders: &Folders) -> Result<(), FileError> {
        folders.files.replace_for_good(&self.path, &json(&self.entry, &self.path)?)
    }
}
