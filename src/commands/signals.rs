//! Signals. SIGINT and SIGTERM stop a daemon in good order, and any other command at once, with its
//! progress line cleared. At SIGHUP a daemon stops if its terminal closed, and otherwise continues.

use std::io::IsTerminal;
use std::os::raw::c_int;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;

use super::error::CliError;
use super::progress;

/// A flag that is set once the daemon is to stop: the photo in progress is finished, or given up
/// before its next capture. A second SIGINT ends the program at once.
pub(super) fn stop_flag() -> Result<Arc<AtomicBool>, CliError> {
    let stopped = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stopped);
    let at_terminal = std::io::stderr().is_terminal();
    listen(&[SIGINT, SIGTERM, SIGHUP], move |signal| {
        if signal == SIGHUP && at_terminal == std::io::stderr().is_terminal() {
            // A closed terminal is no terminal any more.
            log::info!(
                "SIGHUP is ignored: the rig file is read at the start only; restart relens to read \
                 it again"
            );
        } else if flag.swap(true, Ordering::AcqRel) && signal == SIGINT {
            end(signal);
        }
    })?;
    Ok(stopped)
}

/// Ends the program at SIGINT or SIGTERM, with its progress line cleared.
pub(super) fn end_cleanly() -> Result<(), CliError> {
    listen(&[SIGINT, SIGTERM], end)
}

fn listen(which: &[c_int], mut handle: impl FnMut(c_int) + Send + 'static) -> Result<(), CliError> {
    let mut signals = Signals::new(which).map_err(CliError::Signals)?;
    let thread = std::thread::Builder::new().name("signals".to_owned());
    let begun = thread.spawn(move || signals.forever().for_each(&mut handle));
    begun.map(drop).map_err(CliError::Signals)
}

/// Ends by the signal's default action, so that a shell sees the reason.
fn end(signal: c_int) {
    progress::leave();
    let _ = emulate_default_handler(signal);
}
