//! What the program says: lines on standard output, the log on standard error.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

use super::progress::above;

static QUIET: AtomicBool = AtomicBool::new(false);

/// From now on only what went wrong is said.
pub(super) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether only what went wrong is said.
pub(super) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Writes lines to standard output. A reader that went away is no trouble of ours.
pub(super) fn say(lines: &str) {
    if !is_quiet() {
        above(|| {
            let _ = writeln!(std::io::stdout(), "{lines}");
        });
    }
}

/// Writes lines to standard error, where standard output has the picture.
pub(super) fn note(lines: &str) {
    if !is_quiet() {
        log(lines);
    }
}

/// Writes a line of the log.
pub(super) fn log(line: &str) {
    above(|| {
        // There is nowhere to complain to when standard error is gone.
        let _ = writeln!(std::io::stderr(), "{line}");
    });
}
