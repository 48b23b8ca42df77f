//! The box's lamps.

use super::gpio_line::OutputLine;
use super::{Lamp, LampRow, RigError};
use crate::config::LampDevices;

/// Lamps of the box, as far as the rig file names them.
#[derive(Default)]
pub struct Lamps {
    lines: Vec<(Lamp, OutputLine)>,
}

impl Lamps {
    /// Requests the lines, with all lamps off.
    pub fn open(lamps: &LampDevices) -> Result<Self, RigError> {
        let each = [
            (Lamp::Ready, &lamps.ready),
            (Lamp::Busy, &lamps.busy),
            (Lamp::Trouble, &lamps.trouble),
        ];
        let named = each.into_iter().filter_map(|(lamp, name)| Some((lamp, name.as_ref()?)));
        let lines = named.map(|(lamp, name)| Ok((lamp, OutputLine::open("lamp", name)?)));
        Ok(Lamps { lines: lines.collect::<Result<_, RigError>>()? })
    }
}

impl LampRow for Lamps {
    fn show(&mut self, lit: &[Lamp]) -> Result<(), RigError> {
        for (lamp, line) in &mut self.lines {
            let failed = |source| {
                let (device, doing) = ("lamp", "change its line");
                RigError::Failed { device, doing, source }
            };
            line.set(lit.contains(lamp)).map_err(failed)?;
        }
        Ok(())
    }
}
