//! Results that cannot be stood by are withdrawn, and their photos go back into the inbox: what was
//! restored on a rig that had drifted is done again.

use std::ffi::OsString;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::job::report_name;
use super::run::Daemon;
use super::{DaemonError, atomic_file};
use crate::disk::Disk;

/// The folder in the outbox for results that were withdrawn.
pub(super) const WITHDRAWN: &str = "withdrawn";

/// A photo done and its result; names are bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Delivered {
    /// The original's name in `done`.
    pub kept: OsString,
    /// The result's name in the outbox.
    pub result: OsString,
}

impl Daemon<'_> {
    /// Puts the original of each of `photos` back into the inbox, and its result with its report
    /// into `outbox/withdrawn`. What is gone already is passed over: after a cut this is simply
    /// done again.
    ///
    /// # Errors
    /// When a file cannot be moved.
    pub(super) fn withdraw(&mut self, photos: &[Delivered]) -> Result<(), DaemonError> {
        let disk = self.folders.disk();
        let (inbox, outbox, done) =
            (self.folders.inbox(), self.folders.outbox(), self.folders.done());
        let withdrawn = outbox.join(WITHDRAWN);
        disk.make_folder(&withdrawn).map_err(DaemonError::files("make the folder", &withdrawn))?;
        atomic_file::sync_folder(disk, outbox)?;
        let there = |path: &Path| disk.look(path).is_ok();
        for Delivered { kept, .. } in photos {
            let original = done.join(kept);
            if there(&original) {
                atomic_file::move_to(disk, &original, inbox, kept)?;
            }
        }
        // The photos first: one that is done has a result.
        atomic_file::sync_folder(disk, inbox)?;
        let mut reports = Vec::new();
        for Delivered { result, .. } in photos {
            let taken = atomic_file::Taken::of(disk, &withdrawn)?;
            let (from, report) = (outbox.join(result), outbox.join(report_name(result)));
            let moves = there(&from);
            // One number for the two of them. Where a cut came between, the report's is the first
            // that is free.
            let free =
                |name: &OsString| !(taken.holds(&report_name(name)) || moves && taken.holds(name));
            let Some(name) = (1..).map(|number| atomic_file::numbered(result, number)).find(free)
            else {
                continue;
            };
            if moves {
                rename(disk, &from, &withdrawn.join(&name))?;
            }
            if there(&report) {
                reports.push((report, withdrawn.join(report_name(&name))));
            }
        }
        // Then the results: one without its report would be nobody's.
        atomic_file::sync_folder(disk, &withdrawn)?;
        for (from, to) in &reports {
            rename(disk, from, to)?;
        }
        atomic_file::sync_folder(disk, &withdrawn)?;
        for Delivered { result, .. } in photos {
            self.forget(result);
        }
        log::info!("{} photos go back into the inbox, their results were withdrawn", photos.len());
        Ok(())
    }
}

fn rename(disk: &dyn Disk, from: &Path, to: &Path) -> Result<(), DaemonError> {
    disk.rename_new(from, to).map_err(DaemonError::files("move", from))
}
