//! Detection of the panel in front of the lens, by the difference between its black and white.

use super::RigError;
use super::exposure::Devices;
use super::shoot::{CountRange, mean};
use crate::frame::{Codes, Mosaic};

/// Minimum difference between white and black with a panel in front of the lens, as a share of the
/// count range. Guess: its white fills half of the range or more, that of a panel elsewhere in the
/// room almost nothing.
const DIFFERENCE_MIN: f64 = 0.1;

/// Returns whether the panel is in front of the lens, from captures of black, white and black
/// again. The second black rules out other changes of light.
pub fn is_panel_there(
    devices: &mut Devices,
    mosaic: Option<Mosaic>,
    range: CountRange,
) -> Result<bool, RigError> {
    let size = devices.panel.size();
    let mut light = |code| {
        let exposed = devices.capture_unproven(&Codes::filled(size, code))?;
        let light = mean(&exposed.counts, mosaic);
        devices.camera.give_back(exposed.counts);
        Ok::<f64, RigError>(light)
    };
    let (before, white, after) = (light(0)?, light(255)?, light(0)?);
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
    fn a_panel_is_detected_and_a_scene_is_not() {
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
