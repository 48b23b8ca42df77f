//! `[hardware]`: the devices of a real rig, by the names they keep.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize, Serializer};
use toml::Value;

use super::error::ConfigError;
use super::keys::{KindKeys, table, words};
use super::media::MediaGraph;
use super::places::Places;
use super::simulation::is_default;

table! {
    /// Everything a real rig is made of.
    pub struct Hardware {
        /// The display.
        panel: PanelDevice, Table(&PanelDevice::TABLE), Never;
        /// The camera, by its kind. Its size is `[camera]`'s.
        camera: CameraDevice, ByKind(CameraDevice::KINDS), Never;
        /// What starts an exposure.
        trigger: TriggerDevice, ByKind(TriggerDevice::KINDS), Never;
        /// The start button.
        button: Option<ButtonDevice>, Table(&ButtonDevice::TABLE), Says("the box has none");
        /// The lamps.
        lamps: LampDevices, Table(&LampDevices::TABLE), Means("{}");
    }
}

table! {
    /// A connector of a display driver. Its mode is `[panel]`'s size and refresh rate.
    pub struct PanelDevice {
        /// The DRM node.
        node: Option<PathBuf>, Text, Says("the one that has the connector");
        /// The connector by the kernel's name, such as `HDMI-A-1` (a folder under /sys/class/drm
        /// after `card0-`).
        connector: String, Text, Never;
        /// How the driver is spoken to.
        // Not written when it is what it always was: calibrations made before it could be said
        // stay good.
        @[serde(default, skip_serializing_if = "DisplayInterface::is_atomic")]
        interface: DisplayInterface, Word(DisplayInterface::WORDS), Means("\"atomic\"");
    }
}

words! {
    /// The two ways in which the kernel lets a program set modes and show pictures.
    @[derive(Default)]
    pub enum DisplayInterface {
        /// All settings at once, each read back; a driver that has no such interface is driven by
        /// the other.
        @[default]
        Atomic = "atomic",
        /// One setting at a time, for drivers whose atomic interface does not do what it says.
        Legacy = "legacy",
    }
}

impl DisplayInterface {
    fn is_atomic(&self) -> bool {
        *self == DisplayInterface::Atomic
    }
}

/// A camera. Another kind is a variant, a struct with its keys, and its line in `KINDS`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum CameraDevice {
    /// A video node of the kernel's.
    V4l2(V4l2Device),
}

impl CameraDevice {
    const KINDS: &'static [KindKeys] =
        &[KindKeys { word: "v4l2", keys: &V4l2Device::TABLE, unless_said: true }];

    /// What sets the exposure time.
    pub(super) fn exposure_by(&self) -> ExposureBy {
        match self {
            CameraDevice::V4l2(device) => device.exposure_by,
        }
    }

    /// The rules across keys.
    pub(super) fn check(&self, places: &Places) -> Result<(), ConfigError> {
        match self {
            CameraDevice::V4l2(device) => device.check(places),
        }
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

table! {
    /// A V4L2 node, by `device`, by `card` or by `media`.
    pub struct V4l2Device {
        /// A link that udev keeps, under /dev/v4l/by-id or by-path.
        device: Option<PathBuf>, Text, Says("then `card` or `media` is needed");
        /// The card's name as `v4l2-ctl --info` prints it.
        card: Option<String>, Text, Says("then `device` or `media` is needed");
        /// The media graph of a board's camera.
        @[serde(default, skip_serializing_if = "Option::is_none")]
        media: Option<MediaGraph>, Table(&MediaGraph::TABLE),
            Says("the camera's driver has set itself up");
        /// Four-character code of the pixel format (`v4l2-ctl --list-formats`).
        format: String, Text, Never;
        /// What the stamps of frames are of. One read wrongly lets a frame pass that was exposed
        /// before its picture was up, or keeps all frames out.
        // Not written when it is left to the driver: calibrations from before the key stay good.
        @[serde(default, skip_serializing_if = "is_default")]
        stamps: Stamps, Word(Stamps::WORDS), Means("\"driver\"");
        /// Buffers in the capture ring.
        buffers: usize, Whole(2, 8), Means("4");
        /// What sets the exposure time.
        exposure_by: ExposureBy, Word(ExposureBy::WORDS), Never;
        /// What one step of its control `gain` or `analogue_gain`, whichever `controls` names, adds
        /// to the gain, in decibels: 20 of them are ten times the counts.
        // Captures do not depend on it: calibrations from before the key stay good.
        @[serde(default, skip_serializing)]
        gain_step_db: Option<f64>, Number(0.001, 20.0),
            Says("photos are taken at the gain of the panel's captures");
        /// Controls by their `v4l2-ctl --list-ctrls` names. Automatics are switched off without
        /// being named.
        controls: BTreeMap<String, i32>, Such("names with whole numbers of 32 bits", |value| {
            let fits = |one: &Value| one.as_integer().is_some_and(|n| i32::try_from(n).is_ok());
            value.as_table().is_some_and(|all| all.values().all(fits))
        }), Means("{}");
    }
}

impl V4l2Device {
    fn check(&self, places: &Places) -> Result<(), ConfigError> {
        let one_of = |found| Err(places.broken("hardware.camera", found, "one of them"));
        match (&self.device, &self.card, &self.media) {
            (Some(path), None, None) => {
                let numbered = path.to_str().and_then(|text| text.strip_prefix("/dev/video"));
                let stable = numbered.is_none_or(|rest| rest.parse::<u32>().is_err());
                let allowed =
                    "a link under /dev/v4l/by-id or by-path: numbers change with every plug";
                places.hold(stable, "hardware.camera.device", path.display(), allowed)
            }
            (None, Some(_), None) => Ok(()),
            (None, None, Some(graph)) => graph.check(places),
            (Some(_), Some(_), _) => one_of("both device and card"),
            (_, _, Some(_)) => one_of("media beside device or card"),
            (None, None, None) => one_of("neither device nor card nor media"),
        }
    }
}

words! {
    /// What the stamps of frames are of.
    @[derive(Default)]
    pub enum Stamps {
        /// What the driver says; of `uvcvideo` the first packet, whatever it says.
        @[default]
        Driver = "driver",
        /// The exposure's start.
        ExposureStart = "exposure-start",
        /// The first packet of the frame, which is read out after the exposure.
        FirstPacket = "first-packet",
        /// The frame's end.
        FrameEnd = "frame-end",
    }
}

words! {
    /// What sets the exposure time.
    pub enum ExposureBy {
        /// The camera's exposure control, set from `camera.exposure-ms`.
        Control = "control",
        /// The trigger pulse is as long as the exposure.
        Pulse = "pulse",
        /// Something V4L2 does not reach; `camera.exposure-ms` says what it was set to.
        Elsewhere = "elsewhere",
    }
}

table! {
    /// A GPIO line by the names it keeps.
    pub struct GpioLine {
        /// The chip's label (`gpiodetect`), never its number.
        chip: String, Text, Never;
        /// The line's name (`gpioinfo`).
        line: String, Text, Never;
        /// Which level means "on".
        active: Level, Word(Level::WORDS), Never;
    }
}

words! {
    /// A level on the wire.
    pub enum Level {
        /// Near the supply.
        High = "high",
        /// Near ground.
        Low = "low",
    }
}

/// What starts an exposure.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum TriggerDevice {
    /// A pulse on an output line.
    Line(PulseLine),
    /// The camera takes frames by itself.
    FreeRunning(FreeRunningKeys),
}

impl TriggerDevice {
    const KINDS: &'static [KindKeys] = &[
        KindKeys { word: "line", keys: &PulseLine::TABLE, unless_said: false },
        KindKeys { word: "free-running", keys: &FreeRunningKeys::TABLE, unless_said: false },
    ];
}

table! {
    /// A pulse on an output line starts the exposure.
    @[derive(Eq)]
    pub struct PulseLine {
        /// The chip's label.
        chip: String, Text, Never;
        /// The line's name.
        line: String, Text, Never;
        /// The pulse's level.
        active: Level, Word(Level::WORDS), Never;
        /// The pulse's width.
        pulse_us: u32, Whole(1, 1_000_000), Never;
    }
}

table! {
    /// The camera takes frames by itself; the first whole one after the picture has settled is
    /// used.
    @[derive(Eq)]
    pub struct FreeRunningKeys {}
}

table! {
    /// The start button, on a line.
    pub struct ButtonDevice {
        /// The chip's label.
        chip: String, Text, Never;
        /// The line's name.
        line: String, Text, Never;
        /// Which level means "pressed".
        active: Level, Word(Level::WORDS), Never;
        /// How long a level must hold to count.
        debounce_ms: f64, Number(1.0, 1000.0), Means("30.0");
    }
}

table! {
    /// The lamps, any of them.
    pub struct LampDevices {
        /// Waiting for photos.
        ready: Option<GpioLine>, Table(&GpioLine::TABLE), Says("the box has none");
        /// Working on a photo.
        busy: Option<GpioLine>, Table(&GpioLine::TABLE), Says("the box has none");
        /// The operator is needed.
        trouble: Option<GpioLine>, Table(&GpioLine::TABLE), Says("the box has none");
    }
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
