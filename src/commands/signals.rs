//! What SIGINT and SIGTERM do: a daemon ends in good order; every other command ends at once, and
//! leaves no line of progress behind.

use std::os::raw::c_int;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;

use super::error::CliError;
use super::progress;

/// True once one of the two came: the photo under way is given up before its next capture, or
/// finished. A second SIGINT ends the program at once, for those who sit before it.
///
/// # Errors
/// When the system has no thread or socket left.
pub(super) fn stop_flag() -> Result<Arc<AtomicBool>, CliError> {
    let stopped = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stopped);
    attend(move |signal| {
        if flag.swap(true, Ordering::AcqRel) && signal == SIGINT {
            end(signal);
        }
    })?;
    Ok(stopped)
}

/// Ends the program at the first of the two, with a clean line.
///
/// # Errors
/// As [`stop_flag`].
pub(super) fn end_cleanly() -> Result<(), CliError> {
    attend(end)
}

fn attend(mut came: impl FnMut(c_int) + Send + 'static) -> Result<(), CliError> {
    let mut signals = Signals::new([SIGINT, SIGTERM]).map_err(CliError::Signals)?;
    let thread = std::thread::Builder::new().name("signals".to_owned());
    let begun = thread.spawn(move || signals.forever().for_each(&mut came));
    begun.map(drop).map_err(CliError::Signals)
}

/// Ends as if nobody had listened, so that a shell sees why.
fn end(signal: c_int) {
    progress::leave();
    let _ = emulate_default_handler(signal);
}
