//! The lens measured at focuses other than the panel's, and kept in the calibration.

use std::path::Path;

use super::baseline;
use super::on_rig::watch;
use crate::calibration::{Calibration, store};
use crate::config;
use crate::measurement::{CalibrationProgress, calibrate};
use crate::remedy::AnyFailure;
use crate::rig::exposure::Devices;

/// Measures the lens of `devices` at a focus `offset` dioptres nearer than the panel's, and keeps
/// it in the calibration in `slots`.
///
/// # Errors
/// When the rig cannot be calibrated or the result cannot be kept; the old calibration then stays.
pub fn measure(
    config: &config::RigFile,
    devices: &mut Devices,
    slots: &Path,
    offset: f32,
    calibrating: fn(CalibrationProgress),
) -> Result<Calibration, AnyFailure> {
    let before = store::load(slots, config.identity)?;
    before.check_offset(offset)?;
    let measured = calibrate(devices, config, None, &mut watch(calibrating, None))?;
    let after = before.with_focus(offset, &measured)?;
    keep(slots, &before, &after)?;
    Ok(after)
}

/// Removes the measurements at other focuses, and returns their number.
///
/// # Errors
/// When there is no calibration, or the rest cannot be kept.
pub fn forget(config: &config::RigFile, slots: &Path) -> Result<usize, AnyFailure> {
    let before = store::load(slots, config.identity)?;
    let forgotten = before.focuses.len();
    if forgotten > 0 {
        let generation = before.generation.wrapping_add(1);
        let after = Calibration { focuses: Vec::new(), generation, ..before.clone() };
        keep(slots, &before, &after)?;
    }
    Ok(forgotten)
}

/// Keeps `after` in `slots`. The panel has not moved, so the baseline of drift is carried over.
fn keep(slots: &Path, before: &Calibration, after: &Calibration) -> Result<(), AnyFailure> {
    store::save(slots, after)?;
    if let Some(reading) = baseline::load(slots, before.generation) {
        baseline::save(slots, after.generation, &reading);
    }
    Ok(())
}
