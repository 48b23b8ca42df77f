//! `[hardware]`: the devices of a real rig, by stable names.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use toml::Value;

use super::error::ConfigError;
use super::keys::{KindKeys, number, table, words};
use super::media::MediaGraph;
use super::places::Places;
use super::simulation::is_default;

table! {
    /// Devices of a real rig.
    pub struct Hardware {
        /// Display.
        panel: PanelDevice, Table(&PanelDevice::TABLE), Never;
        /// Camera.
        camera: CameraDevice, ByKind(CameraDevice::KINDS), Never;
        /// Start of an exposure.
        trigger: TriggerDevice, ByKind(TriggerDevice::KINDS), Never;
        /// Start button.
        button: Option<GpioLine>, Table(&GpioLine::TABLE), Says("the box has none");
        /// Lamps.
        lamps: LampDevices, Table(&LampDevices::TABLE), Means("{}");
    }
}

table! {
    /// A connector of a display driver. Its mode has the size and refresh rate of `[panel]`.
    pub struct PanelDevice {
        /// DRM node.
        node: Option<PathBuf>, Text, Says("the one with the connector");
        /// Connector by the kernel's name, such as `HDMI-A-1` (a folder under /sys/class/drm, after
        /// `card0-`).
        connector: String, Text, Never;
    }
}

/// A camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum CameraDevice {
    /// A V4L2 capture node.
    V4l2(V4l2Device),
    /// A USB3 Vision or GigE Vision camera.
    Genicam(GenicamDevice),
}

impl CameraDevice {
    const KINDS: &'static [KindKeys] = &[
        KindKeys { word: "v4l2", keys: &V4l2Device::TABLE, is_default: true },
        KindKeys { word: "genicam", keys: &GenicamDevice::TABLE, is_default: false },
    ];

    /// Name of the pixel format.
    pub fn format(&self) -> &str {
        match self {
            CameraDevice::V4l2(device) => device.format.trim_end(),
            CameraDevice::Genicam(device) => &device.format,
        }
    }

    /// Control of the exposure time.
    pub fn exposure_by(&self) -> ExposureBy {
        match self {
            CameraDevice::V4l2(device) => device.exposure_by,
            CameraDevice::Genicam(device) => device.exposure_by,
        }
    }

    /// Serial number, as far as the rig file names it: in a link
    /// (`/dev/v4l/by-id/…_SERIAL-video-…`), or as a key.
    pub fn serial(&self) -> Option<&str> {
        match self {
            CameraDevice::V4l2(device) => {
                let name = device.device.as_ref()?.file_name()?.to_str()?;
                let (name, _) = name.rsplit_once("-video-index")?;
                name.rsplit_once('_').map(|(_, serial)| serial)
            }
            CameraDevice::Genicam(device) => device.serial.as_deref(),
        }
    }
}

table! {
    /// A V4L2 capture node, given by `device`, `card` or `media`. Frames have the size of
    /// `[camera]`.
    pub struct V4l2Device {
        /// Stable link of udev, under /dev/v4l/by-id or by-path.
        device: Option<PathBuf>,
            Such("a link under /dev/v4l/by-id or by-path, since numbers change on replugging",
                |value| value.as_str().is_some_and(|path| {
                    let number = path.strip_prefix("/dev/video");
                    number.is_none_or(|number| number.parse::<u32>().is_err())
                })), Says("`card` or `media` is required");
        /// Card name as printed by `v4l2-ctl --info`.
        card: Option<String>, Text, Says("`device` or `media` is required");
        /// Media graph of a board's camera.
        @[serde(default, skip_serializing_if = "Option::is_none")]
        media: Option<MediaGraph>, Table(&MediaGraph::TABLE),
            Says("the camera needs no set-up");
        /// Pixel format as a four-character code (`v4l2-ctl --list-formats`).
        format: String, Text, Never;
        /// Event that the frames' time stamps refer to. A wrong value accepts frames exposed before
        /// their picture was shown, or rejects all frames.
        // Not part of an identity where the driver decides.
        @[serde(default, skip_serializing_if = "is_default")]
        stamps: Stamps, Word(Stamps::WORDS), Means("\"driver\"");
        /// Buffers of the capture ring: one filled, one read, two in the queue.
        buffers: usize, Fixed, Means("4");
        /// Control of the exposure time.
        exposure_by: ExposureBy, Word(ExposureBy::WORDS), Never;
        /// Gain in decibels per step of the control `gain` or `analogue_gain`, whichever `controls`
        /// names; 20 dB are ten times the counts.
        // Captures do not depend on it.
        @[serde(default, skip_serializing)]
        gain_step_db: Option<f64>, Number(0.001, 20.0),
            Says("photos are taken at the gain of the captures");
        /// Controls by their names in `v4l2-ctl --list-ctrls`. Automatic adjustments are switched
        /// off in any case.
        controls: BTreeMap<String, i32>, Such("names with whole numbers of 32 bits", |value| {
            let fits = |one: &Value| one.as_integer().is_some_and(|n| i32::try_from(n).is_ok());
            value.as_table().is_some_and(|all| all.values().all(fits))
        }), Means("{}");
    }
}

table! {
    /// A USB3 Vision or GigE Vision camera, the only one with the given `vendor`, `model` and
    /// `serial`. Frames have the size of `[camera]`. Needs the feature `genicam`.
    pub struct GenicamDevice {
        /// Vendor (`arv-tool-0.8`).
        vendor: Option<String>, Text, Says("any; one of the three is required");
        /// Model.
        model: Option<String>, Text, Says("any");
        /// Serial number.
        serial: Option<String>, Text, Says("any");
        /// Pixel format by its name in the Pixel Format Naming Convention, such as `BayerRG8`,
        /// `BayerRG12p` or `Mono10Packed`.
        format: String, Text, Never;
        /// Input line of the trigger (`TriggerSource`), such as `Line0`.
        trigger_source: Option<String>, Text, Says("the camera runs free");
        /// Event that the camera's time stamps refer to; `driver` is the start of the exposure with
        /// a trigger, else its end. Cameras without `TimestampLatch` are timed by the arrival of
        /// the first packet instead.
        @[serde(default, skip_serializing_if = "is_default")]
        stamps: Stamps, Word(Stamps::WORDS), Means("\"driver\"");
        /// Buffers of the stream.
        buffers: usize, Fixed, Means("4");
        /// Control of the exposure time.
        exposure_by: ExposureBy, Word(ExposureBy::WORDS), Never;
        /// Decibels per unit of the feature `Gain` in `features`; 1 for most cameras.
        // Captures do not depend on it.
        @[serde(default, skip_serializing)]
        gain_step_db: Option<f64>, Number(0.001, 20.0),
            Says("photos are taken at the gain of the captures");
        /// Features by their names in `arv-tool-0.8 features`, selectors first. Automatic
        /// adjustments are switched off in any case.
        features: BTreeMap<String, FeatureValue>, Such("names with numbers, words, true or false",
            |value| value.as_table().is_some_and(|all| all.values().all(|one| {
                number(one).is_some() || one.is_str() || one.is_bool()
            }))), Means("{}");
    }
}

/// Value of a camera's feature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum FeatureValue {
    /// A boolean.
    Truth(bool),
    /// A number, whole or fractional.
    Number(f64),
    /// A word of an enumeration, or a text.
    Word(String),
}

impl GenicamDevice {
    /// Checks the rules across keys.
    pub(super) fn check(
        &self,
        places: &Places,
        trigger: &TriggerDevice,
    ) -> Result<(), ConfigError> {
        let is_named = [&self.vendor, &self.model, &self.serial].into_iter().any(Option::is_some);
        let found = "neither vendor nor model nor serial";
        places.hold(is_named, "hardware.camera", found, "one or more of them")?;
        let triggered = !matches!(trigger, TriggerDevice::FreeRunning(_));
        places.hold(
            triggered == self.trigger_source.is_some(),
            "hardware.camera.trigger-source",
            self.trigger_source.as_deref().unwrap_or("nothing"),
            "an input of the camera, or nothing for a trigger of kind \"free-running\"",
        )
    }
}

impl Hardware {
    /// Width of a trigger pulse: the exposure where the pulse sets that, else 1 ms, which is long
    /// beside the 20 µs of an opto-coupler.
    pub fn pulse_us(&self, exposure_ms: f64) -> u32 {
        match self.camera.exposure_by() {
            ExposureBy::Pulse => (exposure_ms * 1e3).round() as u32,
            ExposureBy::Control | ExposureBy::Elsewhere => 1000,
        }
    }
}

impl V4l2Device {
    /// Checks the rules across keys.
    pub(super) fn check(&self, places: &Places) -> Result<(), ConfigError> {
        let given = [self.device.is_some(), self.card.is_some(), self.media.is_some()];
        let count = given.into_iter().filter(|&given| given).count();
        let found = format_args!("{count} of device, card and media");
        places.hold(count == 1, "hardware.camera", found, "one of them")
    }
}

words! {
    /// Event that a frame's time stamp refers to.
    @[derive(Default)]
    pub enum Stamps {
        /// As the driver states; for `uvcvideo` always the first packet.
        @[default]
        Driver = "driver",
        /// Start of the exposure.
        ExposureStart = "exposure-start",
        /// First packet of the frame, which is read out after the exposure.
        FirstPacket = "first-packet",
        /// End of the frame.
        FrameEnd = "frame-end",
    }
}

words! {
    /// Control of the exposure time.
    pub enum ExposureBy {
        /// The camera's exposure control, set to `camera.exposure-ms`.
        Control = "control",
        /// The trigger pulse, as long as the exposure.
        Pulse = "pulse",
        /// Outside V4L2; `camera.exposure-ms` states the value set there.
        Elsewhere = "elsewhere",
    }
}

table! {
    /// A GPIO line by stable names.
    @[derive(Eq)]
    pub struct GpioLine {
        /// Label of the chip (`gpiodetect`), not its number.
        chip: String, Text, Never;
        /// Name of the line (`gpioinfo`).
        line: String, Text, Never;
        /// Level that means "on" or "pressed", or that of the pulse.
        active: Level, Word(Level::WORDS), Never;
    }
}

words! {
    /// Voltage level of a line.
    pub enum Level {
        /// Near the supply voltage.
        High = "high",
        /// Near ground.
        Low = "low",
    }
}

/// Start of an exposure.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum TriggerDevice {
    /// A pulse on an output line.
    Line(GpioLine),
    /// Pulses of a PWM channel.
    Pwm(PwmChannel),
    /// None: the camera runs free.
    FreeRunning(FreeRunningKeys),
}

impl TriggerDevice {
    const KINDS: &'static [KindKeys] = &[
        KindKeys { word: "line", keys: &GpioLine::TABLE, is_default: false },
        KindKeys { word: "pwm", keys: &PwmChannel::TABLE, is_default: false },
        KindKeys { word: "free-running", keys: &FreeRunningKeys::TABLE, is_default: false },
    ];
}

table! {
    /// A PWM channel, which times the pulses that are exposures (`exposure-by = "pulse"`).
    @[derive(Eq)]
    pub struct PwmChannel {
        /// Device of the chip, such as `1f00098000.pwm`: the last name in
        /// `readlink -f /sys/class/pwm/pwmchip*/device`, since a chip's number changes.
        chip: String, Text, Never;
        /// Number of the channel on its chip.
        channel: u32, Whole(0, 255), Never;
        /// Level of the pulse.
        active: Level, Word(Level::WORDS), Never;
    }
}

table! {
    /// A free-running camera: the first frame exposed after the picture has settled is used.
    @[derive(Eq)]
    pub struct FreeRunningKeys {}
}

table! {
    /// Lamps, each optional.
    pub struct LampDevices {
        /// Waiting for photos.
        ready: Option<GpioLine>, Table(&GpioLine::TABLE), Says("the box has none");
        /// Restoring a photo.
        busy: Option<GpioLine>, Table(&GpioLine::TABLE), Says("the box has none");
        /// Needs the operator.
        trouble: Option<GpioLine>, Table(&GpioLine::TABLE), Says("the box has none");
    }
}
