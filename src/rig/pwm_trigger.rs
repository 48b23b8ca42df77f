//! Trigger pulses of a PWM channel, which times them in hardware.
//!
//! An enabled channel repeats its pulse. A frame is accepted if its pulse began after
//! [`Trigger::fire`], as with a free-running camera. The length of a single pulse would depend on
//! where in its period an enabled channel starts, which no source documents for RP1. Its driver
//! documents that a disabled channel stops at once, and that a period and a duty cycle written
//! separately to an enabled channel may be mixed (drivers/pwm/pwm-rp1.c in version 5 of its patch
//! for mainline, linux-pwm, June 2026).

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::device::listed;
use super::{Clock, Moment, RigError, Trigger};
use crate::config::{Level, PwmChannel};

pub(super) const CLASS: &str = "/sys/class/pwm";
/// Rest between two pulses, longer than the read-out of a camera of 25 frames a second. Guess.
const REST_NS: u64 = 40_000_000;
/// Maximum wait until udev has opened a new channel to its group. Guess.
const UDEV_S: f64 = 2.0;

/// Function that writes a text to an attribute's file.
pub(super) type WriteAttribute = Box<dyn Fn(&Path, &str) -> io::Result<()> + Send>;

/// Trigger that repeats pulses as long as the exposure.
pub struct PwmTrigger {
    write: WriteAttribute,
    clock: Box<dyn Clock + Send>,
    folder: PathBuf,
    polarity: &'static str,
    /// Length of a pulse at the rig file's exposure; `times` multiplies it.
    pulse_us: u32,
    times: f64,
    runs: bool,
    /// Period of the previous pulses.
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
        let PwmChannel { chip: device, channel, active } = name;
        let chips = chips(root);
        let Some((_, chip)) = chips.iter().find(|(other, _)| other == device) else {
            let devices: Vec<String> = chips.into_iter().map(|(device, _)| device).collect();
            let found = format!("PWM chip {device:?}");
            return Err(RigError::refused("trigger", found, listed(&devices)));
        };
        let channels = 0..read(&chip.join("npwm"))?.parse().unwrap_or(0);
        if !channels.contains(channel) {
            let found = format!("channel {channel} of PWM chip {device:?}");
            let channels: Vec<String> = channels.map(|n| n.to_string()).collect();
            return Err(RigError::refused("trigger", found, listed(&channels)));
        }
        let folder = chip.join(format!("pwm{channel}"));
        let polarity = if *active == Level::High { "normal" } else { "inversed" };
        let (times, runs, last_ns) = (1.0, false, 0);
        let mut trigger =
            PwmTrigger { write, clock, folder, polarity, pulse_us, times, runs, last_ns };
        if !trigger.folder.exists() {
            trigger.put(&chip.join("export"), &channel.to_string())?;
        }
        trigger.last_ns = trigger.get("period")?.parse().unwrap_or(0);
        trigger.set()?;
        Ok(trigger)
    }

    fn pulse_ns(&self) -> u64 {
        (f64::from(self.pulse_us) * 1e3 * self.times).round() as u64
    }

    fn settings(&self) -> [(&'static str, String); 3] {
        let pulse_ns = self.pulse_ns();
        let (period, pulse) = ((pulse_ns + REST_NS).to_string(), pulse_ns.to_string());
        [("period", period), ("polarity", self.polarity.to_owned()), ("duty_cycle", pulse)]
    }

    fn get(&self, attribute: &str) -> Result<String, RigError> {
        read(&self.folder.join(attribute))
    }

    /// Writes `text` to `file`, as soon as udev has opened it to the group.
    fn put(&self, file: &Path, text: &str) -> Result<(), RigError> {
        let (deadline, is_closed) = (self.clock.now().0 + UDEV_S, ErrorKind::PermissionDenied);
        let mut outcome = (self.write)(file, text);
        while outcome.as_ref().is_err_and(|cause| cause.kind() == is_closed)
            && self.clock.now().0 < deadline
        {
            self.clock.wait_until(Moment(self.clock.now().0 + 0.05));
            outcome = (self.write)(file, text);
        }
        outcome.map_err(|cause| failed(file, text, &cause))
    }

    /// Writes `text` to `attribute` unless it has that value.
    fn make(&self, attribute: &str, text: &str) -> Result<(), RigError> {
        if self.get(attribute)? == text {
            return Ok(());
        }
        self.put(&self.folder.join(attribute), text)
    }

    /// Sets period, polarity and duty cycle of the disabled channel. The kernel refuses a duty
    /// cycle longer than the period, and any without a period (drivers/pwm/core.c, `__pwm_apply`).
    fn set(&mut self) -> Result<(), RigError> {
        self.make("enable", "0")?;
        let settings = self.settings();
        let period = self.get("period")?;
        if period != "0" && period != settings[0].1 {
            self.make("duty_cycle", "0")?;
        }
        settings.iter().try_for_each(|(attribute, text)| self.make(attribute, text))
    }
}

impl Trigger for PwmTrigger {
    /// Returns the current moment. The first call starts the pulses and waits for one period, since
    /// the first pulse may be cut short or have the previous length.
    fn fire(&mut self) -> Result<Moment, RigError> {
        if !self.runs {
            self.set()?;
            self.make("enable", "1")?;
            self.runs = true;
            let period_ns = self.pulse_ns() + REST_NS;
            let wait_s = period_ns.max(self.last_ns) as f64 * 1e-9;
            self.last_ns = period_ns;
            self.clock.wait_until(Moment(self.clock.now().0 + wait_s));
        }
        // Unlike a GPIO line, a channel can be changed by every program of the group.
        for (attribute, text) in self.settings().into_iter().chain([("enable", "1".to_owned())]) {
            let found = self.get(attribute)?;
            if found != text {
                let of = self.folder.display();
                let what = format!("another program has set {of}/{attribute} to {found}; end it");
                return Err(RigError::held("trigger", what));
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
    /// Disables the channel but leaves it exported: RP1's driver drives a released one low,
    /// whatever its polarity (`rp1_pwm_free`).
    fn drop(&mut self) {
        let _ = self.make("enable", "0");
    }
}

pub(super) fn write_attribute(file: &Path, text: &str) -> io::Result<()> {
    fs::OpenOptions::new().write(true).open(file)?.write_all(text.as_bytes())
}

/// Names of the chips' devices, and the chips' folders under `root`.
pub(super) fn chips(root: &Path) -> Vec<(String, PathBuf)> {
    let named = |entry: fs::DirEntry| {
        let device = fs::canonicalize(entry.path().join("device")).ok()?;
        Some((device.file_name()?.to_string_lossy().into_owned(), entry.path()))
    };
    fs::read_dir(root).into_iter().flatten().flatten().filter_map(named).collect()
}

fn read(file: &Path) -> Result<String, RigError> {
    let unread = |cause| format!("{} cannot be read ({cause})", file.display());
    let text = fs::read_to_string(file).map_err(|c| RigError::gone("trigger", unread(c)))?;
    Ok(text.trim().to_owned())
}

fn failed(file: &Path, text: &str, cause: &io::Error) -> RigError {
    let device = "trigger";
    let found = format!("{text} for {} ({cause})", file.display());
    let what = format!("the kernel refuses {found}");
    let allowed = match cause.kind() {
        ErrorKind::PermissionDenied => "files of the group gpio, as 70-relens.rules makes them",
        ErrorKind::ReadOnlyFilesystem => "a folder named by ReadWritePaths= of the service's unit",
        ErrorKind::InvalidInput => "periods and polarities of this chip, or kind = \"line\"",
        ErrorKind::ResourceBusy => return RigError::held(device, what),
        _ => return RigError::gone(device, what),
    };
    RigError::refused(device, found, allowed)
}

#[cfg(test)]
#[path = "pwm_trigger_tests.rs"]
mod tests;
