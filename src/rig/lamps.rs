//! The lamps of the box: what it is doing, seen from across the room.

use embedded_hal::digital::OutputPin;

use super::RigError;
use super::gpio_line::{LineName, OutputLine};

/// A lamp by its meaning (colours after IEC 60073: green ready, white busy, red or yellow trouble).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lamp {
    /// Waiting for photos.
    Ready,
    /// A photo is being worked on; lit at once when the button is pressed.
    Busy,
    /// The operator is needed.
    Trouble,
}

/// The lamps there are; a box may have any of them.
#[derive(Default)]
pub struct Lamps {
    lines: Vec<(Lamp, OutputLine)>,
}

impl Lamps {
    /// Takes the lines and leaves all lamps dark.
    ///
    /// # Errors
    /// When a line cannot be had.
    pub fn open(names: &[(Lamp, LineName)]) -> Result<Self, RigError> {
        let open = |(lamp, name): &(Lamp, LineName)| Ok((*lamp, OutputLine::open("lamp", name)?));
        Ok(Lamps { lines: names.iter().map(open).collect::<Result<_, RigError>>()? })
    }

    /// Lights the lamps in `lit` and no other.
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
