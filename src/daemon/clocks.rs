//! The clocks of the daemon.

use std::time::SystemTime;

use crate::nights::trust::unix_s;
use crate::rig::{Clock, Moment};

/// Monotonic clock and calendar.
#[derive(Clone, Copy)]
pub(super) struct Clocks<'a> {
    pub(super) clock: &'a dyn Clock,
    pub(super) calendar: &'a dyn Fn() -> SystemTime,
}

impl Clocks<'_> {
    pub(super) fn moment(&self) -> Moment {
        self.clock.now()
    }

    /// Time by the calendar, as files have it, in seconds since 1970 UTC.
    pub(super) fn unix_s(&self) -> u64 {
        unix_s((self.calendar)()) as u64
    }
}
