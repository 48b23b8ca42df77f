//! Everything in a camera that adapts is switched off, the exposure set, and all of it read back.

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

/// Control names (as `v4l2-ctl` prints them, in today's spelling and the one before Linux 6.0) and
/// the value that stops the camera from adapting. Auto exposure 1 is "manual mode"
/// (V4L2_EXPOSURE_MANUAL).
const STEADY: [(&str, i32); 15] = [
    ("auto_exposure", 1),
    ("exposure_auto", 1),
    ("exposure_dynamic_framerate", 0),
    ("exposure_auto_priority", 0),
    ("gain_automatic", 0),
    ("autogain", 0),
    ("white_balance_automatic", 0),
    ("white_balance_temperature_auto", 0),
    ("focus_automatic_continuous", 0),
    ("backlight_compensation", 0),
    ("power_line_frequency", 0),
    ("sharpness", i32::MIN),
    // The Imaging Source's own, once its extension is loaded (tiscamera,
    // data/uvc-extensions/usb33.json).
    ("auto_shutter", 0),
    ("gain_auto", 0),
    ("highlight_reduction", 0),
];

/// Sets the steady values, the exposure and the file's own `wanted` controls, in this order, and
/// reads each back.
///
/// # Errors
/// [`RigError::Refused`] for a control the camera has not got, or that does not hold its value.
pub(super) fn settle_controls(
    node: &Node,
    exposure: &Exposure,
    wanted: &[(String, i32)],
) -> Result<(), RigError> {
    let has = node.controls();
    for (name, value) in STEADY {
        if let Some(control) = has.iter().find(|control| control.name == name && control.settable) {
            hold(node, control, value.max(control.minimum))?;
        }
    }
    if let Exposure::Control { exposure_ms } = exposure {
        let steps = (exposure_ms * 10.0).round() as i32;
        let control =
            named(&has, "exposure_time_absolute").or_else(|_| named(&has, "exposure_absolute"))?;
        hold(node, control, steps)?;
    }
    for (name, value) in wanted {
        hold(node, named(&has, name)?, *value)?;
    }
    Ok(())
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
