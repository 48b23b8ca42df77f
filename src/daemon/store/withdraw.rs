//! Withdrawal of results made after the rig had drifted; their photos go back into the inbox.

use std::ffi::OsStr;
use std::path::PathBuf;

use super::folders::Folders;
use super::names::report_name;
use super::report_file::Delivered;
use crate::disk::FileError;
use crate::disk::files::TakenNames;

/// Moves the originals of `photos` back into the inbox, and their results with their reports into
/// `outbox/withdrawn`. Files already moved are skipped, so that it can be repeated after a power
/// cut.
pub(crate) fn withdraw(folders: &Folders, photos: &[Delivered]) -> Result<(), FileError> {
    let (files, outbox, withdrawn) = (&folders.files, &folders.outbox, folders.withdrawn());
    files.make_folder(&withdrawn)?;
    files.sync_folder(outbox)?;
    for Delivered { kept, .. } in photos {
        let original = folders.done.join(kept);
        if files.metadata(&original).is_ok() {
            files.move_to(&original, &folders.inbox, kept)?;
        }
    }
    // The photos first: a photo in `done` must have a result.
    files.sync_folder(&folders.inbox)?;
    let mut reports = Vec::new();
    for Delivered { result, .. } in photos {
        let (from, report) = (outbox.join(result), outbox.join(report_name(result)));
        let moves = files.metadata(&from).is_ok();
        // Result and report get the same number. If a power cut separated them, the report gets its
        // first free one.
        let is_taken = |taken: &TakenNames, name: &OsStr| {
            taken.holds(&report_name(name)) || moves && taken.holds(name)
        };
        let name = files.with_free_name(&withdrawn, result, &is_taken, &mut |name| {
            if moves {
                files.rename_new(&from, &withdrawn.join(name))?;
            }
            Ok(name.to_owned())
        })?;
        if files.metadata(&report).is_ok() {
            reports.push((report, withdrawn.join(report_name(&name))));
        }
    }
    // Reports last: a result without its report would belong to no photo.
    files.sync_folder(&withdrawn)?;
    for (from, to) in &reports {
        files.rename_new(from, to)?;
    }
    files.sync_folder(&withdrawn)?;
    log::info!("{} results withdrawn, their photos put back into the inbox", photos.len());
    Ok(())
}

/// Whether any file of `photo` is still to be withdrawn.
pub(crate) fn is_in_place(folders: &Folders, photo: &Delivered) -> bool {
    let exists = |path: PathBuf| folders.files.metadata(&path).is_ok();
    let (done, outbox) = (&folders.done, &folders.outbox);
    // After a power cut only the report may remain.
    exists(done.join(&photo.kept))
        || exists(outbox.join(&photo.result))
        || exists(outbox.join(report_name(&photo.result)))
}
