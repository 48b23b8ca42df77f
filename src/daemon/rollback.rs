//! Making good what an error left of a job while the daemon lives: disks that were full, gone or
//! failing.
//!
//! A start makes good what it finds on the disk, for what it finds has lasted. Within a life more
//! care is needed: after a failed synchronisation the system shows a file that may not be on the
//! disk at all, and would say of it, asked again, that it is safe. So a result that was not
//! delivered without an error is taken back and made anew.

use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::PathBuf;

use super::ledger::Ledger;
use super::run::Daemon;
use super::{DaemonError, atomic_file, recovery};

impl Daemon<'_> {
    /// Brings the photo `name` out of `working`: to `done` when its result was `delivered`, else
    /// back into the inbox as if it had never been begun; the way to it there.
    ///
    /// # Errors
    /// When the disk still fails. Asked again, this comes to the same.
    pub(super) fn settle(
        &self,
        name: &OsStr,
        delivered: bool,
    ) -> Result<Option<PathBuf>, DaemonError> {
        let (disk, path) = (self.folders.disk(), self.folders.working().join(name));
        let look = match disk.look(&path) {
            Ok(look) => look,
            Err(error) if error.kind() == ErrorKind::NotFound => {
                // Moved already, and only that was not safe. Its record goes at the next start.
                atomic_file::sync_folder(disk, self.folders.done())?;
                atomic_file::sync_folder(disk, self.folders.failed())?;
                return Ok(None);
            }
            Err(error) => return Err(DaemonError::files("look at", &path)(error)),
        };
        let ledger = Ledger::of(&self.folders, name, look)?;
        if delivered {
            recovery::recover_photo(&self.folders, name)?;
            return Ok(None);
        }
        if let Some(result) = ledger.result() {
            recovery::take_back(&self.folders, &result, &path)?;
        }
        let path = atomic_file::move_to(disk, &path, self.folders.inbox(), name)?;
        ledger.close(&self.folders)?;
        Ok(Some(PathBuf::from(path.file_name().unwrap_or(name))))
    }

    /// Tries again what could not be made good before.
    ///
    /// # Errors
    /// The first that still cannot.
    pub(super) fn settle_all(&mut self) -> Result<(), DaemonError> {
        while let Some((name, delivered)) = self.unsettled.last().cloned() {
            self.settle(&name, delivered)?;
            self.unsettled.pop();
        }
        Ok(())
    }
}
