//! Numbers of photos by outcome.

use serde::{Deserialize, Serialize};

use crate::daemon::store::report_file::{Failed, Report, ResultKind};
use crate::daemon::store::waiting::Waiting;

/// Limit of photos of each kind in a summary, as a daemon may run for years.
const SUMMARY_MAX: usize = 1000;

/// Numbers of photos by outcome.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)] // The names describe them.
pub struct PhotoCounts {
    pub restored: usize,
    pub untouched: usize,
    pub failed: usize,
    pub waiting: Waiting,
}

impl PhotoCounts {
    /// Number of photos of all outcomes.
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
        write!(f, "{restored} restored, {untouched} unchanged, {failed} failed, {waiting}")
    }
}

/// Photos processed since the daemon was opened.
#[derive(Debug, Clone, Default)]
#[allow(missing_docs)] // The names describe them.
pub struct Summary {
    pub restored: Vec<Report>,
    pub untouched: Vec<Report>,
    /// Rejected photos with their reasons.
    pub failed: Vec<Failed>,
    /// Photos in the inbox to be tried later, with their reasons.
    pub deferred: Vec<Failed>,
    /// Numbers of photos waiting in the inbox, the deferred included.
    pub waiting: Waiting,
    /// Numbers of processed photos no longer in the lists.
    pub(super) dropped: PhotoCounts,
}

impl Summary {
    /// Numbers of photos by outcome.
    pub fn counts(&self) -> PhotoCounts {
        PhotoCounts {
            restored: self.restored.len() + self.dropped.restored,
            untouched: self.untouched.len() + self.dropped.untouched,
            failed: self.failed.len() + self.dropped.failed,
            waiting: self.waiting,
        }
    }

    pub(super) fn add(&mut self, report: Report) {
        let (list, dropped) = match report.outcome {
            ResultKind::Restored => (&mut self.restored, &mut self.dropped.restored),
            ResultKind::Untouched => (&mut self.untouched, &mut self.dropped.untouched),
        };
        *dropped += push(list, report);
    }

    pub(super) fn add_failed(&mut self, failed: Failed) {
        self.dropped.failed += push(&mut self.failed, failed);
    }

    pub(super) fn forget(&mut self, result: &str) {
        self.restored.retain(|report| report.result != result);
        self.untouched.retain(|report| report.result != result);
    }
}

/// Adds `one` and drops the oldest beyond [`SUMMARY_MAX`]. Returns how many it drops.
fn push<T>(all: &mut Vec<T>, one: T) -> usize {
    all.push(one);
    all.drain(..all.len().saturating_sub(SUMMARY_MAX)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_beyond_those_kept_are_counted() {
        let mut summary = Summary::default();
        for n in 0..SUMMARY_MAX + 2 {
            summary.add_failed(Failed { photo: n.to_string(), reason: String::new() });
        }
        assert_eq!(summary.failed.len(), SUMMARY_MAX);
        assert_eq!(summary.counts().failed, SUMMARY_MAX + 2);
    }
}
