//! A rig simulated by ray tracing, and the witness to its ground truth.
//!
//! Light path: codes → [`panel`] response → [`pose`] → [`point_spread`] by [`convolution`] →
//! [`glare`] → dark corners → [`sensor`]. The lens is traced from its [`prescription`] through
//! [`glass`]; [`bench`] adds time, [`faults`] errors. No code is shared with the solver or the
//! calibration.

mod bench;
mod convolution;
mod devices;
mod faults;
mod glare;
mod glass;
mod optics;
mod panel;
mod photograph;
mod point_spread;
mod pose;
mod prescription;
mod sensor;
mod stripes;
mod trace;
mod unrest;
mod wear;
mod witness;

pub use optics::Light;
pub use photograph::RawPhoto;
pub use wear::Wear;
pub use witness::Witness;

use std::sync::Arc;

use self::bench::OpticalBench;
use self::devices::Shared;
use self::optics::Optics;
use super::RigError;
use super::binned::binned;
use super::exposure::{Devices, Timing};
use crate::config;

/// Builds the simulated `rig` and its witness.
///
/// # Errors
/// [`RigError::Refused`] if `rig` is not simulated or its lens forms no real image.
pub fn open(rig: &config::RigFile) -> Result<(Devices, Witness), RigError> {
    let Some(simulation) = rig.simulation() else {
        let found = format!("the rig `{}` of real devices", rig.name);
        return Err(RigError::refused("simulated rig", found, "a simulated one"));
    };
    let (binning, rig) = (rig.camera.binning, &rig.unbinned());
    let optics = Arc::new(Optics::new(simulation, rig.camera.size(), rig.photo_on_sensor())?);
    let pose = simulation.pose.clone();
    let map = optics.map(&pose, rig.panel.size());
    optics.prepare();
    let shared = Shared::new(OpticalBench::new(rig, simulation, Arc::clone(&optics), &map));
    let devices = Devices::new(
        Box::new(shared.clone()),
        Box::new(shared.clone()),
        binned(Box::new(shared.clone()), binning, rig.camera.count_max()),
        Box::new(shared.clone()),
        Timing::of(&rig.panel, &rig.camera),
    );
    let witness = Witness {
        shared,
        optics,
        pose,
        map,
        panel: rig.panel.size(),
        canvas: rig.canvas_on_sensor(),
        surround: simulation.surround,
        curve: rig.photo.curve,
        simulation: simulation.clone(),
    };
    Ok((devices, witness))
}

#[cfg(test)]
mod focus_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod truth_tests;
