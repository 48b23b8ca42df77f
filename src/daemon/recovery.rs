//! What a start makes of what the last end left in `working`: results delivered are closed, other photos go
//! back to the inbox. Whatever instant this itself is cut at, doing it again comes to the same.

use std::ffi::OsStr;
use std::io::ErrorKind;

use super::ledger::Ledger;
use super::{DaemonError, Folders, durable, inbox, job};
use crate::disk::Kind;

/// Finishes jobs whose result was delivered, and puts other photos back into the inbox.
pub(super) fn recover(folders: &Folders) -> Result<(), DaemonError> {
    let (disk, working) = (folders.disk(), folders.working());
    for (name, kind) in disk.list(working).map_err(DaemonError::files("read the folder", working))? {
        if !inbox::is_hidden(&name) && kind != Kind::Folder {
            recover_photo(folders, &name)?;
        }
    }
    Ledger::sweep(folders)
}

fn recover_photo(folders: &Folders, name: &OsStr) -> Result<(), DaemonError> {
    let (disk, path) = (folders.disk(), folders.working().join(name));
    let look = disk.look(&path).map_err(DaemonError::files("look at", &path))?;
    let mut ledger = Ledger::of(folders, name, look)?;
    let shown = name.to_string_lossy();
    if let Some(result) = ledger.result() {
        let at = folders.outbox().join(&result);
        match disk.look(&at) {
            Ok(_) => {
                durable::move_to(disk, &path, folders.done(), name)?;
                // Before the record goes: without it the photo would be restored a second time.
                durable::sync_folder(disk, folders.done())?;
                log::info!("{shown}: found in working after a stop with its result delivered, moved to done");
                return ledger.close(folders);
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(DaemonError::files("look at", &at)(error)),
        }
        // A report without its result; another photo may want the name.
        let report = folders.outbox().join(job::report_name(&result));
        match disk.remove(&report) {
            Ok(()) => durable::sync_folder(disk, folders.outbox())?,
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(DaemonError::files("remove", &report)(error)),
        }
        ledger.forget_result(folders)?;
    }
    durable::move_to(disk, &path, folders.inbox(), name)?;
    log::info!("{shown}: found in working after a stop, moved to inbox");
    Ok(())
}
