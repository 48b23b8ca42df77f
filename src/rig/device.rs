//! What every device of a rig must do: four small traits, and the errors they share.

use crate::frame::{Codes, Counts, Size};
use crate::remedy::{Remediable, Remedy};

/// A moment on a rig's clock, in seconds since that clock began.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Moment(pub f64);

/// A picture's first appearance on the panel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flip {
    /// When scan-out of the new picture began (its first row; vblank time stamp).
    pub at: Moment,
    /// Vblank counter of that scan-out.
    pub vblank: u64,
}

/// One exposure as the camera delivered it.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposed {
    /// Raw counts, one plane a channel.
    pub counts: Counts,
    /// The camera's own frame counter; gaps are lost frames.
    pub sequence: u32,
    /// When the frame was taken, by the camera.
    pub at: Moment,
}

/// The display.
pub trait Panel {
    /// Panel pixels.
    fn size(&self) -> Size;
    /// Puts `codes` on the panel at the next refresh and returns when that was.
    ///
    /// # Errors
    /// When the panel or the right to use it is gone.
    fn show(&mut self, codes: &Codes) -> Result<Flip, RigError>;
}

/// The line that starts an exposure.
pub trait Trigger {
    /// Starts one exposure and returns when.
    ///
    /// # Errors
    /// When the line cannot be driven.
    fn fire(&mut self) -> Result<Moment, RigError>;
}

/// The image sensor.
pub trait Camera {
    /// Camera pixels.
    fn size(&self) -> Size;
    /// The next frame, waiting until `deadline` at the longest.
    ///
    /// # Errors
    /// [`RigError::NoFrame`] when none came in time, [`RigError::Gone`] when the camera went away.
    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError>;
    /// Takes a frame's memory back that nobody needs any more, so that the next one need not
    /// allocate.
    fn give_back(&mut self, counts: Counts) {
        drop(counts);
    }
    /// Makes exposures from now on `times` as long as the rig file says; false, and nothing is
    /// changed, where this camera's exposure is set elsewhere.
    ///
    /// # Errors
    /// When the camera does not take it.
    fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        let _ = times;
        Ok(false)
    }
    /// Makes its counts `times` what the rig file's gain makes of the same light, as near as its
    /// steps allow: how many times it is. `None`, and nothing is changed, where it cannot be set.
    ///
    /// # Errors
    /// When the camera does not take it.
    fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        let _ = times;
        Ok(None)
    }
    /// Closes and opens the camera again, with fresh buffers.
    ///
    /// # Errors
    /// [`RigError::Gone`] while it is away.
    fn reopen(&mut self) -> Result<(), RigError>;
}

/// The time.
pub trait Clock {
    /// Now.
    fn now(&self) -> Moment;
    /// Returns at `moment`, or at once when it has passed.
    fn wait_until(&self, moment: Moment);
}

/// Why a rig did not do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// No frame came before the deadline.
    #[error("no frame from the camera within {waited_ms:.0} ms of the trigger")]
    NoFrame {
        /// How long was waited.
        waited_ms: f64,
    },
    /// Frames came, but none could be shown to belong to the picture shown.
    #[error(
        "{tries} exposures brought no frame of the picture shown; the last one was {last}; `relens \
         check` says whether panel.settle-ms is too short"
    )]
    NotThisPicture {
        /// Exposures tried.
        tries: u32,
        /// What the last frame was.
        last: String,
    },
    /// A device is not there (any more).
    #[error("the {device} is gone: {what}")]
    Gone {
        /// Which device.
        device: &'static str,
        /// What was observed.
        what: String,
    },
    /// No frame can be proven to be its picture's, because the marks that prove it are not seen.
    #[error(
        "the camera does not see the panel's marks: {what} (where `relens check` sees them, \
         panel.settle-ms is too short)"
    )]
    NoMarks {
        /// What was seen.
        what: String,
    },
    /// Another program has a device, a line or the display.
    #[error("the {device} is held: {what}")]
    Held {
        /// Which device.
        device: &'static str,
        /// By whom, as far as the kernel tells.
        what: String,
    },
    /// The kernel refused something that should work.
    #[error("the {device} failed to {doing}")]
    Failed {
        /// Which device.
        device: &'static str,
        /// What was being done.
        doing: &'static str,
        /// The kernel's answer.
        #[source]
        source: std::io::Error,
    },
    /// A device refuses its settings.
    #[error("the {device} cannot do what the rig file asks: found {found}, allowed {allowed}")]
    Refused {
        /// Which device.
        device: &'static str,
        /// What was asked for.
        found: String,
        /// What the device allows.
        allowed: String,
    },
}

impl Remediable for RigError {
    fn remedy(&self) -> Remedy {
        match self {
            RigError::NoFrame { .. } | RigError::NotThisPicture { .. } => Remedy::ShootAgain,
            RigError::Gone { .. } | RigError::Failed { .. } => Remedy::ReopenRig,
            // Whoever holds a device does so for longer than three tries in a row take.
            RigError::Held { .. } | RigError::Refused { .. } | RigError::NoMarks { .. } => {
                Remedy::CallOperator
            }
        }
    }
}
