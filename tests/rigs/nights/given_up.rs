//! A drifted rig that is not recalibrated restores no photo.

use std::cell::RefCell;
use std::time::{Duration, UNIX_EPOCH};

use relens::config::{self, Mode};
use relens::daemon::{
    Attended, Daemon, DaemonSetting, Doing, Folders, Nightly, Progress, Restorer, State, Times,
};
use relens::kiosk::front_panel::FrontPanel;
use relens::kiosk::press::Press;
use relens::nights::pilot::Drift;
use relens::picture::Photo;
use relens::pipeline::Outcome;
use relens::remedy::{AnyFailure, Remediable, Remedy};

use super::{Lived, Scripted, TestClock, in_folder, live, night, nights, photos};

/// Failure of a calibration that was cancelled at the button.
#[derive(Debug, thiserror::Error)]
#[error("cancelled")]
struct Asked;

impl Remediable for Asked {
    fn remedy(&self) -> Remedy {
        Remedy::RetryLater
    }
    fn was_asked_for(&self) -> bool {
        true
    }
}

/// A restorer whose first calibration is cancelled.
struct GivenUp<'a> {
    inner: Scripted<'a>,
    given_up: bool,
}

impl Restorer for GivenUp<'_> {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        self.inner.restore(photo, progress)
    }
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        if !std::mem::replace(&mut self.given_up, true) {
            self.inner.log.borrow_mut().push("given up".into());
            return Err(Box::new(Asked));
        }
        self.inner.mend(remedy)
    }
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        self.inner.pilot()
    }
}

#[test]
fn after_cancelling_a_calibration_the_box_waits_for_the_button() {
    const PRESS_S: f64 = 800.0;
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 5);
    let (clock, log) = (TestClock::default(), RefCell::default());
    // Pilots: a warm-up without drift, then drift after three photos, still present at the press.
    let pilots = RefCell::new(vec![0.0, 0.0, 0.0, 4.0, 4.0]);
    let noon = UNIX_EPOCH + Duration::from_secs(1_768_042_800);
    let calendar = || noon + Duration::from_secs_f64(35_400.0 + clock.0.get());
    let times = Times { clock: &clock, calendar: &calendar, is_set: &|| true };
    let folders = Folders::open(root.path()).unwrap();
    let inner = Nightly::new(&nights("22:00-06:00"), &folders, times).unwrap();
    let front = FrontPanel::default();
    let schedule = Attended::new(front.clone(), Mode::Folder, &clock, Box::new(inner));
    let inner = Scripted { pilots: &pilots, log: &log, clock: &clock, photo_s: 1.0 };
    let mut restorer = GivenUp { inner, given_up: false };
    let size = relens::frame::Size::new(64, 48);
    let setting = DaemonSetting::new("test", size, config::Curve::Srgb);
    let (mut watcher, states) = ((), RefCell::new(Vec::<State>::new()));
    let mut pressed = false;
    let daemon =
        Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let pressing = RefCell::new(|now: f64| {
        if now > PRESS_S && !std::mem::replace(&mut pressed, true) {
            // No retry until then.
            let tried = log.borrow().iter().filter(|line| *line == "pilot 4").count();
            assert_eq!(tried, 1, "{:?}", log.borrow());
            front.press(Press::Down);
        }
    });
    let summary = daemon.scheduled(Box::new(schedule)).run(&|| {
        if let Ok(Some(state)) = State::read(root.path()) {
            states.borrow_mut().push(state);
        }
        pressing.borrow_mut()(clock.0.get());
        clock.0.get() > 1200.0
    });
    let states = states.into_inner();
    let held = states.iter().find(|state| matches!(state.doing, Doing::Held { .. }));
    assert!(held.is_none(), "the operator is not called: {held:?}");
    let waits = |state: &&State| {
        matches!(&state.doing, Doing::Paused { reason }
            if reason.contains("cancelled at the button: press it to measure"))
    };
    let waiting = states.iter().rfind(waits).expect("a reason for waiting").counts.waiting;
    assert!(waiting.button == waiting.all() && waiting.button > 0, "{waiting}");
    let log = log.into_inner();
    let from = log.iter().position(|line| line == "given up").unwrap();
    assert_eq!(log[from + 1..from + 4], ["pilot 4", "calibrated", "pilot 0"], "{log:?}");
    assert_eq!((summary.restored.len(), in_folder(root.path(), "outbox")), (5, 5), "{log:?}");
}

#[test]
fn a_cold_drifted_rig_restores_no_photo() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 5);
    let nights = config::Nights { recalibrate: false, ..nights("22:00-06:00") };
    let pilots = vec![9.0; 1000];
    let Lived { log, summary, .. } = live(super::Night { nights, pilots, ..night(root.path()) });
    assert!(summary.restored.is_empty() && log.iter().all(|line| line == "pilot 9"), "{log:?}");
}
