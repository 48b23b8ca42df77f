//! Removal by the limits of `[keep]`: the oldest files and nothing else, also across power cuts.

use std::cell::Cell;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::{Duration, SystemTime};

use relens::config::Keep;
use relens::daemon::{Daemon, DaemonSetting, Delivered, Folders, Schedule, Summary};
use relens::picture::Format;

use crate::bed::*;
use crate::model_disk::Contents;
use crate::power::{Age, Found, Label, filled, good, live_at, search_at};
use crate::power_checks::{Dropped, nothing_is_orphaned};

const DAY: Duration = Duration::from_secs(86_400);

const KEEP: Keep = Keep {
    results_days_max: 30.0,
    results_mib_max: f64::INFINITY,
    originals_days_max: 60.0,
    originals_mib_max: f64::INFINITY,
};

/// A night that may still withdraw these.
struct Night(Vec<Delivered>);

impl Schedule for Night {
    fn unproven(&self) -> &[Delivered] {
        &self.0
    }
}

/// An unattended box.
struct Later<'a> {
    root: &'a Path,
    keep: Keep,
    /// Days from now.
    days: u32,
    believed: bool,
    unproven: Vec<Delivered>,
    floor_bytes: u64,
}

fn later(root: &Path, days: u32) -> Later<'_> {
    Later { root, keep: KEEP, days, believed: true, unproven: vec![], floor_bytes: 0 }
}

impl Later<'_> {
    fn believed(mut self, believed: bool) -> Self {
        self.believed = believed;
        self
    }

    /// Runs until the inbox is empty.
    fn live(self) -> Summary {
        let Later { root, keep, days, believed, unproven, floor_bytes } = self;
        let (clock, mut restorer, mut watcher) = (TestClock::default(), Brightener::default(), ());
        // The disk dates moved files by the machine's calendar.
        let calendar = || SystemTime::now() + days * DAY;
        let folders = Folders::open(root).unwrap();
        let setting = DaemonSetting { floor_bytes, ..setting() };
        let believed = || believed;
        let daemon =
            Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
        let mut daemon = daemon.scheduled(Box::new(Night(unproven))).keeping(keep, &believed);
        daemon.once().unwrap()
    }
}

/// Restores `photos`: results are dated so many days from now, originals today.
fn done(root: &Path, photos: &[(&str, u32)]) {
    for &(name, days) in photos {
        drop_in(root, name, &file(Format::Png, 8, RIG));
        assert_eq!(later(root, days).live().restored.len(), 1);
    }
}

#[test]
fn files_past_their_age_are_removed_and_nothing_else() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "bad.png", b"Dear Sir or Madam");
    done(root, &[("a.png", 0), ("b.png", 15)]);
    std::fs::write(root.join("outbox/mine.txt"), "not of relens").unwrap();
    std::fs::write(root.join("outbox/mine.json"), "{\"not\": \"a report\"}").unwrap();
    let all = set(&["a.png", "a.png.json", "b.png", "b.png.json", "mine.txt", "mine.json"]);
    let failed = names(&root.join("failed"));

    later(root, 29).live();
    assert_eq!(names(&root.join("outbox")), all);
    let days = 31;
    later(root, days).believed(false).live();
    assert_eq!(names(&root.join("outbox")), all, "the date is unknown");

    later(root, days).live();
    assert_eq!(names(&root.join("outbox")), set(&["b.png", "b.png.json", "mine.txt", "mine.json"]));
    assert_eq!(names(&root.join("done")), set(&["a.png", "b.png"]));
    let pictures = names(&root.join("outbox/gallery"));
    assert_eq!(pictures.iter().filter(|name| name.ends_with(".jpg")).count(), 3, "{pictures:?}");
    let page = std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    assert!(!page.contains("a.png") && page.contains("b.png"));
    assert!(page.contains("results 1, originals 0"), "{page}");

    later(root, 61).live();
    assert!(names(&root.join("done")).is_empty());
    assert_eq!(names(&root.join("outbox")), set(&["mine.txt", "mine.json"]));
    assert_eq!(names(&root.join("failed")), failed, "rejected photos are never removed");
    let page = std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    assert!(page.contains("results 2, originals 2"), "{page}");
}

/// MiB of the files in `folder` with this `ending`.
fn mib(folder: &Path, ending: &str) -> f64 {
    let files = names(folder)
        .into_iter()
        .filter(|name| name.ends_with(ending))
        .map(|name| folder.join(name));
    files.map(|file| file.metadata().unwrap().len() as f64).sum::<f64>() / f64::from(1 << 20)
}

#[test]
fn beyond_the_size_the_oldest_are_removed_except_unproven_and_reserved_ones() {
    let root = fresh_root();
    let root = root.path();
    done(root, &[("a.png", 1), ("b.png", 2), ("c.png", 3), ("d.png", 4)]);
    // Room for two and a half of the four, which are nearly of one size.
    let results_mib_max =
        0.625 * (mib(&root.join("outbox"), "") + mib(&root.join("outbox/gallery"), ".jpg"));
    let originals_mib_max = 0.625 * mib(&root.join("done"), "");
    let keep = Keep { results_mib_max, originals_mib_max, ..Keep::default() };
    let unproven = vec![Delivered { kept: "a.png".into(), result: "a.png".into() }];
    // A photo that waits in the inbox, whose interrupted job has reserved the name b.png.
    drop_in(root, "b", b"Dear Sir or Madam");
    let file = std::fs::metadata(root.join("inbox/b")).unwrap();
    let record = serde_json::json!({
        "photo": b"b", "attempts": 1, "result": b"b.png",
        "file": {
            "inode": file.ino(), "size": file.len(),
            "changed": [file.mtime(), file.mtime_nsec()],
        },
    });
    std::fs::write(root.join("working/.ledger-1"), record.to_string()).unwrap();
    Later { keep, unproven, believed: false, ..later(root, 9) }.live();
    let kept = set(&["a.png", "a.png.json", "b.png", "b.png.json"]);
    assert_eq!(names(&root.join("outbox")), kept, "unproven, and reserved");
    assert_eq!(names(&root.join("done")), set(&["a.png", "d.png"]));

    let keep = Keep { results_mib_max: results_mib_max / 2.0, ..keep };
    Later { keep, believed: false, ..later(root, 9) }.live();
    assert_eq!(names(&root.join("outbox")), set(&["b.png", "b.png.json"]));
}

#[test]
fn a_full_disk_triggers_removal_and_the_photo_waits() {
    let root = fresh_root();
    let root = root.path();
    done(root, &[("a.png", 0)]);
    drop_in(root, "b.png", &file(Format::Png, 8, RIG));
    let (clock, mut restorer, mut watcher) = (TestClock::default(), Brightener::default(), ());
    let (days, believed) = (Cell::new(0), || true);
    let calendar = || SystemTime::now() + days.get() * DAY;
    let floor = DaemonSetting { floor_bytes: u64::MAX, ..setting() };
    let folders = Folders::open(root).unwrap();
    let daemon =
        Daemon::open(folders, floor, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    // Everything ages while the photo waits for space.
    daemon.keeping(KEEP, &believed).run(&|| {
        days.set(if clock.0.get() > 300.0 { 99 } else { 0 });
        if clock.0.get() < 290.0 {
            assert!(root.join("outbox/a.png").is_file());
        }
        clock.0.get() > 600.0
    });
    assert!(!root.join("outbox/a.png").exists() && !root.join("done/a.png").exists());
    assert!(root.join("inbox/b.png").is_file(), "the disk is as full as before");
}

/// A photo restored a month ago, past the limits now: power cuts at every instant, any number of
/// times.
fn search(skip: Option<&Label>) -> Result<Found, String> {
    let photo = good("a.png", 30.0);
    let begun = Age { calendar_unix_s: 0, ..Age::default() };
    let life = live_at(begun, filled(std::slice::from_ref(&photo), None), None, false);
    let (end, _) = life.instants.last().ok_or("no instants")?;
    let start = Contents::after(&end.now(), end.folders());
    // The model disk dates files by their inodes, and the photo's is 1.
    let keep = Keep { results_days_max: 30.0, originals_days_max: 30.0, ..Keep::default() };
    let age = Age { calendar_unix_s: 1 + 30 * DAY.as_secs(), keep, ..Age::default() };
    search_at(age, vec![start], &[Dropped { past_limits: true, ..photo }], skip, &|disk, _| {
        nothing_is_orphaned(disk)
    })
}

#[test]
fn removal_survives_power_cuts_and_needs_each_synchronisation() {
    let found = search(None).unwrap();
    println!("{} states of the disk, {} cuts", found.states, found.cuts);
    let removals = found.labels.iter().filter(|(_, words, _)| words.starts_with("remove"));
    // Result, report, three pictures, original; temporary files are removed at every start.
    let removals: Vec<_> = removals.filter(|(_, words, _)| !words.contains("temporary")).collect();
    assert!(removals.len() >= 6 && found.cuts > 100, "{removals:?}, {} cuts", found.cuts);
    for words in ["sync folder box/outbox", "sync folder box/outbox/gallery"] {
        // The first synchronisation of the outbox is that at the start.
        let ours = found.labels.iter().rfind(|(_, w, _)| w == words).unwrap();
        let harm = search(Some(ours)).expect_err("omitted without harm");
        println!("{ours:?}: {harm}");
    }
}
