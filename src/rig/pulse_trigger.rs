//! Camera triggers: a pulse on an output line, or none for a free-running camera.

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::OutputPin;

use super::{Clock, Moment, RigError, Trigger};

/// Last part of a pulse, timed by polling the clock, since a sleep overruns by 0.1 ms and more.
/// Guess.
const SPUN_US: u32 = 2000;
/// Maximum relative excess of an exposing pulse: a tenth of the pilot's limit of brightness drift.
const EXCESS_MAX: f64 = 0.003;
/// Minimum tolerance of that excess: the time of the two calls that drive the line. Guess.
const CALLS_S: f64 = 20e-6;

/// Pulses on a line. Generic over embedded-hal, for tests without a board.
pub struct PulseTrigger<P, D, C> {
    pin: P,
    delay: D,
    clock: C,
    pulse_s: f64,
    /// Exposure as a multiple of `pulse_s`; `None` if a pulse only starts the exposure.
    exposure_times: Option<f64>,
}

impl<P: OutputPin, D: DelayNs, C: Clock> PulseTrigger<P, D, C> {
    /// Creates a trigger whose pulses start exposures, and sets its line low.
    pub fn new(mut pin: P, delay: D, clock: C, pulse_us: u32) -> Result<Self, RigError> {
        pin.set_low().map_err(|cause| stuck(&cause))?;
        let pulse_s = f64::from(pulse_us) * 1e-6;
        Ok(PulseTrigger { pin, delay, clock, pulse_s, exposure_times: None })
    }

    /// Makes the pulses last as long as the exposure.
    pub fn exposing(self) -> Self {
        PulseTrigger { exposure_times: Some(1.0), ..self }
    }
}

fn stuck(cause: &impl std::fmt::Debug) -> RigError {
    RigError::gone("trigger", format!("its line cannot be driven ({cause:?})"))
}

impl<P: OutputPin, D: DelayNs, C: Clock> Trigger for PulseTrigger<P, D, C> {
    /// Returns the moment before the edge, which precedes the exposure.
    fn fire(&mut self) -> Result<Moment, RigError> {
        let wanted_s = self.pulse_s * self.exposure_times.unwrap_or(1.0);
        let at = self.clock.now();
        self.pin.set_high().map_err(|cause| stuck(&cause))?;
        let lit = self.clock.now();
        self.delay.delay_us(((wanted_s * 1e6) as u32).saturating_sub(SPUN_US));
        while self.clock.now().0 - lit.0 < wanted_s {
            std::hint::spin_loop();
        }
        // A pulse that did not end would leave the shutter open.
        self.pin.set_low().map_err(|cause| stuck(&cause))?;
        let found_s = self.clock.now().0 - at.0;
        let is_exposure = self.exposure_times.is_some();
        if is_exposure && found_s - wanted_s > CALLS_S.max(EXCESS_MAX * wanted_s) {
            let (found_ms, wanted_ms) = (found_s * 1e3, wanted_s * 1e3);
            return Err(RigError::PulseLength { found_ms, wanted_ms });
        }
        Ok(at)
    }

    fn expose_times(&mut self, times: f64) {
        self.exposure_times = self.exposure_times.map(|_| times);
    }
}

/// No trigger: any frame that a free-running camera exposes later qualifies.
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
    use std::cell::{Cell, RefCell};
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

    /// A board whose sleeps overrun.
    #[derive(Clone)]
    struct LateBoard {
        log: Log,
        now_s: Rc<Cell<f64>>,
        overrun_s: f64,
    }

    impl DelayNs for LateBoard {
        fn delay_ns(&mut self, ns: u32) {
            self.log.borrow_mut().push(format!("{ns} ns"));
            self.now_s.set(self.now_s.get() + f64::from(ns) * 1e-9 + self.overrun_s);
        }
    }

    impl Clock for LateBoard {
        /// The current time; a reading takes two microseconds.
        fn now(&self) -> Moment {
            self.now_s.set(self.now_s.get() + 2e-6);
            Moment(self.now_s.get())
        }

        fn wait_until(&self, _: Moment) {}
    }

    fn trigger(
        fails: bool,
        pulse_us: u32,
        overrun_s: f64,
    ) -> (PulseTrigger<Pin, LateBoard, LateBoard>, LateBoard) {
        let board = LateBoard { log: Log::default(), now_s: Rc::new(Cell::new(7.0)), overrun_s };
        let pin = Pin { log: board.log.clone(), fails };
        (PulseTrigger::new(pin, board.clone(), board.clone(), pulse_us).unwrap(), board)
    }

    #[test]
    fn a_pulse_is_stamped_before_its_edge_and_ended() {
        let (mut trigger, board) = trigger(false, 1000, 0.0);
        assert_eq!(trigger.fire().unwrap(), Moment(7.000_002));
        assert_eq!(*board.log.borrow(), ["low", "high", "0 ns", "low"]);
        let took_s = board.now_s.get() - 7.0;
        assert!((0.001..0.00102).contains(&took_s), "{took_s}");
    }

    #[test]
    fn an_exposure_is_as_long_as_its_pulse_or_an_error() {
        // Most of the pulse is spent asleep; an overrun shorter than the rest does no harm.
        for (overrun_s, fits) in [(0.0, true), (0.0019, true), (0.003, false)] {
            let (start, _) = trigger(false, 50_000, overrun_s);
            let mut exposing = start.exposing();
            match exposing.fire() {
                Ok(_) => assert!(fits, "{overrun_s}"),
                Err(RigError::PulseLength { found_ms, wanted_ms }) => {
                    assert!(!fits && (found_ms - 51.0).abs() < 0.1, "{found_ms} {overrun_s}");
                    assert!((wanted_ms - 50.0).abs() < 1e-6, "{wanted_ms}");
                }
                Err(other) => panic!("{other}"),
            }
            // A pulse that only starts the exposure may be longer.
            let (mut start, _) = trigger(false, 50_000, overrun_s);
            assert!(start.fire().is_ok());
        }
    }

    #[test]
    fn an_exposing_pulse_follows_the_exposure_and_another_does_not() {
        for (exposes, length_s) in [(true, 0.015), (false, 0.005)] {
            let (start, board) = trigger(false, 5000, 0.0);
            let mut trigger = if exposes { start.exposing() } else { start };
            trigger.expose_times(3.0);
            let before_s = board.now_s.get();
            trigger.fire().unwrap();
            assert!((board.now_s.get() - before_s - length_s).abs() < 2e-5);
        }
    }

    #[test]
    fn a_line_that_cannot_be_driven_is_an_error() {
        let (mut trigger, _) = trigger(true, 1, 0.0);
        assert!(matches!(trigger.fire(), Err(RigError::Gone { device: "trigger", .. })));
    }
}
