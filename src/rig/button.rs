//! Button with debouncing.
//!
//! Contacts bounce and kernels drop edges, so an edge only triggers a reading of the level. A press
//! counts once the level has been "on" for the debounce time; the next one requires an "off" as
//! long.

use super::Moment;

/// Debouncing of timed levels.
#[derive(Debug, Clone)]
pub struct Debounce {
    debounce_s: f64,
    pressed: bool,
    /// Level last read, and the start of it.
    level: bool,
    since: Moment,
}

impl Debounce {
    /// A released button at `now`; levels must hold for `debounce_ms`.
    pub fn new(debounce_ms: f64, now: Moment) -> Self {
        Debounce { debounce_s: debounce_ms / 1e3, pressed: false, level: false, since: now }
    }

    /// Processes the level read at `now`; returns true once per press.
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

    /// Whether the button is pressed.
    pub fn is_pressed(&self) -> bool {
        self.pressed
    }

    /// Time of the next reading without an edge; `None` while the level is steady.
    pub fn next_reading_at(&self) -> Option<Moment> {
        (self.level != self.pressed).then_some(Moment(self.since.0 + self.debounce_s))
    }
}

#[cfg(feature = "hardware")]
mod line {
    use std::time::Duration;

    use gpiocdev::line::{Bias, EdgeDetection, Value};

    use crate::config::{GpioLine, Level};
    use crate::rig::gpio_line::{CONSUMER, find};
    use crate::rig::monotonic::Monotonic;
    use crate::rig::{ButtonLevel, Clock, Moment, RigError};

    /// Edge events per reading: the kernel queues 16 per line.
    const EVENTS: usize = 16;

    /// A button on a GPIO line.
    pub struct Button {
        request: gpiocdev::Request,
        offset: u32,
    }

    fn failed(doing: &'static str) -> impl Fn(gpiocdev::Error) -> RigError {
        move |cause| RigError::Failed {
            device: "button",
            doing,
            source: std::io::Error::other(cause),
        }
    }

    impl Button {
        /// Requests the line with its pull resistor towards "off".
        ///
        /// # Errors
        /// When there is no such line, or another program uses it.
        pub fn open(name: &GpioLine) -> Result<Self, RigError> {
            let place = find("button", name)?;
            let mut builder = gpiocdev::Request::builder();
            builder.on_chip(&place.node).with_consumer(CONSUMER).with_line(place.offset);
            builder.with_edge_detection(EdgeDetection::BothEdges);
            if name.active == Level::Low {
                builder.as_active_low().with_bias(Bias::PullUp);
            } else {
                builder.with_bias(Bias::PullDown);
            }
            let request = builder.request().map_err(failed("take its line"))?;
            Ok(Button { request, offset: place.offset })
        }
    }

    impl ButtonLevel for Button {
        fn level_by(&mut self, deadline: Moment) -> Result<bool, RigError> {
            let remaining_s = (deadline.0 - Monotonic.now().0).clamp(0.0, 3600.0);
            let waited = self.request.wait_edge_event(Duration::from_secs_f64(remaining_s));
            if waited.map_err(failed("wait for its edges"))? {
                let mut events = self.request.new_edge_event_buffer(EVENTS);
                events.read_event().map_err(failed("read its edges"))?;
            }
            let level = self.request.value(self.offset).map_err(failed("read its level"))?;
            Ok(level == Value::Active)
        }
    }
}

#[cfg(feature = "hardware")]
pub use line::Button;

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
    fn an_unsteady_level_is_read_again_after_the_debounce_time() {
        let mut debounce = Debounce::new(20.0, Moment(0.0));
        assert_eq!(debounce.next_reading_at(), None);
        debounce.read(true, Moment(0.5));
        assert_eq!(debounce.next_reading_at(), Some(Moment(0.52)));
    }
}
