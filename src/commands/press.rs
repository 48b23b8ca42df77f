//! `relens press` and the button of a simulated rig: a file that is there while the button is down.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use relens::daemon::{Folders, State};
use relens::kiosk::attend::ButtonLevel;
use relens::rig::monotonic::Monotonic;
use relens::rig::{Clock, Moment, RigError};

use super::error::CliError;
use super::options::FolderOption;
use super::output::say;

/// Name of the file in the folder of the daemon.
const NAME: &str = ".relens-button-is-down";

/// How often the file is looked for.
const LOOK_S: f64 = 0.01;

/// How long `relens press` holds the button: well over any debounce time, well below a long press.
const SHORT: Duration = Duration::from_millis(300);

/// A button that is pressed by a file.
pub(super) struct SimulatedButton {
    path: PathBuf,
    level: bool,
}

impl SimulatedButton {
    /// The button of the daemon on `folder`.
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
            Monotonic.wait_until(Moment((now.0 + LOOK_S).min(deadline.0)));
        }
    }
}

/// Press the button of the simulated rig that a `relens run` works with
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  relens press --folder DIR
  relens press --folder DIR --long")]
pub(super) struct PressOptions {
    #[command(flatten)]
    folder: FolderOption,
    /// Hold it down: gives the job under way up; in maintenance, measures the lens anew
    #[arg(long)]
    long: bool,
}

/// `relens press`.
pub(super) fn run(options: &PressOptions) -> Result<(), CliError> {
    let folder = &options.folder.folder;
    if !Folders::in_use(folder) {
        return Err(CliError::NobodyThere(folder.clone()));
    }
    // Before anything is pressed: an error after it would have people press again.
    let needs_button =
        State::read(folder).map_err(CliError::BrokenState)?.is_none_or(|state| state.needs_button);
    let path = folder.join(NAME);
    std::fs::write(&path, b"").map_err(|e| CliError::writing(&path, e))?;
    // Twice the longest long press a rig file may ask for would keep people waiting; three seconds
    // do for most.
    std::thread::sleep(if options.long { Duration::from_secs(3) } else { SHORT });
    std::fs::remove_file(&path).map_err(|e| CliError::writing(&path, e))?;
    say(told(options.long, needs_button));
    Ok(())
}

/// What is said of a press.
fn told(long: bool, needs_button: bool) -> &'static str {
    match (long, needs_button) {
        (true, _) => "pressed long",
        (false, true) => "pressed",
        (false, false) => {
            "pressed; this box needs no button: it takes photos as they come ([run] mode = \
             \"button\" in the rig file has them wait)"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_press_that_nothing_waits_for_says_so() {
        assert_eq!((told(false, true), told(true, false)), ("pressed", "pressed long"));
        assert!(told(false, false).contains("this box needs no button"));
    }
}
