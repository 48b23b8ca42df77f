//! Time stamps of a camera, converted to the board's clock.

use aravis::prelude::*;
use aravis::{Buffer, Device};
use rustix::time::{ClockId, clock_gettime};

use super::features::{is_there, number};
use crate::rig::monotonic::Monotonic;

/// Commands that latch the camera's clock, with the features of the latched value and of the ticks
/// per second: SFNC 2.7 (nanoseconds), and GigE Vision 1.2.
const LATCHES: [(&str, &str, Option<&str>); 2] = [
    ("TimestampLatch", "TimestampLatchValue", None),
    ("GevTimestampControlLatch", "GevTimestampValue", Some("GevTimestampTickFrequency")),
];

/// Maximum duration of a usable latch command. Guess: USB takes less than 1 ms, a network a few.
const LATCH_MAX_S: f64 = 0.02;

/// Maximum age of a time stamp, in seconds; an older one is of another clock.
const AGE_MAX_S: f64 = 3600.0;

/// Time stamp of `buffer` in seconds on the monotonic clock, late by at most the duration of the
/// latch command; `None` if the camera has no latch or an unusable one.
///
/// The clocks are compared for each frame, since they drift apart by a millisecond in ten seconds
/// (100 ppm).
pub(super) fn stamped_s(device: &Device, buffer: &Buffer) -> Option<f64> {
    let (command, value, frequency) = LATCHES
        .into_iter()
        .find(|(command, value, _)| is_there(device, command) && is_there(device, value))?;
    let before_s = Monotonic::seconds();
    device.execute_command(command).ok()?;
    let after_s = Monotonic::seconds();
    let ticks_hz = frequency.map_or(Some(1e9), |name| number(device, name))?;
    let age_s = number(device, value)? / ticks_hz - buffer.timestamp() as f64 / 1e9;
    let is_usable = after_s - before_s <= LATCH_MAX_S && (0.0..AGE_MAX_S).contains(&age_s);
    is_usable.then_some(after_s - age_s)
}

/// Arrival of the first packet of `buffer` in seconds on the monotonic clock.
pub(super) fn arrived_s(buffer: &Buffer) -> f64 {
    // The library stamps arrivals by the calendar clock.
    let now = clock_gettime(ClockId::Realtime);
    let age_s = now.tv_sec as f64 - (buffer.system_timestamp() / 1_000_000_000) as f64
        + (now.tv_nsec as f64 - (buffer.system_timestamp() % 1_000_000_000) as f64) / 1e9;
    Monotonic::seconds() - age_s
}
