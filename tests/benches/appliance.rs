//! Computing time and peak memory of restoring a photo on the box, from file to file, simulator
//! excluded: photos of 1024×768 in colour on ideal.toml (default method) and on simulated.toml,
//! with the lens as measured and with a lens touched since; larger photos of simulated.toml's lens
//! with finer pixels, solved on binned pixels; and photos of a rig of 2048×1536.
//!
//! A first process calibrates, photographs and restores on the simulated rig, and stores the
//! calibration and the frames of its camera. For each photo another process reads its file,
//! restores it from the stored frames and encodes the result; its times and its peak resident
//! memory (`VmHWM`) are printed.
//!
//! Run: `cargo bench --bench appliance`; `-- sizes` for the larger photos only; `-- one raw.dng 4`
//! for a single photo with four times the pixels along each side.

// A failed unwrap ends the benchmark.
#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout)]

use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use relens::calibration::store as slots;
use relens::chart::scenes::Scene;
use relens::config::{self, Glare, Kind, RigFile};
use relens::frame::binning::bin;
use relens::frame::resample::resize;
use relens::frame::{Codes, Counts, Frame, Plane, Size, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::{Dng, Format, Manner, RawTags, ReadOptions, Tone, encode};
use relens::restorer::Restorer;
use relens::restorer::on_rig::OnRig;
use relens::rig::exposure::{Devices, Timing};
use relens::rig::simulated::RawPhoto;
use relens::rig::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger, simulated};

#[path = "../lab/sized.rs"]
mod sized;

use sized::sized;

/// Environment variable with the folder of a [`Stand`], set for the other processes.
const STORED: &str = "RELENS_BENCH_STORED";
/// Environment variable with the name of the stand's rig.
const RIG: &str = "RELENS_BENCH_RIG";
/// Environment variable with the number of the photo's pixels along each side of a solved pixel.
const BINNING: &str = "RELENS_BENCH_BINNING";
/// Environment variable with a command that runs this program on another processor
/// (`tests/cross/instructions`).
const RUNNER: &str = "RELENS_BENCH_RUNNER";
/// Environment variable with the photo's file name.
const PHOTO: &str = "RELENS_BENCH_PHOTO";

const PHOTOS: [&str; 3] = ["developed.png", "developed.jpg", "raw.dng"];
const IDEAL: &str = include_str!("../../rig-config/ideal.toml");
const SIMULATED: &str = include_str!("../../rig-config/simulated.toml");
/// simulated.toml with twice the pixels along each side.
const LARGE: &str = "simulated.toml of 2048x1536";

fn main() {
    let variable = |name| std::env::var(name).ok();
    if let (Some(folder), Some(rig)) = (variable(STORED), variable(RIG)) {
        let binning = variable(BINNING).unwrap().parse().unwrap();
        return restore_stored(Path::new(&folder), &rig, binning, &variable(PHOTO).unwrap());
    }
    let words: Vec<String> = std::env::args().collect();
    if let Some(n) = words.iter().position(|word| word == "one") {
        let (photo, binning) = (&words[n + 1], words[n + 2].parse().unwrap());
        let stand = Stand::record("simulated.toml", false);
        stand.store_photos(binning);
        return stand.restore(photo, binning);
    }
    if !words.iter().any(|word| word == "sizes") {
        for name in ["ideal.toml", "simulated.toml"] {
            for is_touched in [false, true] {
                Stand::record(name, is_touched).restore("developed.png", 1);
            }
        }
    }
    let small = Stand::record("simulated.toml", false);
    for binning in [1, 2, 4, 6, 8] {
        small.store_photos(binning);
        PHOTOS.iter().for_each(|photo| small.restore(photo, binning));
    }
    let large = Stand::record(LARGE, false);
    for binning in [1, 2, 4] {
        large.store_photos(binning);
        PHOTOS[1..].iter().for_each(|photo| large.restore(photo, binning));
    }
}

/// The rig called `name`.
fn rig(name: &str) -> RigFile {
    match name {
        "ideal.toml" => config::parse(IDEAL, name).unwrap(),
        LARGE => sized(&config::parse(SIMULATED, name).unwrap(), 2.0),
        _ => config::parse(SIMULATED, name).unwrap(),
    }
}

/// `rig` with a camera of `binning` times the pixels along each side, which are binned.
fn before_finer_pixels(mut rig: RigFile, binning: usize) -> RigFile {
    rig.camera.binning = binning;
    rig
}

/// Seconds since the first call.
fn seconds() -> f64 {
    static BEGUN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// The rig with a fingerprint on its lens. Share and width of the scattered light are guesses.
fn with_fingerprint(mut rig: RigFile) -> RigFile {
    if let Kind::Simulated(simulation) = &mut rig.kind {
        let glare = &mut simulation.glare;
        *glare = Glare { share: 0.2, radius_px: 6.0 };
    }
    rig
}

/// A folder with a calibration, photos, and the camera's frames of one restoration.
struct Stand {
    name: &'static str,
    rig: RigFile,
    folder: tempfile::TempDir,
    /// The developed photo, linear light.
    light: Frame<Work>,
    raw: Option<RawPhoto>,
    black: f64,
    white: u16,
}

impl Stand {
    fn record(name: &'static str, is_touched: bool) -> Stand {
        let state = if is_touched { "lens touched since calibration" } else { "lens as measured" };
        println!("\n{name}, {state}:");
        let rig = rig(name);
        let folder = tempfile::tempdir().unwrap();
        let calibration =
            calibrate(&mut simulated::open(&rig).unwrap().0, &rig, None, &mut to_the_end).unwrap();
        slots::save(folder.path(), &calibration).unwrap();
        let now = if is_touched { with_fingerprint(rig.clone()) } else { rig.clone() };
        let (_, witness) = simulated::open(&now).unwrap();
        let tone = Tone::of_curve(rig.photo.curve, 8);
        let codes = Scene::Astronaut.codes(rig.photo.size());
        let rounded = |plane: &Plane| plane.map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
        let scene: Frame<Work> = Frame::from_fn(|c| tone.plane(c, &rounded(codes.plane(c))));
        let codes = witness.photograph(&scene, 1);
        let light = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
        let raw = witness.photograph_raw(&scene, 1);
        let (black, white) = (witness.black_level_counts(), witness.white_count().round() as u16);
        let stand = Stand { name, rig, folder, light, raw, black, white };
        stand.store_photos(1);

        for photo in PHOTOS {
            stand.record_frames(photo, simulated::open(&now).unwrap().0);
        }
        stand
    }

    /// Restores the stored `photo` on `devices`, and stores the frames of their camera.
    fn record_frames(&self, photo: &str, mut devices: Devices) {
        if !self.folder.path().join(photo).exists() {
            return;
        }
        let frames = Arc::new(Mutex::new(Vec::new()));
        let nothing: Box<dyn Camera + Send> = Box::new(StoredCamera::default());
        let inner = std::mem::replace(&mut devices.camera, nothing);
        devices.camera = Box::new(RecordingCamera { inner, frames: Arc::clone(&frames) });
        let folder = self.folder.path();
        let mut restorer =
            OnRig::new(&self.rig, devices, folder.to_owned(), None, Arc::new(seconds), |_| {})
                .unwrap();
        let file = std::fs::File::open(folder.join(photo)).unwrap();
        let read = ReadOptions::of(&self.rig).photo_of_file(photo, file).unwrap();
        restorer.restore(&read, &mut |_| {}).unwrap();
        for (n, counts) in frames.lock().unwrap().iter().enumerate() {
            store(&folder.join(frame_name(photo, n)), counts);
        }
    }

    /// Stores the photo as if taken by a camera with `binning` times the pixels along each side:
    /// developed as PNG and JPEG, and raw.
    fn store_photos(&self, binning: usize) {
        let Size { width, height } = self.light.size();
        let size = Size::new(binning * width, binning * height);
        let light = Frame::from_fn(|c| resize(self.light.plane(c), size));
        for (name, format) in [("developed.png", Format::Png), ("developed.jpg", Format::Jpeg)] {
            let manner = Manner::plain(format, 8, self.rig.photo.curve);
            let bytes = encode(name, &light, &manner, false).unwrap();
            std::fs::write(self.folder.path().join(name), bytes).unwrap();
        }
        let Some(raw) = &self.raw else { return };
        let (own, enlarged) = (
            &raw.sites,
            Plane::from_fn(size, |x, y| {
                // The nearest site of the same colour.
                let at =
                    |n: usize, most: usize| (n / binning / 2 * 2 + n % 2).min(most - 2 + n % 2);
                raw.sites.at(at(x, width), at(y, height))
            }),
        );
        let sites = if binning == 1 { own } else { &enlarged };
        let dng = Dng {
            sites,
            mosaic: raw.mosaic,
            black: self.black,
            white: self.white,
            camera: &self.rig.name,
            exposure_s: None,
            crop: None,
            tags: RawTags::default(),
        };
        std::fs::write(self.folder.path().join("raw.dng"), dng.bytes()).unwrap();
    }

    /// Restores `photo` of a camera with `binning` times the pixels along each side, in
    /// a process of its own.
    fn restore(&self, photo: &str, binning: usize) {
        let own = std::env::current_exe().unwrap().display().to_string();
        let runner = std::env::var(RUNNER).unwrap_or(own);
        let mut words = runner.split(' ');
        let ended = std::process::Command::new(words.next().unwrap())
            .args(words)
            .env(STORED, self.folder.path())
            .env(RIG, self.name)
            .env(BINNING, binning.to_string())
            .env(PHOTO, photo)
            // As in the systemd unit.
            .env("MALLOC_ARENA_MAX", "1")
            .status()
            .unwrap();
        assert!(ended.success());
    }
}

/// The file name of frame `n` of the restoration of `photo`.
fn frame_name(photo: &str, n: usize) -> String {
    format!("{photo}-{n}.frame")
}

/// Restores `photo` in `folder` as the box does, from file to file; prints the cost.
fn restore_stored(folder: &Path, name: &str, binning: usize, photo: &str) {
    let rig = before_finer_pixels(rig(name), binning);
    let frames = (0..).map(|n| folder.join(frame_name(photo, n))).take_while(|path| path.exists());
    let clock = Steps::default();
    let (frames, size) = (frames.collect(), rig.camera.size());
    let camera = StoredCamera { frames, size, binning, next: 0, clock: clock.clone() };
    let panel = NullPanel { size: rig.panel.size(), clock: clock.clone() };
    let devices = Devices::new(
        Box::new(panel),
        Box::new(clock.clone()),
        Box::new(camera),
        Box::new(clock),
        Timing::of(&rig.panel, &rig.camera),
    );
    let before = memory();
    let mut restorer =
        OnRig::new(&rig, devices, folder.to_owned(), None, Arc::new(seconds), |_| {}).unwrap();
    let opened = memory();
    let mut last = processor_seconds();
    let mut lap = || {
        let now = processor_seconds();
        now - std::mem::replace(&mut last, now)
    };
    let mut options = ReadOptions::of(&rig);
    // Photos of 50 megapixels are beyond the usual limit.
    options.limits.pixels_max = 1 << 26;
    let file = std::fs::File::open(folder.join(photo)).unwrap();
    let read = options.photo_of_file(photo, file).unwrap();
    let (reading, peak_reading) = (lap(), memory());
    let outcome = restorer.restore(&read, &mut |_| {}).unwrap();
    let (restoring, peak_restoring) = (lap(), memory());
    let bytes = read.with_picture(outcome.delivered(&read), read.manner.format).unwrap();
    let (writing, size) = (lap(), read.light.size());
    println!(
        "{photo}, {size}, solved at {}, by {}, {} captures, {}: read {reading:.2} s, restored \
         {restoring:.2} s, encoded to {:.1} MB {writing:.2} s of processor time, {:.2} s a \
         megapixel; peak memory {:.0} MiB ({before:.0} before, {opened:.0} with the lens, \
         {peak_reading:.0} with the photo, {peak_restoring:.0} restored)",
        rig.photo.size(),
        outcome.method,
        outcome.captures,
        if outcome.verdict == relens::pipeline::Verdict::Sound { "sound" } else { "not sound" },
        bytes.len() as f64 / 1e6,
        restoring / (size.area() as f64 / 1e6),
        memory()
    );
}

/// Peak resident memory so far, MiB.
fn memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}

/// User and system time of all threads, seconds (proc(5): fields 14 and 15, in ticks of 1/100 s).
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let after_name = stat.rsplit(')').next().unwrap();
    let ticks = |n: usize| after_name.split_whitespace().nth(n).unwrap().parse::<f64>().unwrap();
    (ticks(11) + ticks(12)) / 100.0
}

fn store(path: &Path, counts: &Counts) {
    let bytes = counts.planes().iter().flat_map(|p| p.data()).flat_map(|v| v.to_le_bytes());
    std::fs::write(path, bytes.collect::<Vec<u8>>()).unwrap();
}

fn load(path: &Path, size: Size) -> Counts {
    let mut file = BufReader::new(std::fs::File::open(path).unwrap());
    Counts::from_fn(|_| {
        Plane::from_fn(size, |_, _| {
            let mut count = [0; 2];
            file.read_exact(&mut count).unwrap();
            u16::from_le_bytes(count)
        })
    })
}

/// A camera that records the frames of another one.
struct RecordingCamera {
    inner: Box<dyn Camera + Send>,
    frames: Arc<Mutex<Vec<Counts>>>,
}

impl Camera for RecordingCamera {
    fn size(&self) -> Size {
        self.inner.size()
    }
    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        let exposed = self.inner.frame(deadline)?;
        self.frames.lock().unwrap().push(exposed.counts.clone());
        Ok(exposed)
    }
    fn reopen(&mut self) -> Result<(), RigError> {
        self.inner.reopen()
    }
}

/// A camera that delivers stored frames, then the last one again and again.
#[derive(Default)]
struct StoredCamera {
    frames: Vec<PathBuf>,
    size: Size,
    binning: usize,
    next: usize,
    clock: Steps,
}

impl Camera for StoredCamera {
    fn size(&self) -> Size {
        self.size
    }
    fn frame(&mut self, _: Moment) -> Result<Exposed, RigError> {
        let mut counts = load(&self.frames[self.next.min(self.frames.len() - 1)], self.size);
        self.next += 1;
        if self.binning > 1 {
            // A camera that bins takes a frame of its own pixels and delivers their means.
            let (Size { width, height }, by) = (self.size, self.binning);
            let own: Counts = Frame::from_fn(|c| {
                let size = Size::new(by * width, by * height);
                Plane::from_fn(size, |x, y| counts.plane(c).at(x / by, y / by))
            });
            counts = Frame::from_fn(|c| bin(own.plane(c), by).map(|mean: f32| mean.round() as u16));
        }
        Ok(Exposed { counts, sequence: self.next as u32, at: self.clock.now() })
    }
    fn reopen(&mut self) -> Result<(), RigError> {
        Ok(())
    }
}

/// A panel without effect.
struct NullPanel {
    size: Size,
    clock: Steps,
}

impl Panel for NullPanel {
    fn size(&self) -> Size {
        self.size
    }
    fn show(&mut self, _: &Codes) -> Result<Flip, RigError> {
        Ok(Flip { at: self.clock.now(), vblank: 0 })
    }
}

/// A clock that only waiting advances, and a trigger on it.
#[derive(Clone, Default)]
struct Steps(Arc<Mutex<f64>>);

impl Clock for Steps {
    fn now(&self) -> Moment {
        Moment(*self.0.lock().unwrap())
    }
    fn wait_until(&self, moment: Moment) {
        let mut now = self.0.lock().unwrap();
        *now = now.max(moment.0);
    }
}

impl Trigger for Steps {
    fn fire(&mut self) -> Result<Moment, RigError> {
        Ok(self.now())
    }
}
