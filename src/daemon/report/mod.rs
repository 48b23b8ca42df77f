//! Reports on the daemon's work: the gallery, the state file, the summary.

pub(super) mod gallery;
pub(super) mod state;
pub(super) mod summary;

mod card;
mod html;
mod now;
mod page;

use super::clocks::Clocks;
use super::setting::DaemonSetting;
use super::store::folders::Folders;
use super::store::inbox::Inbox;
use super::store::report_file::{Failed, Report, ResultKind};
use super::store::waiting::Waiting;
use crate::disk::FileError;
use crate::remedy::full_message;
use crate::rig::Moment;
use gallery::Gallery;
use state::{Doing, State};
use summary::Summary;

/// Writes the state file and the gallery.
pub(super) struct Reporter<'a> {
    folders: Folders,
    clocks: Clocks<'a>,
    state: State,
    pub(super) gallery: Gallery,
    written: Option<Moment>,
    /// Whether the gallery shows results that were removed.
    pub(super) stale: bool,
    /// Deferred and waiting photos in the gallery as last written.
    shown: (Vec<Failed>, Waiting),
    /// Number of the first report after opening, and of the first rejected photo.
    opened: (u64, usize),
}

impl<'a> Reporter<'a> {
    pub(super) fn open(
        folders: &Folders,
        setting: &DaemonSetting,
        clocks: Clocks<'a>,
    ) -> Result<Reporter<'a>, FileError> {
        let gallery = Gallery::load(folders)?;
        let state = State::new(&setting.rig, Doing::Waiting, 0);
        Ok(Reporter {
            folders: folders.clone(),
            clocks,
            state: State { needs_button: setting.needs_button, ..state },
            opened: (gallery.next_number(), gallery.failed.len()),
            gallery,
            written: None,
            stale: false,
            shown: (Vec::new(), Waiting::default()),
        })
    }

    pub(super) fn add(&mut self, report: Report) {
        log::info!("{}", report.line());
        for note in report.notes.iter().filter(|note| !note.starts_with("noise of the photo")) {
            log::info!("{}: {note}", report.photo);
        }
        self.gallery.add(report);
    }

    pub(super) fn add_failed(&mut self, failed: Failed) {
        log::warn!("not restored: {}", failed.reason);
        self.gallery.failed.push(failed);
    }

    pub(super) fn forget(&mut self, result: &str) {
        self.gallery.remove(result);
        self.stale = true;
    }

    /// The photos processed since the reports were opened, and those still in the `inbox`.
    pub(super) fn summary(&self, inbox: &Inbox) -> Summary {
        let (first_number, first_failed) = self.opened;
        let reports = self.gallery.reports.iter().filter(|report| report.number >= first_number);
        let (restored, untouched) =
            reports.cloned().partition(|report| report.outcome == ResultKind::Restored);
        let failed = self.gallery.failed[first_failed..].to_vec();
        let (deferred, waiting) = (inbox.deferred(), inbox.waiting);
        Summary { restored, untouched, failed, deferred, waiting }
    }

    /// Writes the state file and the page's status line. Errors are logged only.
    pub(super) fn set_doing(&mut self, doing: Doing, waiting: Waiting) {
        self.gallery.waiting = waiting;
        let (folders, state) = (&self.folders, &mut self.state);
        (state.doing, state.counts) = (doing, self.gallery.counts());
        state.written_unix_s = self.clocks.unix_s();
        let status_line = now::write(folders, &state.doing, state.written_unix_s);
        for written in [state.write(folders), status_line] {
            if let Err(error) = written {
                log::debug!("{}", full_message(&error));
            }
        }
    }

    /// Whether the gallery is due to be written while photos are still being restored.
    pub(super) fn is_due(&self) -> bool {
        let now = self.clocks.moment();
        self.written.is_none_or(|at| now.0 - at.0 >= self.gallery.period_s())
    }

    /// Writes the numbers of waiting photos if they have changed, and the gallery when it is due.
    pub(super) fn update_waiting(&mut self, inbox: &Inbox) {
        if self.state.counts.waiting != inbox.waiting {
            self.set_doing(self.state.doing.clone(), inbox.waiting);
        }
        let is_shown = self.shown == (inbox.deferred(), inbox.waiting);
        if !is_shown
            && self.is_due()
            && let Err(error) = self.write_gallery(inbox)
        {
            // If it persists, it is reported after the next photo.
            log::debug!("{}", full_message(&error));
        }
    }

    pub(super) fn write_gallery(&mut self, inbox: &Inbox) -> Result<(), FileError> {
        (self.written, self.stale) = (Some(self.clocks.moment()), false);
        self.shown = (inbox.deferred(), inbox.waiting);
        self.gallery.waiting = inbox.waiting;
        let (deferred, _) = &self.shown;
        self.gallery.write(&self.folders, &self.state.rig, deferred, self.clocks.unix_s())
    }
}

#[cfg(test)]
mod tests;
