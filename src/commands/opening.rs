//! Opening of a rig's devices, and of the restorer on them.

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

/// The restorer of `rig`, with the calibration in `folder/calibration`, on the devices opened by
/// `open`: [`devices`] or [`devices_without_panel`]. A simulated rig without a calibration is
/// calibrated first.
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
            return Err(error.into());
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

pub(super) fn devices(rig: &RigFile) -> Result<Devices, CliError> {
    Ok(relens::rig::open(rig)?)
}

/// The devices of `rig`, opened without looking for its panel; a simulated panel is in view.
pub(super) fn devices_without_panel(rig: &RigFile) -> Result<Devices, CliError> {
    match rig.simulation() {
        Some(_) => devices(rig),
        None => Ok(relens::rig::open_without_marks(rig)?),
    }
}

/// The folder of the calibration of a rig that works on `folder`.
pub(super) fn calibration_folder(folder: &Path) -> PathBuf {
    folder.join("calibration")
}

/// Shows on the panel why `rig` cannot be opened, if the panel itself can be, until the returned
/// panel is dropped. A simulated panel shows nothing.
pub(super) fn show_trouble(
    rig: &RigFile,
    reason: &str,
    what_to_do: &str,
) -> Option<Box<dyn Panel + Send>> {
    #[cfg(feature = "hardware")]
    if let relens::config::Kind::Hardware(hardware) = &rig.kind {
        let (what, to_do) = (reason.to_owned(), what_to_do.to_owned());
        let screen = Screen::Trouble { what, to_do };
        let mut panel = relens::rig::hardware::open_panel(&rig.panel, &hardware.panel).ok()?;
        let codes = draw(&screen, panel.size(), None);
        panel.show(&codes).ok()?;
        return Some(panel);
    }
    log::debug!("no panel of {} can show: {reason}; {what_to_do}", rig.name);
    None
}
