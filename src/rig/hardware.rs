//! Opens the devices of a real rig.

use std::path::Path;

use linux_embedded_hal::Delay;

use super::binned::binned;
use super::exposure::{Devices, Timing};
use super::gpio_line::OutputLine;
use super::kms_panel::KmsPanel;
use super::monotonic::Monotonic;
use super::pulse_trigger::{FreeRunning, PulseTrigger};
use super::pwm_trigger::{self, PwmTrigger};
use super::{Panel, RigError, Trigger, camera, kms_card};
use crate::config::{self, ExposureBy, Hardware, PanelDevice, PanelTable, TriggerDevice};

/// Opens panel, trigger and camera.
pub fn open(rig: &config::RigFile, hardware: &Hardware) -> Result<Devices, RigError> {
    let panel = open_panel(&rig.panel, &hardware.panel)?;
    let pulse_us = hardware.pulse_us(rig.camera.exposure_ms);
    let pulsed = hardware.camera.exposure_by() == ExposureBy::Pulse;
    let trigger = open_trigger(&hardware.trigger, pulse_us, pulsed)?;
    let own = camera::open(&rig.unbinned().camera, hardware)?;
    let camera = binned(own, rig.camera.binning, rig.camera.count_max());
    let timing = Timing::of(&rig.panel, &rig.camera);
    let mut devices = Devices::new(panel, trigger, camera, Box::new(Monotonic), timing);
    // Any frame now is untriggered: even a PWM channel sends no pulses before the first exposure.
    if !matches!(hardware.trigger, TriggerDevice::FreeRunning(_)) {
        devices.refuse_free_running()?;
    }
    Ok(devices)
}

/// Opens the panel alone, so that messages can be shown when another device fails.
pub fn open_panel(
    panel: &PanelTable,
    device: &PanelDevice,
) -> Result<Box<dyn Panel + Send>, RigError> {
    Ok(Box::new(KmsPanel::open(panel, device)?))
}

fn open_trigger(
    device: &TriggerDevice,
    pulse_us: u32,
    pulsed: bool,
) -> Result<Box<dyn Trigger + Send>, RigError> {
    match device {
        TriggerDevice::FreeRunning(_) => Ok(Box::new(FreeRunning(Monotonic))),
        TriggerDevice::Line(name) => {
            let pin = OutputLine::open("trigger", name)?;
            let trigger = PulseTrigger::new(pin, Delay, Monotonic, pulse_us)?;
            Ok(Box::new(if pulsed { trigger.exposing() } else { trigger }))
        }
        TriggerDevice::Pwm(name) => {
            let (root, write) = (Path::new(pwm_trigger::CLASS), pwm_trigger::write_attribute);
            let clock = Box::new(Monotonic);
            Ok(Box::new(PwmTrigger::open(root, Box::new(write), clock, name, pulse_us)?))
        }
    }
}

/// Describes the board's displays, PWM chips and cameras, without serial numbers.
pub fn describe() -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = kms_card::describe(&mut text);
    for (device, _) in pwm_trigger::chips(Path::new(pwm_trigger::CLASS)) {
        text.push_str(&format!("PWM chip {device}\n"));
    }
    let _ = camera::v4l2::describe(&mut text);
    #[cfg(feature = "genicam")]
    let _ = camera::genicam::describe(&mut text);
    text
}
