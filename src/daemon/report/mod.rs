//! What is told of the daemon's work, read from the store: the gallery, the state file, the sums.

pub(super) mod gallery;
pub(super) mod state;
pub(super) mod summary;

mod card;
mod charts;
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

/// Tells what the daemon does: in the state file, and in the gallery.
pub(super) struct Reporter {
    rig: String,
    needs_button: bool,
    gallery: Gallery,
    written: Option<Moment>,
    /// The gallery shows results that were removed.
    stale: bool,
    /// What it said of photos without a result when it was written.
    shown: (Vec<Failed>, Waiting),
    summary: Summary,
    /// Who waits, as told last.
    waiting: Waiting,
    /// What was told last.
    doing: Doing,
    /// What the operator should know, as told last.
    attention: Vec<String>,
}

/// What is told together: photos that stay in the inbox, and when that is so.
#[derive(Debug, Clone)]
pub(super) struct Telling {
    pub(super) left: Vec<Failed>,
    pub(super) waiting: Waiting,
    pub(super) moment: Moment,
    pub(super) unix_s: u64,
}

impl Reporter {
    /// Tells of what the rig called `rig` does with `folders`, and whether it waits for a button.
    pub(super) fn open(
        folders: &Folders,
        (rig, needs_button): (&str, bool),
    ) -> Result<Reporter, FileError> {
        Ok(Reporter {
            rig: rig.to_owned(),
            needs_button,
            gallery: Gallery::load(folders)?,
            written: None,
            stale: false,
            shown: (Vec::new(), Waiting::default()),
            summary: Summary::default(),
            waiting: Waiting::default(),
            doing: Doing::Waiting,
            attention: Vec::new(),
        })
    }

    /// A photo has a result.
    pub(super) fn add(&mut self, report: Report) {
        log::info!("{}", report.line());
        // What the file was, and what its result has not of it.
        for note in report.notes.iter().filter(|note| !note.starts_with("noise of the photo")) {
            log::info!("{}: {note}", report.photo);
        }
        self.gallery.add(&report);
        self.summary.add(report);
    }

    /// A photo was set aside.
    pub(super) fn add_failed(&mut self, failed: Failed) {
        log::warn!("not restored: {}", failed.reason);
        self.gallery.add_failed(failed.clone());
        self.summary.add_failed(failed);
    }

    /// A result is no longer in the outbox.
    pub(super) fn forget(&mut self, result: &str) {
        self.gallery.remove(result);
        self.summary.forget(result);
        self.stale = true;
    }

    /// Results were removed from the outbox.
    pub(super) fn reload(&mut self, folders: &Folders) {
        self.gallery = Gallery::load(folders).unwrap_or_default();
        self.stale = true;
    }

    /// What was done, while `left` stay in the inbox, of `waiting` in all.
    pub(super) fn summary(&self, left: Vec<Failed>, waiting: Waiting) -> Summary {
        Summary { left, waiting, ..self.summary.clone() }
    }

    /// Seconds that photos took of late.
    pub(super) fn usual_s(&self) -> Option<f64> {
        self.gallery.usual_s()
    }

    /// What the daemon does, as told last.
    pub(super) fn doing(&self) -> Doing {
        self.doing.clone()
    }

    /// Writes the state file and the page's line. That nobody can look on is no reason to stop.
    pub(super) fn tell(&mut self, folders: &Folders, doing: Doing, telling: &Telling) {
        (self.doing, self.waiting) = (doing.clone(), telling.waiting);
        self.gallery.waiting = telling.waiting;
        let state = State {
            rig: self.rig.clone(),
            doing,
            counts: self.gallery.counts(),
            attention: self.attention.clone(),
            needs_button: self.needs_button,
            written_unix_s: telling.unix_s,
        };
        if let Err(error) = state.write(folders) {
            log::debug!("{}", full_message(&error));
        }
        if let Err(error) = now::write(folders, &state.doing, telling.unix_s) {
            log::debug!("{}", full_message(&error));
        }
    }

    /// Says once what the operator should know. Whether that is something else than before, and so
    /// to be told and shown.
    pub(super) fn call_attention(&mut self, attention: Vec<String>) -> bool {
        let new = attention.iter().filter(|words| !self.attention.contains(words));
        new.for_each(|words| log::warn!("{words}"));
        let changed = attention != self.attention;
        self.attention = attention;
        changed
    }

    /// Whether the gallery should be written though more photos are to come.
    pub(super) fn is_due(&self, now: Moment) -> bool {
        self.written.is_none_or(|at| now.0 - at.0 >= self.gallery.period_s())
    }

    /// Tells who waits, where that changed; the page follows, which names them and says why.
    pub(super) fn tell_who_waits(&mut self, folders: &Folders, telling: &Telling) {
        if self.waiting != telling.waiting {
            self.tell(folders, self.doing.clone(), telling);
        }
        let (left, waiting) = &self.shown;
        let is_shown = *left == telling.left && *waiting == telling.waiting;
        if !is_shown
            && self.is_due(telling.moment)
            && let Err(error) = self.show(folders, telling)
        {
            log::warn!("{}", full_message(&error));
        }
    }

    /// Whether the gallery shows what is no more.
    pub(super) fn is_stale(&self) -> bool {
        self.stale
    }

    /// Writes the gallery.
    pub(super) fn show(&mut self, folders: &Folders, telling: &Telling) -> Result<(), FileError> {
        (self.written, self.stale) = (Some(telling.moment), false);
        self.shown = (telling.left.clone(), telling.waiting);
        self.gallery.waiting = telling.waiting;
        self.gallery.write(folders, &self.rig, &telling.left, &self.attention, telling.unix_s)
    }
}

#[cfg(test)]
mod tests;
