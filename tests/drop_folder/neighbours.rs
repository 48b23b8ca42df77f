//! Two boxes on one set of folders: each photo goes to exactly one, and none is lost with a box.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant, UNIX_EPOCH};

use relens::daemon::{Daemon, DaemonSetting, Folders, JobStep, Summary, Watcher};
use relens::picture::Format;
use relens::rig::{Clock, Moment};
use rustix::fs::{FlockOperation, flock};

use crate::bed::*;

fn shared(root: &Path, name: &str) -> Folders {
    Folders::open_shared(root, name.as_ref()).unwrap()
}

/// The time as it is: two boxes at once have no other in common.
struct RealClock(Instant);

impl Clock for RealClock {
    fn now(&self) -> Moment {
        Moment(self.0.elapsed().as_secs_f64())
    }
    fn wait_until(&self, moment: Moment) {
        std::thread::sleep(Duration::from_secs_f64((moment.0 - self.now().0).max(0.0)));
    }
}

/// One box working until `stop` says so, told the time.
fn work(
    root: &Path,
    name: &str,
    watcher: &mut dyn Watcher,
    stop: &dyn Fn(f64) -> bool,
) -> (Summary, usize) {
    work_by(&TestClock::default(), setting(), root, name, watcher, stop)
}

fn work_by(
    clock: &dyn Clock,
    setting: DaemonSetting,
    root: &Path,
    name: &str,
    watcher: &mut dyn Watcher,
    stop: &dyn Fn(f64) -> bool,
) -> (Summary, usize) {
    let mut restorer = Brightener::default();
    let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let setting = DaemonSetting { hints: false, ..setting };
    let mut daemon =
        Daemon::open(shared(root, name), setting, &mut restorer, clock, &calendar, watcher)
            .unwrap();
    let summary = daemon.run(&|| stop(clock.now().0));
    drop(daemon);
    (summary, restorer.restored)
}

fn all_done(root: &Path, photos: usize) {
    assert_eq!(names(&root.join("done")).len(), photos);
    let outbox = names(&root.join("outbox"));
    assert_eq!(outbox.len(), 2 * photos, "a result and a report each: {outbox:?}");
    for folder in ["inbox", "working/left", "working/right", "failed"] {
        assert!(names(&root.join(folder)).is_empty(), "{folder}");
    }
}

#[test]
fn two_boxes_share_the_work_and_never_a_photo() {
    const PHOTOS: usize = 60;
    let root = fresh_root();
    let root = root.path();
    for n in 0..PHOTOS {
        // Some of them namesakes by another case.
        let name = if n % 10 == 9 { format!("P{}.PNG", n - 1) } else { format!("p{n}.png") };
        drop_in(root, &name, &file(Format::Png, 8, RIG));
    }
    let restored = AtomicUsize::new(0);
    let over = |_: f64| names(&root.join("done")).len() == PHOTOS;
    std::thread::scope(|scope| {
        for name in ["left", "right"] {
            let (restored, over) = (&restored, &over);
            scope.spawn(move || {
                let setting = DaemonSetting { quiet_s: 0.0, poll_s: 0.01, ..setting() };
                let (_, count) =
                    work_by(&RealClock(Instant::now()), setting, root, name, &mut (), over);
                restored.fetch_add(count, Ordering::SeqCst)
            });
        }
    });
    assert_eq!(restored.load(Ordering::SeqCst), PHOTOS, "none was restored twice");
    all_done(root, PHOTOS);
}

/// Dies at a step, or does something first.
struct At<'a>(JobStep, &'a dyn Fn());

impl Watcher for At<'_> {
    fn step(&mut self, step: JobStep) {
        if step == self.0 {
            (self.1)();
        }
    }
}

#[test]
fn a_dead_boxs_photos_are_taken_over_when_its_lease_has_run_out() {
    for step in JobStep::ALL {
        let root = fresh_root();
        let root = root.path();
        drop_in(root, "a.png", &file(Format::Png, 8, RIG));
        let die = || std::panic::resume_unwind(Box::new("the power fails"));
        let died =
            catch_unwind(AssertUnwindSafe(|| work(root, "left", &mut At(step, &die), &|_| false)));
        assert!(died.is_err(), "{step:?}");
        let waits = !root.join("done/a.png").exists();
        let (_, early) = work(root, "right", &mut (), &|now| now > 200.0);
        assert_eq!(
            waits,
            !root.join("done/a.png").exists(),
            "{step:?}: not before the lease has run out"
        );
        let (_, late) = work(root, "right", &mut (), &|now| now > 400.0);
        let delivered = step >= JobStep::Delivered;
        assert_eq!(early + late, usize::from(!delivered), "{step:?}");
        all_done(root, 1);
    }
}

#[test]
fn a_box_that_only_slept_gives_up_what_was_taken_over() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    let other_works = || {
        let (_, restored) = work(root, "right", &mut (), &|now| now > 400.0);
        assert_eq!(restored, 1, "taken over while the other slept");
    };
    let (summary, restored) =
        work(root, "left", &mut At(JobStep::Restored, &other_works), &|now| now > 100.0);
    assert_eq!(
        (restored, summary.restored.len()),
        (1, 0),
        "restored and not delivered: {summary:?}"
    );
    all_done(root, 1);
}

#[test]
fn a_box_slower_than_its_lease_delivers_what_nobody_took_over() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    drop(shared(root, "right"));
    let clock = TestClock::default();
    let takes_long = || clock.wait_until(Moment(clock.now().0 + 1000.0));
    let mut slow = At(JobStep::Restored, &takes_long);
    let (summary, restored) =
        work_by(&clock, setting(), root, "left", &mut slow, &|now| now > 1500.0);
    assert_eq!((restored, summary.restored.len()), (1, 1), "{summary:?}");
    all_done(root, 1);
}

#[test]
fn a_box_that_cannot_renew_its_lease_delivers_nothing_until_it_can() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    drop(shared(root, "right"));
    let (clock, lease) = (TestClock::default(), root.join("working/left/.relens-lease"));
    let first = std::cell::Cell::new(true);
    let is_slow_and_its_disk_fails = || {
        if first.replace(false) {
            clock.wait_until(Moment(clock.now().0 + 1000.0));
            std::fs::remove_file(&lease).unwrap();
            std::fs::create_dir_all(lease.join("in the way")).unwrap();
        }
    };
    let fails = |now: f64| {
        let delivered = root.join("outbox/a.png").exists() || root.join("done/a.png").exists();
        assert!(!delivered || !lease.is_dir(), "delivered without a lease");
        if now > 1030.0 && lease.is_dir() {
            assert!(
                names(&root.join("inbox")).contains("a.png"),
                "meanwhile it is for whoever can"
            );
            std::fs::remove_dir_all(&lease).unwrap();
        }
        now > 2000.0
    };
    let mut slow = At(JobStep::Restored, &is_slow_and_its_disk_fails);
    let (summary, restored) = work_by(&clock, setting(), root, "left", &mut slow, &fails);
    assert_eq!((restored, summary.restored.len()), (2, 1), "{summary:?}");
    all_done(root, 1);
}

#[test]
fn a_box_that_starts_while_another_looks_whether_it_is_alone_joins_it() {
    let root = fresh_root();
    let root = root.path();
    let lock = std::fs::File::create(root.join(".relens-lock")).unwrap();
    flock(&lock, FlockOperation::NonBlockingLockExclusive).unwrap();
    std::thread::scope(|scope| {
        let joined = scope.spawn(|| Folders::open_shared(root, "left".as_ref()).is_ok());
        std::thread::sleep(Duration::from_millis(300));
        flock(&lock, FlockOperation::NonBlockingLockShared).unwrap();
        assert!(joined.join().unwrap());
    });
}

#[test]
fn names_of_boxes_are_held_to_one_box_each_and_a_box_alone_shares_with_nobody() {
    let root = fresh_root();
    let root = root.path();
    for bad in ["", ".", "..", ".hidden", "a/b"] {
        assert!(Folders::open_shared(root, bad.as_ref()).is_err(), "{bad}");
    }
    let left = shared(root, "left");
    assert!(
        Folders::open_shared(root, "left".as_ref()).unwrap_err().to_string().contains("in use")
    );
    assert!(Folders::open(root).unwrap_err().to_string().contains("in use"));
    let right = shared(root, "right");
    drop((left, right));
    let alone = Folders::open(root).unwrap();
    assert!(Folders::open_shared(root, "left".as_ref()).is_err());
    drop(alone);
}
