//! Traits of a rig's four devices, and their common errors.

use crate::frame::{Codes, Counts, Size};
use crate::remedy::{Remediable, Remedy};

/// A moment on a rig's clock, in seconds.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Moment(pub f64);

/// Start of a picture's scan-out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flip {
    /// Vblank time stamp: scan-out of the picture's first row.
    pub at: Moment,
    /// Vblank counter.
    pub vblank: u64,
}

/// A frame as delivered by the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposed {
    /// Raw counts, one plane per channel.
    pub counts: Counts,
    /// The camera's frame counter; gaps are lost frames.
    pub sequence: u32,
    /// Start of the exposure, by the camera's time stamp.
    pub at: Moment,
}

/// Display.
pub trait Panel {
    /// Size in panel pixels.
    fn size(&self) -> Size;
    /// Shows `codes` from the next refresh on.
    ///
    /// # Errors
    /// If the panel is disconnected, or another program has taken it over.
    fn show(&mut self, codes: &Codes) -> Result<Flip, RigError>;
}

/// Device that starts exposures.
pub trait Trigger {
    /// Starts an exposure; returns the moment before it.
    ///
    /// # Errors
    /// When the line cannot be driven; [`RigError::PulseLength`] after an exposure of wrong length.
    fn fire(&mut self) -> Result<Moment, RigError>;
    /// Sets the length of exposing pulses for an exposure of `times` the rig file's.
    fn expose_times(&mut self, times: f64) {
        let _ = times;
    }
}

/// Image sensor.
pub trait Camera {
    /// Size in sensor pixels.
    fn size(&self) -> Size;
    /// Waits for the next frame until `deadline`.
    ///
    /// # Errors
    /// [`RigError::NoFrame`] if none arrives in time, [`RigError::Gone`] if the camera disconnects.
    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError>;
    /// Switches to the sensor's own pixels (`own`) or back to binned ones. Has no effect on a
    /// camera that is not binned.
    fn deliver_own(&mut self, own: bool) {
        let _ = own;
    }
    /// Takes back the memory of a frame for reuse.
    fn give_back(&mut self, counts: Counts) {
        drop(counts);
    }
    /// Sets the exposure to `times` the rig file's. Returns false, and changes nothing, if the
    /// exposure is set outside this program.
    fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        let _ = times;
        Ok(false)
    }
    /// Sets the gain to `times` the rig file's, as closely as its steps allow, and returns the
    /// multiple reached; `None`, without a change, if the gain cannot be set.
    fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        let _ = times;
        Ok(None)
    }
    /// Closes and reopens the camera with new buffers.
    ///
    /// # Errors
    /// [`RigError::Gone`] while it is disconnected.
    fn reopen(&mut self) -> Result<(), RigError>;
}

/// Clock.
pub trait Clock {
    /// Current moment.
    fn now(&self) -> Moment;
    /// Waits until `moment`, if that is in the future.
    fn wait_until(&self, moment: Moment);
}

/// Error of a rig.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The messages describe the variants.
pub enum RigError {
    #[error("no frame from the camera within {waited_ms:.0} ms of the trigger")]
    NoFrame { waited_ms: f64 },
    /// Frames arrived, but none could be identified as showing the picture.
    #[error(
        "none of {tries} exposures gave a frame of the picture shown; the last was {last}. Run \
         `relens check`: panel.settle-ms may be too short"
    )]
    NotThisPicture { tries: u32, last: String },
    /// The trigger pulse that times the exposure had the wrong length.
    #[error("the trigger's pulse lasted {found_ms:.2} ms instead of {wanted_ms:.2}")]
    PulseLength { found_ms: f64, wanted_ms: f64 },
    /// A device is missing or disconnected.
    #[error("the {device} is gone: {what}")]
    Gone { device: &'static str, what: String },
    #[error(
        "the camera does not see the panel's marks: {what}. If `relens check` finds them, \
         panel.settle-ms is too short"
    )]
    NoMarks { what: String },
    #[error("the {device} is in use: {what}")]
    Held { device: &'static str, what: String },
    #[error("the {device} failed to {doing}")]
    Failed { device: &'static str, doing: &'static str, source: std::io::Error },
    #[error("the {device} does not fit the rig file: found {found}, allowed {allowed}")]
    Refused { device: &'static str, found: String, allowed: String },
}

impl RigError {
    /// Creates a [`RigError::Refused`] with what was `found` and what is `allowed` instead.
    pub fn refused(
        device: &'static str,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> RigError {
        RigError::Refused { device, found: found.into(), allowed: allowed.into() }
    }

    /// Creates a [`RigError::Gone`] for a missing or disconnected `device`.
    pub fn gone(device: &'static str, what: impl Into<String>) -> RigError {
        RigError::Gone { device, what: what.into() }
    }

    /// Creates a [`RigError::Held`] for a `device` in use by another program.
    pub fn held(device: &'static str, what: impl Into<String>) -> RigError {
        RigError::Held { device, what: what.into() }
    }
}

/// Joins `names` for a message.
#[cfg(feature = "hardware")]
pub(super) fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

impl Remediable for RigError {
    fn remedy(&self) -> Remedy {
        match self {
            RigError::NoFrame { .. }
            | RigError::NotThisPicture { .. }
            | RigError::PulseLength { .. } => Remedy::ShootAgain,
            RigError::Gone { .. } | RigError::Failed { .. } => Remedy::ReopenRig,
            // A program that holds a device keeps it for longer than a few tries.
            RigError::Held { .. } | RigError::Refused { .. } | RigError::NoMarks { .. } => {
                Remedy::CallOperator
            }
        }
    }
}

/// The level of a button.
pub trait ButtonLevel {
    /// Waits for a change of level, at most until `deadline`, and returns the level. May return
    /// early.
    fn level_by(&mut self, deadline: Moment) -> Result<bool, RigError>;
}

/// The lamps of a box.
pub trait LampRow {
    /// Lights exactly `lit`.
    fn show(&mut self, lit: &[Lamp]) -> Result<(), RigError>;
}

/// A box without lamps.
impl LampRow for () {
    fn show(&mut self, _: &[Lamp]) -> Result<(), RigError> {
        Ok(())
    }
}

/// Meaning of a lamp. Colours after IEC 60073: green ready, white busy, red trouble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lamp {
    /// Waiting for photos.
    Ready,
    /// Restoring a photo; lit at once when the button is pressed.
    Busy,
    /// Needs the operator.
    Trouble,
}
