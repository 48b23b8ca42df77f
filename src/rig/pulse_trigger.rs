//! Camera triggers: a pulse on an output line, or none for a free-running camera.

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;

use super::{Clock, Moment, RigError, Trigger};

/// Pulses on a line. Generic over embedded-hal, for tests without a board.
pub struct PulseTrigger<P, D, C> {
    pin: P,
    delay: D,
    clock: C,
    pulse_us: u32,
}

impl<P: OutputPin, D: DelayNs, C: Clock> PulseTrigger<P, D, C> {
    /// A trigger; its line is set low.
    ///
    /// # Errors
    /// When the line cannot be driven.
    pub fn new(mut pin: P, delay: D, clock: C, pulse_us: u32) -> Result<Self, RigError> {
        pin.set_low().map_err(|cause| stuck(&cause))?;
        Ok(PulseTrigger { pin, delay, clock, pulse_us })
    }
}

fn stuck(cause: &impl std::fmt::Debug) -> RigError {
    RigError::Gone { device: "trigger", what: format!("its line cannot be driven ({cause:?})") }
}

impl<P: OutputPin, D: DelayNs, C: Clock> Trigger for PulseTrigger<P, D, C> {
    /// Returns the moment before the edge, which precedes the exposure.
    fn fire(&mut self) -> Result<Moment, RigError> {
        let at = self.clock.now();
        self.pin.set_high().map_err(|cause| stuck(&cause))?;
        self.delay.delay_us(self.pulse_us);
        // A pulse that does not end leaves the shutter open.
        self.pin.set_low().map_err(|cause| stuck(&cause))?;
        Ok(at)
    }
}

/// No trigger: any later frame of a free-running camera qualifies.
pub struct FreeRunning<C>(pub C);

impl<C: Clock> Trigger for FreeRunning<C> {
    fn fire(&mut self) -> Result<Moment, RigError> {
        Ok(self.0.now())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_hal::digital::{ErrorKind, ErrorType};
    use std::cell::RefCell;
    use std::rc::Rc;

    type Log = Rc<RefCell<Vec<String>>>;

    struct Pin {
        log: Log,
        fails: bool,
    }

    #[derive(Debug)]
    struct Broken;

    impl embedded_hal::digital::Error for Broken {
        fn kind(&self) -> ErrorKind {
            ErrorKind::Other
        }
    }

    impl ErrorType for Pin {
        type Error = Broken;
    }

    impl OutputPin for Pin {
        fn set_low(&mut self) -> Result<(), Broken> {
            self.log.borrow_mut().push("low".to_owned());
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Broken> {
            self.log.borrow_mut().push("high".to_owned());
            if self.fails { Err(Broken) } else { Ok(()) }
        }
    }

    struct Wait(Log);

    impl DelayNs for Wait {
        fn delay_ns(&mut self, ns: u32) {
            self.0.borrow_mut().push(format!("{ns} ns"));
        }
    }

    struct Still(Log);

    impl Clock for Still {
        fn now(&self) -> Moment {
            self.0.borrow_mut().push("clock".to_owned());
            Moment(7.0)
        }

        fn wait_until(&self, _: Moment) {}
    }

    fn trigger(fails: bool) -> (PulseTrigger<Pin, Wait, Still>, Log) {
        let log = Log::default();
        let pin = Pin { log: log.clone(), fails };
        (PulseTrigger::new(pin, Wait(log.clone()), Still(log.clone()), 1).unwrap(), log)
    }

    #[test]
    fn a_pulse_is_stamped_before_its_edge_and_ended() {
        let (mut trigger, log) = trigger(false);
        assert_eq!(trigger.fire().unwrap(), Moment(7.0));
        assert_eq!(*log.borrow(), ["low", "clock", "high", "1000 ns", "low"]);
    }

    #[test]
    fn a_line_that_cannot_be_driven_is_an_error() {
        let (mut trigger, _) = trigger(true);
        assert!(matches!(trigger.fire(), Err(RigError::Gone { device: "trigger", .. })));
    }
}
