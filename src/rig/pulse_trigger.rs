//! Camera triggers: a pulse on an output line, or none for a free-running camera.

use std::io;

use super::{Clock, Moment, RigError, Trigger};

/// End of a pulse that is awaited by reading the clock, since a sleep overruns by 0.1 ms and more.
/// Guess.
const SPUN_S: f64 = 0.002;
/// Most that an exposure by pulse may be too long, relative: a tenth of a night's limit of drift.
const EXCESS_MAX: f64 = 0.003;
/// Time of the two calls that drive the line, not counted as excess. Guess.
const CALLS_S: f64 = 20e-6;

/// Pulses on a line, which the function `set` switches.
pub struct PulseTrigger<S, C> {
    set: S,
    clock: C,
    pulse_s: f64,
    /// Exposure as a multiple of the pulse's; `None` where a pulse only starts it.
    exposure_times: Option<f64>,
}

impl<S: FnMut(bool) -> io::Result<()>, C: Clock> PulseTrigger<S, C> {
    /// A trigger whose pulses start exposures, or if `exposing` last as long; its line is switched
    /// off.
    pub fn new(mut set: S, clock: C, pulse_us: u32, exposing: bool) -> Result<Self, RigError> {
        set(false).map_err(stuck)?;
        let (pulse_s, exposure_times) = (f64::from(pulse_us) * 1e-6, exposing.then_some(1.0));
        Ok(PulseTrigger { set, clock, pulse_s, exposure_times })
    }
}

fn stuck(cause: io::Error) -> RigError {
    RigError::gone("trigger", format!("its line cannot be driven ({cause})"))
}

impl<S: FnMut(bool) -> io::Result<()>, C: Clock> Trigger for PulseTrigger<S, C> {
    /// Returns the moment before the edge, which precedes the exposure.
    fn fire(&mut self) -> Result<Moment, RigError> {
        let wanted_s = self.pulse_s * self.exposure_times.unwrap_or(1.0);
        let at = self.clock.now();
        (self.set)(true).map_err(stuck)?;
        let lit = self.clock.now();
        self.clock.wait_until(Moment(lit.0 + wanted_s - SPUN_S));
        while self.clock.now().0 - lit.0 < wanted_s {
            std::hint::spin_loop();
        }
        // A pulse that does not end leaves the shutter open.
        (self.set)(false).map_err(stuck)?;
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
    use std::cell::{Cell, RefCell};
    use std::rc::Rc;

    type Log = Rc<RefCell<Vec<String>>>;

    /// A board whose sleeps overrun.
    #[derive(Clone)]
    struct LateBoard {
        log: Log,
        now_s: Rc<Cell<f64>>,
        overrun_s: f64,
    }

    impl Clock for LateBoard {
        /// A reading takes two microseconds.
        fn now(&self) -> Moment {
            self.now_s.set(self.now_s.get() + 2e-6);
            Moment(self.now_s.get())
        }

        fn wait_until(&self, moment: Moment) {
            if moment.0 > self.now_s.get() {
                self.log.borrow_mut().push("sleep".to_owned());
                self.now_s.set(moment.0 + self.overrun_s);
            }
        }
    }

    type Set = Box<dyn FnMut(bool) -> io::Result<()>>;

    struct Given {
        fails: bool,
        pulse_us: u32,
        overrun_s: f64,
        exposing: bool,
    }

    const GIVEN: Given = Given { fails: false, pulse_us: 50_000, overrun_s: 0.0, exposing: false };

    fn trigger(given: Given) -> (PulseTrigger<Set, LateBoard>, LateBoard) {
        let Given { fails, pulse_us, overrun_s, exposing } = given;
        let board = LateBoard { log: Log::default(), now_s: Rc::new(Cell::new(7.0)), overrun_s };
        let log = board.log.clone();
        let set: Set = Box::new(move |on| {
            log.borrow_mut().push(if on { "high" } else { "low" }.to_owned());
            if on && fails { Err(io::ErrorKind::Other.into()) } else { Ok(()) }
        });
        (PulseTrigger::new(set, board.clone(), pulse_us, exposing).unwrap(), board)
    }

    #[test]
    fn a_pulse_is_stamped_before_its_edge_and_ended() {
        let (mut trigger, board) = trigger(Given { pulse_us: 1000, ..GIVEN });
        assert_eq!(trigger.fire().unwrap(), Moment(7.000_002));
        assert_eq!(*board.log.borrow(), ["low", "high", "low"]);
        let took_s = board.now_s.get() - 7.0;
        assert!((0.001..0.00102).contains(&took_s), "{took_s}");
    }

    #[test]
    fn an_exposure_is_as_long_as_its_pulse_or_an_error() {
        // Most of it is slept, and an overrun shorter than the rest does no harm.
        for (overrun_s, fits) in [(0.0, true), (0.0019, true), (0.003, false)] {
            let (mut exposing, _) = trigger(Given { overrun_s, exposing: true, ..GIVEN });
            match exposing.fire() {
                Ok(_) => assert!(fits, "{overrun_s}"),
                Err(RigError::PulseLength { found_ms, wanted_ms }) => {
                    assert!(!fits && (found_ms - 51.0).abs() < 0.1, "{found_ms} {overrun_s}");
                    assert!((wanted_ms - 50.0).abs() < 1e-6, "{wanted_ms}");
                }
                Err(other) => panic!("{other}"),
            }
            // A pulse that only starts the exposure may be longer.
            let (mut start, _) = trigger(Given { overrun_s, ..GIVEN });
            assert!(start.fire().is_ok());
        }
    }

    #[test]
    fn an_exposing_pulse_follows_the_exposure_and_another_does_not() {
        for (exposes, length_s) in [(true, 0.015), (false, 0.005)] {
            let (mut trigger, board) =
                trigger(Given { pulse_us: 5000, exposing: exposes, ..GIVEN });
            trigger.expose_times(3.0);
            let before_s = board.now_s.get();
            trigger.fire().unwrap();
            assert!((board.now_s.get() - before_s - length_s).abs() < 2e-5);
        }
    }

    #[test]
    fn a_line_that_cannot_be_driven_is_an_error() {
        let (mut trigger, _) = trigger(Given { fails: true, ..GIVEN });
        assert!(matches!(trigger.fire(), Err(RigError::Gone { device: "trigger", .. })));
    }
}
