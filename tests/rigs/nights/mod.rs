//! Nights on the small simulated rig: drift is detected by captures alone and corrected.

mod given_up;

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use relens::calibration::store;
use relens::config::{self, ClockSource, Nights};
use relens::daemon::{
    Daemon, DaemonSetting, Doing, Folders, Nightly, Progress, Restorer, State, Summary, Times,
};
use relens::deconvolution::stage::ResultStage;
use relens::frame::{Frame, Plane, Work};
use relens::nights::pilot::Drift;
use relens::picture::{Format, Manner, Photo, encode};
use relens::pipeline::{Outcome, Verdict};
use relens::remedy::{AnyFailure, Remedy};
use relens::restorer::on_rig::{self, OnRig};
use relens::rig::simulated::{self, Witness};
use relens::rig::{Clock, Moment};

/// A simulated clock: waiting advances it at once.
#[derive(Default)]
struct TestClock(Cell<f64>);

impl Clock for TestClock {
    fn now(&self) -> Moment {
        Moment(self.0.get())
    }
    fn wait_until(&self, moment: Moment) {
        self.0.set(self.0.get().max(moment.0));
    }
}

/// A calibrated rig and its restorer.
struct NightRig {
    config: config::RigFile,
    restorer: OnRig,
    witness: Witness,
}

fn rig(slots: &Path) -> NightRig {
    let config = config::load(Path::new("small.toml")).unwrap();
    let (mut devices, witness) = simulated::open(&config).unwrap();
    on_rig::measure(&config, &mut devices, slots, |_| {}, None).unwrap_or_else(|e| panic!("{e}"));
    let method = Some(config::MethodName::Digital);
    let restorer = OnRig::new(&config, devices, slots.to_owned(), method, Arc::new(|| 0.0), |_| {});
    let restorer = restorer.unwrap_or_else(|e| panic!("{e}"));
    NightRig { config, restorer, witness }
}

#[test]
fn the_pilot_measures_changes_of_the_rig() {
    let slots = tempfile::tempdir().unwrap();
    let NightRig { mut restorer, mut witness, .. } = rig(slots.path());
    let mut pilot = || restorer.pilot().unwrap_or_else(|e| panic!("{e}")).unwrap();
    let at_rest = pilot();
    println!("at rest: {at_rest:?}");
    assert_eq!(at_rest.complaint(), None);
    assert!(
        at_rest.shift_px < 0.02
            && at_rest.gain_percent.abs() < 0.3
            && at_rest.offset_levels.abs() < 0.3
    );
    assert!((0.9..1.1).contains(&at_rest.noise_ratio));

    witness.knock_panel(0.4, -0.3);
    let knocked = pilot();
    println!("knocked by 0.5 px: {knocked:?}");
    assert!((knocked.shift_px - 0.5).abs() < 0.05);
    witness.knock_panel(-0.4, 0.3);

    // The white share in small.toml is 0.78.
    witness.change_sensor(|sensor| sensor.white_share = 0.78 * 0.95);
    let darker = pilot();
    println!("darker by 5 %: {darker:?}");
    assert!((darker.gain_percent + 5.0).abs() < 0.5);
    witness.change_sensor(|sensor| sensor.white_share = 0.78);

    witness.change_sensor(|sensor| sensor.ambient_levels = [3.4, 3.5, 3.6]);
    let lit = pilot();
    println!("3 levels of light in the room: {lit:?}");
    assert!((lit.offset_levels - 3.0).abs() < 0.5);
    witness.change_sensor(|sensor| sensor.ambient_levels = [0.4, 0.5, 0.6]);

    witness.change_sensor(|sensor| sensor.read_noise_levels = 3.0);
    let noisy = pilot();
    println!("noise of 3 levels: {noisy:?}");
    assert!(noisy.noise_ratio > 2.0);
    for (drift, words) in [
        (knocked, "displaced by"),
        (darker, "brightness changed"),
        (lit, "stray light changed"),
        (noisy, "noise"),
    ] {
        assert!(drift.complaint().unwrap().contains(words));
    }
}

#[test]
fn a_cancelled_calibration_keeps_the_previous_one() {
    let slots = tempfile::tempdir().unwrap();
    let NightRig { config, restorer, .. } = rig(slots.path());
    let asked = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&asked);
    let mut restorer = restorer.interruptible(Arc::new(move || flag.load(Ordering::Acquire)));
    let generation = || store::load(slots.path(), config.identity).unwrap().generation;
    let before = generation();
    asked.store(true, Ordering::Release);
    let end = restorer.mend(Remedy::Recalibrate).unwrap_err();
    assert!(end.was_asked_for() && generation() == before, "{end}");
    asked.store(false, Ordering::Release);
    assert_eq!(restorer.pilot().unwrap_or_else(|e| panic!("{e}")).unwrap().complaint(), None);
    restorer.mend(Remedy::Recalibrate).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(generation(), before + 1);
}

/// A restorer that brightens photos and reports scripted drifts.
struct Scripted<'a> {
    pilots: &'a RefCell<Vec<f64>>,
    log: &'a RefCell<Vec<String>>,
    clock: &'a TestClock,
    /// Time to restore a photo, seconds.
    photo_s: f64,
}

impl Restorer for Scripted<'_> {
    fn restore(
        &mut self,
        photo: &Photo,
        _: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        self.log.borrow_mut().push(photo.name.clone());
        self.clock.0.set(self.clock.0.get() + self.photo_s);
        Ok(Outcome {
            verdict: Verdict::Sound,
            method: "brighten",
            stage: ResultStage::LensModel,
            captures: 1,
            seconds: 1.0,
            ..Outcome::untouched(
                Frame::from_fn(|c| photo.light.plane(c).map(|v| v + 1.0)),
                "on request",
            )
        })
    }
    fn mend(&mut self, _: Remedy) -> Result<(), AnyFailure> {
        self.log.borrow_mut().push("calibrated".into());
        Ok(())
    }
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        let mut pilots = self.pilots.borrow_mut();
        let gain_percent = if pilots.is_empty() { 0.0 } else { pilots.remove(0) };
        self.log.borrow_mut().push(format!("pilot {gain_percent}"));
        Ok(Some(Drift { gain_percent, noise_ratio: 1.0, ..Drift::default() }))
    }
}

fn nights(window: &str) -> Nights {
    Nights {
        window: window.into(),
        time_zone: "Europe/Vienna".into(),
        clock: ClockSource::Network,
        pilot_every_photos: 3,
        recalibrate: true,
    }
}

fn photos(root: &Path, count: usize) {
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    let size = relens::frame::Size::new(64, 48);
    for n in 0..count {
        let light: Frame<Work> =
            Frame::from_fn(|_| Plane::from_fn(size, |x, y| (x + y + n) as f32));
        let manner = Manner::plain(Format::Png, 8, config::Curve::Srgb);
        let path = root.join("inbox").join(format!("{n}.png"));
        std::fs::write(&path, encode("n", &light, &manner, false).unwrap()).unwrap();
        let aged = SystemTime::now() - Duration::from_secs(1000 - n as u64);
        std::fs::File::options().write(true).open(&path).unwrap().set_modified(aged).unwrap();
    }
}

/// Conditions of a night.
struct Night<'a> {
    root: &'a Path,
    nights: Nights,
    /// Drift in gain that each pilot finds, percent, in order; 0 after the last.
    pilots: Vec<f64>,
    /// Start, in seconds after noon of 2026-01-10 in Vienna.
    begins_s: f64,
    /// Duration, seconds.
    lasts_s: f64,
    is_set: bool,
    photo_s: f64,
}

/// Record of a simulated night.
struct Lived {
    /// Photos, pilots and calibrations.
    log: Vec<String>,
    summary: Summary,
    states: Vec<Doing>,
}

/// Simulates a night.
fn live(night: Night<'_>) -> Lived {
    let Night { root, nights, pilots, begins_s, lasts_s, is_set, photo_s } = night;
    let (clock, pilots, log) = (TestClock::default(), RefCell::new(pilots), RefCell::default());
    let noon = UNIX_EPOCH + Duration::from_secs(1_768_042_800);
    let calendar = || noon + Duration::from_secs_f64(begins_s + clock.0.get());
    let set = || is_set;
    let times = Times { clock: &clock, calendar: &calendar, is_set: &set };
    let folders = Folders::open(root).unwrap();
    let schedule = Nightly::new(&nights, &folders, times).unwrap();
    let mut restorer = Scripted { pilots: &pilots, log: &log, clock: &clock, photo_s };
    let size = relens::frame::Size::new(64, 48);
    let setting = DaemonSetting::new("test", size, config::Curve::Srgb);
    let mut watcher = ();
    let states: RefCell<Vec<Doing>> = RefCell::default();
    let daemon =
        Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let summary = daemon.scheduled(Box::new(schedule)).run(&|| {
        if let Ok(Some(state)) = State::read(root)
            && states.borrow().last() != Some(&state.doing)
        {
            states.borrow_mut().push(state.doing);
        }
        clock.0.get() > lasts_s
    });
    Lived { log: log.into_inner(), summary, states: states.into_inner() }
}

fn night(root: &Path) -> Night<'_> {
    let nights = nights("22:00-06:00");
    // At 21:50, for twenty minutes.
    Night {
        root,
        nights,
        pilots: vec![],
        begins_s: 35_400.0,
        lasts_s: 1200.0,
        is_set: true,
        photo_s: 1.0,
    }
}

fn in_folder(root: &Path, folder: &str) -> usize {
    let hidden =
        |path: &PathBuf| path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
    let entries = std::fs::read_dir(root.join(folder)).unwrap().flatten().map(|e| e.path());
    entries.filter(|p| p.extension().is_some_and(|e| e == "png") && !hidden(p)).count()
}

#[test]
fn photos_wait_for_the_night_and_pilots_come_between_them() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 7);
    let Lived { log, summary, states } = live(night(root.path()));
    assert_eq!(summary.restored.len(), 7);
    let warm_up = ["pilot 0", "pilot 0", "pilot 0"];
    let wanted = warm_up
        .into_iter()
        .chain(["0.png", "1.png", "2.png", "pilot 0", "3.png", "4.png", "5.png"]);
    let wanted: Vec<&str> = wanted.chain(["pilot 0", "6.png", "pilot 0"]).collect();
    assert_eq!(log, wanted);
    let paused = |words: &str| {
        states.iter().any(|d| matches!(d, Doing::Paused { reason } if reason.contains(words)))
    };
    assert!(paused("the night begins at 22:00") && paused("warming up"), "{states:?}");
}

#[test]
fn drift_beyond_its_limit_recalibrates_and_repeats_photos_since_the_last_good_pilot() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 5);
    // Warm-up, then 4 % too bright after three photos.
    let pilots = vec![0.0, 0.0, 0.0, 4.0];
    let Lived { log, summary, .. } = live(Night { pilots, ..night(root.path()) });
    let wanted = [
        "pilot 0",
        "pilot 0",
        "pilot 0",
        "0.png",
        "1.png",
        "2.png",
        "pilot 4",
        "calibrated",
        "pilot 0",
    ];
    assert_eq!(log[..9], wanted);
    let times = |name: &str| log.iter().filter(|l| *l == name).count();
    assert_eq!([0, 1, 2, 3, 4].map(|n| times(&format!("{n}.png"))), [2, 2, 2, 1, 1], "{log:?}");
    assert_eq!(summary.restored.len(), 5);
    assert_eq!((in_folder(root.path(), "done"), in_folder(root.path(), "outbox")), (5, 5));
    assert_eq!(in_folder(root.path(), "outbox/withdrawn"), 3);
}

#[test]
fn a_rig_that_may_not_recalibrate_calls_the_operator() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 5);
    let nights = Nights { recalibrate: false, ..nights("22:00-06:00") };
    let pilots = std::iter::repeat_n(0.0, 3).chain(std::iter::repeat_n(-9.0, 1000)).collect();
    let Lived { log, summary, states } = live(Night { nights, pilots, ..night(root.path()) });
    assert!(!log.contains(&"calibrated".to_owned()) && summary.restored.len() == 3);
    assert!(
        states.iter().any(
            |d| matches!(d, Doing::Held { reason } if reason.contains("brightness changed by \
             -9.0 %"))
        ),
        "{states:?}"
    );
}

#[test]
fn after_a_reboot_the_first_pilot_decides_on_earlier_photos() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 2);
    // The power fails after the last photo, before its pilot.
    let begun = night(root.path());
    let Lived { log, .. } = live(Night { begins_s: 36_000.0, lasts_s: 100.0, ..begun });
    assert_eq!(log.len(), 5, "{log:?}");
    assert_eq!(in_folder(root.path(), "done"), 2);
    // Then the rig is knocked.
    let pilots = vec![7.0, 7.0, 7.0, 0.0];
    let Lived { log, summary, .. } =
        live(Night { begins_s: 37_000.0, pilots, ..night(root.path()) });
    assert_eq!(log[..5], ["pilot 7", "pilot 7", "pilot 7", "calibrated", "pilot 0"]);
    assert_eq!(summary.restored.len(), 2, "{log:?}");
    assert_eq!((in_folder(root.path(), "done"), in_folder(root.path(), "outbox")), (2, 2));
}

#[test]
fn an_unset_clock_starts_no_night() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 2);
    let Lived { log, summary, states } = live(Night { is_set: false, ..night(root.path()) });
    assert!(log.is_empty() && summary.restored.is_empty());
    assert!(
        states.iter().any(
            |d| matches!(d, Doing::Paused { reason } if reason.contains("no network has set"))
        )
    );
}

#[test]
fn after_the_night_photos_wait_for_the_next_one() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 4);
    let Lived { log, summary, .. } = live(Night { begins_s: 65_100.0, ..night(root.path()) });
    assert!(log.is_empty() && summary.restored.is_empty(), "06:05 is after the night");
    assert_eq!(in_folder(root.path(), "inbox"), 4);
}

#[test]
fn a_batch_interrupted_by_morning_continues_the_next_night() {
    const HOUR: f64 = 3600.0;
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 7);
    // At 05:50, a photo every four minutes: morning comes within the batch, evening long after.
    let begun = Night { begins_s: 17.0 * HOUR + 50.0 * 60.0, photo_s: 240.0, ..night(root.path()) };
    let Lived { log, summary, states } = live(Night { lasts_s: 17.0 * HOUR, ..begun });
    let warm_up = ["pilot 0"; 3];
    // The current photo is finished; then the pilot confirms all three.
    let first = warm_up.into_iter().chain(["0.png", "1.png", "2.png", "pilot 0"]);
    let second =
        warm_up.into_iter().chain(["3.png", "4.png", "5.png", "pilot 0", "6.png", "pilot 0"]);
    let wanted: Vec<&str> = first.chain(second).collect();
    assert_eq!(log, wanted);
    assert_eq!((summary.restored.len(), in_folder(root.path(), "done")), (7, 7));
    let waited = |d: &Doing| {
        matches!(d, Doing::Paused { reason } if reason.contains("the night \
     begins at 22:00"))
    };
    assert!(states.iter().any(waited), "{states:?}");
}

#[test]
fn a_batch_continues_after_reboots_at_night_and_by_day() {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 7);
    let at = |begins_s: f64, lasts_s: f64| {
        let Lived { log, .. } =
            live(Night { begins_s, lasts_s, photo_s: 240.0, ..night(root.path()) });
        log.into_iter().filter(|line| line.ends_with(".png")).collect::<Vec<_>>()
    };
    // From 22:00 for six minutes, again for six, at noon for an hour, and the next night.
    let lives =
        [at(36_000.0, 360.0), at(37_000.0, 360.0), at(86_400.0, 3600.0), at(122_400.0, 3600.0)];
    assert!(!lives[0].is_empty() && !lives[1].is_empty() && lives[2].is_empty(), "{lives:?}");
    let all: Vec<String> = (0..7).map(|n| format!("{n}.png")).collect();
    assert_eq!(lives.concat(), all, "none twice, none missed, the oldest first: {lives:?}");
    assert_eq!((in_folder(root.path(), "done"), in_folder(root.path(), "outbox")), (7, 7));
}
