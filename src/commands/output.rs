//! Lines on standard output, and the log on standard error.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

use super::progress::above;

static QUIET: AtomicBool = AtomicBool::new(false);

/// Prints warnings and errors alone from now on.
pub(super) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Whether warnings and errors alone are printed.
pub(super) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Writes lines to standard output; a closed one is ignored.
pub(super) fn say(lines: &str) {
    if !is_quiet() {
        above(|| {
            let _ = writeln!(std::io::stdout(), "{lines}");
        });
    }
}

/// Writes lines to standard error, where standard output carries the picture.
pub(super) fn note(lines: &str) {
    if !is_quiet() {
        log(lines);
    }
}

/// Writes a line of the log.
pub(super) fn log(line: &str) {
    above(|| {
        // A closed standard error is ignored.
        let _ = writeln!(std::io::stderr(), "{line}");
    });
}
