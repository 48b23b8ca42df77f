//! Computing time and peak memory of a photo of 1024×768 in colour on the box, simulator excluded:
//! on ideal.toml (default method) and on simulated.toml, with the lens as measured and touched
//! since.
//!
//! A first process calibrates, photographs and restores on the simulated rig and stores the frames
//! of its camera. A second process restores the same photo from the stored frames; printed are its
//! times and its peak resident memory (`VmHWM`).
//!
//! Run: `cargo bench --bench appliance`

// A failed unwrap ends the benchmark.
#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout)]

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use relens::calibration::Calibration;
use relens::chart::scenes::Scene;
use relens::config::{self, Glare, Kind};
use relens::frame::{Channels, Codes, Counts, Frame, Plane, Size, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::Tone;
use relens::pipeline::{PhotoData, Pipeline, method};
use relens::rig::exposure::{Devices, Timing};
use relens::rig::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger, simulated};

/// Variable with the folder of stored frames, set for the second process.
const STORED: &str = "RELENS_BENCH_STORED";
/// Variable with the name of its rig file.
const RIG: &str = "RELENS_BENCH_RIG";

/// Rig files by name.
const RIGS: [(&str, &str); 2] = [
    ("ideal.toml", include_str!("../../rig-config/ideal.toml")),
    ("simulated.toml", include_str!("../../rig-config/simulated.toml")),
];

fn main() {
    if let Some(folder) = std::env::var_os(STORED) {
        return restore_stored(Path::new(&folder), &std::env::var(RIG).unwrap());
    }
    for (name, _) in RIGS {
        [false, true].into_iter().for_each(|is_touched| record(name, is_touched));
    }
}

fn rig(name: &str) -> config::RigFile {
    let (_, text) = RIGS.iter().find(|(of, _)| *of == name).unwrap();
    config::parse(text, name).unwrap()
}

/// Seconds since the first call.
fn seconds() -> f64 {
    static BEGUN: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// The rig with a fingerprint on its lens. Share and width of the scattered light are guesses.
fn with_fingerprint(mut rig: config::RigFile) -> config::RigFile {
    if let Kind::Simulated(simulation) = &mut rig.kind {
        let glare = &mut simulation.glare;
        *glare = Glare { share: 0.2, radius_px: 6.0 };
    }
    rig
}

fn record(name: &str, is_touched: bool) {
    println!(
        "\n{name}, {}:",
        if is_touched { "lens touched since calibration" } else { "lens as measured" }
    );
    let rig = rig(name);
    let folder = tempfile::tempdir().unwrap();
    let calibration =
        calibrate(&mut simulated::open(&rig).unwrap().0, &rig, None, &mut to_the_end).unwrap();
    let now = if is_touched { with_fingerprint(rig.clone()) } else { rig.clone() };
    let (mut devices, witness) = simulated::open(&now).unwrap();
    std::fs::write(folder.path().join("calibration"), postcard::to_allocvec(&calibration).unwrap())
        .unwrap();
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let codes = Scene::Astronaut.codes(rig.photo.size());
    let rounded = |plane: &Plane| plane.map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
    let light: Frame<Work> = Frame::from_fn(|c| tone.plane(c, &rounded(codes.plane(c))));
    let codes = witness.photograph(&light, 1);
    let photo: Frame<Work> = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
    store(&folder.path().join("photo"), photo.planes());

    let frames = Arc::new(Mutex::new(Vec::new()));
    let nothing: Box<dyn Camera + Send> =
        Box::new(StoredCamera { frames: Vec::new(), next: 0, clock: Steps::default() });
    let inner = std::mem::replace(&mut devices.camera, nothing);
    devices.camera = Box::new(RecordingCamera { inner, frames: Arc::clone(&frames) });
    restore(&rig, &calibration, &photo, &mut devices);
    for (n, counts) in frames.lock().unwrap().iter().enumerate() {
        let planes: Vec<Plane> = counts.planes().iter().map(|p| p.map(f32::from)).collect();
        store(&folder.path().join(format!("frame-{n}")), &planes);
    }
    drop(devices);
    let program = std::env::current_exe().unwrap();
    let ended = std::process::Command::new(program)
        .env(STORED, folder.path())
        .env(RIG, name)
        .status()
        .unwrap();
    assert!(ended.success());
}

fn restore_stored(folder: &Path, name: &str) {
    let rig = rig(name);
    let calibration: Calibration =
        postcard::from_bytes(&std::fs::read(folder.join("calibration")).unwrap()).unwrap();
    let photo = Frame::from_planes(load(&folder.join("photo"), rig.photo.size()));
    let mut frames = Vec::new();
    while let Some(path) =
        Some(folder.join(format!("frame-{}", frames.len()))).filter(|p| p.exists())
    {
        let planes = load(&path, rig.camera.size());
        frames.push(Counts::from_planes(planes.map(|p| p.map(|v: f32| v as u16))));
    }
    let clock = Steps::default();
    let camera = StoredCamera { frames, next: 0, clock: clock.clone() };
    let panel = NullPanel { size: rig.panel.size(), clock: clock.clone() };
    let mut devices = Devices::new(
        Box::new(panel),
        Box::new(clock.clone()),
        Box::new(camera),
        Box::new(clock),
        Timing::of(&rig.panel, &rig.camera),
    );
    let before = memory();
    let Cost { computing_s, captures, processor_s } =
        restore(&rig, &calibration, &photo, &mut devices);
    let (size, method) = (rig.photo.size(), rig.restore.method.name());
    println!("{method}, {size} in colour, {captures} captures, no simulator");
    println!(
        "computing          {computing_s:6.2} s ({processor_s:.2} s of processor time, {:.2} s a \
         megapixel)",
        processor_s / (size.area() as f64 / 1e6)
    );
    println!(
        "peak memory        {:6.0} MiB ({before:.0} MiB with photo and frames read)",
        memory()
    );
}

/// Cost of a restoration without judging.
struct Cost {
    computing_s: f64,
    captures: usize,
    processor_s: f64,
}

/// Restores `photo`; prints the cost of judging apart.
fn restore(
    rig: &config::RigFile,
    calibration: &Calibration,
    photo: &Frame<Work>,
    devices: &mut Devices,
) -> Cost {
    let before = memory();
    let pipeline = Pipeline::new(rig, calibration).unwrap().timed_by(Arc::new(seconds));
    println!("lens model and corrections: {:.0} MiB", memory() - before);
    let solver = method(rig, rig.restore.method);
    let (begun, processor) = (seconds(), processor_seconds());
    let mut watch = |_: &relens::deconvolution::method::Step, _: Option<&Frame<Work>>| {};
    let prepared = pipeline.prepare(PhotoData::developed(photo, Channels::Colour));
    let restored = pipeline.solve(devices, &prepared, &*solver, &mut watch).unwrap();
    let (solved, solved_processor) = (seconds(), processor_seconds());
    pipeline.judge(&prepared, &restored, &mut watch).unwrap();
    println!(
        "judging            {:6.2} s of processor time",
        processor_seconds() - solved_processor
    );
    Cost {
        computing_s: solved - begun - restored.waited_seconds,
        captures: restored.captures,
        processor_s: solved_processor - processor,
    }
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

fn store(path: &Path, planes: &[Plane]) {
    let bytes = planes.iter().flat_map(|p| p.data()).flat_map(|v| v.to_le_bytes());
    std::fs::write(PathBuf::from(path), bytes.collect::<Vec<u8>>()).unwrap();
}

fn load(path: &Path, size: Size) -> [Plane; 3] {
    let bytes = std::fs::read(path).unwrap();
    let values: Vec<f32> =
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let mut planes =
        values.chunks_exact(size.area()).map(|v| Plane::from_vec(size, v.to_vec()).unwrap());
    std::array::from_fn(|_| planes.next().unwrap())
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
struct StoredCamera {
    frames: Vec<Counts>,
    next: usize,
    clock: Steps,
}

impl Camera for StoredCamera {
    fn size(&self) -> Size {
        self.frames[0].size()
    }
    fn frame(&mut self, _: Moment) -> Result<Exposed, RigError> {
        let counts = self.frames[self.next.min(self.frames.len() - 1)].clone();
        self.next += 1;
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
