//! GPIO lines, found by chip label and line name, since numbers differ between boards and kernels.

use std::io;
use std::path::PathBuf;

use embedded_hal::digital::{ErrorKind, ErrorType, OutputPin};
use rustix::io::Errno;

use super::RigError;
use super::device::listed;
use crate::config::{GpioLine, Level};

/// A line by its chip's node and its number.
pub(super) struct LinePlace {
    pub(super) node: PathBuf,
    pub(super) offset: u32,
}

/// Consumer name of this program's lines.
pub(super) const CONSUMER: &str = "relens";

/// Finds a line; `device` names its purpose in messages.
///
/// # Errors
/// [`RigError::Refused`] for an unknown chip or line, with the existing ones; [`RigError::Held`]
/// for a line in use, with the name of the program that uses it.
pub(super) fn find(device: &'static str, name: &GpioLine) -> Result<LinePlace, RigError> {
    let GpioLine { chip: label, line: wanted, .. } = name;
    let mut labels = Vec::new();
    for node in gpiocdev::chip::chips().unwrap_or_default() {
        let Ok(chip) = gpiocdev::chip::Chip::from_path(&node) else { continue };
        let Ok(info) = chip.info() else { continue };
        if info.label != *label {
            labels.push(info.label);
            continue;
        }
        let mut names = Vec::new();
        for line in (0..info.num_lines).filter_map(|n| chip.line_info(n).ok()) {
            if line.name != *wanted {
                names.push(line.name);
            } else if line.used {
                let holder = if line.consumer.is_empty() { "the kernel" } else { &line.consumer };
                let what = format!("line {wanted} of {label} is in use by {holder:?}");
                return Err(RigError::held(device, what));
            } else {
                return Ok(LinePlace { node, offset: line.offset });
            }
        }
        names.retain(|other| !other.is_empty());
        let found = format!("line {wanted:?} on chip {label:?}");
        return Err(RigError::refused(device, found, listed(&names)));
    }
    Err(RigError::refused(device, format!("GPIO chip {label:?}"), listed(&labels)))
}

/// An output line, off when opened and when dropped.
pub struct OutputLine {
    lines: gpiod::Lines<gpiod::Output>,
}

impl OutputLine {
    /// Requests the line and switches it off.
    ///
    /// # Errors
    /// Those of [`find`]; [`RigError::Failed`] if the kernel refuses the line.
    pub fn open(device: &'static str, name: &GpioLine) -> Result<Self, RigError> {
        let LinePlace { node, offset } = find(device, name)?;
        let active = match name.active {
            Level::High => gpiod::Active::High,
            Level::Low => gpiod::Active::Low,
        };
        let options =
            gpiod::Options::output([offset]).active(active).values([false]).consumer(CONSUMER);
        let lines = gpiod::Chip::new(node).and_then(|chip| chip.request_lines(options));
        let lines = lines.map_err(|source| match Errno::from_io_error(&source) {
            Some(Errno::BUSY) => {
                let GpioLine { chip, line, .. } = name;
                RigError::held(
                    device,
                    format!("line {line} of {chip} is in use by another program"),
                )
            }
            _ => RigError::Failed { device, doing: "take its line", source },
        })?;
        Ok(OutputLine { lines })
    }

    /// Switches the line on or off, whatever the level on the wire.
    pub fn set(&self, on: bool) -> io::Result<()> {
        self.lines.set_values([on])
    }
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
pub struct LineError(#[source] io::Error);

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
        self.set(false).map_err(LineError)
    }

    fn set_high(&mut self) -> Result<(), LineError> {
        self.set(true).map_err(LineError)
    }
}
