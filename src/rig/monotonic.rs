//! `CLOCK_MONOTONIC`, the clock of flip events and camera frames.

use rustix::time::ClockId;
#[cfg(feature = "hardware")]
use rustix::time::Timespec;

use super::{Clock, Moment};

/// The kernel's monotonic clock.
#[derive(Debug, Clone, Copy, Default)]
pub struct Monotonic;

impl Monotonic {
    /// Current time in seconds.
    pub fn seconds() -> f64 {
        Monotonic.now().0
    }
}

impl Clock for Monotonic {
    fn now(&self) -> Moment {
        let now = rustix::time::clock_gettime(ClockId::Monotonic);
        Moment(now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9)
    }

    fn wait_until(&self, moment: Moment) {
        loop {
            let remaining_s = moment.0 - self.now().0;
            if remaining_s <= 0.0 || !remaining_s.is_finite() {
                return;
            }
            std::thread::sleep(std::time::Duration::from_secs_f64(remaining_s.min(3600.0)));
        }
    }
}

/// Processor time of all threads of this process, in seconds.
pub fn processor_seconds() -> f64 {
    let now = rustix::time::clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

/// Time until `deadline`, at least zero, for `poll`.
#[cfg(feature = "hardware")]
pub(super) fn remaining_until(deadline: Moment) -> Timespec {
    let remaining_s = (deadline.0 - Monotonic.now().0).clamp(0.0, 3600.0);
    Timespec { tv_sec: remaining_s as i64, tv_nsec: (remaining_s.fract() * 1e9) as i64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_does_not_end_early() {
        let until = Moment(Monotonic.now().0 + 0.01);
        Monotonic.wait_until(until);
        assert!(Monotonic.now() >= until);
    }

    #[test]
    #[cfg(feature = "hardware")]
    fn no_time_remains_of_a_deadline_that_has_passed() {
        let remaining = remaining_until(Moment(Monotonic.now().0 - 1.0));
        assert_eq!((remaining.tv_sec, remaining.tv_nsec), (0, 0));
    }
}
