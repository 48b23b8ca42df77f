//! What is written down before a photo is touched, so that a stop at any instant can be made good.
//!
//! One small file a photo under way, in `working/`: how often it was begun, and the name its result will
//! have. A photo that ends the program each time is set aside after [`ATTEMPTS_MAX`]; a result that was
//! delivered is not made again.

use std::ffi::{OsStr, OsString};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{DaemonError, Folders, durable};

/// Attempts that may end with the program before a photo is set aside. Guess.
pub(super) const ATTEMPTS_MAX: u32 = 3;

/// Beginning of the records' file names.
const BEGINNING: &str = ".ledger-";

/// The record of one photo under way.
#[derive(Debug)]
pub(super) struct Ledger {
    folder: PathBuf,
    file: OsString,
    written: Written,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Written {
    /// The photo's name; names are bytes.
    photo: Vec<u8>,
    attempts: u32,
    result: Option<Vec<u8>>,
}

impl Ledger {
    /// The record of the photo `name`, as found on the disk or new.
    pub(super) fn of(folders: &Folders, name: &OsStr) -> Ledger {
        let folder = folders.working();
        let file = OsString::from(format!("{BEGINNING}{}", id(name)));
        let found = std::fs::read(folder.join(&file)).ok();
        let found = found.and_then(|bytes| serde_json::from_slice::<Written>(&bytes).ok());
        let written = found.filter(|w| w.photo == name.as_bytes());
        let written =
            written.unwrap_or_else(|| Written { photo: name.as_bytes().to_vec(), ..Written::default() });
        Ledger { folder, file, written }
    }

    /// Removes the records of photos that have left: one dropped later under the same name is another one.
    pub(super) fn sweep(folders: &Folders) -> Result<(), DaemonError> {
        let folder = folders.working();
        let entries = std::fs::read_dir(&folder).map_err(DaemonError::files("read the folder", &folder))?;
        for entry in entries.flatten() {
            if !entry.file_name().as_bytes().starts_with(BEGINNING.as_bytes()) {
                continue;
            }
            let path = entry.path();
            let written = std::fs::read(&path).ok().and_then(|b| serde_json::from_slice::<Written>(&b).ok());
            // A result still named was delivered: the record is of a photo that is in `done`.
            let waits = |w: Written| {
                let home = folders.inbox().join(OsString::from_vec(w.photo));
                w.result.is_none() && home.symlink_metadata().is_ok()
            };
            if !written.is_some_and(waits) {
                std::fs::remove_file(&path).map_err(DaemonError::files("remove", &path))?;
            }
        }
        Ok(())
    }

    /// Attempts begun so far.
    pub(super) fn attempts(&self) -> u32 {
        self.written.attempts
    }

    /// The name chosen for the result.
    pub(super) fn result(&self) -> Option<OsString> {
        self.written.result.clone().map(OsString::from_vec)
    }

    /// Writes down that an attempt begins.
    pub(super) fn begin(&mut self) -> Result<(), DaemonError> {
        self.written.attempts += 1;
        self.written.result = None;
        self.write()
    }

    /// Writes down the name the result will have.
    pub(super) fn name_result(&mut self, result: &OsStr) -> Result<(), DaemonError> {
        self.written.result = Some(result.as_bytes().to_vec());
        self.write()
    }

    /// Writes down that the result named was not delivered and never will be under this attempt.
    pub(super) fn forget_result(&mut self) -> Result<(), DaemonError> {
        self.written.result = None;
        self.write()
    }

    /// Removes the record; the photo has left `working`.
    pub(super) fn close(self) -> Result<(), DaemonError> {
        let path = self.folder.join(&self.file);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(DaemonError::files("remove", &path)(error))
            }
            _ => Ok(()),
        }
    }

    fn write(&self) -> Result<(), DaemonError> {
        let bytes = serde_json::to_vec(&self.written).map_err(std::io::Error::other);
        durable::replace(&self.folder, &self.file, &bytes.map_err(DaemonError::files("write", &self.folder))?)
    }
}

/// A short name for a name: 16 hexadecimal digits.
pub(super) fn id(name: &OsStr) -> String {
    let mut hasher = DefaultHasher::new();
    name.as_bytes().hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}
