//! The button: edges only wake, the level read afterwards decides.
//!
//! Contacts bounce and kernels drop edges, so an edge is a hint to look. A press counts when the
//! level has been "on" at two readings a debounce time apart, and the next one only after an "off"
//! as steady.

use super::Moment;

/// The debouncing itself, fed with levels and the time.
#[derive(Debug, Clone)]
pub struct Debounce {
    debounce_s: f64,
    pressed: bool,
    /// The level last read and since when it has been so.
    level: bool,
    since: Moment,
}

impl Debounce {
    /// A button at rest at `now`; a level must hold `debounce_ms` to count.
    pub fn new(debounce_ms: f64, now: Moment) -> Self {
        Debounce { debounce_s: debounce_ms / 1e3, pressed: false, level: false, since: now }
    }

    /// Takes the level read at `now`; true exactly once for every press.
    pub fn read(&mut self, level: bool, now: Moment) -> bool {
        if level != self.level {
            (self.level, self.since) = (level, now);
        }
        let steady = now.0 - self.since.0 >= self.debounce_s;
        if steady && self.pressed != self.level {
            self.pressed = self.level;
            return self.pressed;
        }
        false
    }

    /// Whether the button is down, as far as steady levels tell.
    pub fn is_pressed(&self) -> bool {
        self.pressed
    }

    /// When the level should be read again though no edge came; `None` while nothing is open.
    pub fn look_again_at(&self) -> Option<Moment> {
        (self.level != self.pressed).then_some(Moment(self.since.0 + self.debounce_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Presses counted while reading `levels`, one a millisecond, with 20 ms of debounce.
    fn presses(levels: impl IntoIterator<Item = bool>) -> usize {
        let mut debounce = Debounce::new(20.0, Moment(0.0));
        let read = |(ms, level)| debounce.read(level, Moment(ms as f64 / 1e3));
        levels.into_iter().enumerate().map(read).filter(|&pressed| pressed).count()
    }

    #[test]
    fn a_bouncing_press_counts_once() {
        let bounce = (0..15).map(|ms| ms % 3 != 1);
        let levels = bounce.clone().chain([true; 60]).chain(bounce).chain([false; 60]);
        assert_eq!(presses(levels), 1);
    }

    #[test]
    fn a_spike_is_no_press() {
        assert_eq!(presses([[false; 30].as_slice(), &[true; 10], &[false; 60]].concat()), 0);
    }

    #[test]
    fn a_press_whose_release_edge_was_lost_does_not_repeat() {
        assert_eq!(presses([true; 500]), 1);
    }

    #[test]
    fn two_presses_are_two() {
        let one = [[true; 40].as_slice(), &[false; 40]].concat();
        assert_eq!(presses(one.repeat(2)), 2);
    }

    #[test]
    fn an_open_question_names_the_time_to_look_again() {
        let mut debounce = Debounce::new(20.0, Moment(0.0));
        assert_eq!(debounce.look_again_at(), None);
        debounce.read(true, Moment(0.5));
        assert_eq!(debounce.look_again_at(), Some(Moment(0.52)));
    }
}
