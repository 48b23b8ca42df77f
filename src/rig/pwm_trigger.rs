//! Trigger pulses of a PWM channel, which times them in hardware.
//!
//! An enabled channel repeats its pulse. A frame is accepted if its pulse began after
//! [`Trigger::fire`], as with a free-running camera. A single pulse would depend on the place in
//! the period at which an enabled channel starts, which no source states for RP1. Its driver states
//! that a disabled channel is at rest at once, and that a period and a duty cycle written
//! separately to an enabled one may be mixed (drivers/pwm/pwm-rp1.c in version 5 of its patch for
//! mainline, linux-pwm, June 2026).

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::gpio_line::refused;
use super::{Clock, Moment, RigError, Trigger};
use crate::config::{Level, PwmChannel};

/// Folder of the kernel's PWM chips.
pub(super) const CLASS: &str = "/sys/class/pwm";
/// Rest between two pulses, longer than the read-out of a camera of 25 frames a second. Guess.
const REST_NS: u64 = 40_000_000;
/// Limit of the time until udev has opened a new channel to its group. Guess.
const UDEV_S: f64 = 2.0;

/// Writes a text to an attribute.
pub(super) type WriteAttribute = Box<dyn Fn(&Path, &str) -> io::Result<()> + Send>;

/// Repeated pulses as long as the exposure.
pub struct PwmTrigger {
    write: WriteAttribute,
    clock: Box<dyn Clock + Send>,
    /// Folder of the channel.
    folder: PathBuf,
    active: Level,
    /// Pulse at the rig file's exposure.
    pulse_us: u32,
    /// Exposure as a multiple of the rig file's.
    times: f64,
    runs: bool,
    /// Period of the last pulses, in nanoseconds.
    last_ns: u64,
}

impl PwmTrigger {
    /// Takes the channel `name` of a chip under `root` and stops its pulses.
    ///
    /// # Errors
    /// [`RigError::Refused`] for a missing chip or channel, a file that may not be written, or an
    /// unsupported period or polarity; [`RigError::Held`] for a channel that the kernel uses.
    pub(super) fn open(
        root: &Path,
        write: WriteAttribute,
        clock: Box<dyn Clock + Send>,
        name: &PwmChannel,
        pulse_us: u32,
    ) -> Result<Self, RigError> {
        let chip = find(root, name)?;
        let folder = chip.join(format!("pwm{}", name.channel));
        if !folder.exists() {
            let (file, channel) = (chip.join("export"), name.channel.to_string());
            write(&file, &channel).map_err(|cause| failed(&file, &channel, &cause))?;
            let file = folder.join("period");
            let is_closed = || {
                write(&file, "0").is_err_and(|error| error.kind() == ErrorKind::PermissionDenied)
            };
            let deadline = clock.now().0 + UDEV_S;
            while is_closed() && clock.now().0 < deadline {
                clock.wait_until(Moment(clock.now().0 + 0.05));
            }
        }
        let (active, times, runs, last_ns) = (name.active, 1.0, false, 0);
        let mut trigger =
            PwmTrigger { write, clock, folder, active, pulse_us, times, runs, last_ns };
        trigger.last_ns = trigger.get("period")?.parse().unwrap_or(0);
        trigger.set()?;
        Ok(trigger)
    }

    fn pulse_ns(&self) -> u64 {
        (f64::from(self.pulse_us) * 1e3 * self.times).round() as u64
    }

    fn settings(&self) -> [(&'static str, String); 3] {
        let polarity = match self.active {
            Level::High => "normal",
            Level::Low => "inversed",
        };
        let pulse_ns = self.pulse_ns();
        [
            ("period", (pulse_ns + REST_NS).to_string()),
            ("polarity", polarity.to_owned()),
            ("duty_cycle", pulse_ns.to_string()),
        ]
    }

    fn get(&self, attribute: &str) -> Result<String, RigError> {
        read(&self.folder.join(attribute))
    }

    fn put(&self, attribute: &str, text: &str) -> Result<(), RigError> {
        let file = self.folder.join(attribute);
        (self.write)(&file, text).map_err(|cause| failed(&file, text, &cause))
    }

    /// Ends the pulses. A channel without a period refuses to be disabled.
    fn stop(&mut self) -> Result<(), RigError> {
        self.runs = false;
        if self.get("enable")? != "0" { self.put("enable", "0") } else { Ok(()) }
    }

    /// Sets the stopped channel. The kernel refuses a duty cycle longer than the period, and one
    /// without a period (drivers/pwm/core.c, `__pwm_apply`).
    fn set(&mut self) -> Result<(), RigError> {
        self.stop()?;
        for (attribute, text) in self.settings() {
            let found = self.get(attribute)?;
            if attribute == "period" && found != "0" && found != text {
                self.put("duty_cycle", "0")?;
            }
            if found != text {
                self.put(attribute, &text)?;
            }
        }
        Ok(())
    }
}

impl Trigger for PwmTrigger {
    /// Returns the current moment. The first call starts the pulses and waits for one period, since
    /// the first pulse may be short, or still as long as those before.
    fn fire(&mut self) -> Result<Moment, RigError> {
        if !self.runs {
            self.set()?;
            self.put("enable", "1")?;
            self.runs = true;
            let period_ns = self.pulse_ns() + REST_NS;
            let wait_s = period_ns.max(self.last_ns) as f64 * 1e-9;
            self.last_ns = period_ns;
            self.clock.wait_until(Moment(self.clock.now().0 + wait_s));
        }
        // Unlike a line, a channel is open to every program of the group.
        for (attribute, text) in self.settings().into_iter().chain([("enable", "1".to_owned())]) {
            let found = self.get(attribute)?;
            if found != text {
                let file = self.folder.join(attribute);
                let what = format!("{} is {found} instead of {text}", file.display());
                let what = format!("{what}, set by another program; end it");
                return Err(RigError::Held { device: "trigger", what });
            }
        }
        Ok(self.clock.now())
    }

    fn expose_times(&mut self, times: f64) {
        self.runs &= times == self.times;
        self.times = times;
    }
}

impl Drop for PwmTrigger {
    /// Leaves the channel exported: RP1's driver puts a released one low, whatever its polarity
    /// (`rp1_pwm_free`).
    fn drop(&mut self) {
        let _ = self.stop();
    }
}

/// Writes `text` to the attribute `file` of the kernel.
pub(super) fn write_attribute(file: &Path, text: &str) -> io::Result<()> {
    fs::OpenOptions::new().write(true).open(file)?.write_all(text.as_bytes())
}

/// Names of the chips' devices, and the chips' folders under `root`.
pub(super) fn chips(root: &Path) -> Vec<(String, PathBuf)> {
    let folders = fs::read_dir(root).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut chips: Vec<_> = folders
        .filter_map(|folder| {
            let device = fs::canonicalize(folder.join("device")).ok()?;
            Some((device.file_name()?.to_string_lossy().into_owned(), folder))
        })
        .collect();
    chips.sort();
    chips
}

fn find(root: &Path, name: &PwmChannel) -> Result<PathBuf, RigError> {
    let chips = chips(root);
    let Some((_, chip)) = chips.iter().find(|(device, _)| *device == name.chip) else {
        let devices = chips.into_iter().map(|(device, _)| device).collect();
        return Err(refused("trigger", format!("PWM chip {:?}", name.chip), devices));
    };
    let file = chip.join("npwm");
    let count = read(&file)?;
    if count.parse().is_ok_and(|count: u32| name.channel < count) {
        return Ok(chip.clone());
    }
    Err(RigError::Refused {
        device: "trigger",
        found: format!("channel {} of PWM chip {:?}", name.channel, name.chip),
        allowed: format!("channels below {count}, the number in {}", file.display()),
    })
}

fn read(file: &Path) -> Result<String, RigError> {
    match fs::read_to_string(file) {
        Ok(text) => Ok(text.trim().to_owned()),
        Err(cause) => {
            let what = format!("{} cannot be read ({cause})", file.display());
            Err(RigError::Gone { device: "trigger", what })
        }
    }
}

/// Error of writing `text` to `file`.
fn failed(file: &Path, text: &str, cause: &io::Error) -> RigError {
    let device = "trigger";
    let found = format!("{text} for {} ({cause})", file.display());
    let allowed = match cause.kind() {
        ErrorKind::PermissionDenied => "files of the group gpio, as 70-relens.rules makes them",
        ErrorKind::ReadOnlyFilesystem => "a folder named by ReadWritePaths= of the service's unit",
        ErrorKind::InvalidInput => "periods and polarities of this chip, or kind = \"line\"",
        ErrorKind::ResourceBusy => {
            return RigError::Held { device, what: format!("the kernel refuses {found}") };
        }
        _ => return RigError::Gone { device, what: format!("the kernel refuses {found}") },
    };
    RigError::Refused { device, found, allowed: allowed.to_owned() }
}

#[cfg(test)]
#[path = "pwm_trigger_tests.rs"]
mod tests;
