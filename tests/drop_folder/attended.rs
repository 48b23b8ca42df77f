//! A box with button and panel.

use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use relens::config::Mode;
use relens::daemon::{
    Attended, Daemon, DaemonError, DaemonSetting, Folders, Progress, Question, Restorer, Schedule,
    Summary, Turn,
};
use relens::kiosk::front_panel::{BoxState, FrontPanel};
use relens::kiosk::press::Press;
use relens::kiosk::screen::Screen;
use relens::picture::{Format, Photo};
use relens::pipeline::Outcome;
use relens::remedy::{AnyFailure, Remedy};

use crate::bed::*;

/// Brightens, and records the screens shown.
struct Shown {
    inner: Brightener,
    screens: Rc<RefCell<Vec<Screen>>>,
}

impl Restorer for Shown {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        self.inner.restore(photo, progress)
    }
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        self.inner.mend(remedy)
    }
    fn show(&mut self, screen: &Screen) {
        self.screens.borrow_mut().push(screen.clone());
    }
}

/// Runs a box in `mode` on `root` until `until_s`, calling `act` at each reading of the clock.
fn attended(
    root: &Path,
    mode: Mode,
    inner: Brightener,
    until_s: f64,
    front: &FrontPanel,
    act: impl FnMut(f64, &FrontPanel),
) -> (Summary, Vec<Screen>, Vec<Remedy>) {
    let calendar = || -> SystemTime { UNIX_EPOCH + Duration::from_secs(1_700_000_000) };
    let screens = Rc::default();
    let (clock, mut restorer) =
        (TestClock::default(), Shown { inner, screens: Rc::clone(&screens) });
    let folders = Folders::open(root).unwrap();
    let mut watcher = ();
    let schedule = Attended::new(front.clone(), mode, &clock, Box::new(()));
    let daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let act = RefCell::new(act);
    let summary = daemon.scheduled(Box::new(schedule)).run(&|| {
        act.borrow_mut()(clock.0.get(), front);
        clock.0.get() > until_s
    });
    let screens = screens.borrow().clone();
    (summary, screens, restorer.inner.mended)
}

fn photos(root: &Path, count: usize) {
    for n in 0..count {
        drop_in(root, &format!("{n}.png"), &file(Format::Png, 8, RIG));
    }
}

/// Presses once at `at_s`.
fn press_at(at_s: f64, press: Press) -> impl FnMut(f64, &FrontPanel) {
    let mut done = false;
    move |now, front| {
        if now >= at_s && !std::mem::replace(&mut done, true) {
            front.press(press);
        }
    }
}

#[test]
fn one_press_restores_all_photos_that_wait() {
    let (root, front) = (fresh_root(), FrontPanel::default());
    photos(root.path(), 3);
    let (summary, screens, _) =
        attended(root.path(), Mode::Button, Brightener::default(), 60.0, &front, |_, _| {});
    let waiting = Screen::Waiting { photos: 3, others: String::new() };
    assert!(summary.restored.is_empty() && screens.contains(&waiting));
    assert_eq!(front.state(), BoxState::Waiting);
    let press = press_at(20.0, Press::Down);
    let (summary, screens, _) =
        attended(root.path(), Mode::Button, Brightener::default(), 60.0, &front, press);
    assert_eq!(summary.restored.len(), 3);
    let working = |s: &&Screen| matches!(s, Screen::Working { of: 3, .. });
    assert_eq!(screens.iter().filter(working).count(), 3, "{screens:?}");
    assert!(matches!(screens.last(), Some(Screen::Result { .. })), "{screens:?}");
}

#[test]
fn later_photos_wait_for_another_press() {
    let (root, front) = (fresh_root(), FrontPanel::default());
    photos(root.path(), 1);
    let (mut dropped, mut presses) = (false, 0);
    let (summary, ..) =
        attended(root.path(), Mode::Button, Brightener::default(), 60.0, &front, |now, front| {
            if now >= 10.0 && presses < 10 {
                presses += 1;
                front.press(Press::Down);
            }
            if now > 20.0 && !std::mem::replace(&mut dropped, true) {
                drop_in(root.path(), "later.png", &file(Format::Png, 8, RIG));
            }
        });
    assert_eq!(summary.restored.len(), 1);
    assert!(root.path().join("inbox/later.png").exists());
}

#[test]
fn a_press_without_photos_ends_in_ready() {
    let (root, front) = (fresh_root(), FrontPanel::default());
    let press = press_at(5.0, Press::Down);
    attended(root.path(), Mode::Button, Brightener::default(), 20.0, &front, press);
    assert_eq!(front.state(), BoxState::Ready);
}

#[test]
fn a_button_held_at_the_start_means_maintenance_until_a_short_press() {
    let (root, front) = (fresh_root(), FrontPanel::default());
    photos(root.path(), 2);
    front.press(Press::HeldAtStart);
    let mut presses = [(20.0, Press::Long), (40.0, Press::Short)].into_iter().peekable();
    let (summary, screens, mended) =
        attended(root.path(), Mode::Folder, Brightener::default(), 80.0, &front, |now, front| {
            if let Some((_, press)) = presses.next_if(|(at, _)| now >= *at) {
                assert!(root.path().join("inbox/0.png").exists(), "photos wait");
                front.press(press);
            }
        });
    assert_eq!((summary.restored.len(), mended), (2, vec![Remedy::Recalibrate]));
    let said = |words: &str| {
        screens.iter().any(|s| matches!(s, Screen::Maintenance { words: w } if w.contains(words)))
    };
    assert!(said("waits for you") && said("has been measured"), "{screens:?}");
}

#[test]
fn measuring_the_lens_in_maintenance_can_be_cancelled() {
    let (root, front) = (fresh_root(), FrontPanel::default());
    front.press(Press::HeldAtStart);
    let inner = Brightener { gives_up: true, ..Brightener::default() };
    let press = press_at(20.0, Press::Long);
    let (_, screens, mended) = attended(root.path(), Mode::Folder, inner, 40.0, &front, press);
    assert_eq!(mended, [Remedy::Recalibrate]);
    let said = |screen: &Screen| match screen {
        Screen::Maintenance { words } => {
            words.contains("cancelled") && !words.contains("could not")
        }
        _ => false,
    };
    assert!(screens.last().is_some_and(said), "{screens:?}");
}

#[test]
fn an_unchanged_photo_is_not_shown_as_restored() {
    let (root, front) = (fresh_root(), FrontPanel::default());
    photos(root.path(), 1);
    let inner = Brightener { untouched: true, ..Brightener::default() };
    let (summary, screens, _) = attended(root.path(), Mode::Folder, inner, 30.0, &front, |_, _| {});
    assert_eq!((summary.restored.len(), summary.untouched.len()), (0, 1));
    let said = |s: &Screen| match s {
        Screen::Result { untouched, words, .. } => *untouched && words == "Told to.",
        _ => false,
    };
    assert!(screens.iter().any(said), "{screens:?}");
}

/// A schedule that calls for help at each turn, with the error that the function returns.
struct Needy(fn() -> DaemonError);

impl Schedule for Needy {
    fn turn(&mut self, _: Question, _: &mut dyn Restorer) -> Turn {
        Turn::Help((self.0)())
    }
}

/// The instructions on the panel of a box in trouble.
fn to_do(floor_bytes: u64, inner: Brightener, schedule: Box<dyn Schedule>) -> String {
    let (root, clock, screens) = (fresh_root(), TestClock::default(), Rc::default());
    photos(root.path(), 1);
    let calendar = || UNIX_EPOCH;
    let (mut restorer, mut watcher) = (Shown { inner, screens: Rc::clone(&screens) }, ());
    let setting = DaemonSetting { floor_bytes, ..setting() };
    let folders = Folders::open(root.path()).unwrap();
    let schedule = Attended::new(FrontPanel::default(), Mode::Folder, &clock, schedule);
    let daemon =
        Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    daemon.scheduled(Box::new(schedule)).run(&|| clock.0.get() > 20.0);
    let screens = screens.borrow();
    let said = screens.iter().find_map(|screen| match screen {
        Screen::Trouble { to_do, .. } => Some(to_do.clone()),
        _ => None,
    });
    said.unwrap_or_else(|| panic!("{screens:?}"))
}

#[test]
fn each_trouble_has_its_own_instructions() {
    let failing = |remedy, cannot_mend| Brightener {
        failures: vec![remedy],
        cannot_mend,
        ..Brightener::default()
    };
    let well = Brightener::default;
    let full = to_do(u64::MAX, well(), Box::new(()));
    assert!(full.contains("Free some disk space"), "{full}");
    let gone = to_do(0, failing(Remedy::CallOperator, false), Box::new(()));
    assert!(gone.contains("cables"), "{gone}");
    let lost = to_do(0, failing(Remedy::ReopenRig, true), Box::new(()));
    assert!(lost.contains("cables"), "{lost}");
    let uncalibrated = to_do(0, failing(Remedy::Recalibrate, true), Box::new(()));
    assert!(uncalibrated.contains("The lens could not be measured"), "{uncalibrated}");
    let drifted =
        || DaemonError::Drifted { complaint: "displaced by 3 px".into(), calibrations: 0 };
    let drifted = to_do(0, well(), Box::new(Needy(drifted)));
    assert!(drifted.contains("moved") && drifted.contains("measure the lens"), "{drifted}");
    for words in [full, drifted, uncalibrated] {
        assert!(!words.contains("cables"), "{words}");
    }
}

#[test]
fn a_press_in_trouble_tries_again() {
    let (root, front) = (fresh_root(), FrontPanel::default());
    photos(root.path(), 1);
    let failing = Brightener { failures: vec![Remedy::CallOperator], ..Brightener::default() };
    let (mut press, mut done) = (press_at(20.0, Press::Down), f64::INFINITY);
    let (summary, screens, _) =
        attended(root.path(), Mode::Folder, failing, 120.0, &front, |now, front| {
            press(now, front);
            if !names(&root.path().join("done")).is_empty() {
                done = done.min(now);
            }
        });
    assert_eq!(summary.restored.len(), 1);
    assert!((20.0..40.0).contains(&done), "done at {done} s");
    let hint = "Press the button to try again";
    let shown = |s: &Screen| matches!(s, Screen::Trouble { to_do, .. } if to_do.contains(hint));
    assert!(screens.iter().any(shown), "{screens:?}");
}

#[test]
fn trouble_is_shown_with_instructions_and_clears_itself() {
    let (root, front) = (fresh_root(), FrontPanel::default());
    photos(root.path(), 1);
    let failing = Brightener { failures: vec![Remedy::CallOperator], ..Brightener::default() };
    let mut trouble = false;
    let (summary, screens, _) =
        attended(root.path(), Mode::Folder, failing, 120.0, &front, |_, front| {
            trouble |= matches!(front.state(), BoxState::Trouble);
        });
    assert!(
        trouble
            && screens
                .iter()
                .any(|s| matches!(s, Screen::Trouble { to_do, .. } if to_do.contains("cables")))
    );
    assert_eq!(summary.restored.len(), 1, "continued by itself");
    assert!(!matches!(front.state(), BoxState::Trouble));
}
