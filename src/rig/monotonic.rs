//! `CLOCK_MONOTONIC`, the clock of flip events and camera frames.

use rustix::time::ClockId;
#[cfg(feature = "hardware")]
use rustix::{
    event::{PollFd, PollFlags, poll},
    io::Errno,
    time::Timespec,
};

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

/// Waits until `file` can be read or has failed, at most until `deadline`; returns what happened.
#[cfg(feature = "hardware")]
pub(super) fn ready_by(
    file: &impl std::os::fd::AsFd,
    deadline: Moment,
) -> std::io::Result<PollFlags> {
    loop {
        let remaining_s = (deadline.0 - Monotonic.now().0).clamp(0.0, 3600.0);
        let (tv_sec, tv_nsec) = (remaining_s as i64, (remaining_s.fract() * 1e9) as i64);
        let mut waiting = [PollFd::new(file, PollFlags::IN)];
        match poll(&mut waiting, Some(&Timespec { tv_sec, tv_nsec })) {
            Err(Errno::INTR) => {}
            outcome => return Ok(outcome.map(|_| waiting[0].revents())?),
        }
    }
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
    fn a_deadline_that_has_passed_is_not_waited_for() {
        let (quiet, _other) = std::os::unix::net::UnixStream::pair().unwrap();
        let passed = Moment(Monotonic.now().0 - 1.0);
        assert!(ready_by(&quiet, passed).unwrap().is_empty());
    }
}
