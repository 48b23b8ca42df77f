//! How many photos came to what end.

use serde::{Deserialize, Serialize};

use crate::daemon::store::report_file::{Failed, Report, ResultKind};
use crate::daemon::store::waiting::Waiting;

/// Outcomes of each kind that a daemon that watches still has to tell at its end: a box runs for a
/// year, and what it did is in the outbox and not in its memory.
const SUMMARY_MAX: usize = 1000;

/// Photos by what became of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct PhotoCounts {
    /// Photos whose result is the restored picture.
    pub restored: usize,
    /// Photos whose result is the photo itself.
    #[serde(default)]
    pub untouched: usize,
    /// Photos set aside.
    pub failed: usize,
    /// Photos that wait in the inbox.
    #[serde(default)]
    pub waiting: Waiting,
}

impl PhotoCounts {
    /// All of them.
    pub fn all(self) -> usize {
        self.restored + self.untouched + self.failed + self.waiting.all()
    }

    /// Counts a photo with a result.
    pub(super) fn add(&mut self, kind: ResultKind) {
        match kind {
            ResultKind::Restored => self.restored += 1,
            ResultKind::Untouched => self.untouched += 1,
        }
    }
}

impl std::fmt::Display for PhotoCounts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let PhotoCounts { restored, untouched, failed, waiting } = self;
        let were = if *untouched == 1 { "it was" } else { "they were" };
        write!(f, "{restored} restored, {untouched} left as {were}, {failed} failed, {waiting}")
    }
}

/// What was done, since the daemon was opened.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    /// Photos that were restored.
    pub restored: Vec<Report>,
    /// Photos whose result is the photo itself.
    pub untouched: Vec<Report>,
    /// Photos set aside, with their reasons.
    pub failed: Vec<Failed>,
    /// Photos put back into the inbox to be tried later, with their reasons.
    pub left: Vec<Failed>,
    /// How many wait in the inbox, those included.
    pub waiting: Waiting,
}

impl Summary {
    /// How many there are of each.
    pub fn counts(&self) -> PhotoCounts {
        PhotoCounts {
            restored: self.restored.len(),
            untouched: self.untouched.len(),
            failed: self.failed.len(),
            waiting: self.waiting,
        }
    }

    pub(super) fn add(&mut self, report: Report) {
        push(
            match report.outcome {
                ResultKind::Restored => &mut self.restored,
                ResultKind::Untouched => &mut self.untouched,
            },
            report,
        );
    }

    pub(super) fn add_failed(&mut self, failed: Failed) {
        push(&mut self.failed, failed);
    }

    pub(super) fn forget(&mut self, result: &str) {
        self.restored.retain(|report| report.result != result);
        self.untouched.retain(|report| report.result != result);
    }
}

/// Adds `one` and leaves out the oldest beyond what is kept.
fn push<T>(all: &mut Vec<T>, one: T) {
    all.push(one);
    all.drain(..all.len().saturating_sub(SUMMARY_MAX));
}
