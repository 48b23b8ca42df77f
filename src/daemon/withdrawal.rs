//! Results that cannot be stood by are withdrawn, and their photos go back into the inbox: what was restored
//! on a rig that had drifted is done again.

use std::ffi::OsString;

use serde::{Deserialize, Serialize};

use super::job::report_name;
use super::run::Daemon;
use super::{DaemonError, durable};

/// A photo done and its result; names are bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Delivered {
    /// The original's name in `done`.
    pub kept: OsString,
    /// The result's name in the outbox.
    pub result: OsString,
}

impl Daemon<'_> {
    /// Puts the original of each of `photos` back into the inbox, and its result with its report into
    /// `outbox/withdrawn`. What is gone already is passed over: after a cut this is simply done again.
    ///
    /// # Errors
    /// When a file cannot be moved.
    pub(super) fn withdraw(&mut self, photos: &[Delivered]) -> Result<(), DaemonError> {
        let disk = self.folders.disk();
        let (inbox, outbox, done) = (self.folders.inbox(), self.folders.outbox(), self.folders.done());
        let withdrawn = outbox.join("withdrawn");
        disk.make_folder(&withdrawn).map_err(DaemonError::files("make the folder", &withdrawn))?;
        durable::sync_folder(disk, outbox)?;
        for Delivered { kept, result } in photos {
            let original = done.join(kept);
            if disk.look(&original).is_ok() {
                durable::move_to(disk, &original, inbox, kept)?;
                // The photo first: whatever the power does, it is somewhere.
                durable::sync_folder(disk, inbox)?;
            }
            // The result first: one without its report would be nobody's.
            for name in [result.clone(), report_name(result)] {
                let path = outbox.join(&name);
                if disk.look(&path).is_ok() {
                    durable::move_to(disk, &path, &withdrawn, &name)?;
                }
            }
        }
        for folder in [done, &withdrawn, outbox] {
            durable::sync_folder(disk, folder)?;
        }
        for Delivered { result, .. } in photos {
            self.forget(result);
        }
        log::info!("{} photos go back into the inbox, their results were withdrawn", photos.len());
        Ok(())
    }
}
