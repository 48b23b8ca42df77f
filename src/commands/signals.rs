//! Signals. SIGINT and SIGTERM stop a daemon in good order, and any other command at once, with its
//! progress line cleared. A daemon logs its state at SIGUSR1. At SIGHUP it stops if its terminal
//! closed, and otherwise continues.

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

/// A flag that is set once the daemon with its state in `home` is to stop: the photo in progress is
/// finished, or given up before its next capture. A second SIGINT ends the program at once.
pub(super) fn stop_flag(home: PathBuf) -> Result<Arc<AtomicBool>, CliError> {
    let stopped = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stopped);
    let at_terminal = std::io::stderr().is_terminal();
    listen(&[SIGINT, SIGTERM, SIGHUP, SIGUSR1], move |signal| {
        if signal == SIGUSR1 {
            match status::of(&home) {
                Ok(words) => words.lines().for_each(|line| log::info!("{line}")),
                Err(error) => log::warn!("{}", full_message(&error)),
            }
        } else if signal == SIGHUP && at_terminal == std::io::stderr().is_terminal() {
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
