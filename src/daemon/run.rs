//! The loop: empty the inbox once, or watch it until told to stop.

use std::collections::{BTreeMap, HashMap};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use crate::picture::Growth;
use crate::remedy::full_message;
use crate::rig::{Clock, Moment};

use super::gallery::Gallery;
use super::hints::Hints;
use super::inbox::{Inbox, Patience};
use super::job::Verdict;
use super::keeping::Keeping;
use super::lease::{Lease, Neighbours};
use super::schedule::{Ended, Schedule, Turn};
use super::{DaemonError, Doing, Failed, Folders, Report, Restorer, Setting, State, Watcher};
use crate::disk::Look;

/// While the schedule holds, it is asked again after this long at the most.
const HOLD_LOOK_S: f64 = 15.0;

/// Outcomes of either kind that a daemon that watches still has to tell at its end.
const SUMMARY_MAX: usize = 1000;

/// A wait is made of steps of this length, after each of which a stop is heard.
const STEP_S: f64 = 0.2;

/// A photo whose end is missing is spoken about after this long without a change. Guess.
const MENTION_S: f64 = 60.0;

/// What was done, since the daemon was opened.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    /// Photos with a result.
    pub restored: Vec<Report>,
    /// Photos set aside, with their reasons.
    pub failed: Vec<Failed>,
    /// Photos put back into the inbox to be tried later, with their reasons.
    pub left: Vec<Failed>,
}

/// The daemon over one set of folders and one rig.
pub struct Daemon<'a> {
    pub(super) folders: Folders,
    pub(super) setting: Setting,
    pub(super) restorer: &'a mut dyn Restorer,
    pub(super) clock: &'a dyn Clock,
    calendar: &'a dyn Fn() -> SystemTime,
    pub(super) watcher: &'a mut dyn Watcher,
    pub(super) schedule: Box<dyn Schedule + 'a>,
    pub(super) keeping: Option<Keeping<'a>>,
    inbox: Inbox,
    pub(super) lease: Lease,
    neighbours: Neighbours,
    hints: Hints,
    pub(super) gallery: Gallery,
    gallery_written: Option<Moment>,
    /// Results that it shows were removed.
    pub(super) gallery_stale: bool,
    /// Photos put back: not to be tried before this moment unless they change.
    resting: HashMap<PathBuf, (Option<Look>, Moment)>,
    /// Photos that stay in the inbox for now, by the way to them, and why.
    left: BTreeMap<PathBuf, Failed>,
    summary: Summary,
    /// Photos restored and set aside since it was opened.
    counts: (usize, usize),
    /// What was told last.
    doing: Doing,
    /// What the operator should know, as told last.
    attention: Vec<String>,
    /// Photos in `working` that an error left there, and whether their result was delivered.
    pub(super) unsettled: Vec<(OsString, bool)>,
}

impl<'a> Daemon<'a> {
    /// A daemon over `folders`, which were made good by opening them. `clock` measures waits,
    /// `calendar` dates the reports.
    ///
    /// # Errors
    /// When the outbox cannot be read.
    pub fn open(
        folders: Folders,
        setting: Setting,
        restorer: &'a mut dyn Restorer,
        clock: &'a dyn Clock,
        calendar: &'a dyn Fn() -> SystemTime,
        watcher: &'a mut dyn Watcher,
    ) -> Result<Daemon<'a>, DaemonError> {
        let gallery = Gallery::load(&folders)?;
        let lease = Lease::new(setting.lease_s);
        let hints = if setting.hints { Hints::new() } else { Hints::none() };
        Ok(Daemon {
            folders,
            setting,
            restorer,
            clock,
            calendar,
            watcher,
            schedule: Box::new(()),
            keeping: None,
            inbox: Inbox::default(),
            lease,
            neighbours: Neighbours::default(),
            hints,
            gallery,
            gallery_written: None,
            gallery_stale: false,
            resting: HashMap::new(),
            left: BTreeMap::new(),
            summary: Summary::default(),
            counts: (0, 0),
            doing: Doing::Waiting,
            attention: Vec::new(),
            unsettled: Vec::new(),
        })
    }

    /// The same daemon, taking photos when `schedule` says so. Without one it takes each at once.
    #[must_use]
    pub fn scheduled(mut self, schedule: Box<dyn Schedule + 'a>) -> Daemon<'a> {
        self.schedule = schedule;
        self
    }

    /// Empties the inbox and returns what became of each photo. Files need not have been quiet; one
    /// whose end is missing is left when it changed not long ago, as are those for which the
    /// schedule holds.
    ///
    /// # Errors
    /// When the folders or the rig need help; photos not begun are still in the inbox.
    pub fn once(&mut self) -> Result<Summary, DaemonError> {
        let patience = Patience {
            quiet_s: 0.0,
            mention_s: 0.0,
            unfinished_s: self.setting.unfinished_s,
            by_its_record: Some(self.unix_s()),
        };
        let passed = self.pass(patience, f64::INFINITY, &|| false);
        let shown = self.show_gallery();
        self.tell(match &passed {
            Ok(_) => Doing::Ended,
            Err(error) => Doing::Held { reason: full_message(error) },
        });
        passed.and(shown)?;
        Ok(self.summary())
    }

    /// Watches the inbox until `stop` says so, which is asked between photos and between looks.
    /// Needs of the operator are said once, held, and tried again, as is a disk that is full or
    /// gone. The summary is of the last thousand of either kind.
    pub fn run(&mut self, stop: &dyn Fn() -> bool) -> Summary {
        let patience = Patience {
            quiet_s: self.setting.quiet_s,
            mention_s: MENTION_S,
            unfinished_s: self.setting.unfinished_s,
            by_its_record: None,
        };
        let mut held: Option<String> = None;
        self.tell(Doing::Waiting);
        let _ = self.show_gallery().inspect_err(|error| log::warn!("{}", full_message(error)));
        while !stop() {
            // A box runs for a year; what it did is in the outbox and not in its memory.
            let Summary { restored, failed, .. } = &mut self.summary;
            restored.drain(..restored.len().saturating_sub(SUMMARY_MAX));
            failed.drain(..failed.len().saturating_sub(SUMMARY_MAX));
            let passed = self.pass(patience, self.setting.retry_s, stop);
            if let Err(error) = &passed {
                self.schedule.held(error, &mut *self.restorer);
            }
            self.call_attention();
            let wait_s = match passed {
                Ok(Turn::Stop) => break,
                Ok(Turn::Go | Turn::Again(_) | Turn::Help { .. }) => {
                    if held.take().is_some() {
                        log::info!("going on");
                        self.tell(Doing::Waiting);
                    }
                    self.watcher.looked();
                    self.wait_for_photos(stop);
                    continue;
                }
                Ok(Turn::Hold { reason, until }) => {
                    if held.as_ref() != Some(&reason) {
                        log::info!("not now: {reason}");
                        self.tell(Doing::Paused { reason: reason.clone() });
                    }
                    held = Some(reason);
                    // Whoever supervises the loop must see it come round.
                    until.map_or(0.0, |at| at.0 - self.clock.now().0).min(HOLD_LOOK_S)
                }
                Err(error) => {
                    let reason = full_message(&error);
                    if held.as_ref() != Some(&reason) {
                        log::warn!("holding: {reason}");
                        self.tell(Doing::Held { reason: reason.clone() });
                    }
                    held = Some(reason);
                    self.setting.retry_s
                }
            };
            self.watcher.looked();
            self.wait(wait_s.max(self.setting.poll_s), stop);
        }
        let _ = self.show_gallery().inspect_err(|error| log::warn!("{}", full_message(error)));
        self.tell(Doing::Ended);
        self.summary()
    }

    /// Takes what is ready, oldest first, until nothing is or the schedule holds: then that turn.
    fn pass(
        &mut self,
        patience: Patience,
        retry_s: f64,
        stop: &dyn Fn() -> bool,
    ) -> Result<Turn, DaemonError> {
        let mut number = 0;
        let turn = 'all: loop {
            if self.schedule.impatient() {
                self.resting.clear();
            }
            let (ready, waiting) = self.look(patience)?;
            if ready.is_empty() {
                match self.schedule.idle(waiting, &mut *self.restorer) {
                    Turn::Again(photos) => self.withdraw(&photos)?,
                    Turn::Help { reason } => return Err(DaemonError::Held { reason }),
                    turn => break turn,
                }
                continue;
            }
            let of = number + ready.len();
            for (taken, way) in ready.into_iter().enumerate() {
                if stop() {
                    return Ok(Turn::Stop);
                }
                if !self.may_be_taken(&way, patience) {
                    continue;
                }
                self.make_room()?;
                let turn = self.schedule.before(waiting - taken, &mut *self.restorer);
                match turn {
                    Turn::Go => {}
                    Turn::Again(photos) => {
                        self.withdraw(&photos)?;
                        continue 'all;
                    }
                    Turn::Help { reason } => return Err(DaemonError::Held { reason }),
                    other => break 'all other,
                }
                number += 1;
                let shown = way.to_string_lossy().into_owned();
                self.tell(Doing::Restoring { photo: shown.clone() });
                self.watcher.begun(&shown, number, of);
                self.lease.beat(&self.folders, self.clock.now());
                self.schedule.begun(&shown, number, of, &mut *self.restorer);
                let verdict = self.job(&way);
                self.watcher.ended();
                self.note(&way, verdict?, retry_s);
                let due = self
                    .gallery_written
                    .is_none_or(|at| self.clock.now().0 - at.0 >= self.gallery.period_s());
                if due {
                    self.show_gallery()?;
                }
            }
        };
        if number > 0 || self.gallery_stale {
            self.show_gallery()?;
        }
        if number > 0 {
            self.tell(Doing::Waiting);
        }
        Ok(turn)
    }

    /// One look at the inbox: the ways to photos that may be taken now, and how many wait in all.
    fn look(&mut self, patience: Patience) -> Result<(Vec<PathBuf>, usize), DaemonError> {
        let now = self.clock.now();
        self.lease.beat(&self.folders, now);
        self.settle_all()?;
        self.keep_within_limits();
        self.neighbours.look(&self.folders, now, self.setting.lease_s);
        let (disk, folder) = (self.folders.disk(), self.folders.inbox());
        self.hints.listen(folder);
        let found = self.inbox.look(disk, folder, now, patience)?;
        let unfinished = found.unfinished;
        self.resting.retain(|way, _| disk.look(&folder.join(way)).is_ok());
        let resting = &self.resting;
        self.left
            .retain(|way, _| resting.contains_key(way) || unfinished.iter().any(|(u, _)| u == way));
        for (way, reason) in unfinished {
            let reason = format!("{reason} (waiting for the rest of it)");
            self.left.entry(way).or_insert_with_key(|way| {
                log::warn!("left in the inbox: {reason}");
                Failed { photo: way.to_string_lossy().into_owned(), reason }
            });
        }
        let waiting = found.ready.len();
        let ready = found.ready.into_iter().filter(|way| match resting.get(way) {
            Some((look, until)) => *look != disk.look(&folder.join(way)).ok() || now >= *until,
            None => true,
        });
        Ok((ready.collect(), waiting))
    }

    /// Whether the photo at `way` is all there, or never will be. Whatever else is wrong with it is
    /// the job's to say.
    fn may_be_taken(&mut self, way: &Path, patience: Patience) -> bool {
        let (setting, disk, path) =
            (&self.setting, self.folders.disk(), self.folders.inbox().join(way));
        self.inbox.may_be_taken(way, self.clock.now(), patience, || {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let lacking =
                setting.reader.whole(&name, disk.open(&path).ok()?, &setting.limits).err()?;
            (lacking.growth() == Growth::Likely).then(|| full_message(&lacking))
        })
    }

    fn note(&mut self, way: &Path, verdict: Verdict, retry_s: f64) {
        self.left.remove(way);
        self.resting.remove(way);
        match verdict {
            Verdict::Restored { report, delivered } => {
                log::info!("{}", report.line());
                self.schedule.after(
                    Ended::Restored { report: &report, delivered: &delivered },
                    &mut *self.restorer,
                );
                self.gallery.add(&report);
                self.counts.0 += 1;
                self.summary.restored.push(*report);
            }
            Verdict::Failed(failed) => {
                log::warn!("not restored: {}", failed.reason);
                self.schedule.after(Ended::Failed(&failed), &mut *self.restorer);
                self.gallery.add_failed(failed.clone());
                self.counts.1 += 1;
                self.summary.failed.push(failed);
            }
            Verdict::Left { way, left } => {
                log::warn!("left in the inbox: {}", left.reason);
                self.schedule.after(Ended::Left(&left), &mut *self.restorer);
                let look = self.folders.disk().look(&self.folders.inbox().join(&way)).ok();
                self.resting.insert(way.clone(), (look, Moment(self.clock.now().0 + retry_s)));
                self.left.insert(way, left);
            }
            Verdict::Gone => {}
        }
    }

    /// A result is no longer in the outbox.
    pub(super) fn forget(&mut self, result: &OsStr) {
        let name = result.to_string_lossy();
        self.gallery.remove(&name);
        self.summary.restored.retain(|report| report.result != name);
    }

    fn summary(&self) -> Summary {
        Summary { left: self.left.values().cloned().collect(), ..self.summary.clone() }
    }

    fn show_gallery(&mut self) -> Result<(), DaemonError> {
        (self.gallery_written, self.gallery_stale) = (Some(self.clock.now()), false);
        if self.folders.shared() {
            self.gallery = Gallery::load(&self.folders)?;
        }
        let left: Vec<Failed> = self.left.values().cloned().collect();
        self.gallery.write(&self.folders, &self.setting.rig, &left, &self.attention, self.unix_s())
    }

    /// Says once what the operator should know, and that there is nothing more to know.
    fn call_attention(&mut self) {
        let attention = self.schedule.attention();
        if attention == self.attention {
            return;
        }
        attention
            .iter()
            .filter(|words| !self.attention.contains(words))
            .for_each(|words| log::warn!("{words}"));
        self.attention = attention;
        self.tell(self.doing.clone());
        let _ = self.show_gallery().inspect_err(|error| log::warn!("{}", full_message(error)));
    }

    /// Writes the state file. That nobody can look on is no reason to stop.
    fn tell(&mut self, doing: Doing) {
        self.watcher.doing(&doing);
        self.doing = doing.clone();
        let state = State {
            rig: self.setting.rig.clone(),
            doing,
            restored: self.counts.0,
            failed: self.counts.1,
            left: self.left.len(),
            attention: self.attention.clone(),
            written_unix_s: self.unix_s(),
        };
        if let Err(error) = state.write(&self.folders) {
            log::debug!("{}", full_message(&error));
        }
    }

    /// Waits for the next look at the inbox: until it is due, a file there will have been quiet for
    /// long enough, or something happens.
    fn wait_for_photos(&self, stop: &dyn Fn() -> bool) {
        let now = self.clock.now().0;
        let due = self.inbox.due().map_or(f64::INFINITY, |due| due.0 - now);
        let soonest = self.setting.quiet_s.min(self.setting.poll_s).min(STEP_S);
        self.wait(self.setting.poll_s.min(due.max(soonest)), &|| stop() || self.hints.heard());
    }

    /// Waits in short steps, so that a stop is heard.
    fn wait(&self, wait_s: f64, stop: &dyn Fn() -> bool) {
        let until = self.clock.now().0 + wait_s;
        while !stop() && !self.schedule.impatient() && self.clock.now().0 < until {
            self.lease.beat(&self.folders, self.clock.now());
            self.clock.wait_until(Moment((self.clock.now().0 + STEP_S).min(until)));
        }
    }

    pub(super) fn unix_s(&self) -> u64 {
        (self.calendar)().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
    }
}
