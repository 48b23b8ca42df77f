//! Whether the calendar may be believed. A board without a battery clock wakes up in the past: at
//! the time its image was made, or where it was when the power failed.

use crate::config::ClockSource;

/// Jumps of the calendar against the monotonic clock that are worth a line in the log.
const JUMP_S: f64 = 60.0;

/// The calendar, judged.
#[derive(Debug, Clone)]
pub struct Calendar {
    source: ClockSource,
    /// The latest believed time, seconds since 1970 UTC: time does not go back before it.
    floor_unix_s: f64,
    /// The last look: monotonic, calendar.
    last: Option<(f64, f64)>,
}

/// A look at the calendar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Belief {
    /// This time may be gone by.
    Believed {
        /// Seconds the calendar has jumped since the last look, if it has.
        jumped_s: Option<f64>,
    },
    /// Nobody has set the clock since the box was switched on.
    NotSet,
    /// It is before a time that already was.
    Before {
        /// That time, seconds since 1970 UTC.
        floor_unix_s: f64,
    },
}

impl Calendar {
    /// A calendar that is believed for `source`; times before `floor_unix_s` have already been.
    pub fn new(source: ClockSource, floor_unix_s: f64) -> Calendar {
        Calendar { source, floor_unix_s, last: None }
    }

    /// The latest believed time.
    pub fn floor_unix_s(&self) -> f64 {
        self.floor_unix_s
    }

    /// Judges `unix_s`, read at the monotonic time `now_s`; `set` is whether the kernel calls its
    /// clock synchronised.
    pub fn look(&mut self, unix_s: f64, now_s: f64, set: bool) -> Belief {
        let jumped_s = self.last.map(|(then_s, then_unix)| (unix_s - then_unix) - (now_s - then_s));
        self.last = Some((now_s, unix_s));
        let jumped_s = jumped_s.filter(|jump| jump.abs() > JUMP_S);
        match self.source {
            // Set by the network: believed even when that takes it back, for then the floor was
            // wrong.
            ClockSource::Network if set => {}
            ClockSource::Network => return Belief::NotSet,
            ClockSource::Battery if unix_s + JUMP_S < self.floor_unix_s => {
                return Belief::Before { floor_unix_s: self.floor_unix_s };
            }
            ClockSource::Battery => {}
        }
        self.floor_unix_s = match self.source {
            ClockSource::Network => unix_s,
            ClockSource::Battery => self.floor_unix_s.max(unix_s),
        };
        Belief::Believed { jumped_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_battery_only_a_set_clock_is_believed() {
        let mut calendar = Calendar::new(ClockSource::Network, 1000.0);
        assert_eq!(calendar.look(500.0, 0.0, false), Belief::NotSet);
        assert_eq!(calendar.look(5000.0, 1.0, false), Belief::NotSet);
        assert_eq!(calendar.look(9000.0, 2.0, true), Belief::Believed { jumped_s: Some(3999.0) });
        assert_eq!(calendar.look(9001.0, 3.0, true), Belief::Believed { jumped_s: None });
        assert_eq!(calendar.floor_unix_s(), 9001.0);
    }

    #[test]
    fn with_a_battery_time_does_not_go_back_over_a_reboot() {
        let mut calendar = Calendar::new(ClockSource::Battery, 1e6);
        assert_eq!(calendar.look(10.0, 0.0, false), Belief::Before { floor_unix_s: 1e6 });
        assert_eq!(
            calendar.look(1e6 + 5.0, 1.0, false),
            Belief::Believed { jumped_s: Some(1e6 - 6.0) }
        );
        assert_eq!(
            calendar.look(1e6 - 90_000.0, 2.0, false),
            Belief::Before { floor_unix_s: 1e6 + 5.0 }
        );
    }

    #[test]
    fn a_day_forward_and_back_are_told_as_jumps() {
        let mut calendar = Calendar::new(ClockSource::Network, 0.0);
        calendar.look(1e6, 0.0, true);
        let day = 86_400.0;
        assert_eq!(calendar.look(1e6 + day, 0.0, true), Belief::Believed { jumped_s: Some(day) });
        assert_eq!(calendar.look(1e6, 0.0, true), Belief::Believed { jumped_s: Some(-day) });
    }
}
