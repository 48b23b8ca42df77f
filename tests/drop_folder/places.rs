//! Folders that disappear and come back while the daemon runs, and disks without free inodes.

use std::cell::RefCell;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::{Duration, UNIX_EPOCH};

use relens::daemon::{Daemon, DaemonSetting, Doing, Folders, JobStep, Watcher};
use relens::picture::Format;

use crate::bed::*;
use crate::model_disk::{Contents, ModelDisk, Op, Verdict};

/// Reasons for which the daemon was held, without consecutive repetitions.
#[derive(Default)]
struct Reasons(Vec<String>);

impl Watcher for Reasons {
    fn doing(&mut self, doing: &Doing) {
        if let Doing::Held { reason } = doing
            && self.0.last() != Some(reason)
        {
            self.0.push(reason.clone());
        }
    }
}

/// Watches `folders` for 300 s, calling `world` with the time before each step; returns the reasons
/// for which it was held, and the number of restorations.
fn watch(folders: Folders, world: &mut dyn FnMut(f64)) -> (Vec<String>, usize) {
    let clock = TestClock::default();
    let (mut restorer, mut watcher) = (Brightener::default(), Reasons::default());
    let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let setting = DaemonSetting { hints: false, floor_bytes: 0, ..setting() };
    let mut daemon =
        Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let (world, mut asked) = (RefCell::new(world), 0);
    let asked = RefCell::new(&mut asked);
    let summary = daemon.run(&|| {
        **asked.borrow_mut() += 1;
        assert!(**asked.borrow() < 100_000, "the clock does not advance");
        world.borrow_mut()(clock.0.get());
        clock.0.get() > 300.0
    });
    assert!(summary.failed.is_empty() && summary.deferred.is_empty(), "{summary:?}");
    drop(daemon);
    (watcher.0, restorer.restored)
}

/// A world in which `away` is called at 20 s, a photo dropped into `inbox` at 21 s, and `back`
/// called at 100 s; the photo must have its result within 10 s of that.
fn away_and_back<'a>(
    root: &'a Path,
    inbox: &'a Path,
    away: &'a dyn Fn(),
    back: &'a dyn Fn(),
) -> impl FnMut(f64) + 'a {
    let (mut steps, bytes) = (0, file(Format::Png, 8, RIG));
    move |now| {
        let due = [20.0, 21.0, 100.0].iter().filter(|&&at| now >= at).count();
        while steps < due {
            match steps {
                0 => away(),
                1 => std::fs::write(inbox.join("b.png"), &bytes).unwrap(),
                _ => {
                    assert_eq!(std::fs::read(inbox.join("b.png")).unwrap(), bytes, "untouched");
                    back();
                }
            }
            steps += 1;
        }
        assert!(now < 110.0 || root.join("outbox/b.png").exists(), "none at {now} s");
    }
}

/// Checks that both photos were restored, and that the only reason contains all `words`.
fn both_came_through(root: &Path, (reasons, restored): (Vec<String>, usize), words: &[&str]) {
    assert!(reasons.len() == 1, "one sentence: {reasons:#?}");
    assert!(words.iter().all(|word| reasons[0].contains(word)), "{words:?}: {reasons:?}");
    assert_eq!(restored, 2, "none in vain");
    assert_eq!(names(&root.join("done")), set(&["a.png", "b.png"]));
    for folder in ["inbox", "working", "failed"] {
        assert!(names(&root.join(folder)).is_empty(), "{folder}");
    }
}

#[test]
fn each_folder_may_go_away_and_come_back() {
    for name in ["inbox", "working", "outbox", "done", "failed"] {
        let root = fresh_root();
        let root = root.path();
        drop_in(root, "a.png", &file(Format::Png, 8, RIG));
        let (here, there) = (root.join(name), root.join("away"));
        let inbox = if name == "inbox" { &there } else { &root.join("inbox") };
        let away = || std::fs::rename(&here, &there).unwrap();
        let back = || std::fs::rename(&there, &here).unwrap();
        let seen =
            watch(Folders::open(root).unwrap(), &mut away_and_back(root, inbox, &away, &back));
        both_came_through(root, seen, &[&here.display().to_string(), "No such file"]);
    }
}

#[test]
fn a_folder_that_goes_away_during_a_photo_loses_nothing() {
    struct Mover<'a>(&'a Path, &'a str, JobStep, Reasons);
    impl Watcher for Mover<'_> {
        fn step(&mut self, step: JobStep) {
            let Mover(root, name, at, reasons) = self;
            if step == *at && reasons.0.is_empty() && !root.join("away").exists() {
                std::fs::rename(root.join(name), root.join("away")).unwrap();
            }
        }
        fn doing(&mut self, doing: &Doing) {
            self.3.doing(doing);
        }
    }
    for name in ["working", "outbox", "done", "inbox"] {
        for step in [JobStep::Claimed, JobStep::Restored, JobStep::Delivered] {
            let root = fresh_root();
            let root = root.path();
            drop_in(root, "a.png", &file(Format::Png, 8, RIG));
            let (clock, mut restorer) = (TestClock::default(), Brightener::default());
            let mut watcher = Mover(root, name, step, Reasons::default());
            let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
            let folders = Folders::open(root).unwrap();
            let mut daemon =
                Daemon::open(folders, setting(), &mut restorer, &clock, &calendar, &mut watcher)
                    .unwrap();
            daemon.run(&|| {
                if clock.0.get() > 100.0 && root.join("away").exists() {
                    std::fs::rename(root.join("away"), root.join(name)).unwrap();
                }
                clock.0.get() > 300.0
            });
            drop(daemon);
            let reasons = watcher.3.0;
            assert_eq!(reasons.len(), 1, "{name} at {step:?}: {reasons:#?}");
            assert_eq!(names(&root.join("done")), set(&["a.png"]), "{name} at {step:?}");
            assert_eq!(names(&root.join("outbox")), set(&["a.png", "a.png.json"]));
            for folder in ["inbox", "working"] {
                assert!(names(&root.join(folder)).is_empty(), "{folder}: {name} at {step:?}");
            }
        }
    }
}

#[test]
fn a_share_that_is_gone_is_one_sentence_and_not_one_a_photo() {
    const ROOT: &str = "/box";
    let inbox = Path::new(ROOT).join("inbox");
    for errno in [19, 107, 116, 110, 113] {
        let gone = Arc::new(AtomicI32::new(0));
        let (now_gone, place) = (Arc::clone(&gone), inbox.clone());
        // The names in the share are still cached, but its files cannot be read.
        let guard = move |op: &Op, _: &Contents| match (op, now_gone.load(Ordering::SeqCst)) {
            (Op::Read(path) | Op::Rename(path, _), errno @ 1..)
                if path.parent() == Some(&place) =>
            {
                Err(std::io::Error::from_raw_os_error(errno))
            }
            _ => Ok(Verdict::Done),
        };
        let disk = ModelDisk::new(Contents::default(), Box::new(guard));
        relens::disk::Disk::make_folder(&disk, Path::new(ROOT)).unwrap();
        let folders = Folders::on(Arc::new(disk.clone()), Path::new(ROOT)).unwrap();
        let bytes = file(Format::Png, 8, RIG);
        for n in 0..3 {
            disk.drop_in(&inbox.join(format!("{n}.png")), &bytes, n + 1);
        }
        gone.store(errno, Ordering::SeqCst);
        let (reasons, restored) = watch(folders, &mut |now| {
            if now > 100.0 {
                gone.store(0, Ordering::SeqCst);
            }
        });
        assert_eq!((reasons.len(), restored), (1, 3), "{reasons:#?}");
    }
}

/// Runs the ignored test `name` of this file as root in a mount namespace of its own; returns false
/// if that is not allowed.
fn with_own_mounts(name: &str) -> bool {
    let allowed = Command::new("unshare").args(["-rm", "true"]).output();
    if !allowed.is_ok_and(|it| it.status.success()) {
        return false;
    }
    let test = std::env::current_exe().unwrap();
    let output = Command::new("unshare")
        .arg("-rm")
        .arg(test)
        .args([&*format!("places::{name}"), "--exact", "--ignored", "--nocapture"])
        .output()
        .unwrap();
    let words = [output.stdout, output.stderr].concat();
    let words = String::from_utf8_lossy(&words);
    assert!(output.status.success() && words.contains("1 passed"), "{words}");
    true
}

fn run(program: &str, arguments: &[&str]) {
    let output = Command::new(program).args(arguments).output().unwrap();
    assert!(output.status.success(), "{program} {arguments:?}: {output:?}");
}

fn mount(path: &Path, options: &str) {
    run("mount", &["-t", "tmpfs", "-o", options, "relens-test", &path.display().to_string()]);
}

#[test]
fn a_mount_may_vanish_and_come_back() {
    if !with_own_mounts("mounts_vanish_and_come_back") {
        println!("mounts are not allowed here");
    }
}

#[test]
#[ignore = "a_mount_may_vanish_and_come_back runs it"]
fn mounts_vanish_and_come_back() {
    for name in ["inbox", "working", "outbox", "done"] {
        let root = tempfile::tempdir().unwrap();
        let root = &root.path().canonicalize().unwrap();
        let (here, there) = (root.join(name), root.join("away"));
        std::fs::create_dir(&here).unwrap();
        std::fs::create_dir(&there).unwrap();
        mount(&here, "size=16m");
        drop_in(root, "a.png", &file(Format::Png, 8, RIG));
        let inbox = if name == "inbox" { &there } else { &root.join("inbox") };
        let (from, to) = (here.display().to_string(), there.display().to_string());
        let away = || run("mount", &["--move", &from, &to]);
        let back = || run("mount", &["--move", &to, &from]);
        let seen =
            watch(Folders::open(root).unwrap(), &mut away_and_back(root, inbox, &away, &back));
        both_came_through(root, seen, &[&from, "is not mounted"]);
        run("umount", &[&from]);
    }
}

#[test]
fn a_disk_without_inodes_is_named() {
    if !with_own_mounts("inodes_run_out") {
        println!("mounts are not allowed here");
    }
}

#[test]
#[ignore = "a_disk_without_inodes_is_named runs it"]
fn inodes_run_out() {
    let root = tempfile::tempdir().unwrap();
    let root = &root.path().canonicalize().unwrap();
    let outbox = root.join("outbox");
    std::fs::create_dir(&outbox).unwrap();
    mount(&outbox, "size=16m,nr_inodes=100");
    drop_in(root, "a.png", &file(Format::Png, 8, RIG));
    let filler = |n: usize| outbox.join(format!(".filler-{n}"));
    let away = || {
        let made = (0..100).take_while(|&n| std::fs::write(filler(n), b"").is_ok()).count();
        assert!(made > 10 && made < 100, "{made}");
    };
    let back = || {
        for n in 0..100 {
            let _ = std::fs::remove_file(filler(n));
        }
    };
    let inbox = root.join("inbox");
    let seen = watch(Folders::open(root).unwrap(), &mut away_and_back(root, &inbox, &away, &back));
    both_came_through(root, seen, &[&outbox.display().to_string(), "0 free inodes", "remove"]);
    run("umount", &[&outbox.display().to_string()]);
}
