//! Everything in a camera that adapts or bends is switched off or pinned, the exposure set, and all
//! of it read back.

use super::kernel::{Control, Node};
use crate::rig::RigError;

/// What sets the exposure time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exposure {
    /// The camera's control `exposure_time_absolute`, in steps of 100 µs
    /// (V4L2_CID_EXPOSURE_ABSOLUTE).
    Control {
        /// Exposure time.
        exposure_ms: f64,
    },
    /// The trigger pulse's width, or something outside V4L2; nothing is set here.
    Elsewhere {
        /// Exposure time, as it was set there.
        exposure_ms: f64,
    },
}

impl Exposure {
    /// Exposure time.
    pub fn exposure_ms(&self) -> f64 {
        match self {
            Exposure::Control { exposure_ms } | Exposure::Elsewhere { exposure_ms } => *exposure_ms,
        }
    }
}

/// The control that sets a camera's gain.
#[derive(Debug, Clone, PartialEq)]
pub struct GainControl {
    /// Its name.
    pub name: String,
    /// What the rig file holds it at.
    pub value: i32,
    /// What a step adds, in decibels.
    pub step_db: f64,
}

impl GainControl {
    /// The names that such a control may have: of the whole camera, or of a sensor
    /// (V4L2_CID_GAIN, V4L2_CID_ANALOGUE_GAIN).
    pub const NAMES: [&'static str; 2] = ["gain", "analogue_gain"];

    /// Its value for `times` the rig file's gain.
    fn value_for(&self, times: f64) -> i32 {
        self.value.saturating_add((20.0 * times.log10() / self.step_db).round() as i32)
    }

    /// How many times the rig file's gain it is at for `times`, which need not be a whole step.
    pub fn nearest(&self, times: f64) -> f64 {
        let steps = f64::from(self.value_for(times)) - f64::from(self.value);
        10f64.powf(steps * self.step_db / 20.0)
    }
}

/// What a control is held at.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Held {
    /// This value, or the least above it.
    At(i32),
    /// Its least value.
    Least,
    /// What the driver calls its default: no change of the picture, where there is such a value.
    Default,
    /// A gamma of 1, which is 100 in the units of the USB video class (1.5, §4.2.2.3.9); its
    /// default where 100 cannot be had.
    Straight,
}
use Held::{At, Default, Least, Straight};

/// What the controls of one row do to a picture, and the names they may have (as `v4l2-ctl` prints
/// them, in today's spelling and the one before Linux 6.0; from `auto_shutter` on The Imaging
/// Source's own, tiscamera's data/uvc-extensions/usb33.json), with what stops a camera from
/// adapting. Automatics come before what they would set. Auto exposure 1 is "manual mode"
/// (V4L2_EXPOSURE_MANUAL).
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

/// What the camera `has` no control of.
fn uncontrolled(has: &[Control]) -> Vec<&'static str> {
    let is_there = |name: &str| has.iter().any(|control| control.name == name && control.settable);
    let lacks = |names: &[(&str, Held)]| !names.iter().any(|(name, _)| is_there(name));
    STEADY.iter().filter(|(_, names)| lacks(names)).map(|(what, _)| *what).collect()
}

/// Sets the steady values, the exposure and the file's own `wanted` controls, in this order, and
/// reads each back; what the camera has no control of.
///
/// # Errors
/// [`RigError::Refused`] for a control the camera has not got, or that does not hold its value.
pub(super) fn settle_controls(
    node: &Node,
    exposure: &Exposure,
    wanted: &[(String, i32)],
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
    Ok(uncontrolled(&has))
}

/// Exposes `times` as long as `exposure` says; false where it is set elsewhere.
///
/// # Errors
/// [`RigError::Refused`] when the camera has no such control or does not hold it.
pub(super) fn expose(
    node: &Node,
    has: &[Control],
    exposure: &Exposure,
    times: f64,
) -> Result<bool, RigError> {
    let Exposure::Control { exposure_ms } = exposure else { return Ok(false) };
    let steps = (times * exposure_ms * 10.0).round() as i32;
    let control =
        named(has, "exposure_time_absolute").or_else(|_| named(has, "exposure_absolute"))?;
    hold(node, control, steps)?;
    give_time(node, times * exposure_ms);
    Ok(true)
}

/// Sets `gain` to `times` the rig file's.
///
/// # Errors
/// [`RigError::Refused`] when the camera has no such control or does not hold it.
pub(super) fn amplify(
    node: &Node,
    has: &[Control],
    gain: &GainControl,
    times: f64,
) -> Result<(), RigError> {
    hold(node, named(has, &gain.name)?, gain.value_for(times))
}

/// Asks for an interval between frames in which the exposure has room: drivers cut an exposure that
/// has none. A triggered camera may have no interval, and is left alone.
fn give_time(node: &Node, exposure_ms: f64) {
    let exposure_s = exposure_ms / 1000.0;
    match node.frame_interval_s() {
        Ok(Some(found)) if found < exposure_s => {
            let set = node.set_frame_interval_s(exposure_s).ok().flatten();
            if set.is_none_or(|set| set < exposure_s) {
                log::warn!(
                    "the camera takes a frame every {:.1} ms and does not change that; an \
                     exposure of {exposure_ms} ms may be cut short",
                    1000.0 * set.unwrap_or(found)
                );
            }
        }
        _ => {}
    }
}

fn named<'a>(has: &'a [Control], name: &str) -> Result<&'a Control, RigError> {
    has.iter().find(|control| control.name == name && control.settable).ok_or_else(|| {
        RigError::Refused {
            device: "camera",
            found: format!("control {name}"),
            allowed: has
                .iter()
                .filter(|c| c.settable)
                .map(|c| c.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
        }
    })
}

fn hold(node: &Node, control: &Control, value: i32) -> Result<(), RigError> {
    let outcome = node.set_control(control.id, value).and_then(|()| node.control(control.id));
    match outcome {
        Ok(found) if found == value => Ok(()),
        outcome => Err(RigError::Refused {
            device: "camera",
            found: match outcome {
                Ok(found) => format!("{} = {value}, which reads back as {found}", control.name),
                Err(cause) => format!("{} = {value} ({cause})", control.name),
            },
            allowed: format!("{} to {}", control.minimum, control.maximum),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(name: &str, minimum: i32, maximum: i32, default: i32) -> Control {
        Control { id: 0, name: name.to_owned(), minimum, maximum, default, settable: true }
    }

    #[test]
    fn a_gamma_is_made_straight_where_it_is_in_hundredths() {
        assert_eq!(Straight.value(&control("gamma", 72, 500, 220)), 100);
        assert_eq!(Straight.value(&control("gamma", 0, 3, 1)), 1);
        assert_eq!(Default.value(&control("hue", -40, 40, 0)), 0);
        assert_eq!(Least.value(&control("sharpness", 2, 7, 3)), 2);
        assert_eq!(At(0).value(&control("gain_auto", 1, 2, 2)), 1);
    }

    #[test]
    fn what_a_camera_cannot_be_told_is_named() {
        let has = [control("auto_exposure", 0, 3, 3), control("gamma", 72, 500, 100)];
        let missing = uncontrolled(&has);
        assert!(missing.contains(&"hue") && missing.contains(&"white balance"), "{missing:?}");
        assert!(!missing.contains(&"gamma") && !missing.contains(&"exposure"), "{missing:?}");
    }
}
