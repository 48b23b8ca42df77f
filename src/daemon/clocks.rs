//! The clocks of the daemon.

use std::cell::Cell;
use std::time::SystemTime;

use super::store::limits::Now;
use crate::nights::trust::{JUMP_S, unix_s};
use crate::rig::{Clock, Moment};

/// Monotonic clock and calendar.
pub(super) struct Clocks<'a> {
    pub(super) clock: &'a dyn Clock,
    calendar: &'a dyn Fn() -> SystemTime,
    /// Whether the calendar is right, also after a jump.
    pub(super) is_trusted: &'a dyn Fn() -> bool,
    /// The last of [`Clocks::date`], and its moment.
    dated: Cell<Option<(Moment, f64)>>,
}

impl<'a> Clocks<'a> {
    pub(super) fn new(clock: &'a dyn Clock, calendar: &'a dyn Fn() -> SystemTime) -> Clocks<'a> {
        Clocks { clock, calendar, is_trusted: &|| false, dated: Cell::new(None) }
    }

    pub(super) fn now(&self) -> Now {
        Now { moment: self.clock.now(), unix_s: self.unix_s() }
    }

    pub(super) fn moment(&self) -> Moment {
        self.clock.now()
    }

    /// The calendar, as files' own times are by.
    pub(super) fn unix_s(&self) -> u64 {
        unix_s((self.calendar)()) as u64
    }

    /// The date for a report: the calendar, whose jumps are followed only while it is trusted. From
    /// an untrusted one on, the date goes on with the monotonic clock.
    pub(super) fn date(&self) -> u64 {
        let (now, found) = (self.moment(), unix_s((self.calendar)()));
        let steady = self.dated.get().map_or(found, |(then, date)| date + (now.0 - then.0));
        let has_jumped = (found - steady).abs() > JUMP_S;
        let date = if has_jumped && !(self.is_trusted)() { steady } else { found };
        self.dated.set(Some((now, date)));
        date as u64
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, UNIX_EPOCH};

    use super::*;

    /// A clock that stands at a set moment.
    #[derive(Debug)]
    struct SetClock(std::sync::atomic::AtomicU64);

    impl Clock for SetClock {
        fn now(&self) -> Moment {
            Moment(self.0.load(std::sync::atomic::Ordering::Relaxed) as f64)
        }

        fn wait_until(&self, _: Moment) {}
    }

    #[test]
    fn dates_follow_a_jump_of_the_calendar_only_if_it_is_trusted() {
        let clock = SetClock(0.into());
        let (shown, trusted) = (Cell::new(1_000_000), Cell::new(false));
        let calendar = || UNIX_EPOCH + Duration::from_secs(shown.get());
        let is_trusted = || trusted.get();
        let clocks = Clocks { is_trusted: &is_trusted, ..Clocks::new(&clock, &calendar) };
        let date = |moment_s: u64, unix_s: u64| {
            clock.0.store(moment_s, std::sync::atomic::Ordering::Relaxed);
            shown.set(unix_s);
            clocks.date()
        };
        assert_eq!(date(0, 1_000_000), 1_000_000);
        assert_eq!(date(100, 1_000_103), 1_000_103, "a clock that is adjusted");
        let day = 86_400;
        assert_eq!(date(200, 1_000_203 - day), 1_000_203);
        assert_eq!(date(300, 1_000_303 + 30_000 * day), 1_000_303);
        assert_eq!(date(400, 1_000_403), 1_000_403, "and back");
        trusted.set(true);
        assert_eq!(date(500, 1_000_503 + day), 1_000_503 + day, "set by the network");
    }
}
