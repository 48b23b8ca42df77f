//! Photos read in worker processes equal those read here, and the harm that a file can do is
//! limited.
//!
//! There is only one test, because it measures the memory of its own process.

// Shared test functions may panic as tests do.
#![allow(clippy::unwrap_used)]

use std::fs::File;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use relens::config::Curve;
use relens::daemon::{Daemon, DaemonSetting, Folders, JobStep, Progress, Restorer, Watcher};
use relens::frame::{Frame, Mosaic, Plane, Size, Work};
use relens::picture::worker::Worker;
use relens::picture::{
    ColorType, Dng, Format, Limits, Manner, Photo, PictureError, RawTags, ReadOptions, encode,
};
use relens::pipeline::Outcome;
use relens::remedy::{AnyFailure, Remedy};
use relens::rig::{Clock, Moment};

const RIG: Size = Size::new(64, 48);

fn worker() -> Worker {
    Worker::of(env!("CARGO_BIN_EXE_relens").into())
}

fn picture(manner: &Manner, size: Size) -> Vec<u8> {
    let scene: Frame<Work> = Frame::from_fn(|c| {
        Plane::from_fn(size, |x, y| ((x * 3 + y * 2 + 9 * c.index()) % 200) as f32)
    });
    encode("scene", &scene, manner, !manner.colour.has_color()).unwrap()
}

fn kept(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn read(worker: &Worker, path: &Path) -> Result<Photo, PictureError> {
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    worker.photo(&name, File::open(path).unwrap(), &ReadOptions::new(RIG, Curve::Srgb))
}

/// A grey JPEG of 6400×4800 pixels in 0.4 MB, made without memory for its pixels.
fn bomb() -> Vec<u8> {
    let mut grey = Manner::plain(Format::Jpeg, 8, Curve::Srgb);
    grey.colour = ColorType::L8;
    let mut bytes = picture(&grey, RIG);
    let frame = bytes.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    bytes[frame + 5..frame + 9].copy_from_slice(&[0x12, 0xc0, 0x19, 0x00]);
    let scan = bytes.windows(2).position(|w| w == [0xff, 0xda]).unwrap();
    bytes.truncate(scan + 2 + usize::from(bytes[scan + 3]));
    // Four blocks equal to the one before, of six bits each with the usual codes (T.81, annex K.3).
    bytes.extend([0x28, 0xa2, 0x8a].repeat(6400 * 4800 / 64 / 4));
    bytes.extend([0xff, 0xd9]);
    bytes
}

/// Peak memory of this process, KiB.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").trim().parse().unwrap()
}

/// Returns each photo unchanged.
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
}

struct Still;

impl Clock for Still {
    fn now(&self) -> Moment {
        Moment(0.0)
    }
    fn wait_until(&self, _: Moment) {}
}

/// Reads the records in `working` after each recorded attempt.
struct Attempts(PathBuf, Vec<String>);

impl Watcher for Attempts {
    fn step(&mut self, step: JobStep) {
        if step == JobStep::Recorded {
            let records = std::fs::read_dir(&self.0).unwrap().flatten();
            let records =
                records.filter(|e| e.file_name().to_string_lossy().starts_with(".ledger-"));
            self.1.extend(records.map(|e| std::fs::read_to_string(e.path()).unwrap()));
        }
    }
}

#[test]
fn a_file_can_kill_its_worker_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();

    // A worker returns what this process reads, to the last bit.
    let icc = moxcms::ColorProfile::new_display_p3().encode().unwrap();
    for (format, bits, colour) in [
        (Format::Jpeg, 8, ColorType::Rgb8),
        (Format::Png, 8, ColorType::L8),
        (Format::Png, 16, ColorType::Rgba16),
        (Format::Tiff, 16, ColorType::Rgb16),
    ] {
        let mut manner = Manner::plain(format, bits, Curve::Srgb);
        (manner.colour, manner.icc) = (colour, (bits == 16).then(|| icc.clone()));
        for size in [RIG, Size::new(128, 96)] {
            let path = kept(folder, &format!("a.{}", format.extension()), &picture(&manner, size));
            let here =
                Photo::read(&path, Curve::Srgb, &Limits::default()).unwrap().fit(RIG).unwrap();
            let there = read(&worker(), &path).unwrap();
            assert_eq!(format!("{here:?}"), format!("{there:?}"), "{format:?} {colour:?} {size}");
        }
    }
    let sites = Plane::from_fn(RIG, |x, y| (64 + 13 * x + 2 * y) as u16);
    let (mosaic, camera) = (Mosaic::Grbg, "rig");
    let raw = Dng {
        sites: &sites,
        mosaic,
        black: 64.0,
        white: 1023,
        camera,
        exposure_s: None,
        crop: None,
        tags: RawTags::default(),
    }
    .bytes();
    let path = kept(folder, "a.dng", &raw);
    let here = Photo::read(&path, Curve::Srgb, &Limits::default()).unwrap();
    assert_eq!(format!("{here:?}"), format!("{:?}", read(&worker(), &path).unwrap()));
    let path = kept(folder, "half.jpg", &bomb()[..200]);
    let here = Photo::read(&path, Curve::Srgb, &Limits::default()).unwrap_err();
    let there = read(&worker(), &path).unwrap_err();
    assert_eq!((here.to_string(), here.growth()), (there.to_string(), there.growth()));
    let whole = |path: &Path| worker().whole("x", File::open(path).unwrap(), &Limits::default());
    assert!(whole(&path).is_err() && whole(&kept(folder, "bomb.jpg", &bomb())).is_ok());

    // A worker reads a camera's frame as this process does, and refuses a cut one.
    let frame = picture(&Manner::plain(Format::Jpeg, 8, Curve::Srgb), RIG);
    let here = relens::picture::camera_frame(&frame, RIG).unwrap();
    assert_eq!(worker().frame(&frame, RIG).unwrap(), here);
    let words = worker().frame(&frame[..frame.len() / 2], RIG).unwrap_err().to_string();
    assert!(words.contains("cut short"), "{words}");
    assert!(worker().frame(&bomb(), RIG).is_err(), "a frame of another size");

    // A bomb takes half a gigabyte in its worker, and nothing in this process.
    let before = peak_kib();
    let photo = read(&worker(), &folder.join("bomb.jpg")).unwrap();
    assert_eq!(photo.stored, Size::new(6400, 4800));
    let grown = peak_kib() - before;
    assert!(grown < 16 << 10, "the daemon's memory grew by {grown} KiB");
    println!("a 30-megapixel bomb of {} bytes: the daemon grew by {grown} KiB", bomb().len());

    // A file that kills its worker gets three attempts, each recorded before it begins; then the
    // next photo is restored.
    let small = Worker { memory_bytes_max: 128 << 20, ..worker() };
    let died = read(&small, &folder.join("bomb.jpg")).unwrap_err();
    assert!(matches!(died, PictureError::Died { .. }), "{died}");
    let root = folder.join("box");
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    kept(&root, "inbox/a-bomb.jpg", &bomb());
    kept(&root, "inbox/b-good.png", &picture(&Manner::plain(Format::Png, 8, Curve::Srgb), RIG));
    let setting =
        DaemonSetting { worker: Some(small), ..DaemonSetting::new("test", RIG, Curve::Srgb) };
    let (mut restorer, mut watcher) = (Returner, Attempts(root.join("working"), vec![]));
    let calendar = || UNIX_EPOCH;
    let folders = Folders::open(&root).unwrap();
    let mut daemon =
        Daemon::open(folders, setting, &mut restorer, &Still, &calendar, &mut watcher).unwrap();
    let summary = daemon.once(&|| false).unwrap();
    drop(daemon);
    assert_eq!((summary.untouched.len(), summary.failed.len()), (1, 1), "{summary:?}");
    let reason = &summary.failed[0].reason;
    assert!(
        reason.contains("a-bomb.jpg") && reason.contains("found 3 such attempts, allowed 3"),
        "{reason}"
    );
    assert_eq!(
        watcher.1.iter().filter(|r| r.contains("\"attempts\":3")).count(),
        1,
        "{:?}",
        watcher.1
    );
    assert!(root.join("failed/a-bomb.jpg").is_file() && root.join("outbox/b-good.png").is_file());
    let grown = peak_kib() - before;
    assert!(grown < 24 << 10, "the daemon's memory grew by {grown} KiB");

    // Workers taken over by a file: one hangs, one answers nonsense, one answers without end, one
    // fails. The last worker's program is missing.
    for (script, wanted) in [
        ("exec sleep 100", "no answer within 1 s"),
        ("printf '\\005\\000\\000\\000abcde'", "an answer that cannot be read"),
        ("exec cat /dev/zero", "its answer was too long"),
        ("exit 3", "exit status: 3"),
    ] {
        let program = kept(folder, "taken-over", format!("#!/bin/sh\n{script}\n").as_bytes());
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let error =
            read(&Worker { wall_s_max: 1, ..Worker::of(program) }, &folder.join("bomb.jpg"));
        let words = error.unwrap_err().to_string();
        assert!(words.contains(wanted) && words.contains("bomb.jpg"), "{words}");
    }
    let error = read(&Worker::of(folder.join("nowhere")), &folder.join("bomb.jpg")).unwrap_err();
    assert_eq!(relens::remedy::Remediable::remedy(&error), Remedy::RetryLater, "{error}");

    // Last, because the peak remains: read in this process, the bomb takes this process's memory.
    let before = peak_kib();
    Photo::read(&folder.join("bomb.jpg"), Curve::Srgb, &Limits::default()).unwrap();
    assert!(peak_kib() - before > 100 << 10, "the measurement above works");
}
