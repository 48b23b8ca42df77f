//! The machine's own clock, for the daemon's waits. The rig has its own.

use std::time::{Duration, Instant};

use relens::rig::{Clock, Moment};

/// Seconds since it was made.
#[derive(Clone, Copy)]
pub(super) struct MachineClock(Instant);

impl MachineClock {
    /// A clock that begins now.
    pub(super) fn new() -> Self {
        MachineClock(Instant::now())
    }
}

impl Clock for MachineClock {
    fn now(&self) -> Moment {
        Moment(self.0.elapsed().as_secs_f64())
    }

    fn wait_until(&self, moment: Moment) {
        let seconds = moment.0 - self.now().0;
        // A wait of years is a mistake; a day is more than the daemon ever waits.
        if seconds > 0.0 {
            std::thread::sleep(Duration::from_secs_f64(seconds.min(86_400.0)));
        }
    }
}

/// Seconds since this was first asked.
pub(super) fn seconds() -> f64 {
    static BEGUN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed().as_secs_f64()
}
