//! The loop: empty the inbox once, or watch it until told to stop.

use std::collections::HashMap;
use std::ffi::OsString;
use std::time::{SystemTime, UNIX_EPOCH};

use crate::config::Curve;
use crate::frame::Size;
use crate::picture::Limits;
use crate::rig::{Clock, Moment};

use super::gallery::Gallery;
use super::inbox::{Inbox, Look};
use super::job::Verdict;
use super::schedule::{Ended, Schedule, Turn};
use super::{DaemonError, Doing, Failed, Folders, Report, Restorer, State, Watcher};

/// Seconds between two writings of the gallery while photos come one after another. Guess: often enough to
/// look on, seldom enough for a memory card.
const GALLERY_PERIOD_S: f64 = 10.0;

/// What the daemon is told once.
#[derive(Debug, Clone)]
pub struct Setting {
    /// Name of the rig, for reports.
    pub rig: String,
    /// The rig's photo size.
    pub photo_size: Size,
    /// Curve of photos that carry no profile.
    pub curve: Curve,
    /// What one photo may ask of the box.
    pub limits: Limits,
    /// A photo is taken when it has not changed for this long.
    pub quiet_s: f64,
    /// Time between two looks at the inbox.
    pub poll_s: f64,
    /// Time after which a photo that was put back, or a rig that needed help, is tried again.
    pub retry_s: f64,
}

impl Setting {
    /// The usual waits, which are guesses: 5 s quiet as paperless-ngx has it, a look a second, a minute
    /// until a retry.
    pub fn new(rig: &str, photo_size: Size, curve: Curve) -> Setting {
        let (quiet_s, poll_s, retry_s) = (5.0, 1.0, 60.0);
        Setting {
            rig: rig.to_owned(),
            photo_size,
            curve,
            limits: Limits::default(),
            quiet_s,
            poll_s,
            retry_s,
        }
    }
}

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
    schedule: Box<dyn Schedule + 'a>,
    inbox: Inbox,
    gallery: Gallery,
    gallery_written: Option<Moment>,
    /// Photos put back: not to be tried before this moment unless they change.
    resting: HashMap<OsString, (Option<Look>, Moment)>,
    summary: Summary,
}

impl<'a> Daemon<'a> {
    /// A daemon over `folders`, which were made good by opening them. `clock` measures waits, `calendar`
    /// dates the reports.
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
        Ok(Daemon {
            folders,
            setting,
            restorer,
            clock,
            calendar,
            watcher,
            schedule: Box::new(()),
            inbox: Inbox::default(),
            gallery,
            gallery_written: None,
            resting: HashMap::new(),
            summary: Summary::default(),
        })
    }

    /// The same daemon, taking photos when `schedule` says so. Without one it takes each at once.
    #[must_use]
    pub fn scheduled(mut self, schedule: Box<dyn Schedule + 'a>) -> Daemon<'a> {
        self.schedule = schedule;
        self
    }

    /// Empties the inbox and returns what became of each photo. Files need not have been quiet: one that is
    /// not whole and still grows is left, as are those for which the schedule holds.
    ///
    /// # Errors
    /// When the folders or the rig need help; photos not begun are still in the inbox.
    pub fn once(&mut self) -> Result<Summary, DaemonError> {
        let passed = self.pass(0.0, f64::INFINITY, &|| false);
        let shown = self.show_gallery();
        self.tell(match &passed {
            Ok(_) => Doing::Ended,
            Err(error) => Doing::Held { reason: crate::remedy::full_message(error) },
        })?;
        passed.and(shown)?;
        Ok(self.summary.clone())
    }

    /// Watches the inbox until `stop` says so, which is asked between photos and between looks. Needs of
    /// the operator are said once, held, and tried again.
    ///
    /// # Errors
    /// When not even the state can be written.
    pub fn run(&mut self, stop: &dyn Fn() -> bool) -> Result<Summary, DaemonError> {
        let mut held: Option<String> = None;
        self.tell(Doing::Waiting)?;
        self.show_gallery()?;
        while !stop() {
            let wait_s = match self.pass(self.setting.quiet_s, self.setting.retry_s, stop) {
                Ok(Turn::Stop) => break,
                Ok(Turn::Go) => {
                    if held.take().is_some() {
                        log::info!("going on");
                        self.tell(Doing::Waiting)?;
                    }
                    self.setting.poll_s
                }
                Ok(Turn::Hold { reason, until }) => {
                    if held.as_ref() != Some(&reason) {
                        log::info!("not now: {reason}");
                        self.tell(Doing::Paused { reason: reason.clone() })?;
                    }
                    held = Some(reason);
                    until.map_or(self.setting.poll_s, |at| at.0 - self.clock.now().0)
                }
                Err(error) => {
                    let reason = crate::remedy::full_message(&error);
                    if held.as_ref() != Some(&reason) {
                        log::warn!("holding: {reason}");
                        // A full disk must not end the daemon: it holds, and the log says why.
                        let _ = self.tell(Doing::Held { reason: reason.clone() });
                    }
                    held = Some(reason);
                    self.setting.retry_s
                }
            };
            self.wait(wait_s.max(self.setting.poll_s), stop);
        }
        self.show_gallery()?;
        self.tell(Doing::Ended)?;
        Ok(self.summary.clone())
    }

    /// Takes what is ready, oldest first, until nothing is or the schedule holds: then that turn.
    fn pass(&mut self, quiet_s: f64, retry_s: f64, stop: &dyn Fn() -> bool) -> Result<Turn, DaemonError> {
        let inbox = self.folders.inbox();
        let mut number = 0;
        let turn = 'all: loop {
            let now = self.clock.now();
            let mut ready = self.inbox.ready(&inbox, now, quiet_s)?;
            let waiting = ready.len();
            ready.retain(|name| match self.resting.get(name) {
                Some((look, until)) => *look != Look::at(&inbox.join(name)) || now >= *until,
                None => true,
            });
            if ready.is_empty() {
                self.schedule.idle(waiting, &mut *self.restorer);
                break Turn::Go;
            }
            let of = number + ready.len();
            for (taken, name) in ready.into_iter().enumerate() {
                if stop() {
                    return Ok(Turn::Stop);
                }
                let turn = self.schedule.before(waiting - taken, &mut *self.restorer);
                if turn != Turn::Go {
                    break 'all turn;
                }
                number += 1;
                let shown = name.to_string_lossy().into_owned();
                self.tell(Doing::Restoring { photo: shown.clone() })?;
                self.watcher.begun(&shown, number, of);
                let verdict = self.job(&name);
                self.watcher.ended();
                self.note(name, verdict?, retry_s);
                let due = self.gallery_written.is_none_or(|at| self.clock.now().0 - at.0 >= GALLERY_PERIOD_S);
                if due {
                    self.show_gallery()?;
                }
            }
        };
        if number > 0 {
            self.show_gallery()?;
            self.tell(Doing::Waiting)?;
        }
        Ok(turn)
    }

    fn note(&mut self, name: OsString, verdict: Verdict, retry_s: f64) {
        match verdict {
            Verdict::Restored { report, kept } => {
                log::info!("{}", report.line());
                self.schedule.after(Ended::Restored { report: &report, kept: &kept }, &mut *self.restorer);
                self.summary.left.retain(|left| left.photo != report.photo);
                self.gallery.add(&report);
                self.summary.restored.push(*report);
            }
            Verdict::Failed(failed) => {
                log::warn!("not restored: {}", failed.reason);
                self.schedule.after(Ended::Failed(&failed), &mut *self.restorer);
                self.summary.left.retain(|left| left.photo != failed.photo);
                self.gallery.add_failed(failed.clone());
                self.summary.failed.push(failed);
            }
            Verdict::Left(left) => {
                log::warn!("left in the inbox: {}", left.reason);
                self.schedule.after(Ended::Left(&left), &mut *self.restorer);
                let look = Look::at(&self.folders.inbox().join(&name));
                self.resting.insert(name, (look, Moment(self.clock.now().0 + retry_s)));
                self.summary.left.retain(|other| other.photo != left.photo);
                self.summary.left.push(left);
            }
            Verdict::Gone => {}
        }
    }

    fn show_gallery(&mut self) -> Result<(), DaemonError> {
        self.gallery_written = Some(self.clock.now());
        self.gallery.write(&self.folders, &self.setting.rig, &self.summary.left, self.unix_s())
    }

    fn tell(&self, doing: Doing) -> Result<(), DaemonError> {
        State {
            rig: self.setting.rig.clone(),
            doing,
            restored: self.summary.restored.len(),
            failed: self.summary.failed.len(),
            left: self.summary.left.len(),
            written_unix_s: self.unix_s(),
        }
        .write(&self.folders)
    }

    /// Waits in short steps, so that a stop is heard.
    fn wait(&self, wait_s: f64, stop: &dyn Fn() -> bool) {
        const STEP_S: f64 = 0.2;
        let until = self.clock.now().0 + wait_s;
        while !stop() && !self.schedule.wakes() && self.clock.now().0 < until {
            self.clock.wait_until(Moment((self.clock.now().0 + STEP_S).min(until)));
        }
    }

    pub(super) fn unix_s(&self) -> u64 {
        (self.calendar)().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
    }
}
