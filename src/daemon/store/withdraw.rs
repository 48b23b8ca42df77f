//! Results that cannot be stood by are withdrawn, and their photos go back into the inbox: what was
//! restored on a rig that had drifted is done again.

use std::path::PathBuf;

use super::folders::Folders;
use super::report_file::{Delivered, report_name};
use crate::disk::FileError;
use crate::disk::files::numbered;

/// Puts the original of each of `photos` back into the inbox, and its result with its report into
/// `outbox/withdrawn`. What is gone already is passed over: after a cut this is simply done again.
pub(crate) fn withdraw(folders: &Folders, photos: &[Delivered]) -> Result<(), FileError> {
    let (files, outbox, withdrawn) = (folders.files(), folders.outbox(), folders.withdrawn());
    files.make_folder(&withdrawn)?;
    files.sync_folder(outbox)?;
    for Delivered { kept, .. } in photos {
        let original = folders.done().join(kept);
        if files.look(&original).is_ok() {
            files.move_to(&original, folders.inbox(), kept)?;
        }
    }
    // The photos first: one that is done has a result.
    files.sync_folder(folders.inbox())?;
    let mut reports = Vec::new();
    for Delivered { result, .. } in photos {
        let taken = files.taken_names(&withdrawn)?;
        let (from, report) = (outbox.join(result), outbox.join(report_name(result)));
        let moves = files.look(&from).is_ok();
        // One number for the two of them. Where a cut came between, the report's is the first that
        // is free.
        let mut names = numbered(result);
        let Some(name) =
            names.find(|name| !(taken.holds(&report_name(name)) || moves && taken.holds(name)))
        else {
            continue;
        };
        if moves {
            files.rename_new(&from, &withdrawn.join(&name))?;
        }
        if files.look(&report).is_ok() {
            reports.push((report, withdrawn.join(report_name(&name))));
        }
    }
    // Then the results: one without its report would be nobody's.
    files.sync_folder(&withdrawn)?;
    for (from, to) in &reports {
        files.rename_new(from, to)?;
    }
    files.sync_folder(&withdrawn)?;
    log::info!("{} photos go back into the inbox, their results were withdrawn", photos.len());
    Ok(())
}

/// Whether any of what belongs to `photo` is still in its old place.
pub(crate) fn is_in_place(folders: &Folders, photo: &Delivered) -> bool {
    let there = |path: PathBuf| folders.files().look(&path).is_ok();
    let (done, outbox) = (folders.done(), folders.outbox());
    // The report alone is what a cut may have left.
    there(done.join(&photo.kept))
        || there(outbox.join(&photo.result))
        || there(outbox.join(report_name(&photo.result)))
}
