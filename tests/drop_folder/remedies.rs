//! Failures of the rig, the lock, the state file and the watching loop.

use std::time::UNIX_EPOCH;

use relens::daemon::{Daemon, DaemonSetting, Doing, Folders, State};
use relens::picture::Format;
use relens::remedy::Remedy;
use relens::rig::Clock;

use crate::bed::*;

#[test]
fn the_remedy_decides_the_outcome() {
    use Remedy::{CallOperator, Recalibrate, ReopenRig, RetryLater, ShootAgain, SkipPhoto};
    // Each case: failures in order, outcome, repairs.
    let cases: [(&[Remedy], &str, &[Remedy]); 7] = [
        (&[ShootAgain], "restored", &[]),
        (&[ReopenRig, Recalibrate], "restored", &[ReopenRig, Recalibrate]),
        (&[SkipPhoto], "failed", &[]),
        (&[RetryLater], "left", &[]),
        (&[CallOperator], "held", &[]),
        (&[ShootAgain, ShootAgain, ShootAgain], "held", &[]),
        (&[ReopenRig, ReopenRig, ReopenRig], "held", &[ReopenRig, ReopenRig]),
    ];
    for (failures, wanted, mended) in cases {
        let root = fresh_root();
        let root = root.path();
        drop_in(root, "a.png", &file(Format::Png, 8, RIG));
        let failures_last_first = failures.iter().rev().copied().collect();
        let mut restorer = Brightener { failures: failures_last_first, ..Brightener::default() };
        let outcome = match once_with(root, &mut restorer, &mut ()) {
            Ok(summary) if summary.restored.len() == 1 => "restored",
            Ok(summary) if summary.failed.len() == 1 => "failed",
            Ok(summary) if summary.deferred.len() == 1 => "left",
            Ok(_) => "nothing",
            Err(error) => {
                assert!(error.to_string().contains("the lamp is out"), "{error}");
                "held"
            }
        };
        assert_eq!(outcome, wanted, "{failures:?}");
        assert_eq!(restorer.mended, mended, "{failures:?}");
        let home = match wanted {
            "restored" => "done",
            "failed" => "failed",
            _ => "inbox",
        };
        assert!(root.join(home).join("a.png").is_file(), "{failures:?}: the photo is in {home}");
        assert!(names(&root.join("working")).is_empty());
    }
}

#[test]
fn a_photo_whose_calibration_is_cancelled_waits() {
    let root = fresh_root();
    drop_in(root.path(), "a.png", &file(Format::Png, 8, RIG));
    let mut restorer =
        Brightener { failures: vec![Remedy::Recalibrate], gives_up: true, ..Brightener::default() };
    let summary = once_with(root.path(), &mut restorer, &mut ()).unwrap();
    assert_eq!((summary.deferred.len(), restorer.mended.len()), (1, 1));
    assert!(root.path().join("inbox/a.png").is_file());
}

#[test]
fn a_panic_in_the_restoration_rejects_one_photo() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    drop_in(root, "b.png", &file(Format::Png, 8, RIG));
    let mut restorer = Brightener { panics: true, ..Brightener::default() };
    let summary = once_with(root, &mut restorer, &mut ()).unwrap();
    assert_eq!(summary.failed.len(), 2);
    assert!(summary.failed[0].reason.contains("internal error"));
}

#[test]
fn a_folder_has_one_daemon_and_a_state_file() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    once(root);
    let state = State::read(root).unwrap().unwrap();
    assert_eq!((state.doing, state.counts.restored), (Doing::Ended, 1));
    let held = Folders::open(root).unwrap();
    assert!(Folders::in_use(root));
    let refused = Folders::open(root).err().unwrap().to_string();
    assert!(refused.contains("in use by another relens"), "{refused}");
    drop(held);
    assert!(!Folders::in_use(root));
}

#[test]
fn a_watched_photo_is_restored_once_it_is_quiet() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    let (clock, calendar) = (TestClock::default(), || UNIX_EPOCH);
    let (mut restorer, mut watcher) =
        (Brightener { failures: vec![Remedy::CallOperator], ..Default::default() }, ());
    let folders = Folders::open(root).unwrap();
    let mut daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    // Held once, tried again after a minute.
    let stop = || clock.now().0 > 100.0;
    let summary = daemon.run(&stop);
    drop(daemon);
    assert_eq!((summary.restored.len(), restorer.restored), (1, 1));
    assert!(clock.now().0 > 65.0, "quiet first, then held: {}", clock.now().0);
}

#[test]
fn a_nearly_full_disk_holds_photos_until_there_is_space() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    let calendar = || UNIX_EPOCH;
    let (mut restorer, mut watcher) = (Brightener::default(), ());
    for (floor_bytes, wanted) in [(u64::MAX, 0), (0, 1)] {
        let (clock, folders) = (TestClock::default(), Folders::open(root).unwrap());
        let setting = DaemonSetting { floor_bytes, ..setting() };
        let mut daemon =
            Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
        let reasons = std::cell::RefCell::new(vec![]);
        let summary = daemon.run(&|| {
            if let Some(State { doing: Doing::Held { reason }, .. }) = State::read(root).unwrap() {
                reasons.borrow_mut().push(reason);
            }
            clock.now().0 > 100.0
        });
        assert_eq!((summary.restored.len(), summary.failed.len()), (wanted, 0));
        let reported =
            reasons.borrow().iter().any(|r| r.contains("nearly full") && r.contains("by itself"));
        assert_eq!(reported, wanted == 0, "{reasons:?}");
    }
    assert!(root.join("done/a.png").is_file());
}
