//! Missed nights: if photos waited through a whole window, the box reports it with time and reason
//! in its state, log, report and panel; but not after a mere change of the calendar.

use std::cell::{Cell, RefCell};
use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use relens::config::{self, ClockSource, Mode, Nights};
use relens::daemon::{
    Attended, Daemon, DaemonSetting, Folders, Nightly, Progress, Reader, Restorer, State, Times,
};
use relens::kiosk::front_panel::{BoxState, FrontPanel};
use relens::kiosk::press::Press;
use relens::kiosk::screen::Screen;
use relens::nights::pilot::Drift;
use relens::picture::Photo;
use relens::pipeline::Outcome;
use relens::remedy::{AnyFailure, Remediable, Remedy};

use super::{Scripted, TestClock, nights, photos};

const HOUR: f64 = 3600.0;
const DAY: f64 = 24.0 * HOUR;

thread_local! {
    static WARNED: RefCell<Vec<String>> = RefCell::default();
}

/// Records the warnings of each test's thread.
struct Ear;

impl log::Log for Ear {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }
    fn log(&self, record: &log::Record<'_>) {
        if record.level() == log::Level::Warn {
            WARNED.with_borrow_mut(|warned| warned.push(record.args().to_string()));
        }
    }
    fn flush(&self) {}
}

#[derive(Debug, thiserror::Error)]
#[error("the camera is gone: no frame came within 500 ms")]
struct CameraGone;

impl Remediable for CameraGone {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}

/// A rig whose camera may disappear, with a recorded panel.
struct Fragile<'a> {
    inner: Scripted<'a>,
    gone: &'a dyn Fn(f64) -> bool,
    screens: &'a RefCell<Vec<Screen>>,
}

impl Fragile<'_> {
    fn ask(&self) -> Result<(), AnyFailure> {
        if (self.gone)(self.inner.clock.0.get()) { Err(Box::new(CameraGone)) } else { Ok(()) }
    }
}

impl Restorer for Fragile<'_> {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        self.ask()?;
        self.inner.restore(photo, progress)
    }
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        self.ask()?;
        self.inner.mend(remedy)
    }
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        self.ask()?;
        self.inner.pilot()
    }
    fn show(&mut self, screen: &Screen) {
        self.screens.borrow_mut().push(screen.clone());
    }
}

/// A period of a box; times are seconds since power-on.
struct Life<'a> {
    nights: Nights,
    /// Power-on, seconds after noon in Vienna, 2026-01-10.
    begins_s: f64,
    lasts_s: f64,
    /// Error of the calendar.
    off_s: &'a dyn Fn(f64) -> f64,
    is_set: &'a dyn Fn(f64) -> bool,
    gone: &'a dyn Fn(f64) -> bool,
    /// Whether the button is held at power-on.
    maintenance: bool,
}

/// A box powered on at 21:50 without a camera.
fn life(hours: f64) -> Life<'static> {
    Life {
        nights: nights("22:00-06:00"),
        begins_s: 9.0 * HOUR + 50.0 * 60.0,
        lasts_s: hours * HOUR,
        off_s: &|_| 0.0,
        is_set: &|_| true,
        gone: &|_| true,
        maintenance: false,
    }
}

/// Visible state at the end of a period.
struct Seen {
    restored: usize,
    missed: Option<String>,
    /// Warnings about missed nights.
    warned: Vec<String>,
    page: String,
    screens: Vec<Screen>,
    front: BoxState,
}

fn live(root: &Path, life: &Life<'_>) -> Seen {
    if log::set_logger(&Ear).is_ok() {
        log::set_max_level(log::LevelFilter::Warn);
    }
    WARNED.with_borrow_mut(Vec::clear);
    let clock = TestClock(Cell::new(0.0));
    let noon_unix_s = 1_768_042_800.0;
    let calendar = || {
        let now = clock.0.get();
        UNIX_EPOCH + Duration::from_secs_f64(noon_unix_s + life.begins_s + now + (life.off_s)(now))
    };
    let set = || (life.is_set)(clock.0.get());
    let times = Times { clock: &clock, calendar: &calendar, is_set: &set, temperature_c: &|| None };
    let folders = Folders::open(root).unwrap();
    let night = Nightly::new(&life.nights, &folders, times).unwrap();
    let front = FrontPanel::default();
    if life.maintenance {
        front.press(Press::HeldAtStart);
    }
    let schedule = Attended::new(front.clone(), Mode::Folder, &clock, Box::new(night));
    let (pilots, log, screens) = (RefCell::default(), RefCell::default(), RefCell::default());
    let inner = Scripted { pilots: &pilots, log: &log, clock: &clock, photo_s: 1.0 };
    let mut restorer = Fragile { inner, gone: life.gone, screens: &screens };
    let size = relens::frame::Size::new(64, 48);
    let setting = DaemonSetting {
        reader: Reader::Here,
        ..DaemonSetting::new("test", size, config::Curve::Srgb)
    };
    let mut watcher = ();
    let daemon =
        Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let summary = daemon.scheduled(Box::new(schedule)).run(&|| clock.0.get() > life.lasts_s);
    let page = std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    let state = State::read(root).unwrap().unwrap();
    let warned = WARNED.with_borrow(|warned| warned.clone());
    Seen {
        restored: summary.restored.len(),
        missed: state.attention.into_iter().next(),
        warned: warned
            .into_iter()
            .filter(|words| words.contains("no photo was restored"))
            .collect(),
        page,
        screens: screens.into_inner(),
        front: front.state(),
    }
}

fn with_photos() -> tempfile::TempDir {
    let root = tempfile::tempdir().unwrap();
    photos(root.path(), 2);
    root
}

#[test]
fn a_night_without_a_camera_is_reported_everywhere_afterwards() {
    let root = with_photos();
    let seen = live(root.path(), &life(8.0));
    assert_eq!(
        (seen.missed, seen.warned.len()),
        (None, 0),
        "ten minutes before the end it is not missed yet"
    );
    let root = with_photos();
    let seen = live(root.path(), &life(9.0));
    let missed = seen.missed.unwrap();
    for words in [
        "no photo was restored in the night up to 2026-01-11 06:00 (Europe/Vienna)",
        "wait since 2026-01-10 21:50 (Europe/Vienna)",
        "the camera is gone",
    ] {
        assert!(missed.contains(words), "{missed}");
    }
    assert!(seen.warned.len() == 1 && seen.warned[0] == missed, "one line: {:?}", seen.warned);
    assert!(
        seen.page.contains("Attention: no photo was restored")
            && seen.page.contains("camera is gone")
    );
    assert_eq!(seen.front, BoxState::Trouble, "the lamp");
    let last = seen.screens.last().unwrap();
    assert!(
        matches!(last, Screen::Missed { what, why, photos: 2, .. }
            if missed.starts_with(what) && missed.ends_with(why)),
        "{last:?}"
    );
    assert_eq!(seen.restored, 0);
}

#[test]
fn missed_nights_are_counted_until_a_photo_is_restored() {
    let root = with_photos();
    let (late, back) = (&|t| t < 40.0 * HOUR, &|t| t < 30.0 * HOUR);
    let seen = live(root.path(), &Life { gone: late, ..life(33.0) });
    assert!(seen.missed.unwrap().contains("in 2 nights, the last up to 2026-01-12 06:00"));
    assert_eq!(seen.warned.len(), 2);
    // The camera returns in the middle of the second night.
    let root = with_photos();
    let seen = live(root.path(), &Life { gone: back, ..life(33.0) });
    assert_eq!((seen.restored, seen.missed, seen.warned.len()), (2, None, 1));
    assert!(!seen.page.contains("Attention"));
}

#[test]
fn an_unset_clock_counts_as_a_missed_night_once_any_night_has_passed() {
    let root = with_photos();
    let unset: Life<'_> = Life { is_set: &|_| false, gone: &|_| false, ..life(32.0) };
    assert_eq!(
        live(root.path(), &unset).missed,
        None,
        "a night of eight hours, begun a minute too late"
    );
    let root = with_photos();
    let seen = live(root.path(), &Life { lasts_s: 34.0 * HOUR, ..unset });
    let missed = seen.missed.unwrap();
    assert!(
        missed.contains("for 33 hours") && missed.contains("no network has set the clock"),
        "{missed}"
    );
    assert_eq!(seen.warned.len(), 1);
    // Set in the afternoon of the second day: the missed night has a date.
    let root = with_photos();
    let set = &|t| t > 20.0 * HOUR;
    let seen = live(root.path(), &Life { is_set: set, gone: &|_| false, ..life(21.0) });
    let missed = seen.missed.unwrap();
    assert!(
        missed.contains("up to 2026-01-11 06:00") && missed.contains("no network has set"),
        "{missed}"
    );
}

#[test]
fn a_box_that_was_off_reports_it_at_power_on() {
    let root = with_photos();
    live(root.path(), &Life { lasts_s: 300.0, ..life(0.0) });
    let well = Life { begins_s: 21.0 * HOUR, gone: &|_| false, ..life(0.1) };
    let seen = live(root.path(), &well);
    let missed = seen.missed.unwrap();
    assert!(
        missed.contains("the box was off, or relens did not run, before 2026-01-11 09:00"),
        "{missed}"
    );
    assert_eq!(seen.warned.len(), 1);
    // Held all night and then restarted: the reason is kept.
    let root = with_photos();
    live(root.path(), &life(10.0));
    let missed = live(root.path(), &well).missed.unwrap();
    assert!(missed.contains("the camera is gone"), "{missed}");
}

#[test]
fn a_change_of_the_calendar_by_a_day_is_no_missed_night() {
    for (day, source) in
        [(DAY, ClockSource::Network), (-DAY, ClockSource::Network), (DAY, ClockSource::Battery)]
    {
        let root = with_photos();
        let nights = Nights { clock: source, ..nights("22:00-06:00") };
        // At 20:00; the clock changes at 20:30 and is corrected at 21:00.
        let there = &|t| if t > 1800.0 { day } else { 0.0 };
        let there_and_back = &|t| if (1800.0..3600.0).contains(&t) { day } else { 0.0 };
        let evening =
            |off_s| Life { nights: nights.clone(), begins_s: 8.0 * HOUR, off_s, ..life(1.9) };
        assert_eq!(live(root.path(), &evening(there)).missed, None, "{day} {source:?}");
        let root = with_photos();
        assert_eq!(
            live(root.path(), &evening(there_and_back)).missed,
            None,
            "{day} {source:?}, and back"
        );
        // The night after it counts.
        let root = with_photos();
        let seen = live(root.path(), &Life { lasts_s: 11.0 * HOUR, ..evening(there) });
        assert!(seen.missed.is_some_and(|m| m.contains("in the night up to")), "{day} {source:?}");
        assert_eq!(seen.warned.len(), 1);
    }
}

#[test]
fn a_battery_clock_set_back_by_a_day_misses_one_night() {
    let root = with_photos();
    let nights = Nights { clock: ClockSource::Battery, ..nights("22:00-06:00") };
    // It reaches a plausible time after a day and misses the night in between.
    let off_s = &|t| if t > 60.0 { -DAY } else { 0.0 };
    let seen = live(root.path(), &Life { nights, off_s, gone: &|_| false, ..life(34.0) });
    assert_eq!((seen.restored, seen.missed), (2, None), "the second night runs");
}

#[test]
fn without_photos_nothing_is_missed_and_maintenance_is_a_reason() {
    let root = tempfile::tempdir().unwrap();
    assert_eq!(live(root.path(), &life(33.0)).missed, None);
    let root = with_photos();
    let seen = live(root.path(), &Life { maintenance: true, gone: &|_| false, ..life(9.0) });
    assert!(seen.missed.unwrap().ends_with("the box is in maintenance"));
}
