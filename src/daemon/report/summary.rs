//! Numbers of photos by outcome.

use serde::{Deserialize, Serialize};

use crate::daemon::store::report_file::{Failed, Report, ResultKind};
use crate::daemon::store::waiting::Waiting;

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
}

impl Summary {
    /// Numbers of photos by outcome.
    pub fn counts(&self) -> PhotoCounts {
        PhotoCounts {
            restored: self.restored.len(),
            untouched: self.untouched.len(),
            failed: self.failed.len(),
            waiting: self.waiting,
        }
    }
}
