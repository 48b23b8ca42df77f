//! A rig of real devices, opened as its file says.

use linux_embedded_hal::Delay;

use super::button::Button;
use super::exposure::{Rig, Timing};
use super::frame_mark::MarkPlace;
use super::gpio_line::{LineName, OutputLine};
use super::kms_panel::{KmsPanel, KmsSettings};
use super::lamps::{Lamp, Lamps};
use super::monotonic::Monotonic;
use super::pixel_format::PixelFormat;
use super::pulse_trigger::{FreeRunning, PulseTrigger};
use super::v4l2_camera::{CameraName, CameraSettings, V4l2Camera};
use super::v4l2_controls::Exposure;
use super::{Panel, RigError, Trigger};
use crate::config::{self, ExposureBy, Hardware, Level, TriggerDevice};

/// Opens panel, trigger and camera, and finds the frame marks where the rig has room for them.
///
/// # Errors
/// Whatever a device has to say: see its own file.
pub fn open(rig: &config::Rig, hardware: &Hardware) -> Result<Rig, RigError> {
    let panel = open_panel(rig, hardware)?;
    let trigger = open_trigger(&hardware.trigger)?;
    let camera = V4l2Camera::open(camera_settings(rig, hardware)?)?;
    let mut devices =
        Rig::new(panel, trigger, Box::new(camera), Box::new(Monotonic), Timing::of(rig));
    if let Some(place) = MarkPlace::of(rig) {
        devices.find_marks(place)?;
    }
    Ok(devices)
}

/// The panel alone, for saying what is wrong with the rest.
///
/// # Errors
/// When there is no such panel, or another program has it.
pub fn open_panel(
    rig: &config::Rig,
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

/// The camera's settings alone, for whoever looks at the camera without the rest of the rig.
///
/// # Errors
/// [`RigError::Refused`] for a pixel format relens does not take, or one whose depth is not
/// `camera.bits`.
pub fn camera_settings(rig: &config::Rig, hardware: &Hardware) -> Result<CameraSettings, RigError> {
    let camera = &hardware.camera;
    let format =
        PixelFormat::from_code(&camera.format).filter(|format| format.bits() == rig.camera.bits);
    let format = format.ok_or_else(|| {
        let fits = PixelFormat::ALL.iter().filter(|(_, format)| format.bits() == rig.camera.bits);
        RigError::Refused {
            device: "camera",
            found: format!(
                "hardware.camera.format = {:?} with camera.bits = {}",
                camera.format, rig.camera.bits
            ),
            allowed: fits.map(|(code, _)| *code).collect::<Vec<_>>().join(", "),
        }
    })?;
    // The rig file names exactly one of the two.
    let name = match (&camera.device, &camera.card) {
        (Some(link), _) => CameraName::Link(link.clone()),
        (None, card) => CameraName::Card(card.clone().unwrap_or_default()),
    };
    let exposure_ms = rig.camera.exposure_ms;
    let exposure = match camera.exposure_by {
        ExposureBy::Control => Exposure::Control { exposure_ms },
        ExposureBy::Pulse | ExposureBy::Elsewhere => Exposure::Elsewhere { exposure_ms },
    };
    let controls = camera.controls.iter().map(|(name, value)| (name.clone(), *value)).collect();
    Ok(CameraSettings {
        name,
        size: rig.camera.size(),
        format,
        buffers: camera.buffers,
        exposure,
        controls,
    })
}

fn line(chip: &str, line: &str, active: Level) -> LineName {
    LineName { chip: chip.to_owned(), line: line.to_owned(), active_low: active == Level::Low }
}

fn open_trigger(device: &TriggerDevice) -> Result<Box<dyn Trigger + Send>, RigError> {
    match device {
        TriggerDevice::FreeRunning => Ok(Box::new(FreeRunning(Monotonic))),
        TriggerDevice::Line { chip, line: name, active, pulse_us } => {
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
