//! The box's lamps.

use embedded_hal::digital::OutputPin;

use super::gpio_line::{LineName, OutputLine};
use super::{Lamp, LampRow, RigError};

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
}

impl LampRow for Lamps {
    fn show(&mut self, lit: &[Lamp]) -> Result<(), RigError> {
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
