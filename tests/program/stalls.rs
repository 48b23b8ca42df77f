//! Whatever hangs, the watchdog is no longer fed or the problem is reported.
//!
//! The daemon's thread may hang in a capture or a solve, a pilot, a calibration, a screen, the disk
//! or the worker that decodes a photo. The front panel (button and lamps) has its own thread.

use std::io::{self, Read};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant, SystemTime};

use relens::config::{Curve, Mode};
use relens::daemon::service::{ServiceManager, Supervised};
use relens::daemon::{
    Attended, Daemon, DaemonSetting, Folders, Progress, Question, Restorer, Schedule, Turn,
};
use relens::disk::{Disk, FileKind, LocalDisk, Metadata, Unsynced};
use relens::frame::{Frame, Plane, Size, Work};
use relens::kiosk::attend::attend;
use relens::kiosk::front_panel::FrontPanel;
use relens::kiosk::screen::Screen;
use relens::picture::worker::Worker;
use relens::picture::{Format, Manner, Photo, encode};
use relens::pipeline::Outcome;
use relens::remedy::{AnyFailure, Remediable, Remedy};
use relens::rig::{ButtonLevel, Clock, Lamp, LampRow, Moment, RigError};

const RIG: Size = Size::new(64, 48);

/// Time for a few rounds of a working daemon, also on a busy machine.
const WHILE: Duration = Duration::from_millis(1500);

/// A gate that blocks while it is shut.
#[derive(Clone, Default)]
struct Gate(Arc<(Mutex<(bool, bool)>, Condvar)>);

impl Gate {
    /// Waits until the gate is open.
    fn pass(&self) {
        let (state, changed) = &*self.0;
        let mut state = state.lock().unwrap();
        while state.0 {
            state.1 = true;
            changed.notify_all();
            state = changed.wait(state).unwrap();
        }
    }
    fn set_shut(&self, shut: bool) {
        let (state, changed) = &*self.0;
        state.lock().unwrap().0 = shut;
        changed.notify_all();
    }
    /// Waits until a thread is blocked.
    fn wait_for_blocked(&self) {
        let (state, changed) = &*self.0;
        let (state, waited) = changed
            .wait_timeout_while(state.lock().unwrap(), Duration::from_secs(60), |s| !s.1)
            .unwrap();
        assert!(!waited.timed_out() && state.1, "no thread is blocked");
    }
}

/// Real time.
struct Wall(Instant);

impl Clock for Wall {
    fn now(&self) -> Moment {
        Moment(self.0.elapsed().as_secs_f64())
    }
    fn wait_until(&self, moment: Moment) {
        let wait_s = moment.0 - self.now().0;
        std::thread::sleep(Duration::from_secs_f64(wait_s.clamp(0.0, 0.02)));
    }
}

/// Location of a stall.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    Restore,
    Mend,
    Pilot,
    Panel,
    Disk,
}

#[derive(Debug, thiserror::Error)]
#[error("the rig must be calibrated")]
struct Stale;

impl Remediable for Stale {
    fn remedy(&self) -> Remedy {
        Remedy::Recalibrate
    }
}

struct Rig {
    place: Place,
    gate: Gate,
    mended: bool,
}

impl Rig {
    fn pass(&self, place: Place) {
        if self.place == place {
            self.gate.pass();
        }
    }
}

impl Restorer for Rig {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        progress(Progress { done: 0.5, doing: "capturing", captures: 1 });
        self.pass(Place::Restore);
        if self.place == Place::Mend && !self.mended {
            return Err(Box::new(Stale));
        }
        Ok(Outcome { captures: 1, ..Outcome::untouched(photo.light.clone(), "told to") })
    }
    fn mend(&mut self, _: Remedy) -> Result<(), AnyFailure> {
        self.pass(Place::Mend);
        self.mended = true;
        Ok(())
    }
    fn pilot(&mut self) -> Result<Option<relens::nights::pilot::Drift>, AnyFailure> {
        self.pass(Place::Pilot);
        Ok(None)
    }
    fn show(&mut self, _: &Screen) {
        self.pass(Place::Panel);
    }
}

/// Shows a pilot before each photo.
struct Piloted;

impl Schedule for Piloted {
    fn turn(&mut self, asked: Question, rig: &mut dyn Restorer) -> Turn {
        if asked.is_ready {
            rig.pilot().unwrap();
        }
        Turn::Go
    }
}

/// A disk that hangs when listing a folder.
struct Hanging(LocalDisk, Option<Gate>);

impl Disk for Hanging {
    fn list(&self, folder: &Path) -> io::Result<Vec<(std::ffi::OsString, FileKind)>> {
        if let Some(gate) = &self.1 {
            gate.pass();
        }
        self.0.list(folder)
    }
    fn metadata(&self, path: &Path) -> io::Result<Metadata> {
        self.0.metadata(path)
    }
    fn open(&self, path: &Path) -> io::Result<std::fs::File> {
        self.0.open(path)
    }
    fn free_bytes(&self, folder: &Path) -> io::Result<u64> {
        self.0.free_bytes(folder)
    }
    fn make_folder(&self, folder: &Path) -> io::Result<()> {
        self.0.make_folder(folder)
    }
    fn write(&self, path: &Path, content: &mut dyn Read) -> io::Result<Box<dyn Unsynced>> {
        self.0.write(path, content)
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

fn photo(root: &Path) {
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    let light: Frame<Work> = Frame::from_fn(|_| Plane::from_fn(RIG, |x, y| (x + y) as f32));
    let bytes = encode("a", &light, &Manner::plain(Format::Png, 8, Curve::Srgb), false).unwrap();
    std::fs::write(root.join("inbox/a.png"), bytes).unwrap();
}

fn setting() -> DaemonSetting {
    DaemonSetting {
        quiet_s: 0.0,
        poll_s: 0.05,
        retry_s: 0.1,
        ..DaemonSetting::new("test", RIG, Curve::Srgb)
    }
}

/// Number of times the watchdog was fed since the last call.
fn fed(socket: &UnixDatagram) -> usize {
    let (mut fed, mut buffer) = (0, [0; 4096]);
    while let Ok(length) = socket.recv(&mut buffer) {
        fed += usize::from(&buffer[..length] == b"WATCHDOG=1");
    }
    fed
}

/// Checks that a daemon that hangs in `place` does not feed the watchdog until it is released.
fn starves(place: Place) {
    let root = tempfile::tempdir().unwrap();
    let root = &root.path().canonicalize().unwrap();
    let address = root.join("notify");
    let socket = UnixDatagram::bind(&address).unwrap();
    socket.set_nonblocking(true).unwrap();
    let (gate, stop) = (Gate::default(), AtomicBool::new(false));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let manager = ServiceManager::at(Some(address.as_os_str()));
            let mut watcher = Supervised::new(&manager, Box::new(()));
            let names =
                ["inbox", "working", "outbox", "done", "failed"].map(|name| root.join(name));
            let local = LocalDisk::new(names.into_iter().chain([root.clone()]).collect());
            let disk = Hanging(local, (place == Place::Disk).then(|| gate.clone()));
            let folders = Folders::on(Arc::new(disk), root).unwrap();
            let clock = Wall(Instant::now());
            let mut rig = Rig { place, gate: gate.clone(), mended: false };
            let inner: Box<dyn Schedule> =
                if place == Place::Pilot { Box::new(Piloted) } else { Box::new(()) };
            let schedule = Attended::new(FrontPanel::default(), Mode::Folder, &clock, inner);
            let daemon =
                Daemon::open(folders, setting(), &mut rig, &clock, &SystemTime::now, &mut watcher)
                    .unwrap();
            daemon.scheduled(Box::new(schedule)).run(&|| stop.load(Ordering::Acquire));
        });
        let until_fed = || {
            let begun = Instant::now();
            while fed(&socket) == 0 {
                assert!(
                    begun.elapsed() < Duration::from_secs(60),
                    "{place:?}: the watchdog is never fed"
                );
                std::thread::sleep(Duration::from_millis(5));
            }
        };
        until_fed();
        gate.set_shut(true);
        photo(root);
        gate.wait_for_blocked();
        fed(&socket);
        std::thread::sleep(WHILE);
        let hungry = fed(&socket);
        gate.set_shut(false);
        until_fed();
        let begun = Instant::now();
        while !root.join("done/a.png").exists() && begun.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(5));
        }
        stop.store(true, Ordering::Release);
        assert_eq!(hungry, 0, "{place:?}: hung, and the watchdog was fed");
        assert!(root.join("done/a.png").exists(), "{place:?}: released, it goes on");
    });
}

#[test]
fn a_capture_or_solve_that_hangs_starves_the_watchdog() {
    starves(Place::Restore);
}

#[test]
fn a_calibration_that_hangs_starves_the_watchdog() {
    starves(Place::Mend);
}

#[test]
fn a_pilot_that_hangs_starves_the_watchdog() {
    starves(Place::Pilot);
}

#[test]
fn a_panel_that_hangs_starves_the_watchdog() {
    starves(Place::Panel);
}

#[test]
fn a_disk_that_hangs_starves_the_watchdog() {
    starves(Place::Disk);
}

#[test]
fn a_hanging_worker_is_killed_and_its_photo_has_a_reason() {
    let root = tempfile::tempdir().unwrap();
    let root = root.path();
    photo(root);
    let program = root.join("hangs");
    std::fs::write(&program, "#!/bin/sh\nexec sleep 100\n").unwrap();
    std::fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
    let worker = Some(Worker { wall_s_max: 1, ..Worker::of(program) });
    let gate = Gate::default();
    let mut rig = Rig { place: Place::Restore, gate, mended: false };
    let (clock, mut watcher) = (Wall(Instant::now()), ());
    let folders = Folders::open(root).unwrap();
    let setting = DaemonSetting { worker, ..setting() };
    let mut daemon =
        Daemon::open(folders, setting, &mut rig, &clock, &SystemTime::now, &mut watcher).unwrap();
    let summary = daemon.once(&|| false).unwrap();
    let told: Vec<_> = summary.failed.iter().chain(&summary.deferred).collect();
    assert!(told.len() == 1 && told[0].reason.contains("no answer within 1 s"), "{summary:?}");
}

/// Lamps that hang or panic.
struct Wire(Gate, bool);

impl LampRow for Wire {
    fn show(&mut self, _: &[Lamp]) -> Result<(), RigError> {
        self.0.pass();
        assert!(!self.1, "told to");
        Ok(())
    }
}

/// A button that hangs.
struct Stuck(Gate);

impl ButtonLevel for Stuck {
    fn level_by(&mut self, _: Moment) -> Result<bool, RigError> {
        self.0.pass();
        std::thread::sleep(Duration::from_millis(1));
        Ok(false)
    }
}

/// A simulated clock: waiting advances it at once.
struct Quick(Mutex<f64>);

impl Clock for Quick {
    fn now(&self) -> Moment {
        Moment(*self.0.lock().unwrap())
    }
    fn wait_until(&self, moment: Moment) {
        // A working front panel makes a round meanwhile.
        std::thread::sleep(Duration::from_millis(4));
        let mut now = self.0.lock().unwrap();
        *now = now.max(moment.0);
    }
}

/// Runs a box with these lamps and this button for `lasts_s` seconds, or until it ends by itself;
/// returns the seconds and the last screen.
fn with_front_panel(
    mut lamps: Wire,
    mut button: Stuck,
    mode: Mode,
    lasts_s: f64,
) -> (f64, Option<Screen>) {
    struct Panel(Option<Screen>);
    impl Restorer for Panel {
        fn restore(
            &mut self,
            _: &Photo,
            _: &mut dyn FnMut(Progress),
        ) -> Result<Outcome, AnyFailure> {
            Err(Box::new(Stale))
        }
        fn mend(&mut self, _: Remedy) -> Result<(), AnyFailure> {
            Ok(())
        }
        fn show(&mut self, screen: &Screen) {
            self.0 = Some(screen.clone());
        }
    }
    let root = tempfile::tempdir().unwrap();
    let (front, ended) = (FrontPanel::default(), AtomicBool::new(false));
    let gates = [lamps.0.clone(), button.0.clone()];
    let mut panel = Panel(None);
    front.count_round();
    let lasted_s = std::thread::scope(|scope| {
        let desk = scope.spawn(|| {
            let clock = Wall(Instant::now());
            let ended = || ended.load(Ordering::Acquire);
            attend(&front, Some(&mut button), &mut lamps, &clock, &ended);
        });
        let (clock, mut watcher) = (Quick(Mutex::new(0.0)), ());
        let folders = Folders::open(root.path()).unwrap();
        let schedule = Attended::new(front.clone(), mode, &clock, Box::new(()));
        let setting = DaemonSetting { poll_s: 5.0, hints: false, ..setting() };
        let daemon =
            Daemon::open(folders, setting, &mut panel, &clock, &SystemTime::now, &mut watcher)
                .unwrap();
        daemon.scheduled(Box::new(schedule)).run(&|| clock.now().0 > lasts_s);
        ended.store(true, Ordering::Release);
        gates.iter().for_each(|gate| gate.set_shut(false));
        // The front panel's thread may have panicked as scripted.
        let _ = desk.join();
        clock.now().0
    });
    (lasted_s, panel.0)
}

#[test]
fn a_hanging_or_ended_front_panel_ends_the_program() {
    let shut = Gate::default();
    shut.set_shut(true);
    let open = Gate::default;
    let (lasted_s, screen) =
        with_front_panel(Wire(open(), false), Stuck(open()), Mode::Button, 60.0);
    assert!(
        lasted_s > 60.0 && matches!(screen, Some(Screen::Ready { .. })),
        "{lasted_s} {screen:?}"
    );
    for (lamps, button) in [
        (Wire(shut.clone(), false), Stuck(open())),
        (Wire(open(), false), Stuck(shut.clone())),
        (Wire(open(), true), Stuck(open())),
    ] {
        shut.set_shut(true);
        let (lasted_s, _) = with_front_panel(lamps, button, Mode::Button, 90.0);
        assert!((30.0..60.0).contains(&lasted_s), "{lasted_s}");
    }
}
