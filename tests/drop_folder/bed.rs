//! Test bed: size of the rig, clock, a restorer that brightens, generated files.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use relens::config::Curve;
use relens::daemon::{
    Daemon, DaemonError, DaemonSetting, Folders, Progress, Restorer, Summary, Watcher,
};
use relens::deconvolution::stage::ResultStage;
use relens::frame::{Channel, Frame, Mosaic, Plane, Size, Work};
use relens::light_path::Interrupted;
use relens::picture::{Dng, Format, Limits, Manner, Photo, RawTags, encode};
use relens::pipeline::{CertifiedFocus, Iteration, OpticalResidual, Outcome, Verdict};
use relens::remedy::{AnyFailure, Remediable, Remedy};
use relens::rig::{Clock, Moment};

pub const RIG: Size = Size::new(64, 48);

/// Present of these tests' calendar, so far in the future that every file in an inbox is years old.
pub const CALENDAR_UNIX_S: u64 = 4_000_000_000;

/// A simulated clock: waiting advances it at once.
#[derive(Default)]
pub struct TestClock(pub Cell<f64>);

impl Clock for TestClock {
    fn now(&self) -> Moment {
        Moment(self.0.get())
    }
    fn wait_until(&self, moment: Moment) {
        self.0.set(self.0.get().max(moment.0));
    }
}

#[derive(Debug, thiserror::Error)]
#[error("the lamp is out")]
pub struct LampOut(pub Remedy);

impl Remediable for LampOut {
    fn remedy(&self) -> Remedy {
        self.0
    }
}

/// Adds ten grey levels of light, or fails as scripted.
#[derive(Default)]
pub struct Brightener {
    /// Failures to come, the next one last.
    pub failures: Vec<Remedy>,
    pub mended: Vec<Remedy>,
    pub cannot_mend: bool,
    /// Whether repairs are cancelled.
    pub gives_up: bool,
    pub untouched: bool,
    pub panics: bool,
    pub restored: usize,
}

impl Restorer for Brightener {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        progress(Progress { done: 0.5, doing: "brightening", captures: 1 });
        assert!(!self.panics, "told to");
        if let Some(remedy) = self.failures.pop() {
            return Err(Box::new(LampOut(remedy)));
        }
        self.restored += 1;
        Ok(Outcome {
            verdict: if self.untouched { Verdict::Untouched } else { Verdict::Sound },
            method: "brighten",
            stage: ResultStage::LensModel,
            captures: 1,
            seconds: 0.5,
            certificate: Some(OpticalResidual {
                focus: CertifiedFocus::Photo,
                of_any_sensor: false,
                residual_grey_levels: 1.0,
                floor_grey_levels: 1.0,
            }),
            iterations: vec![Iteration { residual_grey_levels: 1.0, captures: 1, seconds: 0.5 }],
            ..Outcome::untouched(
                Frame::from_fn(|c| photo.light.plane(c).map(|v| v + 10.0)),
                "told to",
            )
        })
    }

    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        self.mended.push(remedy);
        if self.gives_up {
            return Err(Box::new(Interrupted));
        }
        if self.cannot_mend { Err(Box::new(LampOut(Remedy::CallOperator))) } else { Ok(()) }
    }
}

pub fn setting() -> DaemonSetting {
    DaemonSetting::new("test rig", RIG, Curve::Srgb)
}

pub fn once_with(
    root: &Path,
    restorer: &mut Brightener,
    watcher: &mut dyn Watcher,
) -> Result<Summary, DaemonError> {
    let clock = TestClock::default();
    let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let folders = Folders::open(root)?;
    Daemon::open(folders, setting(), restorer, &clock, &calendar, watcher)?.once(&|| false)
}

pub fn once(root: &Path) -> Summary {
    once_with(root, &mut Brightener::default(), &mut ()).unwrap()
}

pub fn scene(size: Size) -> Frame<Work> {
    Frame::from_fn(|c| Plane::from_fn(size, |x, y| ((x * 3 + y * 2) % 200 + 10 * c.index()) as f32))
}

pub fn file(format: Format, bits: u8, size: Size) -> Vec<u8> {
    encode("scene", &scene(size), &Manner::plain(format, bits, Curve::Srgb), false).unwrap()
}

/// A raw photo whose sites all record the scene's green light.
pub fn raw_file(size: Size) -> Vec<u8> {
    let sites = scene(size).plane(Channel::Green).map(|v: f32| 64 + 3 * v as u16);
    let (mosaic, camera, tags) = (Mosaic::Gbrg, "rig", RawTags::default());
    let (black, white, exposure_s, crop) = (64.0, 1023, None, None);
    Dng { sites: &sites, mosaic, black, white, camera, exposure_s, crop, tags }.bytes()
}

pub fn drop_in(root: &Path, name: &str, bytes: &[u8]) {
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    std::fs::write(root.join("inbox").join(name), bytes).unwrap();
}

/// Visible names in a folder, without those of the gallery.
pub fn names(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    names.filter(|n| !n.starts_with('.') && n != "index.html" && n != "gallery").collect()
}

pub fn set(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(|&n| n.to_owned()).collect()
}

pub fn read_back(path: &Path) -> Photo {
    Photo::read(path, Curve::Srgb, &Limits::default()).unwrap()
}

/// A new root folder, in memory if possible: these tests synchronise a thousand files.
pub fn fresh_root() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() {
        tempfile::tempdir_in(memory).unwrap()
    } else {
        tempfile::tempdir().unwrap()
    }
}
