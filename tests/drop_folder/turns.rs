//! A schedule decides when photos are restored, and is notified of each outcome.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use relens::daemon::{
    Awaited, Daemon, Doing, Event, Folders, JobEnd, Question, Restorer, Schedule, State, Turn,
};
use relens::picture::Format;

use crate::bed::*;

/// Returns the turns of a list in order, then `Go`.
#[derive(Default)]
struct Script {
    turns: Vec<Turn>,
    log: Rc<RefCell<Vec<String>>>,
}

impl Schedule for Script {
    fn turn(&mut self, asked: Question, _: &mut dyn Restorer) -> Turn {
        let mut log = self.log.borrow_mut();
        if !asked.is_ready {
            log.push("idle".into());
            return Turn::Go;
        }
        log.push(format!("before {}", asked.waiting));
        if self.turns.is_empty() { Turn::Go } else { self.turns.remove(0) }
    }
    fn notify(&mut self, event: Event<'_>, _: &mut dyn Restorer) {
        let Event::Ended(end) = event else { return };
        self.log.borrow_mut().push(match end {
            JobEnd::Done { report, delivered, .. } => {
                format!("{} is {}", report.result, delivered.kept.to_string_lossy())
            }
            JobEnd::Failed(failed) => format!("{} failed", failed.photo),
            JobEnd::Deferred { path, .. } => format!("{} deferred", path.display()),
            JobEnd::Gone => "gone".into(),
        });
    }
}

fn hold(until: Option<f64>) -> Turn {
    Turn::Hold {
        reason: "the night has not begun".into(),
        awaited: Awaited::Window,
        until: until.map(relens::rig::Moment),
    }
}

fn calendar() -> SystemTime {
    UNIX_EPOCH + Duration::from_secs(4_000_000_000)
}

/// Fills the inbox with three photos, the oldest last by name, and a broken one, the newest.
fn inbox(root: &std::path::Path) {
    for (age, name) in [(30, "c.png"), (20, "b.png"), (10, "a.png"), (5, "broken.png")] {
        let bytes =
            if name == "broken.png" { b"no png".to_vec() } else { file(Format::Png, 8, RIG) };
        drop_in(root, name, &bytes);
        let opened =
            std::fs::File::options().write(true).open(root.join("inbox").join(name)).unwrap();
        opened.set_modified(SystemTime::now() - Duration::from_secs(age)).unwrap();
    }
}

#[test]
fn photos_go_oldest_first_and_each_outcome_is_notified() {
    let root = fresh_root();
    inbox(root.path());
    let log = Rc::default();
    let script = Script { turns: vec![], log: Rc::clone(&log) };
    let (clock, mut restorer) = (TestClock::default(), Brightener::default());
    let folders = Folders::open(root.path()).unwrap();
    let mut watcher = ();
    let mut daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    daemon = daemon.scheduled(Box::new(script));
    daemon.once(&|| false).unwrap();
    let expected =
        ["before 4", "c.png is c.png", "before 3", "b.png is b.png", "before 2", "a.png is a.png"];
    let expected = expected.iter().chain(&["before 1", "broken.png failed", "idle"]);
    assert_eq!(*log.borrow(), expected.map(|s| (*s).to_owned()).collect::<Vec<_>>());
}

#[test]
fn a_hold_keeps_photos_in_the_inbox_until_the_next_turn() {
    let root = fresh_root();
    inbox(root.path());
    let script = Script {
        turns: vec![Turn::Go, hold(Some(1000.0)), hold(None), Turn::Go],
        ..Script::default()
    };
    let (clock, mut restorer) = (TestClock::default(), Brightener::default());
    let folders = Folders::open(root.path()).unwrap();
    let mut watcher = ();
    let mut daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    daemon = daemon.scheduled(Box::new(script));
    let mut paused = vec![];
    let summary = {
        let stop = || {
            let now = clock.0.get();
            let state = State::read(root.path()).unwrap().unwrap();
            if matches!(state.doing, Doing::Paused { .. }) {
                paused.push(now);
                assert!(
                    !root.path().join("done/b.png").exists()
                        && root.path().join("inbox/b.png").exists()
                );
            }
            now > 100.0
        };
        let stop = RefCell::new(stop);
        daemon.run(&|| stop.borrow_mut()())
    };
    assert_eq!((summary.restored.len(), summary.failed.len()), (3, 1));
    let (first, last) = (paused.first().unwrap(), paused.last().unwrap());
    assert!(*first < 10.0 && (15.0..45.0).contains(last), "{first} to {last}");
}

#[test]
fn a_schedule_can_stop_the_daemon() {
    let root = fresh_root();
    inbox(root.path());
    let script = Script { turns: vec![Turn::Go, Turn::Stop], ..Script::default() };
    let (clock, mut restorer) = (TestClock::default(), Brightener::default());
    let folders = Folders::open(root.path()).unwrap();
    let mut watcher = ();
    let mut daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    daemon = daemon.scheduled(Box::new(script));
    let summary = daemon.run(&|| false);
    assert_eq!(summary.restored.len(), 1);
    assert_eq!(State::read(root.path()).unwrap().unwrap().doing, Doing::Ended);
}
