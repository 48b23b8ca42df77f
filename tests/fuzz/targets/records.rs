//! The daemon's own records with arbitrary content: the ledger of a photo in progress, the night, a
//! report, a note on a failure, the state. No photo may be lost or duplicated, and no foreign
//! result and no file outside the folders may be touched.

#![no_main]

use std::cell::Cell;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use libfuzzer_sys::fuzz_target;
use relens::config::{ClockSource, Curve, Nights};
use relens::daemon::{Daemon, DaemonSetting, Folders, Nightly, Progress, Restorer, State, Times};
use relens::frame::{Frame, Plane, Size, Work};
use relens::nights::pilot::Drift;
use relens::picture::{Format, Manner, Photo, encode};
use relens::pipeline::Outcome;
use relens::remedy::{AnyFailure, Remedy};
use relens::rig::{Clock, Moment};

const RIG: Size = Size::new(16, 12);

#[derive(Default)]
struct Still(Cell<f64>);

impl Clock for Still {
    fn now(&self) -> Moment {
        Moment(self.0.get())
    }
    fn wait_until(&self, moment: Moment) {
        self.0.set(self.0.get().max(moment.0));
    }
}

/// Returns each photo, on a rig that never drifts.
struct Returner;

impl Restorer for Returner {
    fn restore(
        &mut self,
        photo: &Photo,
        _: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        Ok(Outcome { captures: 0, ..Outcome::untouched(photo.light.clone(), "as asked") })
    }
    fn mend(&mut self, _: Remedy) -> Result<(), AnyFailure> {
        Ok(())
    }
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        Ok(Some(Drift { noise_ratio: 1.0, ..Drift::default() }))
    }
}

fn photo(light: f32) -> Vec<u8> {
    let scene: Frame<Work> = Frame::from_fn(|_| Plane::filled(RIG, light));
    encode("photo", &scene, &Manner::plain(Format::Png, 8, Curve::Srgb), false).expect("a photo")
}

/// Number of files below `folder` whose content is `bytes`.
fn copies(folder: &Path, bytes: &[u8]) -> usize {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let count = |path: std::path::PathBuf| match path.is_dir() {
        true => copies(&path, bytes),
        false => usize::from(fs::read(&path).is_ok_and(|found| found == bytes)),
    };
    entries.map(count).sum()
}

fn nights() -> Nights {
    Nights {
        window: "always".into(),
        time_zone: "UTC".into(),
        clock: ClockSource::Battery,
        pilot_every_photos: 1,
        recalibrate: true,
    }
}

/// FNV-1a, which names the record of a photo in progress.
fn hash(name: &str) -> u64 {
    name.bytes()
        .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

/// Fills `root` like a box that was stopped with one photo in progress and one done.
fn stopped(root: &Path, under_way: &[u8], done: &[u8], written: &[u8]) {
    for folder in ["inbox", "working", "outbox/gallery", "done", "failed"] {
        fs::create_dir_all(root.join(folder)).expect("a folder");
    }
    let put = |name: &str, bytes: &[u8]| fs::write(root.join(name), bytes).expect("a file");
    put("working/a.png", under_way);
    put("done/c.png", done);
    put("outbox/c.png", b"the result of c");
    put("outbox/b.png", b"a foreign result");
    // The inode of the photo in progress, which only the disk knows.
    let about = fs::metadata(root.join("working/a.png")).expect("the photo");
    let file = format!(
        "{{\"inode\":{},\"size\":{},\"changed\":[{},{}]}}",
        about.ino(),
        about.size(),
        about.mtime(),
        about.mtime_nsec()
    );
    let known = |text: &[u8]| {
        let text = String::from_utf8_lossy(text).replace("@file", &file);
        let text = text.replace("@bytes", &under_way.len().to_string());
        text.replace("@crc", &format!("{:08x}", crc32fast::hash(under_way))).into_bytes()
    };
    let ledger = format!("working/.ledger-{:016x}", hash("a.png"));
    let names = [
        ledger.as_str(),
        ".relens-night.json",
        "outbox/a.png.json",
        "failed/d.png.txt",
        ".relens-state.json",
        "outbox/a.png",
    ];
    for (name, text) in names.into_iter().zip(written.split(|&byte| byte == 0)) {
        if !text.is_empty() {
            put(name, &known(text));
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let (under_way, done) = (photo(50.0), photo(90.0));
    let outside = tempfile::tempdir().expect("a folder");
    fs::write(outside.path().join("c.png"), b"untouched").expect("a file");
    let root = outside.path().join("box");
    stopped(&root, &under_way, &done, bytes);
    let _ = State::read(&root);
    {
        let clock = Still::default();
        let calendar = || UNIX_EPOCH + Duration::from_secs(4_000_000_000);
        let folders = Folders::open(&root).expect("valid folders");
        let times = Times { clock: &clock, calendar: &calendar, is_set: &|| true };
        let night = Nightly::new(&nights(), &folders, times).expect("valid hours");
        let setting = DaemonSetting {
            hints: false,
            floor_bytes: 0,
            ..DaemonSetting::new("test", RIG, Curve::Srgb)
        };
        let (mut restorer, mut watcher) = (Returner, ());
        let daemon = Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher);
        let _ = daemon.expect("valid folders").scheduled(Box::new(night)).once(&|| false);
    }
    for (name, photo) in [("under way", &under_way), ("done", &done)] {
        let found =
            ["inbox", "working", "done", "failed"].map(|folder| copies(&root.join(folder), photo));
        assert_eq!(
            found.iter().sum::<usize>(),
            1,
            "the photo {name} in inbox, working, done, failed: {found:?}"
        );
    }
    for result in [&b"a foreign result"[..], b"the result of c"] {
        assert_eq!(copies(&root.join("outbox"), result), 1, "{}", String::from_utf8_lossy(result));
    }
    let foreign = fs::read(outside.path().join("c.png")).expect("a file");
    assert_eq!(foreign, b"untouched");
    assert_eq!(fs::read_dir(outside.path()).expect("a folder").count(), 2);
});
