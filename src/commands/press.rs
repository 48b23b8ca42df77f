//! `relens press`, and the simulated button: a file that exists while the button is down.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use relens::daemon::{Folders, State};
use relens::rig::monotonic::Monotonic;
use relens::rig::{ButtonLevel, Clock, Moment, RigError};

use super::error::CliError;
use super::options::FolderOption;
use super::output::say;

/// Name of the simulated button's file, in the daemon's folder.
const NAME: &str = ".relens-button-is-down";

const POLL_S: f64 = 0.01;

/// A short press: well above any debounce time, well below a long press.
const SHORT: Duration = Duration::from_millis(300);

pub(super) struct SimulatedButton {
    path: PathBuf,
    level: bool,
}

impl SimulatedButton {
    pub(super) fn new(folder: &Path) -> SimulatedButton {
        SimulatedButton { path: folder.join(NAME), level: false }
    }
}

impl ButtonLevel for SimulatedButton {
    fn level_by(&mut self, deadline: Moment) -> Result<bool, RigError> {
        loop {
            let level = self.path.exists();
            let now = Monotonic.now();
            if level != self.level || now >= deadline {
                self.level = level;
                return Ok(level);
            }
            Monotonic.wait_until(Moment((now.0 + POLL_S).min(deadline.0)));
        }
    }
}

/// Press the button of a simulated rig under `relens run`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens press --folder DIR
  relens press --folder DIR --long")]
pub(super) struct PressOptions {
    #[command(flatten)]
    folder: FolderOption,
    /// Press long: cancels the current job; in maintenance, calibrates
    #[arg(long)]
    long: bool,
}

pub(super) fn run(options: &PressOptions) -> Result<(), CliError> {
    let folder = &options.folder.folder;
    if !Folders::in_use(folder) {
        return Err(CliError::NobodyThere(folder.clone()));
    }
    // Read first, because an error after the press would make people press again.
    let needs_button =
        State::read(folder).map_err(CliError::BrokenState)?.is_none_or(|state| state.needs_button);
    let path = folder.join(NAME);
    std::fs::write(&path, b"").map_err(|e| CliError::writing(&path, e))?;
    // Three seconds suffice for most rig files; the longest long press would keep people waiting.
    std::thread::sleep(if options.long { Duration::from_secs(3) } else { SHORT });
    std::fs::remove_file(&path).map_err(|e| CliError::writing(&path, e))?;
    say(message(options.long, needs_button));
    Ok(())
}

fn message(long: bool, needs_button: bool) -> &'static str {
    match (long, needs_button) {
        (true, _) => "pressed long",
        (false, true) => "pressed",
        (false, false) => {
            "pressed; this box needs no button: it restores photos as they come ([run] mode = \
             \"button\" in the rig file makes them wait)"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_press_without_need_is_reported() {
        assert_eq!((message(false, true), message(true, false)), ("pressed", "pressed long"));
        assert!(message(false, false).contains("this box needs no button"));
    }
}
