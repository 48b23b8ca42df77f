//! A thousand photos, one in twenty broken, with two power cuts, two losses of the camera and one
//! full disk: each is accounted for once, and memory does not grow. `RELENS_SOAK_PHOTOS=n` sets the
//! number.

use std::cell::{Cell, RefCell};
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, UNIX_EPOCH};

use relens::daemon::{Daemon, DaemonSetting, Folders, JobStep, Watcher};
use relens::disk::{Disk, FileKind, LocalDisk, Metadata, Unsynced};
use relens::frame::{Frame, Plane, Work};
use relens::picture::{Format, Manner, encode};
use relens::remedy::Remedy;

use crate::bed::*;

/// The machine's disk, which can be made full.
struct Fillable(LocalDisk, Arc<AtomicBool>);

impl Disk for Fillable {
    fn list(&self, folder: &Path) -> io::Result<Vec<(OsString, FileKind)>> {
        self.0.list(folder)
    }
    fn metadata(&self, path: &Path) -> io::Result<Metadata> {
        self.0.metadata(path)
    }
    fn open(&self, path: &Path) -> io::Result<File> {
        self.0.open(path)
    }
    fn free_bytes(&self, folder: &Path) -> io::Result<u64> {
        if self.1.load(Ordering::SeqCst) { Ok(1 << 20) } else { self.0.free_bytes(folder) }
    }
    fn make_folder(&self, folder: &Path) -> io::Result<()> {
        self.0.make_folder(folder)
    }
    fn write(&self, path: &Path, content: &mut dyn Read) -> io::Result<Box<dyn Unsynced>> {
        if self.1.load(Ordering::SeqCst) {
            Err(ErrorKind::StorageFull.into())
        } else {
            self.0.write(path, content)
        }
    }
    fn sync_file(&self, path: &Path) -> io::Result<()> {
        self.0.sync_file(path)
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.0.rename(from, to)
    }
    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.0.rename_new(from, to)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        self.0.remove(path)
    }
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        self.0.sync_folder(folder)
    }
}

/// Cuts the power during two photos and fills the disk during a third.
struct Night<'a> {
    photos: &'a Cell<usize>,
    of: usize,
    full: &'a AtomicBool,
    resident_kib: &'a RefCell<Vec<u64>>,
}

impl Watcher for Night<'_> {
    fn step(&mut self, step: JobStep) {
        if step == JobStep::Claimed {
            self.photos.set(self.photos.get() + 1);
            if self.photos.get().is_multiple_of(self.of / 10) {
                self.resident_kib.borrow_mut().push(resident_kib());
            }
        }
        let n = self.photos.get();
        if (n == self.of / 3 && step == JobStep::Named)
            || (n == self.of / 2 && step == JobStep::Delivered)
        {
            // Cut only once.
            self.photos.set(n + 1);
            std::panic::resume_unwind(Box::new("the power fails"));
        }
        if n == self.of * 2 / 3 && step == JobStep::Restored {
            self.full.store(true, Ordering::SeqCst);
        }
    }
}

/// Resident memory of this process, KiB.
fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap();
    line.trim().trim_end_matches(" kB").trim().parse().unwrap()
}

#[test]
fn a_thousand_photos_are_all_accounted_for() {
    let of =
        std::env::var("RELENS_SOAK_PHOTOS").ok().and_then(|n| n.parse().ok()).unwrap_or(1000usize);
    let root = fresh_root();
    let root = root.path().canonicalize().unwrap();
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    let bad = |n: usize| n % 20 == 7;
    for n in 0..of {
        let light: Frame<Work> =
            Frame::from_fn(|_| Plane::from_fn(RIG, |x, y| ((n * 7 + x * 3 + y) % 200) as f32));
        let whole =
            encode("p", &light, &Manner::plain(Format::Png, 8, relens::config::Curve::Srgb), false)
                .unwrap();
        let bytes = if bad(n) { b"Dear Sir or Madam".to_vec() } else { whole };
        std::fs::write(root.join(format!("inbox/p{n:05}.png")), bytes).unwrap();
    }
    let full = Arc::new(AtomicBool::new(false));
    let (photos, resident, clock) = (Cell::new(0), RefCell::new(vec![]), TestClock::default());
    let dates = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let (mut lives, mut restored) = (0, 0);
    loop {
        lives += 1;
        // The camera is lost twice, for all attempts of a job.
        let failures = if lives > 1 { vec![Remedy::ReopenRig; 3] } else { vec![] };
        let mut restorer = Brightener { failures, ..Brightener::default() };
        let mut watcher = Night { photos: &photos, of, full: &full, resident_kib: &resident };
        let setting = DaemonSetting { hints: false, ..setting() };
        let freed = Cell::new(0);
        let lived = catch_unwind(AssertUnwindSafe(|| {
            let anchors: Vec<PathBuf> = vec![root.clone()];
            let disk = Arc::new(Fillable(LocalDisk::new(anchors), Arc::clone(&full)));
            let folders = Folders::on(disk, &root).unwrap();
            let mut daemon =
                Daemon::open(folders, setting, &mut restorer, &clock, &dates, &mut watcher)
                    .unwrap();
            daemon.run(&|| {
                // Space is freed after a while.
                if full.load(Ordering::SeqCst) {
                    freed.set(freed.get() + 1);
                    full.store(freed.get() < 1000, Ordering::SeqCst);
                }
                std::fs::read_dir(root.join("inbox")).unwrap().next().is_none()
            });
        }));
        restored += restorer.restored;
        if lived.is_ok() {
            break;
        }
    }
    assert_eq!(lives, 3, "two power cuts");
    let broken = (0..of).filter(|&n| bad(n)).count();
    let good = of - broken;
    assert_eq!(
        (names(&root.join("done")).len(), names(&root.join("failed")).len()),
        (good, 2 * broken)
    );
    let outbox = names(&root.join("outbox"));
    assert_eq!(outbox.len(), 2 * good);
    assert!(
        (0..of).all(|n| outbox.contains(&format!("p{n:05}.png")) != bad(n)),
        "each under its own name, none twice"
    );
    assert!(names(&root.join("inbox")).is_empty() && names(&root.join("working")).is_empty());
    // Two were restored again: one after a cut before its delivery, one after the full disk.
    assert_eq!(restored, good + 2);
    let resident = resident.into_inner();
    println!("{good} restored, {broken} rejected, in {lives} runs; memory {resident:?} KiB");
    let (early, late) = (resident[resident.len() / 3], *resident.last().unwrap());
    // Other tests run in the same process; one photo leaked each time would be 37 MiB in all.
    assert!(late < early + (24 << 10), "memory grew from {early} to {late} KiB");
}
