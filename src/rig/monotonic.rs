//! The machine's clock: `CLOCK_MONOTONIC`, the one that flip events and camera frames are stamped
//! with.

use rustix::time::ClockId;
#[cfg(feature = "hardware")]
use rustix::time::Timespec;

use super::{Clock, Moment};

/// The kernel's monotonic clock.
#[derive(Debug, Clone, Copy, Default)]
pub struct Monotonic;

impl Monotonic {
    /// Seconds on this clock.
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
            let left = moment.0 - self.now().0;
            if left <= 0.0 || !left.is_finite() {
                return;
            }
            std::thread::sleep(std::time::Duration::from_secs_f64(left.min(3600.0)));
        }
    }
}

/// Processor time of all threads of this process, seconds: what computing costs, however many cores
/// there are and whatever else they do.
pub fn processor_seconds() -> f64 {
    let now = rustix::time::clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

/// What is left until `deadline` as `poll` wants it; nothing when it has passed.
#[cfg(feature = "hardware")]
pub(super) fn left_until(deadline: Moment) -> Timespec {
    let left = (deadline.0 - Monotonic.now().0).clamp(0.0, 3600.0);
    Timespec { tv_sec: left as i64, tv_nsec: (left.fract() * 1e9) as i64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_ends_no_earlier_than_asked() {
        let until = Moment(Monotonic.now().0 + 0.01);
        Monotonic.wait_until(until);
        assert!(Monotonic.now() >= until);
    }

    #[cfg(feature = "hardware")]
    #[test]
    #[cfg(feature = "hardware")]
    fn nothing_is_left_of_a_deadline_that_has_passed() {
        let left = left_until(Moment(Monotonic.now().0 - 1.0));
        assert_eq!((left.tv_sec, left.tv_nsec), (0, 0));
    }
}
