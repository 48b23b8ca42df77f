//! Presses of the button: short, long, or held while the box starts.

use crate::rig::Moment;
use crate::rig::button::Debounce;

/// Time that a level must hold: longer than contacts bounce, ms. Guess.
pub const DEBOUNCE_MS: f64 = 30.0;
/// Duration of a long press, which cancels a job, starts a calibration in maintenance, and starts
/// maintenance when the box is switched on, ms. Guess.
pub const LONG_PRESS_MS: f64 = 1500.0;

/// A press.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Press {
    /// The button went down; reported after the debounce time.
    Down,
    /// It was released before a long press.
    Short,
    /// It is held for a long press; reported while it is down.
    Long,
    /// It was down when the box started.
    HeldAtStart,
}

/// Converts levels to presses.
#[derive(Debug, Clone)]
pub struct Presses {
    debounce: Debounce,
    long_s: f64,
    down_since: Option<Moment>,
    is_reported: bool,
    /// Until when a press counts as held at the start.
    starting_until: Moment,
}

impl Presses {
    /// A button first read at `now`. A level counts after `debounce_ms`, a press is long after
    /// `long_ms`.
    pub fn new(debounce_ms: f64, long_ms: f64, now: Moment) -> Presses {
        Presses {
            debounce: Debounce::new(debounce_ms, now),
            long_s: long_ms / 1e3,
            down_since: None,
            is_reported: false,
            // Half a debounce time of grace for the first reading.
            starting_until: Moment(now.0 + 1.5 * debounce_ms / 1e3),
        }
    }

    /// Processes the level read at `now`.
    pub fn read(&mut self, level: bool, now: Moment) -> Option<Press> {
        if self.debounce.read(level, now) {
            self.down_since = Some(now);
            let at_start = now.0 <= self.starting_until.0;
            // Held at the start, the press is not a long one as well.
            self.is_reported = at_start;
            return Some(if at_start { Press::HeldAtStart } else { Press::Down });
        }
        let since = self.down_since?;
        if !self.debounce.is_pressed() {
            self.down_since = None;
            return (!self.is_reported).then_some(Press::Short);
        }
        if level && !self.is_reported && now.0 - since.0 >= self.long_s {
            self.is_reported = true;
            return Some(Press::Long);
        }
        None
    }

    /// When to read the level again without an edge.
    pub fn look_again_at(&self) -> Option<Moment> {
        let long = self
            .down_since
            .filter(|_| !self.is_reported)
            .map(|since| Moment(since.0 + self.long_s));
        match (self.debounce.next_reading_at(), long) {
            (Some(a), Some(b)) => Some(if a <= b { a } else { b }),
            (a, b) => a.or(b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Presses read from `levels`, one a millisecond: 20 ms of debounce, long after 500 ms.
    fn presses(levels: impl IntoIterator<Item = bool>) -> Vec<(usize, Press)> {
        let mut presses = Presses::new(20.0, 500.0, Moment(0.0));
        let each = levels.into_iter().enumerate();
        // Slightly late, so that rounding does not affect the debounce time.
        each.filter_map(|(ms, level)| {
            Some((ms, presses.read(level, Moment(ms as f64 * 1.000_001e-3))?))
        })
        .collect()
    }

    fn levels(parts: &[(bool, usize)]) -> Vec<bool> {
        parts.iter().flat_map(|&(level, ms)| std::iter::repeat_n(level, ms)).collect()
    }

    #[test]
    fn a_short_press_is_reported_once() {
        let read = presses(levels(&[(false, 100), (true, 200), (false, 100)]));
        assert_eq!(read, [(120, Press::Down), (320, Press::Short)]);
    }

    #[test]
    fn a_long_press_is_reported_once_while_it_lasts() {
        let read = presses(levels(&[(false, 100), (true, 3000), (false, 100)]));
        assert_eq!(read, [(120, Press::Down), (620, Press::Long)]);
    }

    #[test]
    fn a_press_that_bounces_at_its_end_is_one_short_press() {
        let mut bouncing = levels(&[(false, 100), (true, 300)]);
        bouncing.extend((0..200).map(|ms| ms % 5 < 2));
        bouncing.extend(levels(&[(false, 600)]));
        let read: Vec<Press> = presses(bouncing).into_iter().map(|p| p.1).collect();
        assert_eq!(read, [Press::Down, Press::Short]);
    }

    #[test]
    fn a_press_held_at_the_start_is_never_long() {
        assert_eq!(presses(levels(&[(true, 3000), (false, 50)])), [(20, Press::HeldAtStart)]);
        let later = presses(levels(&[(false, 15), (true, 100), (false, 50)]));
        assert_eq!(later[0], (35, Press::Down));
    }

    #[test]
    fn a_lost_release_edge_does_not_repeat_the_press() {
        // The level is polled; edges do not matter.
        let read =
            presses(levels(&[(false, 50), (true, 100), (false, 30), (true, 100), (false, 30)]));
        assert_eq!(read.iter().filter(|p| p.1 == Press::Down).count(), 2, "{read:?}");
    }
}
