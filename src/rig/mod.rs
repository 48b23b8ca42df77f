//! Rigs: panel, trigger, camera and clock, behind four traits.
//!
//! [`exposure`] combines them into captures. [`simulated`] implements them by physics, without any
//! knowledge of the solver or the calibration.
//!
//! A new kind of camera needs its keys in `config/hardware.rs`, an arm of `open` in
//! `rig/camera/mod.rs`, and an implementation of [`Camera`] beside it. A new pixel format is a row
//! in the table [`pixel_format::PixelFormat::ALL`].

pub mod bayer;
mod binned;
#[cfg(feature = "hardware")]
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
#[cfg(feature = "hardware")]
pub mod pwm_trigger;
pub mod shoot;
pub mod simulated;
#[cfg(any(test, feature = "hardware"))]
mod stamps;

pub use device::{
    ButtonLevel, Camera, Clock, Exposed, Flip, Lamp, LampRow, Moment, Panel, RigError, Trigger,
};

use crate::config;

/// Opens the rig of a rig file, simulated or real, and locates its frame marks.
pub fn open(rig: &config::RigFile) -> Result<exposure::Devices, RigError> {
    let mut devices = open_without_marks(rig)?;
    if let Some(place) = frame_mark::MarkPlace::of(rig) {
        devices.find_marks(place)?;
    }
    Ok(devices)
}

/// Opens a rig without frame marks, for photos with no panel in view.
pub fn open_without_marks(rig: &config::RigFile) -> Result<exposure::Devices, RigError> {
    match &rig.kind {
        config::Kind::Simulated(_) => Ok(simulated::open(rig)?.0),
        #[cfg(feature = "hardware")]
        config::Kind::Hardware(hardware) => hardware::open(rig, hardware),
        #[cfg(not(feature = "hardware"))]
        config::Kind::Hardware(_) => {
            let found = format!("the rig `{}`, which is made of hardware", rig.name);
            let allowed = "a simulated rig; this relens was built without `--features hardware`";
            Err(RigError::refused("rig", found, allowed))
        }
    }
}
