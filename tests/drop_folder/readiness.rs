//! When a photo is taken: not before it is all there, once it is, and however it came.

use std::cell::RefCell;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use relens::config::Curve;
use relens::daemon::{Daemon, DaemonSetting, Doing, Folders, State, Summary};
use relens::frame::Size;
use relens::picture::{Format, Reading};

use crate::bed::*;

/// Watches `root` for `seconds`, telling `world` the time before each step; what became of the
/// photos and how many were restored.
fn watch(
    root: &Path,
    seconds: f64,
    setting: DaemonSetting,
    world: &mut dyn FnMut(f64),
) -> (Summary, usize) {
    let clock = TestClock::default();
    let (mut restorer, mut watcher) = (Brightener::default(), ());
    let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let folders = Folders::open(root).unwrap();
    let mut daemon =
        Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let world = RefCell::new(world);
    let summary = daemon.run(&|| {
        world.borrow_mut()(clock.0.get());
        clock.0.get() > seconds
    });
    drop(daemon);
    (summary, restorer.restored)
}

/// Without events of the inbox.
fn deaf() -> DaemonSetting {
    DaemonSetting { hints: false, ..setting() }
}

#[test]
fn a_jpeg_cut_anywhere_waits_and_is_taken_once_when_whole() {
    let whole = file(Format::Jpeg, 8, Size::new(256, 192));
    for percent in (0..100).chain([1000]) {
        let root = fresh_root();
        let root = root.path();
        let length = if percent == 1000 { whole.len() - 2 } else { whole.len() * percent / 100 };
        drop_in(root, "a.jpg", &whole[..length]);
        let (_, restored) = watch(root, 500.0, deaf(), &mut |_| ());
        assert_eq!(restored, 0, "cut to {length} of {}", whole.len());
        assert_eq!(std::fs::read(root.join("inbox/a.jpg")).unwrap(), whole[..length], "left alone");
        assert!(names(&root.join("failed")).is_empty());
        std::fs::write(root.join("inbox/a.jpg"), &whole).unwrap();
        let (_, restored) = watch(
            root,
            500.0,
            DaemonSetting { reading: Reading::new(Size::new(64, 48), Curve::Srgb), ..deaf() },
            &mut |_| (),
        );
        assert_eq!((restored, names(&root.join("done"))), (1, set(&["a.jpg"])));
    }
}

#[test]
fn a_copy_that_reserves_its_space_first_is_waited_for() {
    let whole = file(Format::Jpeg, 8, Size::new(512, 384));
    let root = fresh_root();
    let root = root.path();
    // The final size from the start, filled in ten steps a minute apart: size alone never changes.
    let (mut filled, mut state) = (0, vec![0; whole.len()]);
    drop_in(root, "a.jpg", &state);
    let mut fill = |now: f64| {
        let due = ((now / 60.0) as usize).min(10) * whole.len() / 10;
        if due > filled {
            state[filled..due].copy_from_slice(&whole[filled..due]);
            filled = due;
            std::fs::write(root.join("inbox/a.jpg"), &state).unwrap();
        }
        assert!(filled == whole.len() || !root.join("done/a.jpg").exists(), "taken at {now} s");
    };
    let (summary, restored) = watch(root, 700.0, deaf(), &mut fill);
    assert_eq!((restored, summary.failed.len(), summary.left.len()), (1, 0, 0), "{summary:?}");
    assert_eq!(std::fs::read(root.join("done/a.jpg")).unwrap(), whole);
}

#[test]
fn every_format_is_waited_for_and_a_broken_file_is_not() {
    for (name, format, bits) in [
        ("a.jpg", Format::Jpeg, 8),
        ("a.png", Format::Png, 8),
        ("a.png", Format::Png, 16),
        ("a.tif", Format::Tiff, 16),
    ] {
        let root = fresh_root();
        let root = root.path();
        let whole = file(format, bits, RIG);
        let mut tail = whole.clone();
        tail[whole.len() / 3..].fill(0);
        for part in [&whole[..0], &whole[..whole.len() / 2], &tail[..]] {
            drop_in(root, name, part);
            let (summary, restored) = watch(root, 100.0, deaf(), &mut |_| ());
            assert_eq!(
                (restored, summary.failed.len(), summary.left.len()),
                (0, 0, 1),
                "{name} {summary:?}"
            );
            assert!(summary.left[0].reason.contains("waiting for the rest of it"), "{summary:?}");
        }
        // Never whole: after a quarter of an hour without a change it is what it is.
        let (summary, _) = watch(root, 1000.0, deaf(), &mut |_| ());
        assert_eq!((summary.failed.len(), summary.left.len()), (1, 0), "{name}");
        assert_eq!(std::fs::read(root.join("failed").join(name)).unwrap(), tail, "unchanged");
    }
    let root = fresh_root();
    drop_in(root.path(), "letter.jpg", b"Dear Sir or Madam");
    let (summary, _) = watch(root.path(), 10.0, deaf(), &mut |_| ());
    assert_eq!(summary.failed.len(), 1, "nothing to wait for");
}

#[test]
fn emptied_once_an_unfinished_photo_that_changed_lately_stays() {
    let root = fresh_root();
    let root = root.path();
    let whole = file(Format::Jpeg, 8, RIG);
    drop_in(root, "a.jpg", &whole[..whole.len() / 2]);
    let clock = TestClock::default();
    let (mut restorer, mut watcher) = (Brightener::default(), ());
    let folders = Folders::open(root).unwrap();
    // By the calendar that dates the file; and by one that jumped into the past.
    for calendar in [SystemTime::now(), UNIX_EPOCH] {
        let calendar = || calendar;
        let folders = Folders::on(
            std::sync::Arc::new(relens::disk::LocalDisk::new(vec![folders.root().to_owned()])),
            folders.root(),
        )
        .unwrap();
        let mut daemon =
            Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher)
                .unwrap();
        let summary = daemon.once().unwrap();
        assert_eq!((summary.failed.len(), summary.left.len()), (0, 1), "{summary:?}");
    }
    drop(folders);
    assert_eq!(once(root).failed.len(), 1, "years later it is what it is");
}

#[test]
fn however_a_photo_comes_it_is_taken_without_events() {
    let root = fresh_root();
    let root = root.path();
    let bytes = file(Format::Png, 8, RIG);
    let aside = root.join("aside");
    std::fs::create_dir_all(aside.join("holiday/sea")).unwrap();
    drop_in(root, "plain.png", &bytes);
    for name in ["moved.png", "linked.png", "holiday/1.png", "holiday/sea/1.png"] {
        std::fs::write(aside.join(name), &bytes).unwrap();
    }
    let mut came = false;
    let mut come = |now: f64| {
        if now > 20.0 && !came {
            came = true;
            std::fs::rename(aside.join("moved.png"), root.join("inbox/moved.png")).unwrap();
            std::fs::hard_link(aside.join("linked.png"), root.join("inbox/linked.png")).unwrap();
            std::fs::rename(aside.join("holiday"), root.join("inbox/holiday")).unwrap();
        }
    };
    let (summary, restored) = watch(root, 60.0, deaf(), &mut come);
    assert_eq!(restored, 5, "{summary:?}");
    let all = ["plain.png", "moved.png", "linked.png", "holiday-1.png", "holiday-sea-1.png"];
    assert_eq!(names(&root.join("done")), set(&all));
    assert_eq!(
        std::fs::read(aside.join("linked.png")).unwrap(),
        bytes,
        "the other name of it stays"
    );
    assert_eq!(names(&root.join("inbox")), set(&["holiday"]), "nothing is deleted");
}

#[test]
fn events_make_it_sooner_and_a_flood_of_them_does_no_harm() {
    let root = fresh_root();
    let root = root.path();
    let bytes = file(Format::Png, 8, RIG);
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    let slow = DaemonSetting { poll_s: 1000.0, ..setting() };
    let (mut came, mut taken) = (false, f64::INFINITY);
    let mut come = |now: f64| {
        if now > 20.0 && !came {
            came = true;
            for n in 0..200 {
                std::fs::write(root.join(format!("inbox/flood-{n}.tmp")), b"").unwrap();
            }
            std::fs::write(root.join("inbox/a.png"), &bytes).unwrap();
        }
        if root.join("done/a.png").exists() {
            taken = now.min(taken);
        }
    };
    watch(root, 900.0, slow, &mut come);
    assert!(taken < 30.0, "taken at {taken} s, quiet since 20 s");
}

#[test]
fn a_photo_that_was_moved_in_is_under_way_within_two_seconds() {
    let root = fresh_root();
    let root = root.path();
    let bytes = file(Format::Png, 8, RIG);
    std::fs::create_dir_all(root.join("aside/sea")).unwrap();
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    // A folder that is there already is listened to as well.
    std::fs::create_dir_all(root.join("inbox/hills")).unwrap();
    for name in ["a.png", "sea/b.png", "c.png"] {
        std::fs::write(root.join("aside").join(name), &bytes).unwrap();
    }
    let (mut came, mut taken) = (None, f64::INFINITY);
    let mut come = |now: f64| {
        if now > 20.0 && came.is_none() {
            came = Some(now);
            for (from, to) in [("a.png", "a.png"), ("sea", "sea"), ("c.png", "hills/c.png")] {
                std::fs::rename(root.join("aside").join(from), root.join("inbox").join(to))
                    .unwrap();
            }
            // Copied: this one may not be all there yet.
            std::fs::write(root.join("inbox/copied.png"), &bytes).unwrap();
        }
        let names = ["a.png", "sea-b.png", "hills-c.png"];
        if names.iter().all(|name| root.join("done").join(name).exists()) {
            taken = now.min(taken);
        }
        assert!(
            now > 25.0 || !root.join("done/copied.png").exists(),
            "a copy is let settle, and not taken at {now} s"
        );
    };
    let (summary, restored) = watch(root, 60.0, setting(), &mut come);
    let came = came.unwrap();
    assert_eq!(restored, 4, "{summary:?}");
    assert!(taken <= came + 2.0, "came at {came} s, done at {taken} s");
}

#[test]
fn an_inbox_that_was_made_anew_is_seen_within_five_seconds() {
    let root = fresh_root();
    let root = root.path();
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    let (mut made, mut seen) = (None, f64::INFINITY);
    let mut come = |now: f64| {
        if now > 20.0 && root.join("inbox").exists() && made.is_none() && now < 30.0 {
            std::fs::remove_dir(root.join("inbox")).unwrap();
        }
        let state = State::read(root).unwrap().unwrap();
        if now > 100.0 && made.is_none() {
            assert!(matches!(state.doing, Doing::Held { .. }), "{:?}", state.doing);
            std::fs::create_dir(root.join("inbox")).unwrap();
            made = Some(now);
        }
        if made.is_some() && state.doing == Doing::Waiting {
            seen = now.min(seen);
        }
    };
    watch(root, 200.0, deaf(), &mut come);
    let made = made.unwrap();
    assert!(seen <= made + 5.0, "made at {made} s, seen at {seen} s");
}

#[test]
fn who_waits_and_for_what_is_told_while_it_is_so() {
    let root = fresh_root();
    let root = root.path();
    let whole = file(Format::Jpeg, 8, Size::new(256, 192));
    drop_in(root, "half.jpg", &whole[..whole.len() / 2]);
    let mut dropped = false;
    let told = RefCell::new(Vec::new());
    let mut look = |now: f64| {
        if now > 30.0 && !dropped {
            dropped = true;
            drop_in(root, "whole.jpg", &whole);
        }
        if let Some(state) = State::read(root).unwrap() {
            let words = state.counts.to_string();
            if told.borrow().last() != Some(&words) {
                told.borrow_mut().push(words);
            }
        }
    };
    watch(root, 60.0, deaf(), &mut look);
    let none = "0 restored, 0 left as they were, 0 failed";
    let one = "1 restored, 0 left as they were, 0 failed";
    let half = "1 for the rest of the file";
    let wanted = [
        format!("{none}, 0 waiting"),
        format!("{none}, 1 waiting (1 settling)"),
        format!("{none}, 1 waiting ({half})"),
        format!("{none}, 2 waiting (1 settling, {half})"),
        format!("{one}, 1 waiting ({half})"),
    ];
    let told = told.into_inner();
    let mut rest = told.iter();
    for words in &wanted {
        assert!(rest.any(|told| told == words), "{words}, in order, in {told:#?}");
    }
    // Another life counts what is there.
    watch(root, 10.0, deaf(), &mut |_| ());
    let counts = State::read(root).unwrap().unwrap().counts.to_string();
    assert_eq!(counts, format!("{one}, 1 waiting ({half})"), "after a restart");
    // The page says the same while the box stands idle, and which photo it is and why.
    let page = || std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    let mut pages = Vec::new();
    let mut look = |now: f64| {
        if (100.0..110.0).contains(&now) && root.join("inbox/half.jpg").exists() {
            pages.push(page());
            std::fs::remove_file(root.join("inbox/half.jpg")).unwrap();
        }
    };
    watch(root, 140.0, deaf(), &mut look);
    assert!(pages[0].contains(&format!("<b>1</b> waiting ({half})")), "{}", pages[0]);
    assert!(pages[0].contains("<b>half.jpg</b> <span>"), "{}", pages[0]);
    assert!(!page().contains("half.jpg") && !page().contains("waiting ("), "{}", page());
}

#[test]
fn links_to_folders_are_not_entered_and_nested_folders_are_refused() {
    let root = fresh_root();
    let root = root.path();
    std::fs::create_dir_all(root.join("aside")).unwrap();
    std::fs::write(root.join("aside/secret.png"), file(Format::Png, 8, RIG)).unwrap();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    std::os::unix::fs::symlink(root.join("aside"), root.join("inbox/way")).unwrap();
    let summary = once(root);
    assert_eq!((summary.restored.len(), summary.failed.len()), (1, 1), "{summary:?}");
    assert!(summary.failed[0].reason.contains("found a link"), "{summary:?}");
    assert!(root.join("aside/secret.png").is_file());
    // The outbox in the inbox, by a link.
    let other = fresh_root();
    let other = other.path();
    std::fs::create_dir_all(other.join("inbox/results")).unwrap();
    std::os::unix::fs::symlink(other.join("inbox/results"), other.join("outbox")).unwrap();
    let refused = Folders::open(other).unwrap_err().to_string();
    assert!(
        refused.contains("inbox/results lies in") && refused.contains("five apart"),
        "{refused}"
    );
}
