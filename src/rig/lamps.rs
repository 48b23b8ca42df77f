//! The box's lamps.

use embedded_hal::digital::OutputPin;

use super::RigError;
use super::gpio_line::{LineName, OutputLine};

/// Meaning of a lamp. Colours after IEC 60073: green ready, white busy, red or yellow trouble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lamp {
    /// Waiting for photos.
    Ready,
    /// Restoring a photo; lit at once when the button is pressed.
    Busy,
    /// Needs the operator.
    Trouble,
}

/// The lamps that the box has.
#[derive(Default)]
pub struct Lamps {
    lines: Vec<(Lamp, OutputLine)>,
}

impl Lamps {
    /// Requests the lines; all lamps are dark.
    ///
    /// # Errors
    /// When a line cannot be requested.
    pub fn open(names: &[(Lamp, LineName)]) -> Result<Self, RigError> {
        let open = |(lamp, name): &(Lamp, LineName)| Ok((*lamp, OutputLine::open("lamp", name)?));
        Ok(Lamps { lines: names.iter().map(open).collect::<Result<_, RigError>>()? })
    }

    /// Lights exactly the lamps in `lit`.
    ///
    /// # Errors
    /// When a line cannot be set.
    pub fn show(&mut self, lit: &[Lamp]) -> Result<(), RigError> {
        for (lamp, line) in &mut self.lines {
            let outcome = if lit.contains(lamp) { line.set_high() } else { line.set_low() };
            outcome.map_err(|cause| RigError::Failed {
                device: "lamp",
                doing: "change its line",
                source: cause.0,
            })?;
        }
        Ok(())
    }
}
