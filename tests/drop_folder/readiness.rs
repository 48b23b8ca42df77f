//! Photos are restored once they are complete, however they arrive.

use std::cell::RefCell;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use relens::config::Curve;
use relens::daemon::{Daemon, DaemonSetting, Doing, Folders, State, Summary};
use relens::frame::Size;
use relens::picture::{Format, ReadOptions};

use crate::bed::*;

/// Watches `root` for `seconds`, calling `world` with the time before each step; returns the
/// summary and the number of restorations.
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

/// Settings of a daemon that receives no events from the inbox.
fn without_events() -> DaemonSetting {
    DaemonSetting { hints: false, ..setting() }
}

#[test]
fn an_incomplete_jpeg_waits_and_is_restored_once_complete() {
    let whole = file(Format::Jpeg, 8, Size::new(256, 192));
    for percent in (0..100).chain([1000]) {
        let root = fresh_root();
        let root = root.path();
        let length = if percent == 1000 { whole.len() - 2 } else { whole.len() * percent / 100 };
        drop_in(root, "a.jpg", &whole[..length]);
        let (_, restored) = watch(root, 500.0, without_events(), &mut |_| ());
        assert_eq!(restored, 0, "cut to {length} of {}", whole.len());
        assert_eq!(
            std::fs::read(root.join("inbox/a.jpg")).unwrap(),
            whole[..length],
            "not touched"
        );
        assert!(names(&root.join("failed")).is_empty());
        std::fs::write(root.join("inbox/a.jpg"), &whole).unwrap();
        let (_, restored) = watch(
            root,
            500.0,
            DaemonSetting {
                reading: ReadOptions::new(Size::new(64, 48), Curve::Srgb),
                ..without_events()
            },
            &mut |_| (),
        );
        assert_eq!((restored, names(&root.join("done"))), (1, set(&["a.jpg"])));
    }
}

#[test]
fn a_copy_with_its_final_size_from_the_start_is_waited_for() {
    let whole = file(Format::Jpeg, 8, Size::new(512, 384));
    let root = fresh_root();
    let root = root.path();
    // Filled in ten steps a minute apart; the size never changes.
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
    let (summary, restored) = watch(root, 700.0, without_events(), &mut fill);
    assert_eq!((restored, summary.failed.len(), summary.deferred.len()), (1, 0, 0), "{summary:?}");
    assert_eq!(std::fs::read(root.join("done/a.jpg")).unwrap(), whole);
}

#[test]
fn incomplete_files_of_every_format_wait_and_broken_ones_do_not() {
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
            let (summary, restored) = watch(root, 100.0, without_events(), &mut |_| ());
            assert_eq!(
                (restored, summary.failed.len(), summary.deferred.len()),
                (0, 0, 1),
                "{name} {summary:?}"
            );
            assert!(summary.deferred[0].reason.contains("waiting for the rest"), "{summary:?}");
        }
        // Never complete: rejected after a quarter of an hour without a change.
        let (summary, _) = watch(root, 1000.0, without_events(), &mut |_| ());
        assert_eq!((summary.failed.len(), summary.deferred.len()), (1, 0), "{name}");
        assert_eq!(std::fs::read(root.join("failed").join(name)).unwrap(), tail, "unchanged");
    }
    let root = fresh_root();
    drop_in(root.path(), "letter.jpg", b"Dear Sir or Madam");
    let (summary, _) = watch(root.path(), 10.0, without_events(), &mut |_| ());
    assert_eq!(summary.failed.len(), 1, "nothing to wait for");
}

#[test]
fn once_leaves_recently_changed_incomplete_photos() {
    let root = fresh_root();
    let root = root.path();
    let whole = file(Format::Jpeg, 8, RIG);
    drop_in(root, "a.jpg", &whole[..whole.len() / 2]);
    let clock = TestClock::default();
    let (mut restorer, mut watcher) = (Brightener::default(), ());
    let folders = Folders::open(root).unwrap();
    // With the calendar that dates the file, and with one that jumped into the past.
    for calendar in [SystemTime::now(), UNIX_EPOCH] {
        let calendar = || calendar;
        let folders = Folders::on(
            std::sync::Arc::new(relens::disk::LocalDisk::new(vec![folders.root.to_owned()])),
            &folders.root,
        )
        .unwrap();
        let mut daemon =
            Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher)
                .unwrap();
        let summary = daemon.once(&|| false).unwrap();
        assert_eq!((summary.failed.len(), summary.deferred.len()), (0, 1), "{summary:?}");
    }
    drop(folders);
    assert_eq!(once(root).failed.len(), 1, "rejected years later");
}

#[test]
fn photos_are_found_without_events_however_they_arrive() {
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
    let (summary, restored) = watch(root, 60.0, without_events(), &mut come);
    assert_eq!(restored, 5, "{summary:?}");
    let all = ["plain.png", "moved.png", "linked.png", "holiday-1.png", "holiday-sea-1.png"];
    assert_eq!(names(&root.join("done")), set(&all));
    assert_eq!(std::fs::read(aside.join("linked.png")).unwrap(), bytes, "its other name stays");
    assert_eq!(names(&root.join("inbox")), set(&["holiday"]), "nothing is deleted");
}

#[test]
fn events_trigger_scans_also_in_a_flood() {
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
fn a_photo_moved_in_is_restored_within_two_seconds() {
    let root = fresh_root();
    let root = root.path();
    let bytes = file(Format::Png, 8, RIG);
    std::fs::create_dir_all(root.join("aside/sea")).unwrap();
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    // An existing folder is watched as well.
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
            // Copied: possibly incomplete.
            std::fs::write(root.join("inbox/copied.png"), &bytes).unwrap();
        }
        let names = ["a.png", "sea-b.png", "hills-c.png"];
        if names.iter().all(|name| root.join("done").join(name).exists()) {
            taken = now.min(taken);
        }
        assert!(
            now > 25.0 || !root.join("done/copied.png").exists(),
            "a copy must settle, restored at {now} s"
        );
    };
    let (summary, restored) = watch(root, 60.0, setting(), &mut come);
    let came = came.unwrap();
    assert_eq!(restored, 4, "{summary:?}");
    assert!(taken <= came + 2.0, "moved at {came} s, done at {taken} s");
}

#[test]
fn a_new_inbox_is_found_within_five_seconds() {
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
    watch(root, 200.0, without_events(), &mut come);
    let made = made.unwrap();
    assert!(seen <= made + 5.0, "made at {made} s, seen at {seen} s");
}

#[test]
fn the_state_counts_waiting_photos_by_what_they_wait_for() {
    let root = fresh_root();
    let root = root.path();
    let whole = file(Format::Jpeg, 8, Size::new(256, 192));
    drop_in(root, "half.jpg", &whole[..whole.len() / 2]);
    let mut dropped = false;
    let states = RefCell::new(Vec::new());
    let mut look = |now: f64| {
        if now > 30.0 && !dropped {
            dropped = true;
            drop_in(root, "whole.jpg", &whole);
        }
        if let Some(state) = State::read(root).unwrap() {
            let words = state.counts.to_string();
            if states.borrow().last() != Some(&words) {
                states.borrow_mut().push(words);
            }
        }
    };
    watch(root, 60.0, without_events(), &mut look);
    let none = "0 restored, 0 unchanged, 0 failed";
    let one = "1 restored, 0 unchanged, 0 failed";
    let half = "1 for the rest of the file";
    let wanted = [
        format!("{none}, 0 waiting"),
        format!("{none}, 1 waiting (1 arriving)"),
        format!("{none}, 1 waiting ({half})"),
        format!("{none}, 2 waiting (1 arriving, {half})"),
        format!("{one}, 1 waiting ({half})"),
    ];
    let states = states.into_inner();
    let mut rest = states.iter();
    for words in &wanted {
        assert!(rest.any(|state| state == words), "{words}, in order, in {states:#?}");
    }
    // A restarted daemon counts the files present.
    watch(root, 10.0, without_events(), &mut |_| ());
    let counts = State::read(root).unwrap().unwrap().counts.to_string();
    assert_eq!(counts, format!("{one}, 1 waiting ({half})"), "after a restart");
    // The gallery page of an idle box shows the same count, with name and reason.
    let page = || std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    let mut pages = Vec::new();
    let mut look = |now: f64| {
        if (100.0..110.0).contains(&now) && root.join("inbox/half.jpg").exists() {
            pages.push(page());
            std::fs::remove_file(root.join("inbox/half.jpg")).unwrap();
        }
    };
    watch(root, 140.0, without_events(), &mut look);
    assert!(pages[0].contains(&format!("<b>1</b> waiting ({half})")), "{}", pages[0]);
    assert!(pages[0].contains("<b>half.jpg</b> <span>"), "{}", pages[0]);
    assert!(!page().contains("half.jpg") && !page().contains("waiting ("), "{}", page());
}

#[test]
fn each_folder_may_be_a_link_to_one_elsewhere() {
    let (root, elsewhere) = (fresh_root(), tempfile::tempdir().unwrap());
    let root = root.path();
    for name in ["inbox", "working", "outbox", "done", "failed"] {
        std::fs::create_dir(elsewhere.path().join(name)).unwrap();
        std::os::unix::fs::symlink(elsewhere.path().join(name), root.join(name)).unwrap();
    }
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    drop_in(root, "b.png", b"Dear Sir");
    let summary = once(root);
    assert_eq!((summary.restored.len(), summary.failed.len()), (1, 1), "{summary:?}");
    for path in ["done/a.png", "outbox/a.png", "failed/b.png"] {
        assert!(elsewhere.path().join(path).is_file(), "{path}");
    }
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
    // The outbox inside the inbox, through a link.
    let other = fresh_root();
    let other = other.path();
    std::fs::create_dir_all(other.join("inbox/results")).unwrap();
    std::os::unix::fs::symlink(other.join("inbox/results"), other.join("outbox")).unwrap();
    let refused = Folders::open(other).err().unwrap().to_string();
    assert!(
        refused.contains("inbox/results is inside") && refused.contains("must be separate"),
        "{refused}"
    );
}

#[test]
fn a_photo_written_to_after_it_was_taken_is_restored_again() {
    use std::io::Write;
    let whole = file(Format::Jpeg, 8, RIG);
    let root = fresh_root();
    let root = root.path();
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    // Another program holds the file open, and appends to it after it was restored.
    let mut open = std::fs::File::create(root.join("inbox/a.jpg")).unwrap();
    open.write_all(&whole).unwrap();
    let (mut trailer, mut added_at) = (Some(b"ftypmp42 and a movie"), 0.0);
    let (summary, restored) = watch(root, 600.0, without_events(), &mut |now| {
        if root.join("done/a.jpg").exists() && trailer.is_some() {
            open.write_all(trailer.take().unwrap()).unwrap();
            added_at = now;
        }
    });
    assert!(trailer.is_none() && added_at > 0.0);
    assert_eq!((restored, summary.restored.len(), summary.failed.len()), (2, 1, 0), "{summary:?}");
    assert_eq!(names(&root.join("done")), set(&["a.jpg"]));
    let kept = std::fs::read(root.join("done/a.jpg")).unwrap();
    assert_eq!(kept, [&whole[..], b"ftypmp42 and a movie"].concat());
    assert_eq!(summary.restored[0].photo_bytes, kept.len() as u64);
}

#[test]
fn a_photo_written_to_while_it_is_restored_waits_for_the_next_attempt() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    let more = file(Format::Png, 16, RIG);
    struct Writer<'a>(&'a Path, &'a [u8]);
    impl relens::daemon::Watcher for Writer<'_> {
        fn step(&mut self, step: relens::daemon::JobStep) {
            if step == relens::daemon::JobStep::Restored {
                std::fs::write(self.0.join("working/a.png"), self.1).unwrap();
            }
        }
    }
    let mut writer = Writer(root, &more);
    let summary = once_with(root, &mut Brightener::default(), &mut writer).unwrap();
    assert_eq!((summary.restored.len(), summary.deferred.len()), (0, 1), "{summary:?}");
    assert!(summary.deferred[0].reason.contains("written to while"), "{summary:?}");
    assert_eq!(std::fs::read(root.join("inbox/a.png")).unwrap(), more);
    assert!(names(&root.join("outbox")).iter().all(|name| !name.starts_with("a.")));
}

#[test]
fn a_copy_that_reserved_its_space_is_waited_for() {
    let root = fresh_root();
    let root = root.path();
    // Only the header of a plain picture (PGM) has been copied; its rows are still to come.
    let mut whole = b"P5 64 48 255\n".to_vec();
    whole.extend((0..64 * 48).map(|n| (n % 251) as u8));
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    let copy = std::fs::File::create(root.join("inbox/a.pgm")).unwrap();
    std::os::unix::fs::FileExt::write_all_at(&copy, &whole[..13], 0).unwrap();
    copy.set_len(1 << 20).unwrap();
    let (summary, restored) = watch(root, 100.0, without_events(), &mut |_| ());
    assert_eq!((restored, summary.deferred.len(), summary.failed.len()), (0, 1, 0), "{summary:?}");
    copy.set_len(whole.len() as u64).unwrap();
    std::os::unix::fs::FileExt::write_all_at(&copy, &whole, 0).unwrap();
    let (_, restored) = watch(root, 100.0, without_events(), &mut |_| ());
    assert_eq!(restored, 1);
}
