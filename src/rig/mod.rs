//! What is bolted down: panel, trigger, camera and clock, behind four small traits.
//!
//! [`exposure`] turns them into one act, show-and-see. `simulated` is a rig like any other, made of
//! physics; it knows nothing of the solver or the calibration.

pub mod bayer;
pub mod button;
pub mod coarse_geometry;
#[cfg(any(test, feature = "hardware"))]
mod display_link;
pub mod exposure;
pub mod frame_mark;
#[cfg(feature = "hardware")]
pub mod gpio_line;
#[cfg(feature = "hardware")]
pub mod hardware;
pub mod kernel_time;
#[cfg(feature = "hardware")]
mod kms_card;
#[cfg(feature = "hardware")]
pub mod kms_panel;
#[cfg(feature = "hardware")]
pub mod lamps;
pub mod mark_search;
#[cfg(feature = "hardware")]
mod modeset;
#[cfg(feature = "hardware")]
pub mod monotonic;
pub mod pixel_format;
#[cfg(feature = "hardware")]
pub mod pulse_trigger;
pub mod simulated;
#[cfg(feature = "hardware")]
pub mod v4l2_camera;
#[cfg(feature = "hardware")]
pub mod v4l2_controls;
#[cfg(feature = "hardware")]
mod v4l2_kernel;
#[cfg(feature = "hardware")]
mod v4l2_ring;

use crate::config;
use crate::frame::{Codes, Counts, Size};
use crate::remedy::{Remediable, Remedy};

/// Opens the rig of a rig file, simulated or real.
///
/// # Errors
/// Whatever a device has to say.
pub fn open(rig: &config::Rig) -> Result<exposure::Rig, RigError> {
    match &rig.kind {
        config::Kind::Simulated(_) => {
            let (mut devices, _) = simulated::open(rig)?;
            if let Some(place) = frame_mark::MarkPlace::of(rig) {
                devices.find_marks(place)?;
            }
            Ok(devices)
        }
        #[cfg(feature = "hardware")]
        config::Kind::Hardware(hardware) => hardware::open(rig, hardware),
        #[cfg(not(feature = "hardware"))]
        config::Kind::Hardware(_) => Err(RigError::Refused {
            device: "rig",
            found: format!("the rig `{}`, which is made of hardware", rig.name),
            allowed: "a simulated rig; this relens was built without `--features hardware`"
                .to_owned(),
        }),
    }
}

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
    #[error("{tries} exposures brought no frame of the picture shown; the last one was {last}")]
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
    #[error("the camera does not see the panel's marks: {what}")]
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
