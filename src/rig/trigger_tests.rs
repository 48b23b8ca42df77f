//! Triggered cameras as they behave, each rule broken in turn.

use std::sync::{Arc, Mutex, MutexGuard};

use super::*;
use crate::frame::{Counts, Size};

/// Behaviour of a triggered camera.
#[derive(Clone, Copy, Default)]
struct TriggerRules {
    /// Interval of the frames that arrive without a trigger, in milliseconds.
    free_ms: Option<f64>,
    /// Each frame arrives at the next trigger (Linux before raspberrypi/linux, pull request 6010).
    one_late: bool,
    /// Number of pulses, from the first, that have the wrong length.
    mistimed: u32,
}

/// Panel, trigger, camera and clock.
#[derive(Clone, Default)]
struct FakeRig(Arc<Mutex<FakeState>>);

impl FakeRig {
    fn state(&self) -> MutexGuard<'_, FakeState> {
        self.0.lock().expect("no test panicked meanwhile")
    }
}

#[derive(Default)]
struct FakeState {
    rules: TriggerRules,
    now_s: f64,
    /// Starts of exposures whose frames were not fetched yet.
    exposed: Vec<f64>,
    fired: u32,
    sequence: u32,
    times: f64,
}

impl Panel for FakeRig {
    fn size(&self) -> Size {
        Size::new(4, 4)
    }

    fn show(&mut self, _: &Codes) -> Result<Flip, RigError> {
        Ok(Flip { at: self.now(), vblank: 0 })
    }
}

impl Trigger for FakeRig {
    fn fire(&mut self) -> Result<Moment, RigError> {
        let mut state = self.state();
        let at_s = state.now_s;
        state.exposed.push(at_s);
        state.fired += 1;
        state.now_s += 0.05;
        match state.fired <= state.rules.mistimed {
            true => Err(RigError::PulseLength { found_ms: 53.0, wanted_ms: 50.0 }),
            false => Ok(Moment(at_s)),
        }
    }

    fn expose_times(&mut self, times: f64) {
        self.state().times = times;
    }
}

impl Camera for FakeRig {
    fn size(&self) -> Size {
        Size::new(4, 4)
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        let mut state = self.state();
        let kept = usize::from(state.rules.one_late);
        let free_s = state.rules.free_ms.map(|ms| state.now_s + ms / 1e3);
        let begun_s = match free_s {
            Some(next_s) if next_s < deadline.0 => next_s,
            None if state.exposed.len() > kept => state.exposed.remove(0),
            _ => {
                state.now_s = deadline.0;
                return Err(RigError::NoFrame { waited_ms: 0.0 });
            }
        };
        state.now_s = state.now_s.max(begun_s) + 0.016;
        state.sequence += 1;
        let counts = Counts::zeros(Size::new(4, 4));
        Ok(Exposed { counts, sequence: state.sequence, at: Moment(begun_s) })
    }

    fn expose_times(&mut self, _: f64) -> Result<bool, RigError> {
        Ok(true)
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        Ok(())
    }
}

impl Clock for FakeRig {
    fn now(&self) -> Moment {
        Moment(self.state().now_s)
    }

    fn wait_until(&self, moment: Moment) {
        let mut state = self.state();
        state.now_s = state.now_s.max(moment.0);
    }
}

fn rig(rules: TriggerRules) -> (Devices, FakeRig) {
    let rig = FakeRig::default();
    rig.state().rules = rules;
    let boxed = || Box::new(rig.clone());
    let timing =
        Timing { settle_ms: 100.0, exposure_ms: 50.0, deadline_ms: 500.0, exposures_max: 5 };
    (Devices::new(boxed(), boxed(), boxed(), boxed(), timing), rig)
}

fn grey() -> Codes {
    Codes::zeros(Size::new(4, 4))
}

#[test]
fn a_camera_that_runs_free_is_refused_where_it_should_wait_for_its_trigger() {
    for (free_ms, refused) in [(None, false), (Some(16.6), true), (Some(200.0), true)] {
        let (mut devices, rig) = rig(TriggerRules { free_ms, ..TriggerRules::default() });
        // A frame begun before the check does not prove that the camera runs free.
        rig.state().exposed.push(-0.01);
        let error = devices.refuse_free_running().err().map(|error| error.to_string());
        assert_eq!(error.is_some(), refused, "{error:?}");
        assert!(error.is_none_or(|words| words.contains("the camera runs free")));
        assert!(rig.state().now_s < 0.5, "it takes no longer");
    }
}

#[test]
fn an_exposure_of_wrong_length_is_made_again_and_its_frame_thrown_away() {
    let (mut devices, rig) = rig(TriggerRules { mistimed: 2, ..TriggerRules::default() });
    let exposed = devices.capture(&grey()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((exposed.sequence, devices.rejected().mistimed, rig.state().fired), (3, 2, 3));
    // The same holds for photos; a board that is always late causes an error.
    rig.state().rules.mistimed = 4;
    assert!(devices.expose().is_ok());
    rig.state().rules.mistimed = u32::MAX;
    let error = devices.capture(&grey()).expect_err("no pulse is right").to_string();
    assert!(error.contains("pulse lasted 53.00 ms instead of 50.00"), "{error}");
}

#[test]
fn a_kernel_that_is_one_trigger_late_is_named() {
    let (mut devices, _) = rig(TriggerRules { one_late: true, ..TriggerRules::default() });
    for _ in 0..2 {
        let error = devices.capture(&grey()).expect_err("no frame is right").to_string();
        assert!(error.contains("ms before the trigger, as each time: kernels before"), "{error}");
    }
    // One early frame among others is not the kernel's fault.
    let (mut devices, rig) = rig(TriggerRules::default());
    rig.state().exposed.push(-1.0);
    assert!(devices.capture(&grey()).is_ok());
}

#[test]
fn the_pulse_follows_the_exposure() {
    let (mut devices, rig) = rig(TriggerRules::default());
    assert!(devices.expose_times(3.0).is_ok_and(|is_set| is_set));
    assert_eq!(rig.state().times, 3.0);
    assert_eq!((devices.timing.exposure_ms, devices.timing.deadline_ms), (150.0, 600.0));
}
