//! What the program says: lines on standard output, the log on standard error.

use std::io::Write;

use super::progress::above;

/// Writes lines to standard output. A reader that went away is no trouble of ours.
pub(super) fn say(lines: &str) {
    above(|| {
        let _ = writeln!(std::io::stdout(), "{lines}");
    });
}

/// Writes a line of the log.
pub(super) fn log(line: &str) {
    above(|| {
        // There is nowhere to complain to when standard error is gone.
        let _ = writeln!(std::io::stderr(), "{line}");
    });
}
