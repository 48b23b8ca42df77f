//! A rig file made into devices, and into what restores photos with them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use relens::calibration::store;
use relens::config::{MethodName, RigFile};
use relens::daemon::Restorer;
#[cfg(feature = "hardware")]
use relens::kiosk::screen::{Screen, draw};
use relens::pipeline::Interruption;
use relens::restorer::on_rig::{self, OnRig};
use relens::rig::Panel;
use relens::rig::exposure::Devices;
use relens::rig::monotonic::Monotonic;

use super::error::CliError;
use super::progress;

/// What restores photos on `rig`, with the calibration in `folder/calibration`, on the devices that
/// `open` opens: [`devices`], or [`devices_without_panel`]. A simulated rig
/// that has none is calibrated first.
///
/// # Errors
/// When the rig cannot be opened, or has no valid calibration and is not simulated.
pub(super) fn restorer(
    rig: &RigFile,
    folder: &Path,
    method: Option<MethodName>,
    interrupted: Option<Interruption>,
    open: impl FnOnce(&RigFile) -> Result<Devices, CliError>,
) -> Result<Box<dyn Restorer>, CliError> {
    let mut devices = open(rig)?;
    let kept = calibration_folder(folder);
    if let Err(error) = store::load(&kept, rig.identity) {
        if rig.simulation().is_none() {
            return Err(CliError::of(error));
        }
        log::info!("calibrating the simulated rig {} ({error})", rig.name);
        let asked = interrupted.as_ref();
        let measured = on_rig::measure(rig, &mut devices, &kept, progress::calibrating, asked);
        progress::clear();
        measured?;
    }
    let stopwatch = Arc::new(Monotonic::seconds);
    let restorer = OnRig::new(rig, devices, kept, method, stopwatch, progress::calibrating)?;
    Ok(Box::new(match interrupted {
        Some(interrupted) => restorer.interruptible(interrupted),
        None => restorer,
    }))
}

/// The devices of `rig`.
///
/// # Errors
/// When one of them cannot be had.
pub(super) fn devices(rig: &RigFile) -> Result<Devices, CliError> {
    relens::rig::open(rig).map_err(CliError::of)
}

/// The devices of `rig`, whose panel need not be before the lens; a simulated one is.
///
/// # Errors
/// When one of them cannot be had.
pub(super) fn devices_without_panel(rig: &RigFile) -> Result<Devices, CliError> {
    match rig.simulation() {
        Some(_) => devices(rig),
        None => relens::rig::open_without_marks(rig).map_err(CliError::of),
    }
}

/// Where the calibration of a rig that works on `folder` is kept.
pub(super) fn calibration_folder(folder: &Path) -> PathBuf {
    folder.join("calibration")
}

/// Shows on the panel what keeps `rig` from being opened, if the panel alone can be had; until the
/// value is dropped. A simulated panel nobody sees.
pub(super) fn show_trouble(
    rig: &RigFile,
    reason: &str,
    what_to_do: &str,
) -> Option<Box<dyn Panel + Send>> {
    #[cfg(feature = "hardware")]
    if let relens::config::Kind::Hardware(hardware) = &rig.kind {
        let (what, to_do) = (reason.to_owned(), what_to_do.to_owned());
        let screen = Screen::Trouble { what, to_do };
        let mut panel = relens::rig::hardware::open_panel(rig, hardware).ok()?;
        let codes = draw(&screen, panel.size(), None);
        panel.show(&codes).ok()?;
        return Some(panel);
    }
    log::debug!("{} has no panel to show it on: {reason}; {what_to_do}", rig.name);
    None
}
