//! What is written down before a photo is touched, so that a stop at any instant can be made good.
//!
//! One small file a photo under way, in `working/`: which file it is, how often it was begun, and
//! the name its result will have. A photo that ends the program or its worker each time is set
//! aside after [`ATTEMPTS_MAX`]; a result that was delivered is not made again; a namesake dropped
//! later is another photo.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::folders::Folders;
use crate::disk::files::json;
use crate::disk::{FileError, Look};

/// Attempts that may end with the program or the worker before a photo is set aside. Guess.
pub(crate) const ATTEMPTS_MAX: u32 = 3;

/// Beginning of the records' file names.
const BEGINNING: &str = ".ledger-";

/// No record is longer: two names of 255 bytes as lists of numbers.
const BYTES_MAX: u64 = 8192;

/// The record of one photo under way.
#[derive(Debug)]
pub(crate) struct Ledger {
    folder: PathBuf,
    file: OsString,
    written: LedgerEntry,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct LedgerEntry {
    /// The photo's name; names are bytes.
    photo: Vec<u8>,
    file: Which,
    attempts: u32,
    result: Option<Vec<u8>>,
}

/// Which file a record is of. Moving a file changes none of this.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Which {
    inode: u64,
    size: u64,
    changed: (i64, i64),
}

impl From<Look> for Which {
    fn from(look: Look) -> Which {
        Which { inode: look.inode, size: look.size, changed: look.changed }
    }
}

impl Ledger {
    /// The record of the photo `name`, which looks like `look`: as found on the disk, or new.
    /// When the disk cannot say whether there is one, nothing may be decided.
    pub(super) fn of(folders: &Folders, name: &OsStr, look: Look) -> Result<Ledger, FileError> {
        let folder = folders.working().to_owned();
        let file = OsString::from(format!("{BEGINNING}{}", id(name)));
        let found: Option<LedgerEntry> =
            folders.files().read_json(&folder.join(&file), BYTES_MAX)?;
        let written = found.filter(|w| w.photo == name.as_bytes() && w.file == Which::from(look));
        let photo = name.as_bytes().to_vec();
        let fresh = || LedgerEntry { photo, file: look.into(), attempts: 0, result: None };
        Ok(Ledger { folder, file, written: written.unwrap_or_else(fresh) })
    }

    /// Removes the records of photos that wait nowhere any more.
    pub(super) fn sweep(folders: &Folders) -> Result<(), FileError> {
        for (path, entry) in entries(folders)? {
            let waits = entry.is_some_and(|entry| {
                let home = folders.inbox().join(OsString::from_vec(entry.photo));
                folders.files().look(&home).is_ok_and(|look| Which::from(look) == entry.file)
            });
            if !waits {
                folders.files().remove(&path)?;
            }
        }
        Ok(())
    }

    /// Names of the results that photos under way have been promised.
    pub(super) fn promised(folders: &Folders) -> Result<Vec<OsString>, FileError> {
        let results = entries(folders)?.into_iter().filter_map(|(_, entry)| entry?.result);
        Ok(results.map(OsString::from_vec).collect())
    }

    /// Attempts begun so far.
    pub(crate) fn attempts(&self) -> u32 {
        self.written.attempts
    }

    /// The name chosen for the result.
    pub(super) fn result(&self) -> Option<OsString> {
        self.written.result.clone().map(OsString::from_vec)
    }

    /// Writes down that an attempt begins, so that it is known whatever comes of it.
    pub(crate) fn begin(&mut self, folders: &Folders) -> Result<(), FileError> {
        self.written.attempts += 1;
        self.written.result = None;
        self.write(folders)
    }

    /// Writes down the name the result will have.
    pub(super) fn name_result(
        &mut self,
        folders: &Folders,
        result: &OsStr,
    ) -> Result<(), FileError> {
        self.written.result = Some(result.as_bytes().to_vec());
        self.write(folders)
    }

    /// Writes down that the result named was not delivered and never will be under this attempt.
    /// Should a cut garble this, a record that cannot be read names no result either; should it be
    /// forgotten, the next start comes to the same.
    pub(super) fn forget_result(&mut self, folders: &Folders) -> Result<(), FileError> {
        self.written.result = None;
        folders.files().replace_for_now(&self.folder, &self.file, &self.bytes()?)
    }

    /// Removes the record; the photo has left `working` for good, or the attempts are forgiven.
    pub(super) fn close(&self, folders: &Folders) -> Result<(), FileError> {
        folders.files().remove(&self.folder.join(&self.file))
    }

    fn write(&self, folders: &Folders) -> Result<(), FileError> {
        folders.files().replace_for_good(&self.folder, &self.file, &self.bytes()?)
    }

    fn bytes(&self) -> Result<Vec<u8>, FileError> {
        json(&self.written, &self.folder)
    }
}

/// The records in `working` with their paths; `None` where one cannot be understood.
fn entries(folders: &Folders) -> Result<Vec<(PathBuf, Option<LedgerEntry>)>, FileError> {
    let (files, folder) = (folders.files(), folders.working());
    let names = files.list(folder)?.into_iter().map(|(name, _)| name);
    let records = names.filter(|name| name.as_bytes().starts_with(BEGINNING.as_bytes()));
    let read = |name| {
        let path = folder.join(name);
        files.read_json(&path, BYTES_MAX).map(|entry| (path, entry))
    };
    records.map(read).collect()
}

/// A short name for a name, the same for ever: 64-bit FNV-1a in 16 hexadecimal digits.
pub(super) fn id(name: &OsStr) -> String {
    // Fowler, Noll, Vo: offset basis and prime for 64 bits.
    let step = |hash: u64, &byte: &u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    format!("{:016x}", name.as_bytes().iter().fold(0xcbf2_9ce4_8422_2325, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_those_of_the_published_test_vectors() {
        assert_eq!(id(OsStr::new("")), "cbf29ce484222325");
        assert_eq!(id(OsStr::new("foobar")), "85944171f73967e8");
    }
}
