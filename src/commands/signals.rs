//! What signals do: at SIGINT and SIGTERM a daemon ends in good order, and every other command ends
//! at once and leaves no line of progress behind; a daemon says at SIGUSR1 what it does, and at
//! SIGHUP that it goes on, or ends if its terminal went away.

use std::io::IsTerminal;
use std::os::raw::c_int;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;

use relens::remedy::full_message;

use super::error::CliError;
use super::{progress, status};

/// True once the daemon whose state is kept in `home` is to end: the photo under way is given up
/// before its next capture, or finished. A second SIGINT ends the program at once, for those who
/// sit before it.
///
/// # Errors
/// When the system has no thread or socket left.
pub(super) fn stop_flag(home: PathBuf) -> Result<Arc<AtomicBool>, CliError> {
    let stopped = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stopped);
    let at_terminal = std::io::stderr().is_terminal();
    attend(&[SIGINT, SIGTERM, SIGHUP, SIGUSR1], move |signal| {
        if signal == SIGUSR1 {
            match status::of(&home) {
                Ok(words) => words.lines().for_each(|line| log::info!("{line}")),
                Err(error) => log::warn!("{}", full_message(&error)),
            }
        } else if signal == SIGHUP && at_terminal == std::io::stderr().is_terminal() {
            // A terminal that went away is none any more.
            log::info!(
                "SIGHUP changes nothing: the rig file is read at the start alone; start relens \
                 again to have it read anew"
            );
        } else if flag.swap(true, Ordering::AcqRel) && signal == SIGINT {
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
    attend(&[SIGINT, SIGTERM], end)
}

fn attend(which: &[c_int], mut came: impl FnMut(c_int) + Send + 'static) -> Result<(), CliError> {
    let mut signals = Signals::new(which).map_err(CliError::Signals)?;
    let thread = std::thread::Builder::new().name("signals".to_owned());
    let begun = thread.spawn(move || signals.forever().for_each(&mut came));
    begun.map(drop).map_err(CliError::Signals)
}

/// Ends as if nobody had listened, so that a shell sees why.
fn end(signal: c_int) {
    progress::leave();
    let _ = emulate_default_handler(signal);
}
