//! GPIO lines by chip label and line name, since numbers differ between boards and kernels.

use std::path::{Path, PathBuf};

use embedded_hal::digital::{ErrorKind, ErrorType, OutputPin};

use super::RigError;
use crate::config::{GpioLine, Level};

/// A line by its chip's node and its number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct LinePlace {
    pub(super) node: PathBuf,
    pub(super) offset: u32,
}

/// Consumer name of this program's lines.
pub(super) const CONSUMER: &str = "relens";

pub(super) fn refused(device: &'static str, found: String, allowed: Vec<String>) -> RigError {
    let allowed = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
    RigError::Refused { device, found, allowed }
}

/// Finds a line; `device` names its purpose in messages.
///
/// # Errors
/// [`RigError::Refused`] with the existing labels or names; [`RigError::Held`] with the name of the
/// program that uses the line.
pub(super) fn find(device: &'static str, name: &GpioLine) -> Result<LinePlace, RigError> {
    let mut labels = Vec::new();
    for node in gpiocdev::chip::chips().unwrap_or_default() {
        let Ok(chip) = gpiocdev::chip::Chip::from_path(&node) else { continue };
        let Ok(info) = chip.info() else { continue };
        if info.label != name.chip {
            labels.push(info.label);
            continue;
        }
        let mut names = Vec::new();
        for line in 0..info.num_lines {
            let Ok(line) = chip.line_info(line) else { continue };
            if line.name == name.line {
                if line.used {
                    let holder =
                        if line.consumer.is_empty() { "the kernel" } else { &line.consumer };
                    let what =
                        format!("line {} of {} is in use by {holder:?}", name.line, name.chip);
                    return Err(RigError::Held { device, what });
                }
                return Ok(LinePlace { node, offset: line.offset });
            }
            names.push(line.name);
        }
        names.retain(|other| !other.is_empty());
        return Err(refused(
            device,
            format!("line {:?} on chip {:?}", name.line, name.chip),
            names,
        ));
    }
    Err(refused(device, format!("GPIO chip {:?}", name.chip), labels))
}

/// An output line, off when opened and when dropped.
pub struct OutputLine {
    lines: gpiod::Lines<gpiod::Output>,
}

impl OutputLine {
    /// Requests the line and switches it off.
    ///
    /// # Errors
    /// As [`find`]; [`RigError::Failed`] when the kernel refuses the line.
    pub fn open(device: &'static str, name: &GpioLine) -> Result<Self, RigError> {
        let place = find(device, name)?;
        let lines = request(&place.node, place.offset, name.active).map_err(|source| {
            match rustix::io::Errno::from_io_error(&source) {
                Some(rustix::io::Errno::BUSY) => {
                    let what =
                        format!("line {} of {} is in use by another program", name.line, name.chip);
                    RigError::Held { device, what }
                }
                _ => RigError::Failed { device, doing: "take its line", source },
            }
        })?;
        Ok(OutputLine { lines })
    }

    fn set(&self, on: bool) -> Result<(), LineError> {
        self.lines.set_values([on]).map_err(LineError)
    }
}

fn request(
    node: &Path,
    offset: u32,
    active: Level,
) -> std::io::Result<gpiod::Lines<gpiod::Output>> {
    let active = if active == Level::Low { gpiod::Active::Low } else { gpiod::Active::High };
    let options =
        gpiod::Options::output([offset]).active(active).values([false]).consumer(CONSUMER);
    gpiod::Chip::new(node)?.request_lines(options)
}

impl Drop for OutputLine {
    /// Switches the line off before it is released; afterwards its pull resistor decides
    /// (hardware.md).
    fn drop(&mut self) {
        let _ = self.set(false);
    }
}

/// The kernel refused to set a line.
#[derive(Debug, thiserror::Error)]
#[error("cannot set the line")]
pub struct LineError(#[source] pub std::io::Error);

impl embedded_hal::digital::Error for LineError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl ErrorType for OutputLine {
    type Error = LineError;
}

/// High means "on", whatever the level on the wire.
impl OutputPin for OutputLine {
    fn set_low(&mut self) -> Result<(), LineError> {
        self.set(false)
    }

    fn set_high(&mut self) -> Result<(), LineError> {
        self.set(true)
    }
}
