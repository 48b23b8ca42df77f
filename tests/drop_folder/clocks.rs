//! Calendars that jump: at boot, before the network has set them, and when they are set back.

use std::cell::{Cell, RefCell};
use std::fs::File;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use relens::daemon::{Daemon, DaemonSetting, Folders, Report, Summary};
use relens::picture::Format;

use crate::bed::*;

const DAY_S: i64 = 86_400;

/// Watches `root` for `seconds` by the calendar `unix_s`, calling `world` with the time before each
/// step.
fn watch(root: &Path, seconds: f64, unix_s: &Cell<i64>, world: &mut dyn FnMut(f64)) -> Summary {
    let clock = TestClock::default();
    let (mut restorer, mut watcher) = (Brightener::default(), ());
    let calendar = || {
        let now_s = unix_s.get() as f64 + clock.0.get();
        UNIX_EPOCH + Duration::from_secs_f64(now_s.max(0.0))
    };
    let setting = DaemonSetting { hints: false, ..setting() };
    let folders = Folders::open(root).unwrap();
    let mut daemon =
        Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let world = RefCell::new(world);
    daemon.run(&|| {
        world.borrow_mut()(clock.0.get());
        clock.0.get() > seconds
    })
}

/// Names of the photos in the gallery's data, oldest first.
fn in_order(root: &Path) -> Vec<String> {
    let data = std::fs::read(root.join("outbox/gallery/report.json")).unwrap();
    let data: serde_json::Value = serde_json::from_slice(&data).unwrap();
    let name = |photo: &serde_json::Value| photo["photo"].as_str().unwrap().to_owned();
    data["photos"].as_array().unwrap().iter().map(name).collect()
}

#[test]
fn a_calendar_that_jumps_changes_neither_waiting_nor_order() {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs() as i64;
    // Set back a year; set forward a day; set by the network on a board without a battery.
    for (begin, jump) in [(now, -366 * DAY_S), (now, DAY_S), (100, now)] {
        let root = fresh_root();
        let root = root.path();
        let whole = file(Format::Jpeg, 8, RIG);
        drop_in(root, "c.png", &file(Format::Png, 8, RIG));
        drop_in(root, "b.jpg", &whole[..whole.len() / 2]);
        drop_in(root, "never.jpg", &whole[..whole.len() / 3]);
        let (calendar, mut steps, mut rejected) = (Cell::new(begin), 0, f64::INFINITY);
        let summary = watch(root, 1100.0, &calendar, &mut |at| {
            let due = [20.0, 30.0, 200.0].iter().filter(|&&due| at >= due).count();
            while steps < due {
                match steps {
                    0 => calendar.set(calendar.get() + jump),
                    1 => drop_in(root, "a.png", &file(Format::Png, 8, RIG)),
                    _ => std::fs::write(root.join("inbox/b.jpg"), &whole).unwrap(),
                }
                steps += 1;
            }
            for (name, latest) in [("c.png", 20.0), ("a.png", 40.0), ("b.jpg", 220.0)] {
                assert!(at < latest || root.join("outbox").join(name).exists(), "{name} at {at} s");
            }
            if root.join("failed/never.jpg").exists() {
                rejected = rejected.min(at);
            }
        });
        assert_eq!((summary.restored.len(), summary.failed.len()), (3, 1), "{jump}: {summary:?}");
        assert!((900.0..920.0).contains(&rejected), "{jump}: at {rejected} s");
        let dated = |name: &str| {
            let report = std::fs::read(root.join(format!("outbox/{name}.json"))).unwrap();
            serde_json::from_slice::<Report>(&report).unwrap().finished_unix_s as i64
        };
        assert!((begin..begin + 20).contains(&dated("c.png")), "by the calendar of its time");
        assert!((begin + jump..begin + jump + 50).contains(&dated("a.png")));
        let order = ["c.png", "a.png", "b.jpg"];
        assert_eq!(in_order(root), order, "{jump}");
        // The order survives a restart with one more photo and the calendar set where it began.
        drop_in(root, "d.png", &file(Format::Png, 8, RIG));
        watch(root, 20.0, &Cell::new(begin), &mut |_| ());
        assert_eq!(in_order(root), [&order[..], &["d.png"]].concat(), "{jump}");
    }
}

#[test]
fn damaged_photos_from_the_future_delay_no_others() {
    let root = fresh_root();
    let root = root.path();
    let mut damaged = file(Format::Png, 8, RIG);
    let half = damaged.len() / 2;
    damaged[half] ^= 1;
    for n in 0..30 {
        let name = format!("{n}.png");
        drop_in(root, &name, &damaged);
        let dropped = File::options().write(true).open(root.join("inbox").join(name)).unwrap();
        // Dated by a camera whose clock is ahead, or before the box's clock was set back.
        let ahead = Duration::from_secs(400 * DAY_S as u64);
        dropped.set_modified(UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S) + ahead).unwrap();
    }
    let clock = TestClock::default();
    let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let (mut restorer, mut watcher) = (Brightener::default(), ());
    let folders = Folders::open(root).unwrap();
    let mut daemon =
        Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    assert_eq!(daemon.once(&|| false).unwrap().failed.len(), 30);
    assert!(clock.0.get() < 2.0, "{} s", clock.0.get());
}
