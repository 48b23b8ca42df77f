//! Lines on standard output, and the log on standard error.

use std::io::Write;

use super::progress::{above, is_quiet};

/// Writes lines to standard output; a closed one is ignored.
pub(super) fn say(lines: &str) {
    if !is_quiet() {
        above(|| {
            let _ = writeln!(std::io::stdout(), "{lines}");
        });
    }
}

/// Writes lines to standard error, because standard output may carry the picture.
pub(super) fn note(lines: &str) {
    if !is_quiet() {
        log(lines);
    }
}

pub(super) fn log(line: &str) {
    above(|| {
        // A closed standard error is ignored.
        let _ = writeln!(std::io::stderr(), "{line}");
    });
}
