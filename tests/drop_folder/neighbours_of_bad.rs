//! Unreadable or immovable files do not delay a good photo behind them.

use std::io::{Error, ErrorKind};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant, UNIX_EPOCH};

use relens::daemon::{Daemon, Folders, Summary, Watcher};
use relens::disk::Disk;
use relens::picture::Format;

use crate::bed::*;
use crate::model_disk::{Contents, ModelDisk, Op, Verdict};
use crate::power_checks::ROOT;

/// Fault of the files called `bad-…`.
#[derive(Debug, Clone, Copy)]
enum Fault {
    /// Their metadata cannot be read.
    Hidden,
    /// They cannot be moved out of the inbox.
    Held,
    /// A sector cannot be read.
    Sector,
}

impl Fault {
    fn of(self, op: &Op) -> Option<Error> {
        let is_bad = |path: &Path| {
            path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("bad-"))
        };
        match (self, op) {
            (Fault::Hidden, Op::Read(path)) if is_bad(path) => Some(Error::from_raw_os_error(5)),
            (Fault::Held, Op::Rename(path, _)) if is_bad(path) => {
                Some(ErrorKind::PermissionDenied.into())
            }
            (Fault::Sector, Op::Sync(path)) if is_bad(path) => Some(Error::from_raw_os_error(5)),
            _ => None,
        }
    }
}

/// A disk with `bad` bad files and a good one dropped last, and the summary of a daemon that ran
/// once, or for `watch_s` seconds if given.
fn served(fault: Fault, bad: usize, watch_s: Option<f64>) -> (ModelDisk, Summary) {
    let guard = move |op: &Op, _: &Contents| fault.of(op).map_or(Ok(Verdict::Done), Err);
    let disk = ModelDisk::new(Contents::default(), Box::new(guard));
    disk.make_folder(Path::new(ROOT)).unwrap();
    let folders = Folders::on(Arc::new(disk.clone()), Path::new(ROOT)).unwrap();
    let photo = file(Format::Png, 8, RIG);
    for n in 0..bad {
        let path = folders.inbox.join(format!("bad-{n}.png"));
        disk.drop_in(&path, &photo, 10_000 + n as u64);
    }
    disk.drop_in(&folders.inbox.join("good.png"), &photo, 20_000);
    let (clock, mut restorer, mut watcher) = (TestClock::default(), Brightener::default(), ());
    let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let mut daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let summary = match watch_s {
        None => daemon.once(&|| false).unwrap(),
        Some(seconds) => daemon.run(&|| clock.0.get() > seconds),
    };
    drop(daemon);
    (disk, summary)
}

#[test]
fn a_good_photo_after_bad_ones_is_restored_within_ten_seconds() {
    for fault in [Fault::Hidden, Fault::Held, Fault::Sector] {
        for bad in [1, 4, 400] {
            for watch_s in [None, Some(10.0)] {
                let begun = Instant::now();
                let (disk, summary) = served(fault, bad, watch_s);
                let words = format!("{fault:?}, {bad} bad, {watch_s:?}");
                println!("{words}: {:.1} s", begun.elapsed().as_secs_f64());
                assert!(begun.elapsed() < Duration::from_secs(10), "{words}");
                assert_eq!(summary.restored.len(), 1, "{words}");
                assert_eq!((summary.deferred.len(), summary.failed.len()), (bad, 0), "{words}");
                let now = disk.contents().now();
                for failed in &summary.deferred {
                    let path = Path::new(ROOT).join("inbox").join(&failed.photo);
                    assert!(now.contains_key(&path), "{words}: {} stays", path.display());
                    assert!(!failed.reason.contains("working"), "{words}: {}", failed.reason);
                    assert!(failed.reason.contains("copy"), "instructions: {}", failed.reason);
                }
            }
        }
    }
}

/// A root with `files` bad files in the inbox.
fn with_bad(files: usize) -> tempfile::TempDir {
    let root = fresh_root();
    for n in 0..files {
        drop_in(root.path(), &format!("bad-{n}.png"), b"this is no photo");
    }
    root
}

/// Names of photos in the order in which they were begun.
struct Turns(Vec<String>);

impl Watcher for Turns {
    fn begun(&mut self, name: &str, _: usize, _: usize) {
        self.0.push(name.to_owned());
    }
}

#[test]
fn the_newest_photo_waits_for_one_bad_photo_only() {
    let root = with_bad(20);
    let root = root.path();
    std::thread::sleep(Duration::from_millis(20));
    for good in ["good-1.png", "good-2.png"] {
        drop_in(root, good, &file(Format::Png, 8, RIG));
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut turns = Turns(Vec::new());
    let summary = once_with(root, &mut Brightener::default(), &mut turns).unwrap();
    assert_eq!((summary.restored.len(), summary.failed.len()), (2, 20));
    let good = turns.0.iter().rposition(|name| name.starts_with("good")).unwrap();
    assert!(good <= 3, "two good, one bad before each: {:?}", turns.0);
}

/// Drops a good photo at the first turn; each turn takes a second.
struct Dropper<'a> {
    root: &'a Path,
    clock: &'a TestClock,
    turns: Vec<String>,
}

impl Watcher for Dropper<'_> {
    fn begun(&mut self, name: &str, _: usize, _: usize) {
        if self.turns.is_empty() {
            drop_in(self.root, "good.png", &file(Format::Png, 8, RIG));
        }
        self.clock.0.set(self.clock.0.get() + 1.0);
        self.turns.push(name.to_owned());
    }
}

#[test]
fn a_photo_dropped_meanwhile_does_not_wait_for_all_bad_ones() {
    let root = with_bad(40);
    let root = root.path();
    let (clock, mut restorer) = (TestClock::default(), Brightener::default());
    let mut watcher = Dropper { root, clock: &clock, turns: Vec::new() };
    let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let folders = Folders::open(root).unwrap();
    let mut daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let summary = daemon.run(&|| clock.0.get() > 90.0);
    drop(daemon);
    assert_eq!((summary.restored.len(), summary.failed.len()), (1, 40));
    let good = watcher.turns.iter().position(|name| name == "good.png").unwrap();
    // Five seconds of quiet, and five until the next scan.
    assert!(good <= 12, "{:?}", watcher.turns);
}
