//! Making good what was left of a job: by a stop, at the next start, and by a disk that was full,
//! gone or failing, while the daemon lives. Whatever instant this itself is cut at, doing it again
//! comes to the same.
//!
//! What a start finds on the disk has lasted: results delivered are closed, other photos go back
//! to the inbox. Within a life more care is needed: after a failed synchronisation the system shows
//! a file that may not be on the disk at all, and would say of it, asked again, that it is safe. So
//! a result that was not delivered without an error is taken back and made anew.

use std::ffi::{OsStr, OsString};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::folders::Folders;
use super::inbox::is_hidden;
use super::ledger::Ledger;
use super::report_file::{read_report, report_name};
use crate::disk::{FileError, FileKind};

/// Finishes jobs whose result was delivered, and puts other photos back into the inbox.
pub(super) fn recover(folders: &Folders) -> Result<(), FileError> {
    for name in photos(folders)? {
        recover_photo(folders, &name)?;
    }
    Ledger::sweep(folders)
}

/// Names of the photos in `working`.
fn photos(folders: &Folders) -> Result<Vec<OsString>, FileError> {
    let found = folders.files().list(folders.working())?;
    let photo = |(name, kind): &(OsString, FileKind)| !is_hidden(name) && *kind != FileKind::Folder;
    Ok(found.into_iter().filter(photo).map(|(name, _)| name).collect())
}

/// Finishes or takes back the photo `name`.
fn recover_photo(folders: &Folders, name: &OsStr) -> Result<(), FileError> {
    let (files, path) = (folders.files(), folders.working().join(name));
    let mut ledger = Ledger::of(folders, name, files.look(&path)?)?;
    let shown = name.to_string_lossy();
    if let Some(result) = ledger.result() {
        let there = files.exists(&folders.outbox().join(&result))?;
        if there && is_reported(folders, &result, &path)? {
            files.move_to(&path, folders.done(), name)?;
            // Before the record goes: without it the photo would be restored a second time.
            files.sync_folder(folders.done())?;
            log::info!(
                "{shown}: found in working after a stop with its result delivered, moved to done"
            );
            return ledger.close(folders);
        }
        // A result of that name may be another photo's by now; its report stays.
        if !there {
            take_back(folders, &result, &path)?;
        }
        ledger.forget_result(folders)?;
    }
    files.move_to(&path, folders.inbox(), name)?;
    log::info!("{shown}: found in working after a stop, moved to inbox");
    Ok(())
}

/// Brings the photo `name` out of `working` after an error: to `done` when its result was
/// `delivered`, else back into the inbox as if it had never been begun; the way to it there.
pub(crate) fn settle(
    folders: &Folders,
    name: &OsStr,
    delivered: bool,
) -> Result<Option<PathBuf>, FileError> {
    let (files, path) = (folders.files(), folders.working().join(name));
    let look = match files.look(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            // Moved already, and only that was not safe. Its record goes at the next start.
            files.sync_folder(folders.done())?;
            files.sync_folder(folders.failed())?;
            return Ok(None);
        }
        looked => looked?,
    };
    let ledger = Ledger::of(folders, name, look)?;
    if delivered {
        recover_photo(folders, name)?;
        return Ok(None);
    }
    if let Some(result) = ledger.result() {
        take_back(folders, &result, &path)?;
    }
    let path = files.move_to(&path, folders.inbox(), name)?;
    ledger.close(folders)?;
    Ok(Some(PathBuf::from(path.file_name().unwrap_or(name))))
}

/// Removes the result named and its report, if they are of the photo at `path`: nobody can say
/// whether they are safe, and another photo may want the name.
fn take_back(folders: &Folders, result: &OsStr, path: &Path) -> Result<(), FileError> {
    if !is_reported(folders, result, path)? {
        return Ok(());
    }
    let outbox = folders.outbox();
    // The result first: without it the report is what a cut may leave.
    for path in [outbox.join(result), outbox.join(report_name(result))] {
        folders.files().remove(&path)?;
        folders.files().sync_folder(outbox)?;
    }
    Ok(())
}

/// Whether the report beside the result named is of the photo at `path`.
fn is_reported(folders: &Folders, result: &OsStr, path: &Path) -> Result<bool, FileError> {
    let files = folders.files();
    let Some(report) = read_report(files, &folders.outbox().join(report_name(result)))? else {
        return Ok(false);
    };
    let (mut file, mut hasher) = (files.open(path)?, crc32fast::Hasher::new());
    let (mut piece, mut length) = (vec![0; 1 << 16], 0);
    loop {
        match file.read(&mut piece).map_err(FileError::at("read", path))? {
            0 => break,
            n => {
                hasher.update(&piece[..n]);
                length += n as u64;
            }
        }
    }
    Ok(report.photo_bytes == length && report.photo_crc32 == format!("{:08x}", hasher.finalize()))
}
