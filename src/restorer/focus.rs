//! The lens measured at other focuses than the panel's, and kept beside the calibration.

use std::path::Path;

use super::baseline;
use super::on_rig::watch;
use crate::calibration::{Calibration, store};
use crate::config;
use crate::measurement::{CalibrationProgress, calibrate};
use crate::remedy::{AnyFailure, Remediable};
use crate::rig::exposure::Devices;

/// Whether the lens can be measured at a focus `offset`, dioptres, of the rig whose calibration is
/// in `slots`.
///
/// # Errors
/// When the offset is none, too many others are kept, or nothing is there to keep it beside.
pub fn check(config: &config::RigFile, slots: &Path, offset: f32) -> Result<(), AnyFailure> {
    store::load(slots, config.identity).map_err(boxed)?.check_offset(offset).map_err(boxed)
}

/// Measures the lens of `devices`, which see the panel as a scene `offset` dioptres nearer would be
/// seen, and keeps it beside the calibration in `slots`.
///
/// # Errors
/// When the rig is not fit to be calibrated, or the result cannot be kept; what was kept before
/// stays.
pub fn measure(
    config: &config::RigFile,
    devices: &mut Devices,
    slots: &Path,
    offset: f32,
    calibrating: fn(CalibrationProgress),
) -> Result<Calibration, AnyFailure> {
    let before = store::load(slots, config.identity).map_err(boxed)?;
    before.check_offset(offset).map_err(boxed)?;
    let measured =
        calibrate(devices, config, None, &mut watch(calibrating, None)).map_err(boxed)?;
    let after = before.with_focus(offset, &measured).map_err(boxed)?;
    keep(slots, &before, &after)?;
    Ok(after)
}

/// Forgets what was measured at other focuses; says how many there were.
///
/// # Errors
/// When there is no calibration, or the rest cannot be kept.
pub fn forget(config: &config::RigFile, slots: &Path) -> Result<usize, AnyFailure> {
    let before = store::load(slots, config.identity).map_err(boxed)?;
    let forgotten = before.focuses.len();
    if forgotten > 0 {
        let generation = before.generation.wrapping_add(1);
        let after = Calibration { focuses: Vec::new(), generation, ..before.clone() };
        keep(slots, &before, &after)?;
    }
    Ok(forgotten)
}

/// Keeps `after` in `slots`; the panel has not moved by it, and what drifts, drifts from where it
/// did.
fn keep(slots: &Path, before: &Calibration, after: &Calibration) -> Result<(), AnyFailure> {
    store::save(slots, after).map_err(boxed)?;
    if let Some(reading) = baseline::load(slots, before.generation) {
        baseline::save(slots, after.generation, &reading);
    }
    Ok(())
}

fn boxed(error: impl Remediable + Send + Sync + 'static) -> AnyFailure {
    Box::new(error)
}
