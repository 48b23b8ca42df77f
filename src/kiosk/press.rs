//! Presses of the button: short, long, or held while the box starts.

use crate::rig::Moment;

/// Time for which a level must hold to be valid: longer than contacts bounce. Guess.
const DEBOUNCE_S: f64 = 0.03;
/// Duration of a long press, which cancels a job, starts a calibration in maintenance, and starts
/// maintenance when the box is switched on. Guess.
const LONG_PRESS_S: f64 = 1.5;

/// Event of a press.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Press {
    /// The button went down; reported after the debounce time.
    Down,
    /// The button was released before the press became a long one.
    Short,
    /// The button has been held for a long press; reported while it is still down.
    Long,
    /// The button was down when the box started.
    HeldAtStart,
}

/// Converts timed levels to presses. A level is valid once it has held for the debounce time.
#[derive(Debug, Clone)]
pub struct Presses {
    /// Level last read, and the time since which it has held.
    level: (bool, Moment),
    is_pressed: bool,
    down_since: Moment,
    is_reported: bool,
    /// End of the time in which a press counts as held at the start.
    starting_until: Moment,
}

impl Presses {
    /// State of a released button, first read at `now`.
    pub fn new(now: Moment) -> Presses {
        Presses {
            level: (false, now),
            is_pressed: false,
            down_since: now,
            is_reported: false,
            // Half a debounce time longer than necessary, in case the first reading is late.
            starting_until: Moment(now.0 + 1.5 * DEBOUNCE_S),
        }
    }

    /// Processes the level read at `now`; returns the event that it causes, if any.
    pub fn read(&mut self, level: bool, now: Moment) -> Option<Press> {
        if level != self.level.0 {
            self.level = (level, now);
        }
        if level != self.is_pressed && now.0 - self.level.1.0 >= DEBOUNCE_S {
            self.is_pressed = level;
            if !level {
                return (!self.is_reported).then_some(Press::Short);
            }
            self.down_since = now;
            // A press held at the start is not reported as a long one as well.
            self.is_reported = now.0 <= self.starting_until.0;
            return Some(if self.is_reported { Press::HeldAtStart } else { Press::Down });
        }
        let is_long = self.is_pressed && level && now.0 - self.down_since.0 >= LONG_PRESS_S;
        (is_long && !std::mem::replace(&mut self.is_reported, true)).then_some(Press::Long)
    }

    /// Time in seconds at which the level must be read again even without an edge.
    pub fn look_again_at(&self) -> f64 {
        if self.level.0 != self.is_pressed {
            self.level.1.0 + DEBOUNCE_S
        } else if self.is_pressed && !self.is_reported {
            self.down_since.0 + LONG_PRESS_S
        } else {
            f64::INFINITY
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Presses read from `levels`, one level per millisecond.
    fn presses(levels: impl IntoIterator<Item = bool>) -> Vec<(usize, Press)> {
        let mut presses = Presses::new(Moment(0.0));
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
        assert_eq!(read, [(130, Press::Down), (330, Press::Short)]);
    }

    #[test]
    fn a_long_press_is_reported_once_while_it_lasts() {
        let read = presses(levels(&[(false, 100), (true, 3000), (false, 100)]));
        assert_eq!(read, [(130, Press::Down), (1630, Press::Long)]);
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
        assert_eq!(presses(levels(&[(true, 3000), (false, 50)])), [(30, Press::HeldAtStart)]);
        let later = presses(levels(&[(false, 20), (true, 100), (false, 50)]));
        assert_eq!(later[0], (50, Press::Down));
    }

    #[test]
    fn a_lost_release_edge_does_not_repeat_the_press() {
        // The level is polled; edges do not matter.
        let read =
            presses(levels(&[(false, 50), (true, 100), (false, 40), (true, 100), (false, 40)]));
        assert_eq!(read.iter().filter(|p| p.1 == Press::Down).count(), 2, "{read:?}");
    }

    #[test]
    fn a_bouncing_press_counts_once_and_a_spike_not() {
        let mut bouncing = levels(&[(false, 60)]);
        bouncing.extend((0..15).map(|ms| ms % 3 != 1));
        bouncing.extend(levels(&[(true, 60)]));
        bouncing.extend((0..15).map(|ms| ms % 3 != 1));
        bouncing.extend(levels(&[(false, 60), (true, 10), (false, 60)]));
        let read: Vec<Press> = presses(bouncing).into_iter().map(|p| p.1).collect();
        assert_eq!(read, [Press::Down, Press::Short]);
    }

    #[test]
    fn an_unsteady_level_is_read_again_after_the_debounce_time() {
        let mut presses = Presses::new(Moment(0.0));
        assert!(presses.look_again_at().is_infinite());
        presses.read(true, Moment(0.5));
        assert!((presses.look_again_at() - 0.53).abs() < 1e-9);
    }
}
