//! Camera controls: automatic adjustments and processing off, exposure set, everything read back.

use std::collections::BTreeMap;

use rustix::io::Errno;

use super::finding::busy_or;
use super::kernel::{Control, Node};
use super::request::is;
use crate::config::ExposureBy;
use crate::rig::camera::memory::refused;
use crate::rig::monotonic::Monotonic;
use crate::rig::{Clock, Moment, RigError};

/// Exposure time, and what sets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// `exposure_time_absolute`, in steps of 100 µs (V4L2_CID_EXPOSURE_ABSOLUTE), the width of the
    /// trigger pulse, or a setting outside V4L2.
    pub by: ExposureBy,
    /// Exposure time.
    pub exposure_ms: f64,
}

/// Control of a camera's gain.
#[derive(Debug, Clone, PartialEq)]
pub struct GainControl {
    /// Name of the control.
    pub name: String,
    /// Value in the rig file.
    pub value: i32,
    /// Gain per step, in decibels.
    pub step_db: f64,
}

impl GainControl {
    /// Names of gain controls: V4L2_CID_GAIN and V4L2_CID_ANALOGUE_GAIN.
    pub const NAMES: [&'static str; 2] = ["gain", "analogue_gain"];

    /// Value of the control nearest to `times` the rig file's gain.
    fn value_for(&self, times: f64) -> i32 {
        self.value.saturating_add((20.0 * times.log10() / self.step_db).round() as i32)
    }

    /// Reachable multiple of the rig file's gain that is nearest to `times`.
    pub fn nearest(&self, times: f64) -> f64 {
        let steps = f64::from(self.value_for(times)) - f64::from(self.value);
        10f64.powf(steps * self.step_db / 20.0)
    }
}

/// Value at which a control is held.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Held {
    /// This value, or the minimum if that is larger.
    At(i32),
    Least,
    /// The driver's default, which leaves the picture unchanged where possible.
    Default,
    /// Gamma 1, which is 100 in the USB video class (1.5, §4.2.2.3.9); else the default.
    Straight,
}
use Held::{At, Default, Least, Straight};

/// Adjustments of a picture, each with the controls that disable it, by their `v4l2-ctl` names in
/// today's spelling and that before Linux 6.0; `auto_shutter` and `highlight_reduction` are of The
/// Imaging Source (tiscamera, data/uvc-extensions/usb33.json). Automatic modes come before the
/// values that they govern. Auto exposure 1 is "manual mode" (V4L2_EXPOSURE_MANUAL).
const STEADY: [(&str, &[(&str, Held)]); 8] = [
    (
        "exposure",
        &[
            ("auto_exposure", At(1)),
            ("exposure_auto", At(1)),
            ("exposure_dynamic_framerate", At(0)),
            ("exposure_auto_priority", At(0)),
            ("auto_shutter", At(0)),
            ("backlight_compensation", At(0)),
            ("power_line_frequency", At(0)),
            ("highlight_reduction", At(0)),
        ],
    ),
    ("gain", &[("gain_automatic", At(0)), ("autogain", At(0)), ("gain_auto", At(0))]),
    (
        "white balance",
        &[
            ("white_balance_automatic", At(0)),
            ("white_balance_temperature_auto", At(0)),
            ("white_balance_temperature", Default),
            ("red_balance", Default),
            ("blue_balance", Default),
        ],
    ),
    ("sharpness", &[("focus_automatic_continuous", At(0)), ("sharpness", Least)]),
    ("gamma", &[("gamma", Straight)]),
    ("contrast", &[("contrast_automatic", At(0)), ("contrast", Default)]),
    ("saturation", &[("saturation", Default)]),
    ("hue", &[("hue_automatic", At(0)), ("hue_auto", At(0)), ("hue", Default)]),
];

impl Held {
    fn value(self, control: &Control) -> i32 {
        match self {
            At(value) => value.max(control.minimum),
            Least => control.minimum,
            Straight if (control.minimum..=control.maximum).contains(&100) => 100,
            Default | Straight => control.default,
        }
    }
}

/// Adjustments without a control among `has`; a `wanted` one with the adjustment's name suffices.
fn uncontrolled(has: &[Control], wanted: &BTreeMap<String, i32>) -> Vec<&'static str> {
    let is_there = |name: &str| has.iter().any(|control| control.name == name && control.settable);
    let lacks = |names: &[(&str, Held)]| !names.iter().any(|(name, _)| is_there(name));
    let lacking = STEADY.iter().filter(|(what, names)| lacks(names) && !wanted.contains_key(*what));
    lacking.map(|(what, _)| *what).collect()
}

/// Controls held at 0 before formats are set, unless the rig file has another value: flips, which
/// change the order of the colours, test pictures, and a light beside the lens. The names are those
/// of the kernel and of The Imaging Source's usb33.json.
const ORIENTATION: [&str; 6] = [
    "horizontal_flip",
    "vertical_flip",
    "flip_horizontal",
    "flip_vertical",
    "test_pattern",
    "strobe_enable",
];

/// Maximum wait for controls that a maker's udev rule adds after the node has appeared. Guess.
const CONTROLS_MAX_S: f64 = 10.0;

/// Waits for the `wanted` controls; [`settle_controls`] reports one that is still missing.
pub(super) fn await_controls(node: &Node, wanted: &BTreeMap<String, i32>) {
    let end_s = Monotonic.now().0 + CONTROLS_MAX_S;
    loop {
        let has = node.controls();
        let now_s = Monotonic.now().0;
        if now_s > end_s || wanted.keys().all(|name| named(&has, name).is_ok()) {
            return;
        }
        Monotonic.wait_until(Moment(now_s + 0.2));
    }
}

/// Holds the [`ORIENTATION`] controls at 0, or at the values that `wanted` states.
pub(super) fn settle_orientation(
    node: &Node,
    wanted: &BTreeMap<String, i32>,
) -> Result<(), RigError> {
    let has = node.controls();
    for name in ORIENTATION {
        let Ok(control) = named(&has, name) else { continue };
        let value = wanted.get(name).copied().unwrap_or(0);
        // A streaming sensor refuses even an equal value.
        if node.control(control.id).ok() != Some(value) {
            hold(node, control, value)?;
        }
    }
    Ok(())
}

/// Sets the [`STEADY`] controls, the exposure and the `wanted` controls, in this order, and reads
/// each back. Returns the adjustments for which the camera has no control.
///
/// # Errors
/// [`RigError::Refused`] for a missing control, or one that does not hold its value.
pub(super) fn settle_controls(
    node: &Node,
    exposure: &Exposure,
    wanted: &BTreeMap<String, i32>,
) -> Result<Vec<&'static str>, RigError> {
    let has = node.controls();
    for (name, held) in STEADY.iter().flat_map(|(_, names)| *names) {
        if let Ok(control) = named(&has, name) {
            hold(node, control, held.value(control))?;
        }
    }
    expose(node, &has, exposure, 1.0)?;
    for (name, value) in wanted {
        hold(node, named(&has, name)?, *value)?;
    }
    Ok(uncontrolled(&has, wanted))
}

/// Sets the exposure to `times` `exposure`; an exposure by pulse follows the pulse and needs no
/// setting. Returns false if the exposure is set outside this program.
pub(super) fn expose(
    node: &Node,
    has: &[Control],
    exposure: &Exposure,
    times: f64,
) -> Result<bool, RigError> {
    let Exposure { by, exposure_ms } = *exposure;
    if by != ExposureBy::Control {
        return Ok(by == ExposureBy::Pulse);
    }
    let steps = (times * exposure_ms * 10.0).round() as i32;
    let control =
        named(has, "exposure_time_absolute").or_else(|_| named(has, "exposure_absolute"))?;
    hold(node, control, steps)?;
    fit_interval(node, times * exposure_ms);
    Ok(true)
}

pub(super) fn amplify(
    node: &Node,
    has: &[Control],
    gain: &GainControl,
    times: f64,
) -> Result<(), RigError> {
    hold(node, named(has, &gain.name)?, gain.value_for(times))
}

/// Whether the frame interval of `node` is shorter than `times` the `exposure`.
pub(super) fn needs_longer_interval(node: &Node, exposure: &Exposure, times: f64) -> bool {
    let interval_s = node.frame_interval_s().ok().flatten();
    exposure.by == ExposureBy::Control
        && interval_s.is_some_and(|interval_s| interval_s < times * exposure.exposure_ms / 1e3)
}

/// Requests a frame interval that is long enough for the exposure, since drivers shorten exposures
/// to fit the interval. A triggered camera may have no interval.
fn fit_interval(node: &Node, exposure_ms: f64) {
    let exposure_s = exposure_ms / 1000.0;
    let Ok(Some(found)) = node.frame_interval_s() else { return };
    if found < exposure_s {
        let set = node.set_frame_interval_s(exposure_s).ok().flatten();
        if set.is_none_or(|set| set < exposure_s) {
            log::warn!(
                "the camera takes a frame every {:.1} ms and refuses another interval; an \
                 exposure of {exposure_ms} ms may be cut short",
                1000.0 * set.unwrap_or(found)
            );
        }
    }
}

fn named<'a>(has: &'a [Control], name: &str) -> Result<&'a Control, RigError> {
    let settable = has.iter().filter(|control| control.settable);
    settable.clone().find(|control| control.name == name).ok_or_else(|| {
        let names = settable.map(|control| control.name.as_str()).collect::<Vec<_>>();
        refused(format!("control {name}"), names.join(", "))
    })
}

fn hold(node: &Node, control: &Control, value: i32) -> Result<(), RigError> {
    let Control { id, name, minimum, maximum, .. } = control;
    let outcome = node.set_control(*id, value).and_then(|()| node.control(*id));
    let found = match outcome {
        Ok(found) if found == value => return Ok(()),
        Err(cause) if is(&cause, Errno::BUSY) => return Err(busy_or(cause, "set a control")),
        Ok(found) => format!("{name} = {value}, which reads back as {found}"),
        Err(cause) => format!("{name} = {value} ({cause})"),
    };
    Err(refused(found, format!("{minimum} to {maximum}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(name: &str, minimum: i32, maximum: i32, default: i32) -> Control {
        Control { id: 0, name: name.to_owned(), minimum, maximum, default, settable: true }
    }

    #[test]
    fn gamma_is_1_where_the_control_is_in_hundredths() {
        assert_eq!(Straight.value(&control("gamma", 72, 500, 220)), 100);
        assert_eq!(Straight.value(&control("gamma", 0, 3, 1)), 1);
        assert_eq!(Default.value(&control("hue", -40, 40, 0)), 0);
        assert_eq!(Least.value(&control("sharpness", 2, 7, 3)), 2);
        assert_eq!(At(0).value(&control("gain_auto", 1, 2, 2)), 1);
    }

    #[test]
    fn adjustments_without_a_control_are_named() {
        let has = [control("auto_exposure", 0, 3, 3), control("gamma", 72, 500, 100)];
        let missing = uncontrolled(&has, &BTreeMap::new());
        assert!(missing.contains(&"hue") && missing.contains(&"white balance"), "{missing:?}");
        assert!(!missing.contains(&"gamma") && !missing.contains(&"exposure"), "{missing:?}");
        let of_rig_file = uncontrolled(&has, &BTreeMap::from([("gain".to_owned(), 0)]));
        assert!(missing.contains(&"gain") && !of_rig_file.contains(&"gain"), "{of_rig_file:?}");
    }
}
