//! The loop: empty the inbox once, or watch it until told to stop.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use super::error::DaemonError;
use super::job::{Job, JobEnd, Unsettled};
use super::report::state::Doing;
use super::report::summary::Summary;
use super::report::{Reporter, Telling};
use super::schedule::{Event, Question, Schedule, Turn};
use super::setting::DaemonSetting;
use super::store::folders::Folders;
use super::store::hints::Hints;
use super::store::inbox::{Inbox, Patience, Ready};
use super::store::limits::{Keeping, Now};
use super::store::report_file::{Delivered, Failed};
use super::store::withdraw::withdraw;
use super::watcher::Watcher;
use crate::config::Keep;
use crate::disk::FileError;
use crate::picture::{Growth, PictureError};
use crate::remedy::{Remediable, full_message};
use crate::restorer::{Progress, Restorer};
use crate::rig::{Clock, Moment};

/// While the schedule holds, it is asked again after this long at the most.
const HOLD_LOOK_S: f64 = 15.0;

/// A wait is made of steps of this length, after each of which a stop is heard.
const STEP_S: f64 = 0.2;

/// How far a photo is, is written down after this long. Each is a small file that is not
/// synchronised.
const TELL_S: f64 = 1.0;

/// An inbox that is not there is looked for after this long.
const GONE_LOOK_S: f64 = 2.0;

/// A photo whose end is missing is spoken about after this long without a change. Guess.
const MENTION_S: f64 = 60.0;

/// The clocks.
#[derive(Clone, Copy)]
struct Clocks<'a> {
    /// Measures waits.
    clock: &'a dyn Clock,
    /// Dates the reports.
    calendar: &'a dyn Fn() -> SystemTime,
}

impl Clocks<'_> {
    fn moment(&self) -> Moment {
        self.clock.now()
    }

    fn unix_s(&self) -> u64 {
        (self.calendar)().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
    }

    fn now(&self) -> Now {
        Now { moment: self.moment(), unix_s: self.unix_s() }
    }
}

/// What is looked after at each look at the inbox, beside the photos that wait there.
struct Upkeep<'a> {
    keeping: Keeping<'a>,
    unsettled: Unsettled,
}

/// The daemon over one set of folders and one rig.
pub struct Daemon<'a> {
    folders: Folders,
    setting: DaemonSetting,
    restorer: &'a mut dyn Restorer,
    clocks: Clocks<'a>,
    watcher: &'a mut dyn Watcher,
    schedule: Box<dyn Schedule + 'a>,
    inbox: Inbox,
    upkeep: Upkeep<'a>,
    reporter: Reporter,
}

impl<'a> Daemon<'a> {
    /// A daemon over `folders`, which were made good by opening them. `clock` measures waits,
    /// `calendar` dates the reports.
    ///
    /// # Errors
    /// When the outbox cannot be read.
    pub fn open(
        folders: Folders,
        setting: DaemonSetting,
        restorer: &'a mut dyn Restorer,
        clock: &'a dyn Clock,
        calendar: &'a dyn Fn() -> SystemTime,
        watcher: &'a mut dyn Watcher,
    ) -> Result<Daemon<'a>, DaemonError> {
        Ok(Daemon {
            restorer,
            clocks: Clocks { clock, calendar },
            watcher,
            schedule: Box::new(()),
            inbox: Inbox::new(if setting.hints { Hints::new() } else { Hints::none() }),
            upkeep: Upkeep {
                keeping: Keeping::new(Keep::default(), &|| true),
                unsettled: Unsettled::default(),
            },
            reporter: Reporter::open(&folders, (&setting.rig, setting.needs_button))?,
            folders,
            setting,
        })
    }

    /// The same daemon, taking photos when `schedule` says so. Without one it takes each at once.
    #[must_use]
    pub fn scheduled(mut self, schedule: Box<dyn Schedule + 'a>) -> Daemon<'a> {
        self.schedule = schedule;
        self
    }

    /// The same daemon, which keeps results and originals within `keep`. Ages count for as long as
    /// the calendar is `believed`: a board that wakes up in the wrong year would find everything
    /// old.
    #[must_use]
    pub fn keeping(mut self, keep: Keep, believed: &'a dyn Fn() -> bool) -> Daemon<'a> {
        self.upkeep.keeping = Keeping::new(keep, believed);
        self
    }

    /// Empties the inbox and returns what became of each photo. Files need not have been quiet; one
    /// whose end is missing is left when it changed not long ago, as are those for which the
    /// schedule holds.
    ///
    /// # Errors
    /// When the folders or the rig need help; photos not begun are still in the inbox.
    pub fn once(&mut self) -> Result<Summary, DaemonError> {
        self.once_until(&|| false)
    }

    /// The same until `stop` says so, which is asked between photos: those not begun stay.
    ///
    /// # Errors
    /// As [`Daemon::once`].
    pub fn once_until(&mut self, stop: &dyn Fn() -> bool) -> Result<Summary, DaemonError> {
        let patience = Patience {
            quiet_s: 0.0,
            mention_s: 0.0,
            unfinished_s: self.setting.unfinished_s,
            by_its_record: Some(self.clocks.unix_s()),
        };
        let passed = self.pass(patience, f64::INFINITY, stop);
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
    /// gone. The summary is of the last thousand of each kind.
    pub fn run(&mut self, stop: &dyn Fn() -> bool) -> Summary {
        let patience = Patience {
            quiet_s: self.setting.quiet_s,
            mention_s: MENTION_S,
            unfinished_s: self.setting.unfinished_s,
            by_its_record: None,
        };
        let mut held: Option<String> = None;
        self.tell(Doing::Waiting);
        self.try_to_show_gallery();
        while !stop() {
            let passed = self.pass(patience, self.setting.retry_s, stop);
            if stop() && passed.as_ref().is_err_and(|error| error.was_asked_for()) {
                break;
            }
            if let Err(error) = &passed {
                self.schedule.told(Event::Held(error), &mut *self.restorer);
            }
            self.call_attention();
            let (reason, wait_s) = match passed {
                Ok(Turn::Stop) => break,
                Ok(Turn::Hold { reason, until, .. }) => {
                    if held.as_ref() != Some(&reason) {
                        log::info!("not now: {reason}");
                        self.tell(Doing::Paused { reason: reason.clone() });
                    }
                    // Whoever supervises the loop must see it come round.
                    let wait_s = until.map_or(0.0, |at| at.0 - self.clocks.moment().0);
                    (reason, wait_s.min(HOLD_LOOK_S).max(self.setting.poll_s))
                }
                Ok(Turn::Go | Turn::Again(_) | Turn::Help(_)) => {
                    if held.take().is_some() {
                        log::info!("going on");
                        self.tell(Doing::Waiting);
                    }
                    self.watcher.looked();
                    self.tell_who_waits();
                    self.wait_for_photos(stop);
                    continue;
                }
                Err(error) => {
                    let reason = full_message(&error);
                    if held.as_ref() != Some(&reason) {
                        log::warn!("holding: {reason}");
                        self.tell(Doing::Held { reason: reason.clone() });
                    }
                    let inbox = self.folders.files().look(self.folders.inbox());
                    (reason, if inbox.is_err() { GONE_LOOK_S } else { self.setting.retry_s })
                }
            };
            held = Some(reason);
            self.tell_who_waits();
            self.watcher.looked();
            self.wait(wait_s, stop);
        }
        self.try_to_show_gallery();
        self.tell(Doing::Ended);
        self.summary()
    }

    /// Takes what is ready until nothing is or the schedule holds: then that turn. Oldest first;
    /// but after one that came to nothing the newest is next, of those, too, that came to rest
    /// meanwhile: no heap of such keeps it waiting.
    fn pass(
        &mut self,
        patience: Patience,
        retry_s: f64,
        stop: &dyn Fn() -> bool,
    ) -> Result<Turn, DaemonError> {
        let (mut number, mut newest_next) = (0, false);
        let turn = 'all: loop {
            if self.schedule.impatient() {
                self.inbox.end_rest();
            }
            let looked = self.clocks.moment();
            let Ready { photos, waiting } = self.look(patience)?;
            if photos.is_empty() {
                match self.ask(waiting, false)? {
                    Turn::Again(photos) => self.withdraw(&photos)?,
                    turn => break turn,
                }
                continue;
            }
            let of = number + photos.len();
            let (mut photos, mut taken) = (VecDeque::from(photos), 0);
            loop {
                if newest_next && taken > 0 && self.is_look_due(looked) {
                    continue 'all;
                }
                let newest = photos.iter().rposition(|way| !self.inbox.is_left(way));
                let next = match newest.filter(|_| newest_next) {
                    Some(newest) => photos.remove(newest),
                    None => photos.pop_front(),
                };
                let Some(way) = next else { break };
                if stop() {
                    return Ok(Turn::Stop);
                }
                newest_next = !newest_next;
                taken += 1;
                match self.may_be_taken(&way, patience) {
                    Ok(true) => {}
                    Ok(false) => {
                        self.inbox.has_turn();
                        continue;
                    }
                    Err(unread) => {
                        self.inbox.has_turn();
                        self.leave(way, unread.of_photo(), retry_s);
                        continue;
                    }
                }
                self.make_room()?;
                match self.ask(waiting + 1 - taken, true)? {
                    Turn::Go => {}
                    Turn::Again(photos) => {
                        self.withdraw(&photos)?;
                        continue 'all;
                    }
                    other => break 'all other,
                }
                number += 1;
                let end = self.work(&way, number, of)?;
                newest_next &= !matches!(end, JobEnd::Done { .. });
                self.note(&way, end, retry_s);
                if self.reporter.is_due(self.clocks.moment()) {
                    self.show_gallery()?;
                }
            }
        };
        if number > 0 || self.reporter.is_stale() {
            self.show_gallery()?;
        }
        if number > 0 {
            self.tell(Doing::Waiting);
        }
        Ok(turn)
    }

    /// Whether a file that was not quiet at the look at `looked` may be by now.
    fn is_look_due(&self, looked: Moment) -> bool {
        let now = self.clocks.moment();
        now.0 - looked.0 >= self.setting.poll_s || self.inbox.due().is_some_and(|due| now >= due)
    }

    /// The schedule's turn; an error when somebody must help first.
    fn ask(&mut self, waiting: usize, is_ready: bool) -> Result<Turn, DaemonError> {
        let asked = Question { waiting, is_ready, parts: self.inbox.waiting() };
        match self.schedule.turn(asked, &mut *self.restorer) {
            Turn::Help(error) => Err(error),
            Turn::Hold { reason, until, awaited } => {
                self.inbox.held_for(awaited);
                Ok(Turn::Hold { reason, until, awaited })
            }
            turn => Ok(turn),
        }
    }

    /// One look at the inbox, and at all that is to be looked after.
    fn look(&mut self, patience: Patience) -> Result<Ready, DaemonError> {
        let (folders, now) = (&self.folders, self.clocks.now());
        let Upkeep { keeping, unsettled } = &mut self.upkeep;
        unsettled.settle(folders)?;
        if keeping.sweep(folders, self.schedule.unproven(), now) {
            self.reporter.reload(folders);
        }
        Ok(self.inbox.look(folders, now.moment, patience)?)
    }

    /// Whether the photo at `way` is all there, or never will be; an error when it cannot be read.
    /// Whatever else is wrong with it is the job's to say.
    fn may_be_taken(&mut self, way: &Path, patience: Patience) -> Result<bool, FileError> {
        let (setting, path) = (&self.setting, self.folders.inbox().join(way));
        let files = self.folders.files();
        self.inbox.may_be_taken(way, self.clocks.moment(), patience, || {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let file = match files.open(&path) {
                Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
                opened => opened?,
            };
            match setting.reader.whole(&name, file, &setting.reading.limits) {
                Err(PictureError::Read { source, .. }) => Err(FileError::at("read", &path)(source)),
                Err(lacking) if lacking.growth() == Growth::Likely => {
                    Ok(Some(full_message(&lacking)))
                }
                _ => Ok(None),
            }
        })
    }

    /// Makes room on the disk for one more photo, if the limits have something to remove.
    fn make_room(&mut self) -> Result<(), DaemonError> {
        let (now, unproven) = (self.clocks.now(), self.schedule.unproven());
        let floor_bytes = self.setting.floor_bytes;
        if self.upkeep.keeping.make_room(&self.folders, unproven, now, floor_bytes)? {
            self.reporter.reload(&self.folders);
        }
        Ok(())
    }

    fn work(&mut self, way: &Path, number: usize, of: usize) -> Result<JobEnd, DaemonError> {
        let photo = &*way.to_string_lossy();
        self.inbox.has_turn();
        let restoring = |done, left_s| Doing::Restoring { photo: photo.to_owned(), done, left_s };
        self.tell(restoring(0.0, None));
        self.watcher.begun(photo, number, of);
        self.schedule.told(Event::Begun { photo, number, of }, &mut *self.restorer);
        let (begun, usual_s) = (self.clocks.moment(), self.reporter.usual_s());
        let (mut told, telling) = (begun, self.telling());
        let mut further = |progress: Progress| {
            let Now { moment, unix_s } = self.clocks.now();
            if moment.0 - told.0 < TELL_S {
                return;
            }
            told = moment;
            let (done, passed_s) = (f64::from(progress.done).clamp(0.0, 1.0), moment.0 - begun.0);
            let whole_s = usual_s.unwrap_or(passed_s / done.max(0.01)).max(passed_s);
            let left_s = whole_s * (1.0 - done + telling.waiting.turn as f64);
            let telling = Telling { moment, unix_s, ..telling.clone() };
            self.reporter.tell(&self.folders, restoring(done, Some(left_s)), &telling);
        };
        let job = Job {
            further: &mut further,
            folders: &self.folders,
            setting: &self.setting,
            restorer: &mut *self.restorer,
            clock: self.clocks.clock,
            unix_s: &|| self.clocks.unix_s(),
            watcher: &mut *self.watcher,
            unsettled: &mut self.upkeep.unsettled,
        };
        let end = job.work(way);
        self.watcher.ended();
        end
    }

    fn note(&mut self, way: &Path, end: JobEnd, retry_s: f64) {
        self.schedule.told(Event::Ended(&end), &mut *self.restorer);
        if !matches!(end, JobEnd::Left { .. }) {
            self.inbox.taken(way);
        }
        match end {
            JobEnd::Done { report, .. } => self.reporter.add(*report),
            JobEnd::Failed(failed) => self.reporter.add_failed(failed),
            JobEnd::Left { way, left } => self.leave(way, left.reason, retry_s),
            JobEnd::Gone => {}
        }
    }

    /// The photo at `way` stays in the inbox, and is tried again after `retry_s`.
    fn leave(&mut self, way: PathBuf, reason: String, retry_s: f64) {
        let left = Failed { photo: way.to_string_lossy().into_owned(), reason };
        let until = Moment(self.clocks.moment().0 + retry_s);
        self.inbox.put_back(&self.folders, way, left, until);
    }

    fn withdraw(&mut self, photos: &[Delivered]) -> Result<(), DaemonError> {
        withdraw(&self.folders, photos)?;
        photos.iter().for_each(|photo| self.reporter.forget(&photo.result.to_string_lossy()));
        Ok(())
    }

    fn summary(&self) -> Summary {
        self.reporter.summary(self.inbox.left(), self.inbox.waiting())
    }

    /// Writes down that other photos wait, or for something else, than was told last.
    fn tell_who_waits(&mut self) {
        let telling = self.telling();
        self.reporter.tell_who_waits(&self.folders, &telling);
    }

    fn telling(&self) -> Telling {
        let Now { moment, unix_s } = self.clocks.now();
        Telling { left: self.inbox.left(), waiting: self.inbox.waiting(), moment, unix_s }
    }

    fn show_gallery(&mut self) -> Result<(), DaemonError> {
        let telling = self.telling();
        Ok(self.reporter.show(&self.folders, &telling)?)
    }

    fn try_to_show_gallery(&mut self) {
        if let Err(error) = self.show_gallery() {
            log::warn!("{}", full_message(&error));
        }
    }

    /// Says once what the operator should know, and that there is nothing more to know.
    fn call_attention(&mut self) {
        let attention = self.schedule.attention().iter().map(ToString::to_string).collect();
        if self.reporter.call_attention(attention) {
            self.tell(self.reporter.doing());
            self.try_to_show_gallery();
        }
    }

    fn tell(&mut self, doing: Doing) {
        self.watcher.doing(&doing);
        let telling = self.telling();
        self.reporter.tell(&self.folders, doing, &telling);
    }

    /// Waits for the next look at the inbox: until it is due, a file there will have been quiet for
    /// long enough, or something happens.
    fn wait_for_photos(&self, stop: &dyn Fn() -> bool) {
        let DaemonSetting { quiet_s, poll_s, .. } = self.setting;
        let due_s = self.inbox.due().map_or(f64::INFINITY, |due| due.0 - self.clocks.moment().0);
        let soonest_s = quiet_s.min(poll_s).min(STEP_S);
        self.wait(poll_s.min(due_s.max(soonest_s)), &|| stop() || self.inbox.heard());
    }

    /// Waits in short steps, so that a stop is heard.
    fn wait(&self, wait_s: f64, stop: &dyn Fn() -> bool) {
        let clock = self.clocks.clock;
        let until = clock.now().0 + wait_s;
        while !stop() && !self.schedule.impatient() && clock.now().0 < until {
            clock.wait_until(Moment((clock.now().0 + STEP_S).min(until)));
        }
    }
}
