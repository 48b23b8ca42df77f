//! The clocks of the daemon.

use std::time::SystemTime;

use super::store::limits::Now;
use crate::nights::trust::unix_s;
use crate::rig::{Clock, Moment};

/// Monotonic clock and calendar.
#[derive(Clone, Copy)]
pub(super) struct Clocks<'a> {
    pub(super) clock: &'a dyn Clock,
    pub(super) calendar: &'a dyn Fn() -> SystemTime,
}

impl Clocks<'_> {
    pub(super) fn now(&self) -> Now {
        Now { moment: self.clock.now(), unix_s: self.unix_s() }
    }

    pub(super) fn moment(&self) -> Moment {
        self.clock.now()
    }

    pub(super) fn unix_s(&self) -> u64 {
        unix_s((self.calendar)()) as u64
    }
}
