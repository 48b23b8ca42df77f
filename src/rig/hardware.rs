//! A rig of real devices, opened as its file says.

use linux_embedded_hal::Delay;

use super::button::Button;
use super::exposure::{Devices, Timing};
use super::gpio_line::{LineName, OutputLine};
use super::kms_panel::{KmsPanel, KmsSettings};
use super::lamps::{Lamp, Lamps};
use super::monotonic::Monotonic;
use super::pulse_trigger::{FreeRunning, PulseTrigger};
use super::{Panel, RigError, Trigger, camera};
use crate::config::{self, Hardware, Level, PulseLine, TriggerDevice};

/// Opens panel, trigger and camera.
///
/// # Errors
/// Whatever a device has to say: see its own file.
pub fn open(rig: &config::RigFile, hardware: &Hardware) -> Result<Devices, RigError> {
    let panel = open_panel(rig, hardware)?;
    let trigger = open_trigger(&hardware.trigger)?;
    let camera = camera::open(rig, &hardware.camera)?;
    Ok(Devices::new(panel, trigger, camera, Box::new(Monotonic), Timing::of(rig)))
}

/// The panel alone, for saying what is wrong with the rest.
///
/// # Errors
/// When there is no such panel, or another program has it.
pub fn open_panel(
    rig: &config::RigFile,
    hardware: &Hardware,
) -> Result<Box<dyn Panel + Send>, RigError> {
    Ok(Box::new(KmsPanel::open(KmsSettings {
        node: hardware.panel.node.clone(),
        connector: hardware.panel.connector.clone(),
        size: rig.panel.size(),
        refresh_hz: rig.panel.refresh_hz,
        interface: hardware.panel.interface,
    })?))
}

fn line(chip: &str, line: &str, active: Level) -> LineName {
    LineName { chip: chip.to_owned(), line: line.to_owned(), active_low: active == Level::Low }
}

fn open_trigger(device: &TriggerDevice) -> Result<Box<dyn Trigger + Send>, RigError> {
    match device {
        TriggerDevice::FreeRunning(_) => Ok(Box::new(FreeRunning(Monotonic))),
        TriggerDevice::Line(PulseLine { chip, line: name, active, pulse_us }) => {
            let pin = OutputLine::open("trigger", &line(chip, name, *active))?;
            Ok(Box::new(PulseTrigger::new(pin, Delay, Monotonic, *pulse_us)?))
        }
    }
}

/// The button of the box, if its rig file has one.
///
/// # Errors
/// When its line cannot be had.
pub fn open_button(hardware: &Hardware) -> Result<Option<Button>, RigError> {
    let open =
        |b: &config::ButtonDevice| Button::open(&line(&b.chip, &b.line, b.active), b.debounce_ms);
    hardware.button.as_ref().map(open).transpose()
}

/// The lamps of the box, all dark; those its rig file does not have are never lit.
///
/// # Errors
/// When a line cannot be had.
pub fn open_lamps(hardware: &Hardware) -> Result<Lamps, RigError> {
    let lamps = &hardware.lamps;
    let each =
        [(Lamp::Ready, &lamps.ready), (Lamp::Busy, &lamps.busy), (Lamp::Trouble, &lamps.trouble)];
    let names: Vec<_> = each
        .into_iter()
        .filter_map(|(lamp, device)| {
            device.as_ref().map(|d| (lamp, line(&d.chip, &d.line, d.active)))
        })
        .collect();
    Lamps::open(&names)
}
