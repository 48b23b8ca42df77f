//! Reports on the daemon's work: the gallery, the state file, the summary.

pub(super) mod gallery;
pub(super) mod state;
pub(super) mod summary;

mod card;
mod html;
mod now;
mod page;

use super::store::folders::Folders;
use super::store::report_file::{Failed, Report};
use super::store::waiting::Waiting;
use crate::disk::FileError;
use crate::remedy::full_message;
use crate::rig::Moment;
use gallery::Gallery;
use state::{Doing, State};
use summary::Summary;

/// Writes the state file and the gallery.
pub(super) struct Reporter {
    /// State as last written.
    state: State,
    pub(super) gallery: Gallery,
    written: Option<Moment>,
    /// Whether the gallery shows results that were removed.
    pub(super) stale: bool,
    /// Deferred and waiting photos in the gallery as last written.
    shown: (Vec<Failed>, Waiting),
    summary: Summary,
}

/// Photos in the inbox at one moment.
#[derive(Debug, Clone)]
pub(super) struct Snapshot {
    pub(super) deferred: Vec<Failed>,
    pub(super) waiting: Waiting,
    pub(super) moment: Moment,
    pub(super) unix_s: u64,
}

impl Reporter {
    /// Opens the reports of the rig called `rig` on `folders`.
    pub(super) fn open(
        folders: &Folders,
        rig: &str,
        needs_button: bool,
    ) -> Result<Reporter, FileError> {
        Ok(Reporter {
            state: State { needs_button, ..State::new(rig, Doing::Waiting, 0) },
            gallery: Gallery::load(folders)?,
            written: None,
            stale: false,
            shown: (Vec::new(), Waiting::default()),
            summary: Summary::default(),
        })
    }

    pub(super) fn add(&mut self, report: Report) {
        log::info!("{}", report.line());
        for note in report.notes.iter().filter(|note| !note.starts_with("noise of the photo")) {
            log::info!("{}: {note}", report.photo);
        }
        self.gallery.add(&report);
        self.summary.add(report);
    }

    pub(super) fn add_failed(&mut self, failed: Failed) {
        log::warn!("not restored: {}", failed.reason);
        self.gallery.failed.push(failed.clone());
        self.summary.add_failed(failed);
    }

    pub(super) fn forget(&mut self, result: &str) {
        self.gallery.remove(result);
        self.summary.forget(result);
        self.stale = true;
    }

    /// The summary, with the photos still in the inbox.
    pub(super) fn summary(&self, deferred: Vec<Failed>, waiting: Waiting) -> Summary {
        Summary { deferred, waiting, ..self.summary.clone() }
    }

    /// Writes the state file and the page's status line. Errors are logged only.
    pub(super) fn set_doing(&mut self, folders: &Folders, doing: Doing, snapshot: &Snapshot) {
        self.gallery.waiting = snapshot.waiting;
        let state = &mut self.state;
        (state.doing, state.counts) = (doing, self.gallery.counts());
        state.written_unix_s = snapshot.unix_s;
        for written in [state.write(folders), now::write(folders, &state.doing, snapshot.unix_s)] {
            if let Err(error) = written {
                log::debug!("{}", full_message(&error));
            }
        }
    }

    /// Whether the gallery is due to be written while photos are still being restored.
    pub(super) fn is_due(&self, now: Moment) -> bool {
        self.written.is_none_or(|at| now.0 - at.0 >= self.gallery.period_s())
    }

    /// Writes the numbers of waiting photos if they have changed, and the gallery when it is due.
    pub(super) fn update_waiting(&mut self, folders: &Folders, snapshot: &Snapshot) {
        if self.state.counts.waiting != snapshot.waiting {
            self.set_doing(folders, self.state.doing.clone(), snapshot);
        }
        let (deferred, waiting) = &self.shown;
        let is_shown = *deferred == snapshot.deferred && *waiting == snapshot.waiting;
        if !is_shown
            && self.is_due(snapshot.moment)
            && let Err(error) = self.write_gallery(folders, snapshot)
        {
            // If it persists, it is reported after the next photo.
            log::debug!("{}", full_message(&error));
        }
    }

    pub(super) fn write_gallery(
        &mut self,
        folders: &Folders,
        snapshot: &Snapshot,
    ) -> Result<(), FileError> {
        (self.written, self.stale) = (Some(snapshot.moment), false);
        self.shown = (snapshot.deferred.clone(), snapshot.waiting);
        self.gallery.waiting = snapshot.waiting;
        self.gallery.write(folders, &self.state.rig, &snapshot.deferred, snapshot.unix_s)
    }
}

#[cfg(test)]
mod tests;
