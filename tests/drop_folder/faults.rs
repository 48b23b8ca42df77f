//! Random scripts of faults: the disk fails, fills up or disappears, power cuts, failures of the
//! rig, jumps of the calendar, photos dropped, completed and taken back, stops of the service.
//!
//! After every step each photo is whole and in one place; in the end each has exactly one result or
//! one reason. A script is its seed: `RELENS_FAULT_SEED=n` replays one, `RELENS_FAULT_SCRIPTS=n`
//! runs more.

use std::cell::{Cell, RefCell};
use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, UNIX_EPOCH};

use relens::config::Curve;
use relens::daemon::{Daemon, DaemonSetting, Folders};
use relens::disk::Disk;
use relens::remedy::Remedy;

use crate::bed::{Brightener, CALENDAR_UNIX_S, TestClock};
use crate::model_disk::{Contents, ModelDisk, Op, Verdict};
use crate::power::{TINY, good};
use crate::power_checks::{Dropped, ROOT, at_every_instant, in_the_end};

/// Number of scripts by default.
const SCRIPTS: u64 = 60;
/// A script that lost a photo: one returned to the inbox was replaced in `working` by the next of
/// its name, after a power cut that undid the return but not the claim.
const LOST_ONE: u64 = 1738;

/// Number of runs of the daemon in a script.
const LIVES: usize = 6;
/// Maximum number of steps in a run.
const STEPS: usize = 60;

/// Random numbers from a seed: SplitMix64 (Steele, Lea, Flood 2014).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// Current faults of the disk.
#[derive(Debug, Clone, Default)]
struct Plan {
    full: bool,
    gone: bool,
    /// Number of operations before one fails.
    fails_in: Option<usize>,
    /// Number of operations before the power is cut.
    cut_in: Option<usize>,
}

fn guard(plan: Arc<Mutex<Plan>>) -> crate::model_disk::Guard {
    Box::new(move |op: &Op, _: &Contents| {
        let mut plan = plan.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if plan.gone {
            return Err(std::io::Error::from_raw_os_error(19)); // ENODEV
        }
        let due = |count: &mut Option<usize>| {
            let due = *count == Some(0);
            *count = count.and_then(|n| n.checked_sub(1));
            due
        };
        if due(&mut plan.fails_in) {
            return Err(std::io::Error::from_raw_os_error(5)); // EIO
        }
        if matches!(op, Op::Read(_)) {
            return Ok(Verdict::Done);
        }
        if due(&mut plan.cut_in) {
            drop(plan);
            std::panic::resume_unwind(Box::new("the power fails"));
        }
        if plan.full && matches!(op, Op::Write(_)) {
            return Err(ErrorKind::StorageFull.into());
        }
        Ok(Verdict::Done)
    })
}

/// The world around the box.
struct World {
    chance: Chance,
    plan: Arc<Mutex<Plan>>,
    disk: ModelDisk,
    /// Whole photos that have not been dropped yet.
    to_come: Vec<Dropped>,
    /// The photo being copied, and its path.
    half: Option<(PathBuf, Dropped)>,
    dropped: Vec<Dropped>,
    inodes: u64,
    log: Vec<String>,
}

impl World {
    fn inbox(&self, name: &str) -> PathBuf {
        Path::new(ROOT).join("inbox").join(name)
    }

    fn put(&mut self, path: &Path, bytes: &[u8]) {
        self.inodes += 1;
        self.disk.drop_in(path, bytes, self.inodes);
    }

    /// Repeats the interrupted copy, unless another file has its name.
    fn finish_half(&mut self) -> String {
        let Some((path, photo)) = self.half.take() else { return nothing() };
        let half = &photo.bytes[..photo.bytes.len() / 2];
        if self.disk.contents().now().get(&path).is_some_and(|(_, holds)| holds[..] != *half) {
            self.to_come.push(photo);
            return nothing();
        }
        self.put(&path, &photo.bytes);
        self.dropped.push(photo);
        "the half photo is complete".to_owned()
    }

    /// Performs a random step; returns whether the service is to be stopped.
    fn step(
        &mut self,
        failures: &RefCell<Vec<Remedy>>,
        calendar: &Cell<u64>,
    ) -> Result<bool, String> {
        let what = self.chance.below(16);
        let soon = self.chance.below(50);
        let plan = Arc::clone(&self.plan);
        let mut plan = plan.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut stop = false;
        let words = match what {
            0..=3 => match self.to_come.pop() {
                Some(photo)
                    if !self.disk.contents().now().contains_key(&self.inbox(photo.name)) =>
                {
                    let (path, words) =
                        (self.inbox(photo.name), format!("{} is dropped", photo.name));
                    self.put(&path, &photo.bytes);
                    self.dropped.push(photo);
                    words
                }
                Some(photo) => {
                    self.to_come.insert(0, photo);
                    nothing()
                }
                None => nothing(),
            },
            4 => match self.to_come.pop() {
                Some(photo)
                    if self.half.is_none()
                        && !self.disk.contents().now().contains_key(&self.inbox(photo.name)) =>
                {
                    let path = self.inbox(photo.name);
                    self.put(&path, &photo.bytes[..photo.bytes.len() / 2]);
                    let words = format!("half of {} is dropped", photo.name);
                    self.half = Some((path, photo));
                    words
                }
                Some(photo) => {
                    self.to_come.insert(0, photo);
                    nothing()
                }
                None => nothing(),
            },
            5 => self.finish_half(),
            6 => {
                plan.full = !plan.full;
                format!("full: {}", plan.full)
            }
            7 => {
                plan.gone = !plan.gone;
                format!("gone: {}", plan.gone)
            }
            8 | 9 => {
                plan.fails_in = Some(soon);
                format!("a read or write error in {soon} operations")
            }
            10 | 11 => {
                plan.cut_in = Some(soon);
                format!("a power cut in {soon} operations")
            }
            12 => {
                let all = [
                    Remedy::ShootAgain,
                    Remedy::RetryLater,
                    Remedy::ReopenRig,
                    Remedy::Recalibrate,
                    Remedy::CallOperator,
                ];
                let remedy = all[self.chance.below(all.len())];
                failures.borrow_mut().extend(std::iter::repeat_n(remedy, 1 + self.chance.below(4)));
                format!("the rig: {remedy:?}")
            }
            13 => {
                let day = 86_400;
                calendar.set(if soon.is_multiple_of(2) {
                    calendar.get() + day
                } else {
                    calendar.get() - day
                });
                "the calendar jumps".to_owned()
            }
            14 => {
                let now = self.disk.contents().now();
                let taken = self.dropped.iter().position(|photo| {
                    now.get(&self.inbox(photo.name))
                        .is_some_and(|(_, holds)| holds[..] == photo.bytes[..])
                });
                match taken {
                    Some(n) if !plan.gone => {
                        let photo = self.dropped.remove(n);
                        let there = now
                            .values()
                            .any(|(_, holds)| photo.result.as_deref() == Some(&holds[..]));
                        if there {
                            return Err(format!(
                                "{} waits in the inbox and has a result",
                                photo.name
                            ));
                        }
                        self.disk.take_away(&self.inbox(photo.name));
                        format!("{} is taken back", photo.name)
                    }
                    _ => nothing(),
                }
            }
            _ => {
                stop = true;
                "the service is stopped".to_owned()
            }
        };
        self.log.push(words);
        at_every_instant(&self.disk.contents().now(), &self.dropped)?;
        Ok(stop)
    }
}

fn nothing() -> String {
    "nothing".to_owned()
}

/// Runs the script of `seed`; returns the number of photos dropped.
fn script(seed: u64) -> Result<usize, String> {
    let empty = ModelDisk::new(Contents::default(), Box::new(|_, _| Ok(Verdict::Done)));
    empty.make_folder(Path::new(ROOT)).map_err(|e| e.to_string())?;
    Folders::on(Arc::new(empty.clone()), Path::new(ROOT)).map_err(|e| e.to_string())?;
    let plan = Arc::<Mutex<Plan>>::default();
    let names = ["a.png", "b.png", "c.png", "A.png"];
    static GOOD: OnceLock<Vec<Dropped>> = OnceLock::new();
    let good =
        GOOD.get_or_init(|| (0..9).map(|n| good(names[n % 4], 20.0 + 15.0 * n as f32)).collect());
    let mut to_come = good.clone();
    for (n, name) in names.into_iter().enumerate().take(3) {
        let bytes = format!("Dear Sir {n}").into_bytes();
        to_come.insert(4 * n, Dropped { name, bytes, result: None });
    }
    let mut world = World {
        chance: Chance(seed),
        plan: Arc::clone(&plan),
        disk: ModelDisk::new(empty.contents(), guard(Arc::clone(&plan))),
        to_come,
        half: None,
        dropped: vec![],
        inodes: 0,
        log: vec![],
    };
    let with_log = |world: &World, words: &str| {
        let log =
            world.log.iter().filter(|w| *w != "nothing").cloned().collect::<Vec<_>>().join("; ");
        format!("{words}\nafter: {log}")
    };
    let calendar = Cell::new(CALENDAR_UNIX_S);
    for life in 0..=LIVES {
        let calm = life == LIVES;
        let harm = live(&mut world, calm, &calendar);
        harm.map_err(|words| with_log(&world, &words))?;
    }
    let end = world.disk.contents().now();
    in_the_end(&end, &world.dropped).map_err(|words| with_log(&world, &words))?;
    Ok(world.dropped.len())
}

/// One run of the service: until a stop or a power cut or, in a calm world, until all is done.
fn live(world: &mut World, calm: bool, calendar: &Cell<u64>) -> Result<(), String> {
    let plan = Arc::clone(&world.plan);
    // The disk is repaired before a restart.
    *plan.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Plan::default();
    if calm {
        world.finish_half();
    }
    let disk = world.disk.clone();
    let (clock, failures) = (TestClock::default(), RefCell::new(vec![]));
    let dates = || UNIX_EPOCH + Duration::from_secs(calendar.get());
    let setting =
        DaemonSetting { hints: false, ..DaemonSetting::new("test rig", TINY, Curve::Srgb) };
    let harm = RefCell::new(None);
    let ended = {
        let world = RefCell::new(&mut *world);
        let (calls, steps) = (Cell::new(0usize), Cell::new(0));
        let stop = || {
            calls.set(calls.get() + 1);
            if calm {
                return clock.0.get() > 7200.0;
            }
            // A step of the world now and then, between photos and during waits.
            if !calls.get().is_multiple_of(23) {
                return false;
            }
            steps.set(steps.get() + 1);
            match world.borrow_mut().step(&failures, calendar) {
                Ok(stop) => stop || steps.get() >= STEPS,
                Err(words) => {
                    *harm.borrow_mut() = Some(words);
                    true
                }
            }
        };
        catch_unwind(AssertUnwindSafe(|| -> Result<(), String> {
            let folders =
                Folders::on(Arc::new(disk.clone()), Path::new(ROOT)).map_err(|e| e.to_string())?;
            let mut restorer = Failing { inner: Brightener::default(), failures: &failures };
            let mut watcher = ();
            let mut daemon =
                Daemon::open(folders, setting, &mut restorer, &clock, &dates, &mut watcher)
                    .map_err(|e| e.to_string())?;
            daemon.run(&stop);
            Ok(())
        }))
    };
    if let Some(words) = harm.into_inner() {
        return Err(words);
    }
    match ended {
        Ok(ended) => ended,
        Err(_) => {
            // The power is back, and the disk is in one of its possible states.
            let contents = disk.contents();
            let mut cuts = contents.cuts(&|_| false);
            let survivors = cuts.swap_remove(world.chance.below(cuts.len()));
            at_every_instant(&survivors, &world.dropped)?;
            let contents = Contents::after(&survivors, contents.folders());
            world.log.push("the power is cut".to_owned());
            world.disk = ModelDisk::new(contents, guard(Arc::clone(&world.plan)));
            Ok(())
        }
    }
}

/// Restores, or fails as scripted.
struct Failing<'a> {
    inner: Brightener,
    failures: &'a RefCell<Vec<Remedy>>,
}

impl relens::daemon::Restorer for Failing<'_> {
    fn restore(
        &mut self,
        photo: &relens::picture::Photo,
        progress: &mut dyn FnMut(relens::daemon::Progress),
    ) -> Result<relens::pipeline::Outcome, relens::remedy::AnyFailure> {
        self.inner.failures.extend(self.failures.borrow_mut().pop());
        self.inner.restore(photo, progress)
    }
    fn mend(&mut self, remedy: Remedy) -> Result<(), relens::remedy::AnyFailure> {
        self.inner.mend(remedy)
    }
}

#[test]
fn no_fault_harms_a_photo() {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
    let seeds = match number("RELENS_FAULT_SEED") {
        Some(seed) => vec![seed],
        None => (0..number("RELENS_FAULT_SCRIPTS").unwrap_or(SCRIPTS)).chain([LOST_ONE]).collect(),
    };
    let mut photos = 0;
    for seed in seeds {
        photos += script(seed).unwrap_or_else(|harm| panic!("RELENS_FAULT_SEED={seed}: {harm}"));
    }
    println!("{photos} photos");
    assert!(photos > 0);
}

/// The model disk refuses to rename between folders, as if the inbox were on another file system.
#[test]
fn photos_are_taken_from_an_inbox_on_another_file_system() {
    let guard = |op: &Op, _: &Contents| match op {
        Op::Rename(from, to) if from.parent() != to.parent() => {
            Err(std::io::Error::from_raw_os_error(18)) // EXDEV
        }
        _ => Ok(Verdict::Done),
    };
    let disk = ModelDisk::new(Contents::default(), Box::new(guard));
    disk.make_folder(Path::new(ROOT)).unwrap();
    let folders = Folders::on(Arc::new(disk.clone()), Path::new(ROOT)).unwrap();
    let photo = good("a.png", 50.0);
    let letter = b"Dear Sir".to_vec();
    disk.drop_in(&Path::new(ROOT).join("inbox/a.png"), &photo.bytes, 1);
    disk.drop_in(&Path::new(ROOT).join("inbox/b.png"), &letter, 2);
    let (clock, mut restorer, mut watcher) = (TestClock::default(), Brightener::default(), ());
    let calendar = || UNIX_EPOCH + Duration::from_secs(CALENDAR_UNIX_S);
    let setting = DaemonSetting::new("test rig", TINY, Curve::Srgb);
    let mut daemon =
        Daemon::open(folders, setting, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let summary = daemon.once(&|| false).unwrap();
    assert_eq!((summary.restored.len(), summary.failed.len()), (1, 1), "{summary:?}");
    let now = disk.contents().now();
    let holds =
        |place: &str| now.get(&Path::new(ROOT).join(place)).map(|(_, bytes)| bytes.to_vec());
    assert_eq!(holds("done/a.png"), Some(photo.bytes));
    assert_eq!(holds("failed/b.png"), Some(letter));
    let inbox = Path::new(ROOT).join("inbox");
    assert!(now.keys().all(|path| path.parent() != Some(&inbox)), "{:?}", now.keys());
}
