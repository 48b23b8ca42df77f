//! What is bolted down: panel, trigger, camera and clock, behind four small traits.
//!
//! [`exposure`] turns them into one act, show-and-see. `simulated` is a rig like any other, made of
//! physics; it knows nothing of the solver or the calibration.
//!
//! Another kind of camera is three files: its keys and their rules in `config/hardware.rs`, an arm
//! of `open` in `rig/camera/mod.rs`, and a file of its own beside that, with `Camera` for it.
//! Another pixel format is one file, [`pixel_format`].

pub mod bayer;
pub mod button;
#[cfg(feature = "hardware")]
pub mod camera;
pub mod coarse_geometry;
mod device;
#[cfg(any(test, feature = "hardware"))]
mod display_link;
pub mod exposure;
pub mod frame_mark;
#[cfg(feature = "hardware")]
pub mod gpio_line;
#[cfg(feature = "hardware")]
pub mod hardware;
pub mod kernel_time;
#[cfg(feature = "hardware")]
mod kms_card;
#[cfg(feature = "hardware")]
pub mod kms_panel;
#[cfg(feature = "hardware")]
pub mod lamps;
pub mod mark_search;
#[cfg(feature = "hardware")]
mod modeset;
pub mod monotonic;
pub mod pixel_format;
pub mod presence;
#[cfg(feature = "hardware")]
pub mod pulse_trigger;
pub mod shoot;
pub mod simulated;
#[cfg(any(test, feature = "hardware"))]
mod stamps;

pub use device::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger};

use crate::config;

/// Opens the rig of a rig file, simulated or real, and finds the frame marks where it has room for
/// them.
///
/// # Errors
/// Whatever a device has to say.
pub fn open(rig: &config::RigFile) -> Result<exposure::Devices, RigError> {
    let mut devices = open_without_marks(rig)?;
    if let Some(place) = frame_mark::MarkPlace::of(rig) {
        devices.find_marks(place)?;
    }
    Ok(devices)
}

/// The same for photos of what is not on the panel, which need not be in view.
///
/// # Errors
/// Whatever a device has to say.
pub fn open_without_marks(rig: &config::RigFile) -> Result<exposure::Devices, RigError> {
    match &rig.kind {
        config::Kind::Simulated(_) => Ok(simulated::open(rig)?.0),
        #[cfg(feature = "hardware")]
        config::Kind::Hardware(hardware) => hardware::open(rig, hardware),
        #[cfg(not(feature = "hardware"))]
        config::Kind::Hardware(_) => Err(RigError::Refused {
            device: "rig",
            found: format!("the rig `{}`, which is made of hardware", rig.name),
            allowed: "a simulated rig; this relens was built without `--features hardware`"
                .to_owned(),
        }),
    }
}
