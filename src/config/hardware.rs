//! `[hardware]`: the devices of a real rig, by the names they keep.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::rules::Rules;
use super::{Camera, ConfigError, Panel};

/// Everything a real rig is made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Hardware {
    /// The display.
    pub panel: PanelDevice,
    /// The camera.
    pub camera: CameraDevice,
    /// What starts an exposure.
    pub trigger: TriggerDevice,
    /// The start button, if the box has one.
    pub button: Option<ButtonDevice>,
    /// The lamps, if the box has any.
    #[serde(default)]
    pub lamps: LampDevices,
}

/// `[hardware.panel]`: a connector of a display driver. Its mode is `[panel]`'s size and refresh
/// rate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct PanelDevice {
    /// The DRM node; when left out, the first one that drives a display.
    pub node: Option<PathBuf>,
    /// The connector by the kernel's name, such as `HDMI-A-1` (a folder under /sys/class/drm after
    /// `card0-`).
    pub connector: String,
    /// How the driver is spoken to.
    // Not written when it is what it always was: calibrations made before it could be said stay
    // good.
    #[serde(default, skip_serializing_if = "DisplayInterface::is_atomic")]
    pub interface: DisplayInterface,
}

/// The two ways in which the kernel lets a program set modes and show pictures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DisplayInterface {
    /// All settings at once, each read back; a driver that has no such interface is driven by the
    /// other.
    #[default]
    Atomic,
    /// One setting at a time, for drivers whose atomic interface does not do what it says.
    Legacy,
}

impl DisplayInterface {
    fn is_atomic(&self) -> bool {
        *self == DisplayInterface::Atomic
    }
}

/// `[hardware.camera]`, by its `kind`; without one it is `v4l2`. Its size is `[camera]`'s.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CameraDevice {
    /// A video node of the kernel's.
    V4l2(V4l2Device),
}

impl CameraDevice {
    /// What sets the exposure time.
    fn exposure_by(&self) -> ExposureBy {
        match self {
            CameraDevice::V4l2(device) => device.exposure_by,
        }
    }

    fn check(&self, rules: &Rules) -> Result<(), ConfigError> {
        match self {
            CameraDevice::V4l2(device) => device.check(rules),
        }
    }
}

impl<'de> Deserialize<'de> for CameraDevice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut table = toml::Table::deserialize(deserializer)?;
        let kind = table.remove("kind").unwrap_or_else(|| "v4l2".into());
        let device = match kind.as_str() {
            Some("v4l2") => V4l2Device::deserialize(table).map(CameraDevice::V4l2),
            _ => {
                return Err(D::Error::custom(format_args!("kind: found {kind}, allowed \"v4l2\"")));
            }
        };
        device.map_err(|error| D::Error::custom(error.message()))
    }
}

/// A calibration is bound to the keys of the kind alone, so that those of files without `kind`
/// stay good.
impl Serialize for CameraDevice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            CameraDevice::V4l2(device) => device.serialize(serializer),
        }
    }
}

/// A V4L2 node.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct V4l2Device {
    /// A link that udev keeps, under /dev/v4l/by-id or by-path. This or `card`.
    pub device: Option<PathBuf>,
    /// The card's name as `v4l2-ctl --info` prints it. This or `device`.
    pub card: Option<String>,
    /// Four-character code of the pixel format (`v4l2-ctl --list-formats`).
    pub format: String,
    /// Buffers in the capture ring, 2 to 8.
    pub buffers: usize,
    /// What sets the exposure time.
    pub exposure_by: ExposureBy,
    /// Controls by their `v4l2-ctl --list-ctrls` names. Automatics are switched off without being
    /// named.
    #[serde(default)]
    pub controls: BTreeMap<String, i32>,
}

impl V4l2Device {
    fn check(&self, rules: &Rules) -> Result<(), ConfigError> {
        match (&self.device, &self.card) {
            (Some(path), None) => {
                let numbered = path.to_str().and_then(|text| text.strip_prefix("/dev/video"));
                let stable = numbered.is_none_or(|rest| rest.parse::<u32>().is_err());
                let allowed =
                    "a link under /dev/v4l/by-id or by-path: numbers change with every plug";
                rules.hold(stable, "hardware.camera.device", path.display(), allowed)?;
            }
            (None, Some(_)) => {}
            (both_or_none, _) => {
                let found = if both_or_none.is_some() {
                    "both device and card"
                } else {
                    "neither device nor card"
                };
                return Err(rules.broken("hardware.camera", found, "one of them"));
            }
        }
        rules.hold(
            (2..=8).contains(&self.buffers),
            "hardware.camera.buffers",
            self.buffers,
            "2 to 8",
        )
    }
}

/// What sets the exposure time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExposureBy {
    /// The camera's exposure control, set from `camera.exposure-ms`.
    Control,
    /// The trigger pulse is as long as the exposure.
    Pulse,
    /// Something V4L2 does not reach; `camera.exposure-ms` says what it was set to.
    Elsewhere,
}

/// A GPIO line by the names it keeps.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Line {
    /// The chip's label (`gpiodetect`), never its number.
    pub chip: String,
    /// The line's name (`gpioinfo`).
    pub line: String,
    /// Which level means "on".
    pub active: Level,
}

/// A level on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// Near the supply.
    High,
    /// Near ground.
    Low,
}

/// `[hardware.trigger]`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, tag = "kind")]
pub enum TriggerDevice {
    /// A pulse on an output line.
    Line {
        /// The chip's label.
        chip: String,
        /// The line's name.
        line: String,
        /// The pulse's level.
        active: Level,
        /// The pulse's width.
        #[serde(rename = "pulse-us")]
        pulse_us: u32,
    },
    /// The camera takes frames by itself; the first whole one after the picture has settled is
    /// used.
    FreeRunning,
}

/// `[hardware.button]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct ButtonDevice {
    /// The chip's label.
    pub chip: String,
    /// The line's name.
    pub line: String,
    /// Which level means "pressed".
    pub active: Level,
    /// How long a level must hold to count.
    pub debounce_ms: f64,
}

/// `[hardware.lamps]`: any of them.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct LampDevices {
    /// Waiting for photos.
    pub ready: Option<Line>,
    /// Working on a photo.
    pub busy: Option<Line>,
    /// The operator is needed.
    pub trouble: Option<Line>,
}

/// The rules of `[hardware]`, and what the other tables must be on a real rig.
pub(super) fn check_hardware(
    rules: &Rules,
    hardware: &Hardware,
    panel: &Panel,
    camera: &Camera,
) -> Result<(), ConfigError> {
    let refreshes = camera.exposure_ms * panel.refresh_hz / 1e3;
    // Within a hundredth of a refresh: a control in steps of 100 µs rounds by 0.3 % at 60 Hz.
    rules.hold(
        refreshes > 0.5 && (refreshes - refreshes.round()).abs() <= 0.01,
        "camera.exposure-ms",
        format_args!("{} ms, which is {refreshes:.3} refreshes", camera.exposure_ms),
        "a whole number of refreshes, or the backlight's flicker shows",
    )?;
    hardware.camera.check(rules)?;
    match &hardware.trigger {
        TriggerDevice::Line { pulse_us, .. } => {
            rules.hold(
                (1..=1_000_000).contains(pulse_us),
                "hardware.trigger.pulse-us",
                pulse_us,
                "1 to 1000000",
            )?;
            let as_long = (f64::from(*pulse_us) / 1e3 / camera.exposure_ms - 1.0).abs() <= 0.01;
            rules.hold(
                hardware.camera.exposure_by() != ExposureBy::Pulse || as_long,
                "hardware.trigger.pulse-us",
                pulse_us,
                format_args!(
                    "camera.exposure-ms, {} ms, when the pulse sets the exposure",
                    camera.exposure_ms
                ),
            )?;
        }
        TriggerDevice::FreeRunning => rules.hold(
            hardware.camera.exposure_by() != ExposureBy::Pulse,
            "hardware.camera.exposure-by",
            "pulse",
            "control or elsewhere with a free-running camera",
        )?,
    }
    if let Some(button) = &hardware.button {
        rules.within("hardware.button.debounce-ms", button.debounce_ms, 1.0, 1000.0)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_panel_s_interface_may_be_chosen_and_calibrations_from_before_stay_good() {
        let panel = |text: &str| toml::from_str::<PanelDevice>(text);
        let plain = panel("connector = \"HDMI-A-1\"").unwrap();
        assert_eq!(plain.interface, DisplayInterface::Atomic);
        // What a calibration is bound to.
        assert_eq!(
            serde_json::to_string(&plain).unwrap(),
            r#"{"node":null,"connector":"HDMI-A-1"}"#
        );
        let legacy = panel("connector = \"HDMI-A-1\"\ninterface = \"legacy\"").unwrap();
        assert_eq!(legacy.interface, DisplayInterface::Legacy);
        assert_ne!(serde_json::to_string(&legacy).unwrap(), serde_json::to_string(&plain).unwrap());
        assert!(panel("connector = \"HDMI-A-1\"\ninterface = \"old\"").is_err());
    }
}
