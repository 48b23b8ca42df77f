//! Start of an exposure from the time stamp of its frame.
//!
//! The earliest possible start is assumed, so that a frame counts as exposed after a moment only if
//! it cannot have begun before. An exception is the unknown read-out time before a frame-end stamp.

use super::Moment;
use crate::config::Stamps;

/// Source of time stamps and timing of the camera.
#[derive(Debug, Clone, Copy)]
pub(super) struct StampedBy<'a> {
    pub(super) driver: &'a str,
    /// Whether the driver declares its stamps as taken at the start of exposure (`TSTAMP_SRC_SOE`).
    pub(super) states_start: bool,
    pub(super) exposure_s: f64,
    /// Frame interval of a free-running camera, in seconds; `None` for a triggered one.
    pub(super) interval_s: Option<f64>,
}

/// Driver of USB cameras. It declares start-of-exposure stamps, but stamps the first packet of a
/// frame, which is read out after the exposure (drivers/media/usb/uvc, `uvc_video_decode_start` and
/// `uvc_queue_init`).
const USB_VIDEO: &str = "uvcvideo";

/// Earliest possible start of the exposure stamped `stamp_s`.
///
/// A free-running camera may delay the first packet until it has the next frame (guess), so that
/// the exposure may have begun one interval earlier. A triggered camera exposes on request only.
pub(super) fn earliest_start(wanted: Stamps, by: &StampedBy<'_>, stamp_s: f64) -> Moment {
    let wanted = match wanted {
        Stamps::Driver if by.driver == USB_VIDEO => Stamps::FirstPacket,
        Stamps::Driver if by.states_start => Stamps::ExposureStart,
        Stamps::Driver => Stamps::FrameEnd,
        stated => stated,
    };
    Moment(match wanted {
        Stamps::ExposureStart | Stamps::Driver => stamp_s,
        Stamps::FirstPacket => stamp_s - by.exposure_s - by.interval_s.unwrap_or(0.0),
        // The read-out time is unknown and not subtracted: this start is late by it.
        Stamps::FrameEnd => stamp_s - by.exposure_s,
    })
}

#[cfg(test)]
#[path = "stamps_tests.rs"]
mod tests;
