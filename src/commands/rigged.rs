//! A rig file made into something that restores, photographs, calibrates: the seam to the machinery.

use std::path::Path;

use relens::config::{Method, Rig};
use relens::daemon::Restorer;
use relens::frame::{Frame, Work};

use super::Trouble;

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
pub(super) fn photograph(_rig: &Rig, _scenes: &[Frame<Work>]) -> Result<Vec<Frame<Work, u8>>, Trouble> {
    Err(Trouble::NotYet("photographing"))
}

/// `relens calibrate`.
///
/// # Errors
/// When the rig cannot be opened or is not fit to be calibrated.
pub(super) fn calibrate(_rig: &Rig, _folder: &Path) -> Result<(), Trouble> {
    Err(Trouble::NotYet("`relens calibrate`"))
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
