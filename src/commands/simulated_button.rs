//! The button of a simulated rig: a file that is there while the button is down.

use std::path::{Path, PathBuf};
use std::time::Duration;

use relens::kiosk::desk::Button;
use relens::rig::{Clock, Moment, RigError};

use super::clock::MachineClock;
use super::{CliError, say};

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
    clock: MachineClock,
}

impl SimulatedButton {
    /// The button of the daemon on `folder`; `clock` is the one its deadlines are on.
    pub(super) fn new(folder: &Path, clock: MachineClock) -> SimulatedButton {
        SimulatedButton { path: folder.join(NAME), level: false, clock }
    }
}

impl Button for SimulatedButton {
    fn level_by(&mut self, deadline: Moment) -> Result<bool, RigError> {
        loop {
            let level = self.path.exists();
            let now = self.clock.now();
            if level != self.level || now >= deadline {
                self.level = level;
                return Ok(level);
            }
            self.clock.wait_until(Moment((now.0 + LOOK_S).min(deadline.0)));
        }
    }
}

/// `relens press`.
pub(super) fn press(folder: &Path, long: bool) -> Result<(), CliError> {
    let path = folder.join(NAME);
    std::fs::write(&path, b"").map_err(|e| CliError::writing(&path, &e))?;
    // Twice the longest long press a rig file may ask for would keep people waiting; three seconds
    // do for most.
    std::thread::sleep(if long { Duration::from_secs(3) } else { SHORT });
    std::fs::remove_file(&path).map_err(|e| CliError::writing(&path, &e))?;
    say(if long { "pressed long" } else { "pressed" })
}
