//! Whether the panel is before the lens: it is where its black and its white make a difference.

use super::RigError;
use super::exposure::Devices;
use super::shoot::{CountRange, mean};
use crate::frame::Mosaic;
use crate::patterns::{Trial, trial};

/// The difference that a panel before the lens makes at the least, as a share of what a count can
/// be over black. Guess: a panel's white is half of that or more, and one in the same room next to
/// nothing.
const DIFFERENCE_MIN: f64 = 0.1;

/// Shows black, white and black, and sees whether that is before the lens. Light that comes or goes
/// meanwhile is no panel's.
///
/// # Errors
/// When a capture brings no frame.
pub fn is_panel_there(
    devices: &mut Devices,
    mosaic: Option<Mosaic>,
    range: CountRange,
) -> Result<bool, RigError> {
    let size = devices.panel.size();
    let mut light = |shown| {
        let exposed = devices.capture_unproven(&trial(size, shown))?;
        let light = mean(&exposed.counts, mosaic);
        devices.camera.give_back(exposed.counts);
        Ok::<f64, RigError>(light)
    };
    let (before, white, after) = (light(Trial::Black)?, light(Trial::White)?, light(Trial::Black)?);
    let whole = f64::from(range.max) - range.black;
    Ok(white - before.max(after) > DIFFERENCE_MIN * whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use crate::frame::{Frame, Plane, Work};
    use crate::rig::simulated;
    use std::path::Path;

    #[test]
    fn the_panel_is_seen_where_it_is_and_not_through_a_scene() {
        let rig = config::load(Path::new("small.toml")).unwrap();
        let (mut devices, witness) = simulated::open(&rig).unwrap();
        let range = CountRange { black: 64.0, max: 1023 };
        let mut there = || is_panel_there(&mut devices, None, range).unwrap();
        assert!(there());
        for level in [0.0, 120.0, 255.0] {
            let wall: Frame<Work> =
                Frame::from_fn(|_| Plane::filled(rig.photo_grid().sensor, level));
            witness.put_before_lens(Some(&wall));
            assert!(!there(), "a wall of {level} is no panel");
        }
        witness.put_before_lens(None);
        assert!(there());
    }
}
