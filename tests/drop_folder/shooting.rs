//! A box that takes its photos itself: press, photo, panel, restoration.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use relens::config::{Curve, Mode};
use relens::daemon::{
    Attended, Daemon, DaemonSetting, Folders, Progress, Restorer, Shooting, Summary,
};
use relens::kiosk::front_panel::{BoxState, FrontPanel};
use relens::kiosk::press::Press;
use relens::kiosk::screen::Screen;
use relens::nights::pilot::Drift;
use relens::picture::{Format, Manner, Photo, encode};
use relens::pipeline::Outcome;
use relens::remedy::{AnyFailure, Remedy};
use relens::restorer::PanelView;
use relens::restorer::photo_file::TakenPhoto;

use crate::bed::*;
use crate::model_disk::{Contents, ModelDisk, Op, Survivors, Verdict};
use crate::power::{TINY, canonical, filled};
use crate::power_checks::{Dropped, ROOT, at_every_instant, in_the_end};

/// State of the world around the box.
#[derive(Default)]
pub struct Scene {
    pub panel: Option<PanelView>,
    /// Displacement of the panel, px; a calibration resets it unless `unsteady`.
    pub moved_px: f64,
    pub unsteady: bool,
    /// Whether the user cancels measurements of the lens.
    pub gives_up: bool,
    /// Failures of the next photos, the next one last.
    pub failures: Vec<Remedy>,
    /// Whether photos are returned unchanged.
    pub untouched: bool,
    /// Time from the press to the photo, seconds.
    pub countdown_s: f64,
}

/// Path of the gallery's status line.
const NOW: &str = "outbox/gallery/now.html";

/// A camera of a few pixels in the world of a [`Scene`].
#[derive(Default)]
struct Camera {
    inner: Brightener,
    now: PathBuf,
    scene: Rc<RefCell<Scene>>,
    taken: usize,
}

/// The `n`-th photo of the camera.
fn photo(n: usize) -> Vec<u8> {
    let light = scene(TINY);
    let light = relens::frame::Frame::from_fn(|c| light.plane(c).map(|v: f32| v + n as f32));
    encode("photo", &light, &Manner::plain(Format::Png, 8, Curve::Srgb), false).unwrap()
}

impl Restorer for Camera {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        assert_eq!(self.scene.borrow().panel, Some(PanelView::There), "nothing to capture");
        self.inner.untouched = self.scene.borrow().untouched;
        self.inner.restore(photo, progress)
    }
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        let mut scene = self.scene.borrow_mut();
        if remedy == Remedy::Recalibrate {
            // A measurement takes a minute; users who cannot see the panel read the gallery's page.
            let page = std::fs::read_to_string(&self.now).unwrap();
            assert!(page.contains("measuring the lens"), "{page}");
        }
        self.inner.gives_up = scene.gives_up;
        if remedy == Remedy::Recalibrate && !scene.unsteady {
            scene.moved_px = 0.0;
        }
        self.inner.mend(remedy)
    }
    fn take(&mut self) -> Result<Option<TakenPhoto>, AnyFailure> {
        if let Some(remedy) = self.scene.borrow_mut().failures.pop() {
            return Err(Box::new(LampOut(remedy)));
        }
        self.taken += 1;
        let bytes = photo(self.taken - 1);
        Ok(Some(TakenPhoto { bytes, ending: "png", clipped_share: 0.0 }))
    }
    fn look_for_panel(&mut self) -> Result<PanelView, AnyFailure> {
        Ok(self.scene.borrow().panel.clone().unwrap_or(PanelView::Absent))
    }
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        let shift_px = self.scene.borrow().moved_px;
        Ok(Some(Drift { shift_px, noise_ratio: 1.0, ..Drift::default() }))
    }
}

/// Forwards calls to `inner`, and records the screens shown and the photos taken.
pub struct Watched<'a> {
    pub inner: &'a mut dyn Restorer,
    pub screens: Rc<RefCell<Vec<Screen>>>,
    pub taken: Rc<RefCell<Vec<Vec<u8>>>>,
    /// Whether the user was asked for the panel, which happens after the photo was saved.
    pub asked: Arc<AtomicBool>,
}

impl Restorer for Watched<'_> {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        self.inner.restore(photo, progress)
    }
    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        self.inner.mend(remedy)
    }
    fn show(&mut self, screen: &Screen) {
        if matches!(screen, Screen::Asking { .. }) {
            self.asked.store(true, Ordering::Release);
        }
        self.inner.show(screen);
        self.screens.borrow_mut().push(screen.clone());
    }
    fn take(&mut self) -> Result<Option<TakenPhoto>, AnyFailure> {
        let taken = self.inner.take()?;
        self.taken.borrow_mut().extend(taken.iter().map(|photo| photo.bytes.clone()));
        Ok(taken)
    }
    fn look_for_panel(&mut self) -> Result<PanelView, AnyFailure> {
        self.inner.look_for_panel()
    }
    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        self.inner.pilot()
    }
}

/// Outcome of a run.
pub struct Ran {
    pub summary: Summary,
    pub screens: Vec<Screen>,
    pub taken: Vec<Vec<u8>>,
}

/// Runs a box that takes photos on `folders` until `until_s`; `act` is called before each step.
pub fn run(
    folders: Folders,
    setting: DaemonSetting,
    rig: &mut dyn Restorer,
    asked: Arc<AtomicBool>,
    front: &FrontPanel,
    (countdown_s, until_s): (f64, f64),
    act: impl FnMut(f64, &FrontPanel),
) -> Ran {
    let calendar = || -> SystemTime { UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S) };
    let (screens, taken, clock) = (Rc::default(), Rc::default(), TestClock::default());
    let mut watched =
        Watched { inner: rig, screens: Rc::clone(&screens), taken: Rc::clone(&taken), asked };
    let shooting = Shooting::new(folders.clone(), None, countdown_s, &calendar);
    let schedule = Attended::new(front.clone(), Mode::Shoot, &clock, Box::new(()));
    let schedule = schedule.shooting(shooting);
    let mut watcher = ();
    let daemon =
        Daemon::open(folders, setting, &mut watched, &clock, &calendar, &mut watcher).unwrap();
    let act = RefCell::new(act);
    let summary = daemon.scheduled(Box::new(schedule)).run(&|| {
        act.borrow_mut()(clock.0.get(), front);
        clock.0.get() > until_s
    });
    let (screens, taken) = (screens.borrow().clone(), taken.borrow().clone());
    Ran { summary, screens, taken }
}

/// Runs a box with the small camera and timed `acts`.
fn journey(root: &Path, scene: Scene, until_s: f64, acts: &[(f64, Act)]) -> (Ran, Vec<Remedy>) {
    let times = (scene.countdown_s, until_s);
    let scene = Rc::new(RefCell::new(scene));
    let now = root.join(NOW);
    let mut camera = Camera { now, scene: Rc::clone(&scene), ..Camera::default() };
    let (front, mut acts) = (FrontPanel::default(), acts.iter().peekable());
    let setting = DaemonSetting::new("test rig", TINY, Curve::Srgb);
    let folders = Folders::open(root).unwrap();
    let asked = Arc::default();
    let ran = run(folders, setting, &mut camera, asked, &front, times, |now, front| {
        while let Some((_, act)) = acts.next_if(|(at, _)| now >= *at) {
            match act {
                Act::Press => {
                    front.press(Press::Down);
                    front.press(Press::Short);
                }
                Hold => {
                    front.press(Press::Down);
                    front.press(Press::Long);
                }
                Panel(view) => scene.borrow_mut().panel = Some(view.clone()),
                Is(state) => {
                    assert_eq!(front.state(), *state, "at {now} s");
                    let told = std::fs::read_to_string(root.join(NOW)).unwrap();
                    assert!(*state != BoxState::Waiting || told.contains("press the button"));
                }
            }
        }
    });
    (ran, camera.inner.mended)
}

#[derive(Clone)]
enum Act {
    Press,
    Hold,
    Panel(PanelView),
    Is(BoxState),
}

use Act::{Hold, Is, Panel};

fn asks(ran: &Ran, words: &str) -> bool {
    let said = |screen: &Screen| match screen {
        Screen::Asking { words: found, .. } => found.contains(words),
        _ => false,
    };
    ran.screens.iter().any(said)
}

#[test]
fn a_press_takes_a_photo_that_is_restored_when_the_panel_is_there() {
    let root = fresh_root();
    let acts = [
        (10.0, Is(BoxState::Ready)),
        (10.0, Act::Press),
        (20.0, Is(BoxState::Asking)),
        (60.0, Is(BoxState::Asking)),
        (60.0, Panel(PanelView::Askew("it is upside down".to_owned()))),
        (80.0, Is(BoxState::Asking)),
        (80.0, Panel(PanelView::There)),
        (119.0, Is(BoxState::Done)),
    ];
    let (ran, mended) = journey(root.path(), Scene::default(), 120.0, &acts);
    let now = std::fs::read_to_string(root.path().join(NOW)).unwrap();
    let page = std::fs::read_to_string(root.path().join("outbox/index.html")).unwrap();
    assert!(now.contains("Switched off") && page.contains("src=\"gallery/now.html\""), "{now}");
    assert_eq!((ran.taken.len(), ran.summary.restored.len(), mended), (1, 1, vec![]));
    assert_eq!(names(&root.path().join("done")), set(&["photo-20961002-070640.png"]));
    assert!(ran.screens.contains(&Screen::Taking));
    assert!(asks(&ran, "before the lens") && asks(&ran, "upside down"), "{:?}", ran.screens);
    let last = ran.screens.last();
    assert!(matches!(last, Some(Screen::Result { hint, .. }) if hint.contains("Aim")), "{last:?}");
}

#[test]
fn the_lamps_show_whether_a_photo_was_restored() {
    let root = fresh_root();
    let scene = Scene { panel: Some(PanelView::There), untouched: true, ..Scene::default() };
    // The lamps while the result is shown; the button works meanwhile.
    let (refused, ready) = (Is(BoxState::Refused), Is(BoxState::Ready));
    let acts = [(10.0, Act::Press), (40.0, refused), (40.0, Act::Press), (299.0, ready)];
    let (ran, _) = journey(root.path(), scene, 300.0, &acts);
    assert_eq!((ran.taken.len(), ran.summary.untouched.len()), (2, 2));
}

#[test]
fn a_second_press_cancels_the_countdown() {
    let root = fresh_root();
    let counting =
        |from: f64| [(from + 1.0, Is(BoxState::Counting)), (from + 2.6, Is(BoxState::Counting))];
    let mut acts = vec![(10.0, Act::Press)];
    acts.extend(counting(10.0));
    acts.extend([(14.0, Is(BoxState::Asking)), (30.0, Act::Press)]);
    acts.extend(counting(30.0));
    // The earlier request for the panel continues.
    acts.extend([(32.7, Act::Press), (40.0, Is(BoxState::Asking))]);
    let scene = Scene { countdown_s: 3.0, ..Scene::default() };
    let (ran, _) = journey(root.path(), scene, 50.0, &acts);
    assert_eq!(ran.taken.len(), 1);
    let counted = |screen: &Screen| match screen {
        Screen::Counting { seconds } => Some(Some(*seconds)),
        Screen::Taking => Some(None),
        _ => None,
    };
    let counted: Vec<_> = ran.screens.iter().filter_map(counted).collect();
    let [three, two, one] = [3, 2, 1].map(Some);
    assert_eq!(counted, [three, two, one, None, three, two, one]);

    // Cancelled before the first photo, by a short and a long press.
    for cancel in [Act::Press, Hold] {
        let root = fresh_root();
        let acts = [(10.0, Act::Press), (11.0, cancel), (20.0, Is(BoxState::Ready))];
        let scene = Scene { countdown_s: 3.0, ..Scene::default() };
        let (ran, _) = journey(root.path(), scene, 30.0, &acts);
        assert!(ran.taken.is_empty() && names(&root.path().join("inbox")).is_empty());
    }
}

#[test]
fn postponed_photos_are_restored_with_the_next_one() {
    for (how, postponed_s) in [(Some((30.0, Hold)), 45.0), (None, 960.0)] {
        let root = fresh_root();
        let mut acts = vec![(10.0, Act::Press)];
        acts.extend(how);
        acts.extend([
            (postponed_s, Is(BoxState::Waiting)),
            // Postponed photos do not start by themselves.
            (postponed_s, Panel(PanelView::There)),
            (postponed_s + 60.0, Is(BoxState::Waiting)),
            (postponed_s + 61.0, Act::Press),
        ]);
        let (ran, _) = journey(root.path(), Scene::default(), postponed_s + 120.0, &acts);
        assert_eq!((ran.taken.len(), ran.summary.restored.len()), (2, 2));
    }
}

#[test]
fn a_short_press_takes_another_photo_while_the_panel_is_asked_for() {
    let root = fresh_root();
    let acts = [(10.0, Act::Press), (30.0, Act::Press), (50.0, Panel(PanelView::There))];
    let (ran, _) = journey(root.path(), Scene::default(), 120.0, &acts);
    assert_eq!((ran.taken.len(), ran.summary.restored.len()), (2, 2));
}

#[test]
fn a_moved_panel_is_measured_and_an_unsteady_one_reported() {
    let root = fresh_root();
    let there = || Scene { panel: Some(PanelView::There), moved_px: 2.0, ..Scene::default() };
    let acts = [(10.0, Act::Press)];
    let (ran, mended) = journey(root.path(), there(), 60.0, &acts);
    assert_eq!((ran.summary.restored.len(), mended), (1, vec![Remedy::Recalibrate]));
    assert!(ran.screens.iter().any(|s| matches!(s, Screen::Measuring { .. })));

    let root = fresh_root();
    let unsteady = Scene { unsteady: true, ..there() };
    let (ran, mended) = journey(root.path(), unsteady, 30.0, &acts);
    assert_eq!((ran.summary.restored.len(), mended.len()), (0, 2));
    assert!(asks(&ran, "displaced by 2.00 px") && asks(&ran, "moved"), "{:?}", ran.screens);
    assert_eq!(names(&root.path().join("inbox")).len(), 1, "the photo waits");
}

#[test]
fn after_a_cancelled_measurement_the_panel_is_not_asked_for() {
    let root = fresh_root();
    let scene = Scene {
        panel: Some(PanelView::There),
        moved_px: 2.0,
        unsteady: true,
        gives_up: true,
        ..Scene::default()
    };
    let acts = [(10.0, Act::Press), (20.0, Is(BoxState::Waiting))];
    let (ran, mended) = journey(root.path(), scene, 120.0, &acts);
    assert_eq!((ran.summary.restored.len(), mended), (0, vec![Remedy::Recalibrate]));
    assert!(!ran.screens.iter().any(|s| matches!(s, Screen::Trouble { .. })), "{:?}", ran.screens);
    assert_eq!(names(&root.path().join("inbox")).len(), 1, "the photo waits");
}

#[test]
fn a_failing_camera_is_retried_and_a_missing_one_reported() {
    let root = fresh_root();
    let failures = vec![Remedy::ReopenRig, Remedy::ShootAgain];
    let scene = Scene { panel: Some(PanelView::There), failures, ..Scene::default() };
    let (ran, mended) = journey(root.path(), scene, 60.0, &[(10.0, Act::Press)]);
    assert_eq!((ran.summary.restored.len(), mended), (1, vec![Remedy::ReopenRig]));

    let root = fresh_root();
    let failures = vec![Remedy::CallOperator];
    let scene = Scene { panel: Some(PanelView::There), failures, ..Scene::default() };
    let acts = [
        (10.0, Act::Press),
        (20.0, Is(BoxState::Trouble)),
        (90.0, Is(BoxState::Ready)),
        (90.0, Act::Press),
    ];
    let (ran, _) = journey(root.path(), scene, 150.0, &acts);
    assert_eq!((ran.taken.len(), ran.summary.restored.len()), (1, 1));
    let told = |s: &Screen| matches!(s, Screen::Trouble { what, .. } if what.contains("no photo"));
    assert!(ran.screens.iter().any(told), "{:?}", ran.screens);
}

#[test]
fn a_photo_in_the_inbox_at_the_start_asks_for_the_panel() {
    let root = fresh_root();
    drop_in(root.path(), "before.png", &photo(0));
    let acts = [(20.0, Is(BoxState::Asking)), (20.0, Panel(PanelView::There))];
    let (ran, _) = journey(root.path(), Scene::default(), 60.0, &acts);
    assert_eq!(ran.summary.restored.len(), 1);
}

/// Runs a box on `disk` with the panel in place; if `press`, the button is pressed at the start.
fn live(disk: &ModelDisk, press: bool, asked: Arc<AtomicBool>) -> Ran {
    let scene = Rc::new(RefCell::new(Scene { panel: Some(PanelView::There), ..Scene::default() }));
    let mut camera = Camera { scene, ..Camera::default() };
    let setting =
        DaemonSetting { hints: false, ..DaemonSetting::new("test rig", TINY, Curve::Srgb) };
    let folders = Folders::on(Arc::new(disk.clone()), Path::new(ROOT)).unwrap();
    let mut press = press.then_some(Press::Down);
    run(folders, setting, &mut camera, asked, &FrontPanel::default(), (0.0, 40.0), |now, front| {
        if now > 6.0 {
            press.take().into_iter().for_each(|press| front.press(press));
        }
    })
}

#[test]
fn a_power_cut_leaves_a_taken_photo_whole_or_absent_and_whole_once_announced() {
    let asked: Arc<AtomicBool> = Arc::default();
    let instants: Arc<Mutex<Vec<(Contents, bool)>>> = Arc::default();
    let disk = ModelDisk::new(filled(&[], None), Box::new(|_, _| Ok(Verdict::Done)));
    let (watched, told) = (Arc::clone(&instants), Arc::clone(&asked));
    disk.guarded_by(Box::new(move |op, contents| {
        if !matches!(op, Op::Read(_)) {
            watched.lock().unwrap().push((contents.clone(), told.load(Ordering::Acquire)));
        }
        Ok(Verdict::Done)
    }));
    let ran = live(&disk, true, asked);
    assert_eq!(ran.summary.restored.len(), 1);
    disk.guarded_by(Box::new(|_, _| Ok(Verdict::Done)));
    let end = disk.contents();
    let result = end
        .now()
        .iter()
        .find(|(path, _)| {
            path.starts_with("/box/outbox") && path.extension().is_some_and(|e| e == "png")
        })
        .map(|(_, (_, holds))| holds.to_vec());
    assert!(result.is_some());
    let dropped = [Dropped { name: "photo-20961002-070640.png", bytes: photo(0), result }];
    let mut instants = std::mem::take(&mut *instants.lock().unwrap());
    instants.push((end, true));
    let (mut known, mut absent, mut cuts) = (BTreeSet::<Survivors>::new(), 0, 0);
    for (contents, told) in instants {
        for cut in contents.cuts(&|_| false) {
            cuts += 1;
            // Temporary files are removed at the next start.
            let seen = |path: &Path| !path.to_string_lossy().ends_with(".tmp");
            let of_photo = |(path, (_, holds)): &(&PathBuf, &(u64, Arc<[u8]>))| {
                seen(path) && holds[..] == dropped[0].bytes[..]
            };
            let is_there = cut.iter().any(|file| of_photo(&file));
            if !is_there {
                assert!(!told, "announced as saved, and lost: {:?}", cut.keys());
                let half = cut.keys().find(|path| path.starts_with("/box/inbox") && seen(path));
                assert_eq!(half, None, "half a photo");
                absent += 1;
                continue;
            }
            at_every_instant(&cut, &dropped).unwrap();
            if known.insert(canonical(cut.clone())) {
                let next = ModelDisk::new(
                    Contents::after(&cut, contents.folders()),
                    Box::new(|_, _| Ok(Verdict::Done)),
                );
                live(&next, false, Arc::default());
                in_the_end(&next.contents().now(), &dropped).unwrap();
            }
        }
    }
    println!("{cuts} cuts, {absent} before the photo was there, {} states lived on", known.len());
    assert!(absent > 0 && known.len() > 5);
}

#[test]
fn a_photo_stays_in_memory_while_the_disk_is_full() {
    let disk = ModelDisk::new(filled(&[], None), Box::new(|_, _| Ok(Verdict::Done)));
    let mut refusals = 2;
    disk.guarded_by(Box::new(move |op, _| match op {
        Op::Write(path) if path.starts_with("/box/inbox") && refusals > 0 => {
            refusals -= 1;
            Err(ErrorKind::StorageFull.into())
        }
        _ => Ok(Verdict::Done),
    }));
    let scene = Rc::new(RefCell::new(Scene { panel: Some(PanelView::There), ..Scene::default() }));
    let mut camera = Camera { scene, ..Camera::default() };
    let setting =
        DaemonSetting { hints: false, ..DaemonSetting::new("test rig", TINY, Curve::Srgb) };
    let folders = Folders::on(Arc::new(disk), Path::new(ROOT)).unwrap();
    let (front, mut press, mut trouble) = (FrontPanel::default(), Some(Press::Down), false);
    let ran =
        run(folders, setting, &mut camera, Arc::default(), &front, (0.0, 200.0), |now, front| {
            if now > 6.0 {
                press.take().into_iter().for_each(|press| front.press(press));
            }
            trouble |= front.state() == BoxState::Trouble;
        });
    assert_eq!((ran.taken.len(), ran.summary.restored.len(), trouble), (1, 1, true));
}
