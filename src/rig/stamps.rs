//! When an exposure began, by the stamp of its frame, whatever the stamp is of.
//!
//! A stamp is read as early as it can be: a frame counts as exposed after a moment only when it
//! cannot have begun before.

use super::Moment;
use crate::config::Stamps;

/// Who stamps frames, and how the camera runs.
#[derive(Debug, Clone, Copy)]
pub(super) struct StampedBy<'a> {
    /// The driver's name.
    pub(super) driver: &'a str,
    /// Whether the driver says that stamps are of the exposure's start (`TSTAMP_SRC_SOE`).
    pub(super) says_start: bool,
    /// Exposure time, in seconds.
    pub(super) exposure_s: f64,
    /// From frame to frame of a camera that runs free, in seconds; `None` of a triggered one.
    pub(super) interval_s: Option<f64>,
}

/// The driver of USB cameras. It says start of exposure and stamps the first packet of a frame,
/// which is read out after the exposure (drivers/media/usb/uvc, `uvc_video_decode_start` and
/// `uvc_queue_init`).
const USB_VIDEO: &str = "uvcvideo";

/// The earliest moment at which the exposure stamped `stamp_s` can have begun.
///
/// A camera that runs free may hold a frame back before it sends the first packet, at most until it
/// has the next one (guess): that much earlier it may have begun. A triggered one exposes nothing
/// but what was asked for.
pub(super) fn begun(wanted: Stamps, by: &StampedBy<'_>, stamp_s: f64) -> Moment {
    let wanted = match wanted {
        Stamps::Driver if by.driver == USB_VIDEO => Stamps::FirstPacket,
        Stamps::Driver if by.says_start => Stamps::ExposureStart,
        Stamps::Driver => Stamps::FrameEnd,
        stated => stated,
    };
    Moment(match wanted {
        Stamps::ExposureStart | Stamps::Driver => stamp_s,
        Stamps::FirstPacket => stamp_s - by.exposure_s - by.interval_s.unwrap_or(0.0),
        // The time of read-out stays in it.
        Stamps::FrameEnd => stamp_s - by.exposure_s,
    })
}

#[cfg(test)]
#[path = "stamps_tests.rs"]
mod tests;
