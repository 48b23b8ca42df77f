//! The schedule of unattended nights: hours, a believable calendar, a steady rig, and pilots that
//! prove it.
//!
//! ```text
//! outside the hours ──► inside: warm up ──► pilot good ──► photos … pilot every N … ──► pilot after the last
//!                                             │ past a limit: calibrate if allowed, pilot again, and
//!                                             ▼ restore anew what came after the last good pilot; else call for help
//! ```
//!
//! Photos restored since the last good pilot are *unproven*, and written down as such: after a
//! reboot the first pilot speaks for them, too.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::history::{self, Entry, Verdict};
use super::job::report_name;
use super::schedule::{Ended, Schedule, Turn};
use super::vigil::{Kept, Missed, Time, Vigil};
use super::{DaemonError, Delivered, Folders, Restorer, atomic_file};
use crate::config::Nights;
use crate::disk::Disk;
use crate::nights::pilot::{Drift, Limits};
use crate::nights::trust::{Belief, Calendar};
use crate::nights::warm_up::{WarmUp, Warmth};
use crate::nights::window::{Hours, Window};
use crate::remedy::{Remedy, full_message};
use crate::rig::{Clock, Moment};

/// Seconds between two pilots of a warm-up. Guess: a panel takes an hour.
const WARM_UP_STEP_S: f64 = 30.0;

/// The pilot after the last photo comes when the inbox has been empty for this long. Guess.
const LULL_S: f64 = 60.0;

/// Calibrations in a row after which a rig that drifts again is not believed to become steady.
/// Guess.
const CALIBRATIONS_MAX: u32 = 3;

/// Past the end of the window by the monotonic clock: the calendar has been put back.
const SLACK_S: f64 = 60.0;

/// The file in the root that survives a reboot.
const NAME: &str = ".relens-night.json";

/// A longer file is not ours: room for the names of ten thousand photos.
const BYTES_MAX: u64 = 16 << 20;

/// Where the time and the temperature come from.
#[derive(Clone, Copy)]
pub struct Times<'a> {
    /// The daemon's clock, which only goes forward.
    pub clock: &'a dyn Clock,
    /// The box's calendar.
    pub calendar: &'a dyn Fn() -> SystemTime,
    /// Whether the calendar was set by the network.
    pub is_set: &'a dyn Fn() -> bool,
    /// Temperature of the board in °C, if it tells.
    pub temperature_c: &'a dyn Fn() -> Option<f64>,
}

/// What survives a reboot.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Record {
    /// The latest believed time.
    floor_unix_s: f64,
    /// Photos restored since the last good pilot.
    unproven: Vec<Delivered>,
    /// A pilot was past its limits since then: they are to be restored anew.
    doubted: bool,
    /// They are being put back.
    again: bool,
    /// Photos that wait, and what keeps them.
    #[serde(default)]
    vigil: Kept,
}

/// Photos and results that the night of the box at `home` may still ask back, as far as the disk
/// knows.
pub(super) fn unproven_at(disk: &dyn Disk, home: &Path) -> Result<Vec<Delivered>, DaemonError> {
    let read = atomic_file::read(disk, &home.join(NAME), BYTES_MAX)?;
    let record = read.and_then(|bytes| serde_json::from_slice::<Record>(&bytes).ok());
    Ok(record.unwrap_or_default().unproven)
}

/// One night under way.
struct Session {
    /// When it ends on the daemon's clock.
    ends: Option<Moment>,
    warm_up: Option<WarmUp>,
    next_pilot: Moment,
    photos: usize,
}

/// Nights around a rig with a pilot.
pub struct Nightly<'a> {
    nights: Nights,
    limits: Limits,
    window: Window,
    calendar: Calendar,
    /// The last look at it.
    belief: Belief,
    vigil: Vigil,
    times: Times<'a>,
    disk: Arc<dyn Disk>,
    root: PathBuf,
    inbox: PathBuf,
    done: PathBuf,
    outbox: PathBuf,
    pilots: PathBuf,
    record: Record,
    session: Option<Session>,
    /// This window's time is used up, whatever the calendar says.
    spent: bool,
    calibrations: u32,
    lull_since: Option<Moment>,
}

impl<'a> Nightly<'a> {
    /// The nights of a rig file over `folders`; `None` when they could not be read, which its check
    /// rules out.
    pub fn new(nights: &Nights, folders: &Folders, times: Times<'a>) -> Option<Nightly<'a>> {
        let root = folders.home();
        let read = atomic_file::read(folders.disk(), &root.join(NAME), BYTES_MAX).ok().flatten();
        let record: Record =
            read.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        Some(Nightly {
            nights: nights.clone(),
            limits: Limits::of(nights),
            window: Window::new(nights)?,
            calendar: Calendar::new(nights.clock, record.floor_unix_s),
            belief: Belief::NotSet,
            vigil: Vigil::new(record.vigil.clone()),
            times,
            disk: folders.shared_disk(),
            root,
            inbox: folders.inbox().to_owned(),
            done: folders.done().to_owned(),
            outbox: folders.outbox().to_owned(),
            pilots: folders.previews().to_owned(),
            record,
            session: None,
            spent: false,
            calibrations: 0,
            lull_since: None,
        })
    }

    fn now(&self) -> Moment {
        self.times.clock.now()
    }

    fn unix_s(&self) -> f64 {
        (self.times.calendar)().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
    }

    /// Writes down what must survive a reboot. A disk that is full is told of by the photos.
    fn keep(&mut self) {
        self.record.floor_unix_s = self.calendar.floor_unix_s();
        self.record.vigil = self.vigil.kept();
        let written = serde_json::to_vec(&self.record).map_err(std::io::Error::other);
        let kept = written
            .map_err(DaemonError::files("write", &self.root))
            .and_then(|bytes| atomic_file::replace(&*self.disk, &self.root, NAME.as_ref(), &bytes))
            .and_then(|()| atomic_file::sync_folder(&*self.disk, &self.root));
        if let Err(error) = kept {
            log::debug!("the night's record is not kept: {}", full_message(&error));
        }
    }

    /// Looks at the calendar, and at whether `waiting` photos wait for too long; `None` when nobody
    /// knows how many do.
    fn look(&mut self, waiting: Option<usize>) {
        let (now, unix_s) = (self.now(), self.unix_s());
        self.belief = self.calendar.look(unix_s, now.0, (self.times.is_set)());
        if let Belief::Believed { jumped_s: Some(jump) } = self.belief {
            log::warn!("the clock was changed by {jump:+.0} s");
        }
        let time = self.time(now, unix_s);
        if self.vigil.look(time, waiting, &self.window) {
            self.keep();
        }
    }

    /// The clocks at `now`, as far as the last look believed them.
    fn time(&self, now: Moment, unix_s: f64) -> Time {
        match self.belief {
            Belief::Believed { jumped_s } => Time { now, unix_s: Some(unix_s), jumped_s },
            Belief::NotSet | Belief::Before { .. } => Time { now, unix_s: None, jumped_s: None },
        }
    }

    /// Writes down what keeps photos from being restored, should the whole night pass like this.
    fn hindered(&mut self, why: &str) {
        let time = self.time(self.now(), self.unix_s());
        if self.vigil.hindered(time.unix_s, why) {
            self.keep();
        }
    }

    /// Told while there is no rig to ask for anything, and why there is none.
    pub fn shut_out(&mut self, why: &str) {
        let waits = |name: &OsStr| !super::inbox::is_hidden(name);
        let waiting =
            self.disk.list(&self.inbox).map(|found| found.iter().filter(|(n, _)| waits(n)).count());
        self.look(waiting.ok());
        self.hindered(why);
    }

    /// Whether photos may be taken at this hour; the night is begun or ended as it is time.
    fn hours(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        let (now, unix_s) = (self.now(), self.unix_s());
        let hold = |reason: String, until| Some(Turn::Hold { reason, until });
        match self.belief {
            Belief::Believed { .. } => {}
            Belief::NotSet => {
                self.session = None;
                let reason = "the time is not known: no network has set the clock yet";
                return hold(reason.to_owned(), None);
            }
            Belief::Before { .. } => {
                self.session = None;
                let reason = "the time is not known: the clock says a time that already was";
                return hold(reason.to_owned(), None);
            }
        }
        let over =
            self.session.as_ref().and_then(|s| s.ends).is_some_and(|end| now.0 > end.0 + SLACK_S);
        match self.window.at(unix_s) {
            Hours::Closed { opens_in_s, words } => {
                self.spent = false;
                self.end(rig).or_else(|| hold(words, Some(Moment(now.0 + opens_in_s))))
            }
            Hours::Open { .. } if self.spent || over => {
                self.spent = true;
                let reason = "the night is over, though the clock was put back".to_owned();
                self.end(rig).or_else(|| hold(reason, None))
            }
            Hours::Open { left_s } => {
                if self.session.is_none() {
                    log::info!("the night begins");
                    self.session = Some(Session {
                        ends: left_s.map(|left| Moment(now.0 + left)),
                        warm_up: Some(WarmUp::new(now.0)),
                        next_pilot: now,
                        photos: 0,
                    });
                }
                None
            }
        }
    }

    /// Whether this is no hour for photos, by a calendar that is believed.
    fn is_closed(&self) -> bool {
        let believed = matches!(self.belief, Belief::Believed { .. });
        believed && matches!(self.window.at(self.unix_s()), Hours::Closed { .. })
    }

    /// Ends the night, with the pilot after the last photo.
    fn end(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        let session = self.session.take()?;
        log::info!("the night is over: {} photos since the last pilot", session.photos);
        let proven = self.record.unproven.is_empty() || session.warm_up.is_some();
        let turn = if proven { None } else { self.prove(rig) };
        self.keep();
        turn
    }

    /// Shows a pilot; `None` when the rig has none.
    fn pilot(&mut self, rig: &mut dyn Restorer) -> Result<Option<Drift>, Turn> {
        rig.pilot().map_err(|error| Turn::Help { reason: full_message(&*error) })
    }

    fn note(&self, drift: Drift, verdict: Verdict) {
        let temperature_c = (self.times.temperature_c)();
        let entry = Entry { unix_s: self.unix_s() as u64, drift, verdict, temperature_c };
        if let Err(error) = history::add(&*self.disk, &self.pilots, entry) {
            log::debug!("the pilot is not written down: {}", full_message(&error));
        }
    }

    /// A pilot, and what follows from it; `None` when photos may go on.
    fn prove(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        match self.pilot(rig) {
            Ok(Some(drift)) => self.judge(drift, rig),
            Ok(None) => self.good(),
            Err(turn) => Some(turn),
        }
    }

    fn judge(&mut self, drift: Drift, rig: &mut dyn Restorer) -> Option<Turn> {
        let Some(complaint) = drift.complaint(&self.limits) else {
            self.note(drift, Verdict::Good);
            self.calibrations = 0;
            return self.good();
        };
        self.note(drift, Verdict::Drifted);
        self.record.doubted |= !self.record.unproven.is_empty();
        self.keep();
        if !self.nights.recalibrate || self.calibrations >= CALIBRATIONS_MAX {
            let also = if self.nights.recalibrate { " again and again" } else { "" };
            return Some(Turn::Help { reason: format!("the rig has drifted{also}: {complaint}") });
        }
        self.calibrations += 1;
        log::warn!("the rig has drifted: {complaint}; it is calibrated anew");
        if let Err(error) = rig.mend(Remedy::Recalibrate) {
            let reason = format!("the rig has drifted ({complaint}) and cannot be calibrated: ");
            return Some(Turn::Help { reason: reason + &full_message(&*error) });
        }
        self.prove(rig)
    }

    /// The rig is what was calibrated: what came before is proven, unless it was doubted in
    /// between.
    fn good(&mut self) -> Option<Turn> {
        if let Some(session) = &mut self.session {
            session.photos = 0;
        }
        if self.record.doubted && !self.record.unproven.is_empty() {
            self.record.again = true;
            self.keep();
            return Some(Turn::Again(self.record.unproven.clone()));
        }
        if !self.record.unproven.is_empty() {
            self.record.unproven.clear();
            self.keep();
        }
        None
    }

    /// Photos that are being put back: until none is left in its old place.
    fn putting_back(&mut self) -> Option<Turn> {
        if !self.record.again {
            return None;
        }
        let in_place = |folder: &Path, name: &OsStr| self.disk.look(&folder.join(name)).is_ok();
        let left = |d: &&Delivered| {
            // The report alone is what a cut may have left.
            in_place(&self.done, &d.kept)
                || in_place(&self.outbox, &d.result)
                || in_place(&self.outbox, &report_name(&d.result))
        };
        let left: Vec<Delivered> = self.record.unproven.iter().filter(left).cloned().collect();
        if !left.is_empty() {
            return Some(Turn::Again(left));
        }
        self.record = Record { floor_unix_s: self.record.floor_unix_s, ..Record::default() };
        self.keep();
        None
    }

    /// Warm-up; `None` when it is over.
    fn warm_up(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        let now = self.now();
        let (limits, max_s) = (self.limits, 60.0 * self.nights.warm_up_max_min);
        let session = self.session.as_ref()?;
        session.warm_up.as_ref()?;
        let hold =
            |until| Turn::Hold { reason: "the rig is warming up".to_owned(), until: Some(until) };
        if now.0 < session.next_pilot.0 {
            return Some(hold(session.next_pilot));
        }
        let drift = match self.pilot(rig) {
            Ok(Some(drift)) => drift,
            Ok(None) => {
                self.session.as_mut()?.warm_up = None;
                return self.good();
            }
            Err(turn) => return Some(turn),
        };
        let session = self.session.as_mut()?;
        let warmth = session.warm_up.as_mut()?.take(drift, &limits, now.0, max_s);
        if warmth == Warmth::Warming {
            session.next_pilot = Moment(now.0 + WARM_UP_STEP_S);
            let until = session.next_pilot;
            self.note(drift, Verdict::Warming);
            return Some(hold(until));
        }
        session.warm_up = None;
        if warmth == Warmth::OutOfTime {
            log::warn!("the rig did not become steady within {} min", self.nights.warm_up_max_min);
        }
        self.judge(drift, rig)
    }
}

impl Schedule for Nightly<'_> {
    fn before(&mut self, waiting: usize, rig: &mut dyn Restorer) -> Turn {
        self.lull_since = None;
        self.look(Some(waiting));
        let turn = self.putting_back().or_else(|| self.hours(rig)).or_else(|| self.warm_up(rig));
        let due = self.session.as_ref().is_some_and(|s| s.photos >= self.nights.pilot_every_photos);
        let turn = turn.or_else(|| if due { self.prove(rig) } else { None }).unwrap_or(Turn::Go);
        if let Turn::Hold { reason, .. } = &turn
            && !self.is_closed()
        {
            self.hindered(reason);
        }
        turn
    }

    fn after(&mut self, ended: Ended<'_>, _: &mut dyn Restorer) {
        let time = self.time(self.now(), self.unix_s());
        if let Ended::Left(left) = ended {
            return self.hindered(&left.reason);
        }
        self.vigil.served(time);
        if let Ended::Restored { delivered, .. } = ended {
            self.record.unproven.push(delivered.clone());
            if let Some(session) = &mut self.session {
                session.photos += 1;
            }
        }
        self.keep();
    }

    fn unproven(&self) -> &[Delivered] {
        &self.record.unproven
    }

    fn idle(&mut self, waiting: usize, rig: &mut dyn Restorer) -> Turn {
        self.look(Some(waiting));
        if let Some(turn) = self.putting_back().or_else(|| self.hours(rig)) {
            return turn;
        }
        let now = self.now();
        let since = *self.lull_since.get_or_insert(now);
        if self.record.unproven.is_empty() || now.0 - since.0 < LULL_S {
            return Turn::Go;
        }
        // After a reboot the rig is cold, and what it says is not to be held against the photos.
        let cold = self.session.as_ref().is_some_and(|session| session.warm_up.is_some());
        let turn = if cold { self.warm_up(rig) } else { self.prove(rig) };
        turn.unwrap_or(Turn::Go)
    }

    fn held(&mut self, error: &DaemonError, _: &mut dyn Restorer) {
        self.look(None);
        self.hindered(&full_message(error));
    }

    fn kept_waiting(&mut self, waiting: usize, why: &str) {
        self.look(Some(waiting));
        if waiting > 0 {
            self.hindered(why);
        }
    }

    fn missed(&self) -> Option<Missed> {
        self.vigil.missed().cloned()
    }
}
