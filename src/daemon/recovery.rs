//! What a start makes of what the last end left in `working`: results delivered are closed, other
//! photos go back to the inbox. Whatever instant this itself is cut at, doing it again comes to the
//! same.

use std::ffi::{OsStr, OsString};
use std::io::{ErrorKind, Read};
use std::path::Path;

use crate::disk::{Disk, Kind};

use super::ledger::Ledger;
use super::{DaemonError, Folders, Report, atomic_file, inbox, job};

/// Longest report there is.
const REPORT_BYTES_MAX: u64 = 1 << 20;

/// Finishes jobs whose result was delivered, and puts other photos back into the inbox.
pub(super) fn recover(folders: &Folders) -> Result<(), DaemonError> {
    for name in photos(folders)? {
        recover_photo(folders, &name)?;
    }
    Ledger::sweep(folders)
}

/// Names of the photos in `working`.
pub(super) fn photos(folders: &Folders) -> Result<Vec<OsString>, DaemonError> {
    let working = folders.working();
    let found =
        folders.disk().list(working).map_err(DaemonError::files("read the folder", working))?;
    let photo = |(name, kind): &(OsString, Kind)| !inbox::is_hidden(name) && *kind != Kind::Folder;
    Ok(found.into_iter().filter(photo).map(|(name, _)| name).collect())
}

/// Finishes or takes back the photo `name`.
pub(super) fn recover_photo(folders: &Folders, name: &OsStr) -> Result<(), DaemonError> {
    let (disk, path) = (folders.disk(), folders.working().join(name));
    let look = disk.look(&path).map_err(DaemonError::files("look at", &path))?;
    let mut ledger = Ledger::of(folders, name, look)?;
    let shown = name.to_string_lossy();
    if let Some(result) = ledger.result() {
        let there = exists(disk, &folders.outbox().join(&result))?;
        if there && reported(folders, &result, &path)? {
            atomic_file::move_to(disk, &path, folders.done(), name)?;
            // Before the record goes: without it the photo would be restored a second time.
            atomic_file::sync_folder(disk, folders.done())?;
            log::info!(
                "{shown}: found in working after a stop with its result delivered, moved to done"
            );
            return ledger.close(folders);
        }
        withdraw(folders, &result, &path)?;
        ledger.forget_result(folders)?;
    }
    atomic_file::move_to(disk, &path, folders.inbox(), name)?;
    log::info!("{shown}: found in working after a stop, moved to inbox");
    Ok(())
}

/// Removes the report of the photo at `path` for the result named, if that was not delivered: it is
/// no use to anyone, and another photo may want the name. The name may be another photo's by now;
/// its report stays.
fn withdraw(folders: &Folders, result: &OsStr, path: &Path) -> Result<(), DaemonError> {
    match exists(folders.disk(), &folders.outbox().join(result))? {
        true => Ok(()),
        false => take_back(folders, result, path),
    }
}

/// The same, and the result too if it is there: nobody can say whether it is safe.
pub(super) fn take_back(folders: &Folders, result: &OsStr, path: &Path) -> Result<(), DaemonError> {
    if !reported(folders, result, path)? {
        return Ok(());
    }
    let (disk, outbox) = (folders.disk(), folders.outbox());
    // The result first: without it the report is what a cut may leave.
    for path in [outbox.join(result), outbox.join(job::report_name(result))] {
        match disk.remove(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(DaemonError::files("remove", &path)(error));
            }
            _ => atomic_file::sync_folder(disk, outbox)?,
        }
    }
    Ok(())
}

fn exists(disk: &dyn Disk, path: &Path) -> Result<bool, DaemonError> {
    match disk.look(path) {
        Ok(_) => Ok(true),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(DaemonError::files("look at", path)(error)),
    }
}

/// Whether the report beside the result named is of the photo at `path`.
fn reported(folders: &Folders, result: &OsStr, path: &Path) -> Result<bool, DaemonError> {
    let disk = folders.disk();
    let report = atomic_file::read(
        disk,
        &folders.outbox().join(job::report_name(result)),
        REPORT_BYTES_MAX,
    )?;
    let Some(report) = report.and_then(|bytes| serde_json::from_slice::<Report>(&bytes).ok())
    else {
        return Ok(false);
    };
    let (mut file, mut hasher) =
        (disk.open(path).map_err(DaemonError::files("open", path))?, crc32fast::Hasher::new());
    let (mut piece, mut length) = (vec![0; 1 << 16], 0);
    loop {
        match file.read(&mut piece).map_err(DaemonError::files("read", path))? {
            0 => break,
            n => {
                hasher.update(&piece[..n]);
                length += n as u64;
            }
        }
    }
    Ok(report.photo_bytes == length && report.photo_crc32 == format!("{:08x}", hasher.finalize()))
}
