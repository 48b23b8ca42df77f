//! The loop: empties the inbox once, or watches it until stopped.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::clocks::Clocks;
use super::error::DaemonError;
use super::job::{Job, JobEnd, Unsettled};
use super::report::Reporter;
use super::report::state::Doing;
use super::report::summary::Summary;
use super::schedule::{Event, Question, Schedule, Turn};
use super::setting::DaemonSetting;
use super::store::claim::flat_name;
use super::store::folders::Folders;
use super::store::hints::Hints;
use super::store::inbox::{Inbox, Patience, Ready};
use super::store::late::LateWrites;
use super::store::report_file::Delivered;
use super::store::withdraw::withdraw;
use super::watcher::Watcher;
use crate::disk::{FileError, Metadata, if_found};
use crate::picture::{Growth, PictureError};
use crate::remedy::{Remediable, full_message};
use crate::restorer::{Progress, Restorer};
use crate::rig::{Clock, Moment};

/// Longest interval between two questions to a schedule that holds the photos.
const HOLD_POLL_S: f64 = 15.0;

/// Interval at which a stop is noticed during a wait.
const STEP_S: f64 = 0.2;

/// Interval between two writes of a photo's progress: a small file, not synchronised.
const PROGRESS_S: f64 = 1.0;

/// Interval between two checks for missing folders.
const MISSING_POLL_S: f64 = 2.0;

/// Time without a change after which an incomplete photo is reported. Guess.
const MENTION_S: f64 = 60.0;

struct InboxPass {
    patience: Patience,
    /// Time after which a deferred photo is tried again.
    retry_s: f64,
    /// Number of photos begun.
    number: usize,
    newest_next: bool,
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
    unsettled: Unsettled,
    late: LateWrites,
    reporter: Reporter<'a>,
}

impl<'a> Daemon<'a> {
    /// Opens a daemon on `folders`. `clock` measures waiting times, `calendar` dates the reports.
    pub fn open(
        folders: Folders,
        setting: DaemonSetting,
        restorer: &'a mut dyn Restorer,
        clock: &'a dyn Clock,
        calendar: &'a dyn Fn() -> SystemTime,
        watcher: &'a mut dyn Watcher,
    ) -> Result<Daemon<'a>, DaemonError> {
        let clocks = Clocks { clock, calendar };
        Ok(Daemon {
            restorer,
            clocks,
            watcher,
            schedule: Box::new(()),
            inbox: Inbox::new(if setting.hints { Hints::new() } else { Hints::default() }),
            unsettled: Unsettled::default(),
            late: LateWrites::default(),
            reporter: Reporter::open(&folders, &setting, clocks)?,
            folders,
            setting,
        })
    }

    /// Sets the schedule; without one photos are restored at once.
    #[must_use]
    pub fn scheduled(mut self, schedule: Box<dyn Schedule + 'a>) -> Daemon<'a> {
        self.schedule = schedule;
        self
    }

    /// Empties the inbox once, or until `stop`, which is called between photos, returns true. Files
    /// need not be quiet; incomplete ones that changed recently stay, as do photos that the
    /// schedule holds.
    ///
    /// # Errors
    /// When the folders or the rig need help; photos not begun stay in the inbox.
    pub fn once(&mut self, stop: &dyn Fn() -> bool) -> Result<Summary, DaemonError> {
        let patience = Patience {
            quiet_s: 0.0,
            mention_s: 0.0,
            unfinished_s: self.setting.unfinished_s,
            trusted_unix_s: Some(self.clocks.unix_s()),
        };
        let passed = self.pass(patience, f64::INFINITY, stop);
        let shown = self.reporter.write_gallery(&self.inbox);
        self.set_doing(match &passed {
            Ok(_) => Doing::Ended,
            Err(error) => Doing::Held { reason: full_message(error) },
        });
        passed?;
        shown?;
        Ok(self.reporter.summary(&self.inbox))
    }

    /// Watches the inbox until `stop`, which is called between photos and scans, returns true.
    /// After an error, which is logged once, work is held and tried again.
    pub fn run(&mut self, stop: &dyn Fn() -> bool) -> Summary {
        let patience = Patience {
            quiet_s: self.setting.quiet_s,
            mention_s: MENTION_S,
            unfinished_s: self.setting.unfinished_s,
            trusted_unix_s: None,
        };
        let mut held: Option<Doing> = None;
        self.set_doing(Doing::Waiting);
        self.try_to_show_gallery();
        while !stop() {
            let passed = self.pass(patience, self.setting.retry_s, stop);
            // A missing folder is reported in the same words, whichever operation met it.
            let away = passed.as_ref().err().and_then(|_| self.folders.check_space(0).err());
            let held_s = if away.is_some() { MISSING_POLL_S } else { self.setting.retry_s };
            let passed = passed.map_err(|error| away.unwrap_or(error));
            if stop() && passed.as_ref().is_err_and(|error| error.was_asked_for()) {
                break;
            }
            if let Err(error) = &passed {
                self.schedule.notify(Event::Held(error), &mut *self.restorer);
            }
            let (doing, wait_s) = match passed {
                Ok(Turn::Stop) => break,
                Ok(Turn::Hold { reason, until, .. }) => {
                    // Bounded, so that the watchdog sees the loop advance.
                    let wait_s = until.map_or(0.0, |at| at.0 - self.clocks.moment().0);
                    let wait_s = wait_s.min(HOLD_POLL_S).max(self.setting.poll_s);
                    (Doing::Paused { reason }, wait_s)
                }
                Ok(Turn::Go | Turn::Again(_) | Turn::Help(_)) => {
                    if held.take().is_some() {
                        log::info!("continuing");
                        self.set_doing(Doing::Waiting);
                    }
                    self.watcher.scanned();
                    self.reporter.update_waiting(&self.inbox);
                    self.wait_for_photos(stop);
                    continue;
                }
                Err(error) => (Doing::Held { reason: full_message(&error) }, held_s),
            };
            if held.as_ref() != Some(&doing) {
                match &doing {
                    Doing::Paused { reason } => log::info!("waiting: {reason}"),
                    Doing::Held { reason } => log::warn!("held: {reason}"),
                    _ => {}
                }
                self.set_doing(doing.clone());
                held = Some(doing);
            }
            self.reporter.update_waiting(&self.inbox);
            self.watcher.scanned();
            self.wait(wait_s, stop);
        }
        self.try_to_show_gallery();
        self.set_doing(Doing::Ended);
        self.reporter.summary(&self.inbox)
    }

    /// Restores ready photos until there are none or the schedule holds them; returns its last
    /// turn. The oldest photo is first, but after a photo without a result the newest is next, even
    /// if it became ready meanwhile: a pile of unreadable photos does not delay it.
    fn pass(
        &mut self,
        patience: Patience,
        retry_s: f64,
        stop: &dyn Fn() -> bool,
    ) -> Result<Turn, DaemonError> {
        let mut pass = InboxPass { patience, retry_s, number: 0, newest_next: false };
        let turn = loop {
            if self.schedule.impatient() {
                self.inbox.retry_now();
            }
            let scanned = self.clocks.moment();
            let ready = self.scan(patience)?;
            if !ready.photos.is_empty() {
                match self.take(ready, scanned, &mut pass, stop)? {
                    None => continue,
                    Some(Turn::Stop) => return Ok(Turn::Stop),
                    Some(turn) => break turn,
                }
            }
            match self.ask(ready.waiting, false)? {
                Turn::Again(photos) => self.withdraw(&photos)?,
                turn => break turn,
            }
        };
        if pass.number > 0 || self.reporter.stale {
            self.reporter.write_gallery(&self.inbox)?;
        }
        if pass.number > 0 {
            self.set_doing(Doing::Waiting);
        }
        Ok(turn)
    }

    /// Restores the photos of one scan, made at `scanned`; `None` when the next scan is due.
    fn take(
        &mut self,
        ready: Ready,
        scanned: Moment,
        pass: &mut InboxPass,
        stop: &dyn Fn() -> bool,
    ) -> Result<Option<Turn>, DaemonError> {
        let Ready { photos, waiting } = ready;
        let of = pass.number + photos.len();
        let (mut photos, mut taken) = (VecDeque::from(photos), 0);
        loop {
            if pass.newest_next && taken > 0 && self.is_scan_due(scanned) {
                return Ok(None);
            }
            let newest = photos.iter().rposition(|path| !self.inbox.is_deferred(path));
            let next = match newest.filter(|_| pass.newest_next) {
                Some(newest) => photos.remove(newest),
                None => photos.pop_front(),
            };
            let Some(path) = next else { return Ok(None) };
            if stop() {
                return Ok(Some(Turn::Stop));
            }
            pass.newest_next = !pass.newest_next;
            taken += 1;
            let mut refusal = None;
            match self.may_be_taken(&path, pass.patience, &mut refusal) {
                Ok(true) => {}
                Ok(false) => {
                    self.inbox.count_turn();
                    continue;
                }
                Err(unread) if unread.is_of_disk() => return Err(unread.into()),
                Err(unread) => {
                    self.inbox.count_turn();
                    self.defer(path, unread.message_for_owner(), pass.retry_s);
                    continue;
                }
            }
            self.folders.check_space(self.setting.floor_bytes)?;
            match self.ask(waiting + 1 - taken, true)? {
                Turn::Go => {}
                Turn::Again(photos) => {
                    self.withdraw(&photos)?;
                    return Ok(None);
                }
                other => return Ok(Some(other)),
            }
            pass.number += 1;
            let end = self.work(&path, refusal, pass.number, of)?;
            pass.newest_next &= !matches!(end, JobEnd::Done { .. });
            self.note(&path, end, pass.retry_s);
            if self.reporter.is_due() {
                self.reporter.write_gallery(&self.inbox)?;
            }
        }
    }

    /// Whether a file that was still changing at the scan made at `scanned` may be quiet by now.
    fn is_scan_due(&self, scanned: Moment) -> bool {
        let now = self.clocks.moment();
        now.0 - scanned.0 >= self.setting.poll_s || self.inbox.due.is_some_and(|due| now >= due)
    }

    fn ask(&mut self, waiting: usize, is_ready: bool) -> Result<Turn, DaemonError> {
        let asked = Question { waiting, is_ready, parts: self.inbox.waiting };
        match self.schedule.turn(asked, &mut *self.restorer) {
            Turn::Help(error) => Err(error),
            Turn::Hold { reason, until, awaited } => {
                self.inbox.waiting = self.inbox.waiting.held_for(awaited);
                Ok(Turn::Hold { reason, until, awaited })
            }
            turn => Ok(turn),
        }
    }

    /// Settles failed jobs, withdraws results of photos that have changed, and scans the inbox.
    fn scan(&mut self, patience: Patience) -> Result<Ready, DaemonError> {
        let now = self.clocks.moment();
        self.unsettled.settle(&self.folders)?;
        let late = self.late.take_changed(&self.folders, now);
        if !late.is_empty() {
            self.withdraw(&late)?;
        }
        Ok(self.inbox.scan(&self.folders, now, patience)?)
    }

    /// Whether the photo at `path` is complete, or will never be. Sets `refusal` to a final flaw
    /// that the check finds without decoding; the job finds the others.
    fn may_be_taken(
        &mut self,
        path: &Path,
        patience: Patience,
        refusal: &mut Option<(Metadata, PictureError)>,
    ) -> Result<bool, FileError> {
        let (setting, full) = (&self.setting, self.folders.inbox.join(path));
        let files = &self.folders.files;
        self.inbox.may_be_taken(path, self.clocks.moment(), patience, || {
            let opened = files.metadata(&full).and_then(|about| Ok((about, files.open(&full)?)));
            let Some((about, file)) = if_found(opened)? else { return Ok(None) };
            match setting.check_complete(&flat_name(path).to_string_lossy(), file) {
                Err(PictureError::Read { source, .. }) => Err(FileError::at("read", &full)(source)),
                Err(flaw) if flaw.growth() == Growth::Likely => Ok(Some(full_message(&flaw))),
                Err(flaw) if flaw.is_final() => {
                    *refusal = Some((about, flaw));
                    Ok(None)
                }
                _ => Ok(None),
            }
        })
    }

    fn work(
        &mut self,
        path: &Path,
        refusal: Option<(Metadata, PictureError)>,
        number: usize,
        of: usize,
    ) -> Result<JobEnd, DaemonError> {
        let photo = &*path.to_string_lossy();
        self.inbox.count_turn();
        let restoring =
            |done, remaining_s| Doing::Restoring { photo: photo.to_owned(), done, remaining_s };
        self.set_doing(restoring(0.0, None));
        self.watcher.begun(photo, number, of);
        self.schedule.notify(Event::Begun { photo, number, of }, &mut *self.restorer);
        let (begun, usual_s) = (self.clocks.moment(), self.reporter.gallery.usual_s());
        let mut written = begun;
        let report_number = self.reporter.gallery.next_number();
        let mut on_progress = |progress: Progress| {
            let moment = self.clocks.moment();
            if moment.0 - written.0 < PROGRESS_S {
                return;
            }
            written = moment;
            let (done, passed_s) = (f64::from(progress.done).clamp(0.0, 1.0), moment.0 - begun.0);
            let whole_s = usual_s.unwrap_or(passed_s / done.max(0.01)).max(passed_s);
            let remaining_s = whole_s * (1.0 - done + self.inbox.waiting.turn as f64);
            self.reporter.set_doing(restoring(done, Some(remaining_s)), self.inbox.waiting);
        };
        let job = Job {
            on_progress: &mut on_progress,
            folders: &self.folders,
            setting: &self.setting,
            restorer: &mut *self.restorer,
            clocks: &self.clocks,
            number: report_number,
            watcher: &mut *self.watcher,
            unsettled: &mut self.unsettled,
            refusal,
        };
        let end = job.run(path);
        self.watcher.ended();
        if end.is_err() {
            // The photo is back in the inbox.
            self.inbox.waiting.turn += 1;
        }
        end
    }

    fn note(&mut self, path: &Path, end: JobEnd, retry_s: f64) {
        self.schedule.notify(Event::Ended(&end), &mut *self.restorer);
        if !matches!(end, JobEnd::Deferred { .. }) {
            self.inbox.forget(path);
        }
        match end {
            JobEnd::Done { report, delivered, original } => {
                self.reporter.add(*report);
                let until = Moment(self.clocks.moment().0 + self.setting.unfinished_s);
                self.late.watch(&self.folders, delivered, original, until);
            }
            JobEnd::Failed(failed) => self.reporter.add_failed(failed),
            JobEnd::Deferred { path, reason } => self.defer(path, reason, retry_s),
            JobEnd::Gone => {}
        }
    }

    /// Keeps the photo at `path` in the inbox, to be tried again after `retry_s`.
    fn defer(&mut self, path: PathBuf, reason: String, retry_s: f64) {
        let retry_at = Moment(self.clocks.moment().0 + retry_s);
        self.inbox.put_back(&self.folders, path, reason, retry_at);
    }

    fn withdraw(&mut self, photos: &[Delivered]) -> Result<(), DaemonError> {
        withdraw(&self.folders, photos)?;
        photos.iter().for_each(|photo| self.reporter.forget(&photo.result.to_string_lossy()));
        Ok(())
    }

    fn try_to_show_gallery(&mut self) {
        if let Err(error) = self.reporter.write_gallery(&self.inbox) {
            log::warn!("{}", full_message(&error));
        }
    }

    fn set_doing(&mut self, doing: Doing) {
        self.watcher.doing(&doing);
        self.reporter.set_doing(doing, self.inbox.waiting);
    }

    /// Waits until the next scan of the inbox is due, a file will have been quiet for long enough,
    /// or an event comes.
    fn wait_for_photos(&self, stop: &dyn Fn() -> bool) {
        let DaemonSetting { quiet_s, poll_s, .. } = self.setting;
        let due_s = self.inbox.due.map_or(f64::INFINITY, |due| due.0 - self.clocks.moment().0);
        let soonest_s = quiet_s.min(poll_s).min(STEP_S);
        self.wait(poll_s.min(due_s.max(soonest_s)), &|| stop() || self.inbox.has_events());
    }

    /// Waits in short steps, so that a stop is noticed.
    fn wait(&self, wait_s: f64, stop: &dyn Fn() -> bool) {
        let clock = self.clocks.clock;
        let until = clock.now().0 + wait_s;
        while !stop() && !self.schedule.impatient() && clock.now().0 < until {
            clock.wait_until(Moment((clock.now().0 + STEP_S).min(until)));
        }
    }
}
