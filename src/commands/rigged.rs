//! A rig file made into something that restores, photographs, calibrates: the seam to the machinery.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

use relens::calibrate;
use relens::calibration::{Calibration, store};
use relens::config::{Method, Rig};
use relens::daemon::Restorer;
use relens::frame::{Frame, Work};
use relens::rig::exposure::Rig as Devices;
use relens::rig::simulated;

use super::{Trouble, say};

/// What restores photos on `rig`, with the calibration in `folder/calibration`. A simulated rig that has none
/// is calibrated first, which `say` is told.
///
/// # Errors
/// When the rig cannot be opened, or has no valid calibration and is not simulated.
pub(super) fn restorer(
    _rig: &Rig,
    _folder: &Path,
    _method: Option<Method>,
    _say: &mut dyn FnMut(&str),
) -> Result<Box<dyn Restorer>, Trouble> {
    Err(Trouble::NotYet("restoring"))
}

/// The codes of the photos that the simulated `rig` would take of `scenes` (photo-sized linear light), the
/// n-th with noise of its own.
///
/// # Errors
/// When the rig is not simulated or cannot be opened.
pub(super) fn photograph(rig: &Rig, scenes: &[Frame<Work>]) -> Result<Vec<Frame<Work, u8>>, Trouble> {
    let Some(simulation) = rig.simulation() else {
        let rig = &rig.name;
        return Err(Trouble::Usage(format!("found the rig {rig}, made of devices, allowed simulated rigs")));
    };
    let (_, witness) = simulated::open(rig).map_err(|e| Trouble::of(&e))?;
    let seeds = simulation.seed..;
    Ok(scenes.iter().zip(seeds).map(|(scene, seed)| witness.photograph(scene, seed)).collect())
}

/// `relens calibrate`.
///
/// # Errors
/// When the rig cannot be opened or is not fit to be calibrated; what was kept before then stays.
pub(super) fn calibrate(rig: &Rig, folder: &Path) -> Result<(), Trouble> {
    let mut devices = open(rig)?;
    let calibration = measure(rig, &mut devices, folder)?;
    let [red, green, blue] = calibration.operator_error;
    say(&format!(
        "kept in {}, generation {}: {} captures; operator error {red:.2}, {green:.2}, {blue:.2} grey levels in red, green, blue",
        slots(folder).display(),
        calibration.generation,
        calibration.captures,
    ))
}

/// The devices of `rig`.
fn open(rig: &Rig) -> Result<Devices, Trouble> {
    match rig.simulation() {
        Some(_) => simulated::open(rig).map(|(devices, _)| devices).map_err(|e| Trouble::of(&e)),
        None => Err(Trouble::NotYet("opening a rig of devices")),
    }
}

/// Where the calibration is kept.
fn slots(folder: &Path) -> PathBuf {
    folder.join("calibration")
}

/// Calibrates and keeps the result.
fn measure(rig: &Rig, devices: &mut Devices, folder: &Path) -> Result<Calibration, Trouble> {
    let slots = slots(folder);
    std::fs::create_dir_all(&slots).map_err(|e| Trouble::writing(&slots, &e))?;
    let previous = store::load(&slots, rig.identity).ok();
    let terminal = std::io::stderr().is_terminal();
    let measured = calibrate::calibrate(devices, rig, previous.as_ref(), &mut |progress| {
        if terminal {
            let calibrate::Progress { step, captures, total } = progress;
            let _ = write!(std::io::stderr(), "\r\x1b[2Kcalibrating: {step}, capture {captures} of {total}");
        }
    });
    if terminal {
        let _ = write!(std::io::stderr(), "\r\x1b[2K");
    }
    let measured = measured.map_err(|e| Trouble::of(&e))?;
    store::save(&slots, &measured).map_err(|e| Trouble::of(&e))?;
    Ok(measured)
}

/// `relens chart`.
///
/// # Errors
/// When the rig cannot be opened, or the tables cannot be written.
pub(super) fn chart(_rig: &Rig, _out: &Path, _quick: bool) -> Result<(), Trouble> {
    Err(Trouble::NotYet("`relens chart`"))
}

/// `relens check`.
///
/// # Errors
/// When the operator is needed.
pub(super) fn check(_rig: &Rig, _folder: &Path) -> Result<(), Trouble> {
    Err(Trouble::NotYet("`relens check`"))
}
