//! Trust in the calendar. A board without a battery clock boots in the past: at the time of its
//! image or of the last power failure.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::config::ClockSource;

/// Seconds since 1970 UTC; 0 for earlier times.
pub fn unix_s(time: SystemTime) -> f64 {
    time.duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// Seconds by which a battery clock may be set back.
const SET_BACK_S: f64 = 60.0;

/// Reason to distrust a clock that nothing has set since the box was switched on.
const NOT_SET: &str = "no network has set the clock yet";

/// Reason to distrust a time before the latest trusted one.
const PAST: &str = "the clock shows an earlier time than before: set it; if the time is correct \
                    now, let the network set it";

/// Judges whether the calendar can be trusted.
#[derive(Debug, Clone)]
pub struct Calendar {
    source: ClockSource,
    /// Latest trusted time, seconds since 1970 UTC.
    pub(crate) floor_unix_s: f64,
}

impl Calendar {
    /// A calendar set by `source`, trusted last at `floor_unix_s`.
    pub fn new(source: ClockSource, floor_unix_s: f64) -> Calendar {
        Calendar { source, floor_unix_s }
    }

    /// Judges `unix_s`; `set` is whether the kernel reports its clock as synchronised.
    ///
    /// # Errors
    /// The reason to distrust it.
    pub fn judge(&mut self, unix_s: f64, set: bool) -> Result<(), &'static str> {
        self.floor_unix_s = match self.source {
            // Trusted even when the network sets it back: then the floor was wrong.
            _ if set => unix_s,
            ClockSource::Network => return Err(NOT_SET),
            ClockSource::Battery if unix_s + SET_BACK_S < self.floor_unix_s => return Err(PAST),
            ClockSource::Battery => self.floor_unix_s.max(unix_s),
        };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_battery_only_a_set_clock_is_trusted() {
        let mut calendar = Calendar::new(ClockSource::Network, 1000.0);
        assert_eq!(calendar.judge(500.0, false), Err(NOT_SET));
        assert_eq!(calendar.judge(5000.0, false), Err(NOT_SET));
        assert_eq!(calendar.judge(9000.0, true), Ok(()));
        assert_eq!(calendar.judge(9001.0, true), Ok(()));
        assert_eq!(calendar.floor_unix_s, 9001.0);
    }

    #[test]
    fn with_a_battery_time_does_not_go_back_after_a_reboot() {
        let mut calendar = Calendar::new(ClockSource::Battery, 1e6);
        assert_eq!(calendar.judge(10.0, false), Err(PAST));
        assert_eq!(calendar.judge(1e6 + 5.0, false), Ok(()));
        assert_eq!(calendar.judge(1e6 - 90_000.0, false), Err(PAST));
        assert_eq!(calendar.judge(1e6 + 366.0 * 86_400.0, false), Ok(()));
        assert_eq!(calendar.judge(1e6, false), Err(PAST));
        assert_eq!(calendar.judge(1e6, true), Ok(()), "the network has set it");
        assert_eq!(calendar.judge(1e6, false), Ok(()));
    }
}
