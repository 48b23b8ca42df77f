//! Recovery of interrupted jobs: after a stop, at the next start; after a disk error, in the
//! running daemon. Recovery may itself be interrupted and repeated at any instant.
//!
//! At a start every file found is durable: jobs with a delivered result are closed, other photos go
//! back to the inbox. In a running daemon a failed synchronisation leaves a visible file that may
//! not be durable, and a repeated synchronisation would report success. A result whose delivery met
//! an error is therefore removed and made again.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use super::companions::is_hidden;
use super::folders::Folders;
use super::ledger::Ledger;
use super::names::report_name;
use super::report_file::Report;
use crate::disk::{FileError, FileKind, if_found};

/// Closes jobs whose result was delivered and puts other photos back into the inbox.
pub(super) fn recover(folders: &Folders) -> Result<(), FileError> {
    for name in photos(folders)? {
        recover_photo(folders, &name)?;
    }
    Ledger::sweep(folders)
}

fn photos(folders: &Folders) -> Result<Vec<OsString>, FileError> {
    let found = folders.files.list(&folders.working)?;
    let photo = |(name, kind): &(OsString, FileKind)| !is_hidden(name) && *kind != FileKind::Folder;
    Ok(found.into_iter().filter(photo).map(|(name, _)| name).collect())
}

/// Closes the job of the photo `name`, or puts the photo back into the inbox.
fn recover_photo(folders: &Folders, name: &OsStr) -> Result<(), FileError> {
    let (files, path) = (&folders.files, folders.working.join(name));
    let mut ledger = Ledger::of(folders, name, files.metadata(&path)?)?;
    let photo = name.to_string_lossy();
    if let Some(result) = ledger.result() {
        let exists = files.exists(&folders.outbox.join(&result))?;
        if exists && is_reported(folders, &result, &path)? {
            files.move_to(&path, &folders.done, name)?;
            // Before the record is removed: without it the photo would be restored a second time.
            files.sync_folder(&folders.done)?;
            log::info!(
                "{photo}: found in working after a stop with its result delivered, moved to done"
            );
            return ledger.close(folders);
        }
        // A result that exists belongs to another photo by now; it stays, with its report.
        if !exists {
            remove_result(folders, &result, &path)?;
        }
        ledger.forget_result(folders)?;
    }
    return_to_inbox(folders, &path, name)?;
    log::info!("{photo}: found in working after a stop, moved to inbox");
    Ok(())
}

/// Moves the photo `name` out of `working` after an error: to `done` when its result was
/// `delivered`, else back into the inbox; returns its path there, relative to the inbox.
pub(crate) fn settle(
    folders: &Folders,
    name: &OsStr,
    delivered: bool,
) -> Result<Option<PathBuf>, FileError> {
    let (files, path) = (&folders.files, folders.working.join(name));
    let Some(metadata) = if_found(files.metadata(&path))? else {
        // The photo was moved already but not synchronised, unless `working` itself is missing. Its
        // record is removed at the next start.
        files.sync_folder(&folders.working)?;
        files.sync_folder(&folders.done)?;
        files.sync_folder(&folders.failed)?;
        return Ok(None);
    };
    let ledger = Ledger::of(folders, name, metadata)?;
    if delivered {
        recover_photo(folders, name)?;
        return Ok(None);
    }
    if let Some(result) = ledger.result() {
        remove_result(folders, &result, &path)?;
    }
    let path = return_to_inbox(folders, &path, name)?;
    ledger.close(folders)?;
    Ok(Some(PathBuf::from(path.file_name().unwrap_or(name))))
}

/// Moves the photo at `path` in `working` durably into the inbox, and returns its path there. If a
/// power cut undid this move, but not the claim of the next photo called `name`, that one would
/// replace it.
fn return_to_inbox(folders: &Folders, path: &Path, name: &OsStr) -> Result<PathBuf, FileError> {
    let path = folders.files.move_to(path, &folders.inbox, name)?;
    folders.files.sync_folder(&folders.inbox)?;
    Ok(path)
}

/// Removes `result` and its report, if they belong to the photo at `path`: they may not be durable,
/// and they occupy the name.
fn remove_result(folders: &Folders, result: &OsStr, path: &Path) -> Result<(), FileError> {
    if !is_reported(folders, result, path)? {
        return Ok(());
    }
    let outbox = &folders.outbox;
    // The result first: after a power cut a report may remain, but no result without a report.
    for path in [outbox.join(result), outbox.join(report_name(result))] {
        folders.files.remove(&path)?;
        folders.files.sync_folder(outbox)?;
    }
    Ok(())
}

/// Whether the report beside `result` belongs to the photo at `path`, by its checksum.
fn is_reported(folders: &Folders, result: &OsStr, path: &Path) -> Result<bool, FileError> {
    let files = &folders.files;
    let path_of_report = folders.outbox.join(report_name(result));
    let Some(report) = files.read_json::<Report>(&path_of_report)? else { return Ok(false) };
    let (crc32, length) = files.checksum(path)?;
    Ok(report.photo_bytes == length && report.photo_crc32 == format!("{crc32:08x}"))
}
