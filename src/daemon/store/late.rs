//! Originals that are written to after they were taken: a program may hold a file open that looks
//! complete, and add to it. Their results are withdrawn, and they are restored again.

use std::path::PathBuf;

use super::folders::Folders;
use super::report_file::Delivered;
use crate::disk::Metadata;
use crate::rig::Moment;

/// Originals in `done` that are watched for late writes.
#[derive(Debug, Default)]
pub(crate) struct LateWrites(Vec<WatchedOriginal>);

#[derive(Debug)]
struct WatchedOriginal {
    photo: Delivered,
    /// Length and time of change when the photo was claimed.
    taken: (u64, (i64, i64)),
    until: Moment,
}

impl LateWrites {
    /// Watches the original of `photo`, claimed with the metadata `original`, until `until`.
    pub(crate) fn watch(
        &mut self,
        folders: &Folders,
        photo: Delivered,
        original: Metadata,
        until: Moment,
    ) {
        let Ok(now) = folders.files.metadata(&kept(folders, &photo)) else { return };
        // A copy on another file system has a time of change of its own.
        let taken = if now.inode == original.inode { original } else { now };
        self.0.push(WatchedOriginal { photo, taken: (taken.size, taken.changed), until });
    }

    /// The photos whose originals have changed by `now`. They are no longer watched, nor are those
    /// whose time has passed.
    pub(crate) fn take_changed(&mut self, folders: &Folders, now: Moment) -> Vec<Delivered> {
        let files = &folders.files;
        let mut changed = Vec::new();
        self.0.retain(|watched| {
            let Ok(found) = files.metadata(&kept(folders, &watched.photo)) else { return false };
            let is_as_taken = (found.size, found.changed) == watched.taken;
            if !is_as_taken {
                let name = watched.photo.kept.to_string_lossy();
                log::warn!("{name}: written to after it was taken; it is restored again");
                changed.push(watched.photo.clone());
            }
            is_as_taken && now < watched.until
        });
        changed
    }
}

fn kept(folders: &Folders, photo: &Delivered) -> PathBuf {
    folders.done.join(&photo.kept)
}
