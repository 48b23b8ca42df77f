//! Failures of the rig, the lock, the state file and the watching loop.

use std::time::UNIX_EPOCH;

use relens::daemon::{Daemon, DaemonSetting, Doing, Folders, State};
use relens::picture::Format;
use relens::remedy::Remedy;
use relens::rig::Clock;

use crate::bed::*;

#[test]
fn the_remedy_alone_decides() {
    use Remedy::{CallOperator, Recalibrate, ReopenRig, RetryLater, ShootAgain, SkipPhoto};
    // Failures in order; what comes of it: restored, failed, left, held; what was mended.
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
            Ok(summary) if summary.left.len() == 1 => "left",
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
fn a_photo_whose_calibration_is_given_up_waits_and_nobody_is_called() {
    let root = fresh_root();
    drop_in(root.path(), "a.png", &file(Format::Png, 8, RIG));
    let mut restorer =
        Brightener { failures: vec![Remedy::Recalibrate], gives_up: true, ..Brightener::default() };
    let summary = once_with(root.path(), &mut restorer, &mut ()).unwrap();
    assert_eq!((summary.left.len(), restorer.mended.len()), (1, 1));
    assert!(root.path().join("inbox/a.png").is_file());
}

#[test]
fn a_panic_in_the_restoration_costs_one_photo_and_not_the_night() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    drop_in(root, "b.png", &file(Format::Png, 8, RIG));
    let mut restorer = Brightener { panics: true, ..Brightener::default() };
    let summary = once_with(root, &mut restorer, &mut ()).unwrap();
    assert_eq!(summary.failed.len(), 2);
    assert!(summary.failed[0].reason.contains("mistake of relens"));
}

#[test]
fn one_daemon_a_folder_and_the_state_says_what_it_did() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    once(root);
    let state = State::read(root).unwrap().unwrap();
    assert_eq!((state.doing, state.counts.restored), (Doing::Ended, 1));
    let held = Folders::open(root).unwrap();
    assert!(Folders::in_use(root));
    assert!(Folders::open(root).unwrap_err().to_string().contains("a running relens"));
    drop(held);
    assert!(!Folders::in_use(root));
}

#[test]
fn watching_takes_a_photo_once_it_is_quiet_and_stops_when_told() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    let (clock, calendar) = (TestClock::default(), || UNIX_EPOCH);
    let (mut restorer, mut watcher) =
        (Brightener { failures: vec![Remedy::CallOperator], ..Default::default() }, ());
    let folders = Folders::open(root).unwrap();
    let mut daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    // Held once, tried again after a minute of the clock.
    let stop = || clock.now().0 > 100.0;
    let summary = daemon.run(&stop);
    drop(daemon);
    assert_eq!((summary.restored.len(), restorer.restored), (1, 1));
    assert!(clock.now().0 > 65.0, "quiet first, then held: {}", clock.now().0);
}

#[test]
fn a_disk_at_its_floor_holds_with_its_reason_and_goes_on_by_itself() {
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
        let told =
            reasons.borrow().iter().any(|r| r.contains("nearly full") && r.contains("by itself"));
        assert_eq!(told, wanted == 0, "{reasons:?}");
    }
    assert!(root.join("done/a.png").is_file());
}
