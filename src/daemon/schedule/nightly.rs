//! The schedule of unattended nights: hours, a believable calendar, a steady rig, and pilots that
//! prove it.
//!
//! ```text
//! outside the hours ─► inside: warm up ─► pilot good ─► photos, a pilot every N ─► a last pilot
//!                                             │ past a limit: calibrate if allowed, pilot again,
//!                                             ▼ and restore anew what came after the last good
//!                                               pilot; else call for help
//! ```
//!
//! Photos restored since the last good pilot are *unproven*, and written down as such: after a
//! reboot the first pilot speaks for them, too.

use std::time::{SystemTime, UNIX_EPOCH};

use super::alarm::{Alarm, Time};
use super::{Event, Notice, Question, Schedule, Turn};
use crate::config::Nights;
use crate::daemon::error::DaemonError;
use crate::daemon::job::JobEnd;
use crate::daemon::store::folders::Folders;
use crate::daemon::store::inbox::is_hidden;
use crate::daemon::store::night_record::NightRecord;
use crate::daemon::store::pilots::{self, PilotEntry, PilotVerdict};
use crate::daemon::store::report_file::Delivered;
use crate::daemon::store::waiting::Awaited;
use crate::daemon::store::withdraw::is_in_place;
use crate::nights::pilot::{Drift, DriftLimits};
use crate::nights::trust::{Belief, Calendar};
use crate::nights::warm_up::{WarmUp, Warmth};
use crate::nights::window::{Hours, Window};
use crate::remedy::{AnyFailure, Remedy, full_message};
use crate::restorer::Restorer;
use crate::rig::{Clock, Moment};

/// Seconds between two pilots of a warm-up. Guess: a panel takes an hour.
const WARM_UP_STEP_S: f64 = 30.0;

/// The pilot after the last photo comes when the inbox has been empty for this long. Guess.
const LULL_S: f64 = 60.0;

/// Calibrations in a row after which a rig that drifts again is not believed to become steady.
/// Guess.
const CALIBRATIONS_MAX: u32 = 3;

/// What photos wait for when the lens was to be measured anew and somebody held the button.
const GIVEN_UP: &str = "the rig has drifted, and measuring the lens anew was given up at the \
                        button: press it to measure; else the next night does";

/// Past the end of the window by the monotonic clock: the calendar has been put back.
const SLACK_S: f64 = 60.0;

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

impl Times<'_> {
    fn unix_s(&self) -> f64 {
        (self.calendar)().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
    }
}

/// One night under way.
struct Night {
    /// When it ends on the daemon's clock.
    ends: Option<Moment>,
    warm_up: Option<WarmUp>,
    next_pilot: Moment,
    /// Photos since the last pilot.
    photos: usize,
    /// The last pilot was past a limit, and nothing was put right since.
    drifted: bool,
}

/// Nights around a rig with a pilot.
pub struct Nightly<'a> {
    nights: Nights,
    window: Window,
    times: Times<'a>,
    calendar: Calendar,
    /// The last look at it.
    belief: Belief,
    alarm: Alarm,
    folders: Folders,
    record: NightRecord,
    night: Option<Night>,
    /// This window's time is used up, whatever the calendar says.
    spent: bool,
    calibrations: u32,
    /// Somebody held the button while the lens was measured anew: not before they press again, or
    /// the next night.
    given_up: bool,
    /// Since when there is nothing to take.
    lull_since: Option<Moment>,
}

fn help(failure: AnyFailure) -> Option<Turn> {
    Some(Turn::Help(DaemonError::Rig { about: String::new(), failure }))
}

impl<'a> Nightly<'a> {
    /// The nights of a rig file over `folders`; `None` when they could not be read, which its check
    /// rules out.
    pub fn new(nights: &Nights, folders: &Folders, times: Times<'a>) -> Option<Nightly<'a>> {
        let record = NightRecord::load(folders).unwrap_or_default();
        Some(Nightly {
            nights: nights.clone(),
            window: Window::new(nights)?,
            times,
            calendar: Calendar::new(nights.clock, record.floor_unix_s),
            belief: Belief::NotSet,
            alarm: Alarm::new(times.clock.now(), record.waiting.clone()),
            folders: folders.clone(),
            record,
            night: None,
            spent: false,
            calibrations: 0,
            given_up: false,
            lull_since: None,
        })
    }

    fn now(&self) -> Moment {
        self.times.clock.now()
    }

    /// Writes down what must survive a reboot. A disk that is full is told of by the photos.
    fn keep(&mut self) {
        self.record.floor_unix_s = self.calendar.floor_unix_s();
        self.record.waiting = self.alarm.record(self.time(), &self.record.waiting);
        if let Err(error) = self.record.save(&self.folders) {
            log::debug!("the night's record is not kept: {}", full_message(&error));
        }
    }

    /// The clocks, as far as the last look believed them.
    fn time(&self) -> Time {
        let believed = matches!(self.belief, Belief::Believed { .. });
        Time { now: self.now(), unix_s: believed.then(|| self.times.unix_s()) }
    }

    /// Looks at the calendar, and at whether `waiting` photos wait for too long; `None` when nobody
    /// knows how many do.
    fn look(&mut self, waiting: Option<usize>) {
        let (now, unix_s) = (self.now(), self.times.unix_s());
        self.belief = self.calendar.look(unix_s, now.0, (self.times.is_set)());
        if let Belief::Believed { jumped_s: Some(jump) } = self.belief {
            log::warn!("the clock was changed by {jump:+.0} s");
        }
        self.alarm.look(self.time(), waiting, &self.window);
        self.keep_waiting();
    }

    /// Writes down what the alarm knows, if that is new.
    fn keep_waiting(&mut self) {
        let waiting = self.alarm.record(self.time(), &self.record.waiting);
        if !waiting.is_like(&self.record.waiting) {
            self.keep();
        }
    }

    /// Writes down what keeps photos from being restored, should the whole night pass like this.
    fn hindered(&mut self, why: &str) {
        self.alarm.hindered(self.now(), why);
        self.keep_waiting();
    }

    /// Told while there is no rig to ask for anything, and why there is none.
    pub fn shut_out(&mut self, why: &str) {
        let found = self.folders.files().list(self.folders.inbox());
        self.look(found.ok().map(|found| found.iter().filter(|(n, _)| !is_hidden(n)).count()));
        self.hindered(why);
    }

    /// Photos wait within the hours, for `reason`.
    fn hold(&mut self, awaited: Awaited, reason: &str, until: Option<Moment>) -> Option<Turn> {
        self.hindered(reason);
        Some(Turn::Hold { reason: reason.to_owned(), awaited, until })
    }

    /// Whether photos may be taken at this hour; the night is begun or ended as it is time.
    fn hours(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        let now = self.now();
        let unknown = match self.belief {
            Belief::Believed { .. } => None,
            Belief::NotSet => Some("no network has set the clock yet"),
            Belief::Before { .. } => Some("the clock says a time that already was"),
        };
        if let Some(why) = unknown {
            self.night = None;
            return self.hold(Awaited::Window, &format!("the time is not known: {why}"), None);
        }
        let ends = self.night.as_ref().and_then(|night| night.ends);
        let over = ends.is_some_and(|end| now.0 > end.0 + SLACK_S);
        match self.window.at(self.times.unix_s()) {
            Hours::Closed { opens_in_s, words } => {
                self.spent = false;
                let until = Some(Moment(now.0 + opens_in_s));
                let awaited = Awaited::Window;
                self.end(rig).or(Some(Turn::Hold { reason: words, awaited, until }))
            }
            Hours::Open { .. } if self.spent || over => {
                self.spent = true;
                let turn = self.end(rig);
                let over = "the night is over, though the clock was put back";
                turn.or_else(|| self.hold(Awaited::Window, over, None))
            }
            Hours::Open { left_s } => {
                if self.night.is_none() {
                    log::info!("the night begins");
                    self.night = Some(Night {
                        ends: left_s.map(|left| Moment(now.0 + left)),
                        warm_up: Some(WarmUp::new(now.0)),
                        next_pilot: now,
                        photos: 0,
                        drifted: false,
                    });
                    self.given_up = false;
                }
                None
            }
        }
    }

    /// Ends the night, with the pilot after the last photo.
    fn end(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        let night = self.night.take()?;
        log::info!("the night is over: {} photos since the last pilot", night.photos);
        let proven = self.record.unproven.is_empty() || night.warm_up.is_some();
        let turn = if proven { None } else { self.prove(rig) };
        self.keep();
        turn
    }

    fn note(&self, drift: Drift, verdict: PilotVerdict) {
        let temperature_c = (self.times.temperature_c)();
        let unix_s = self.times.unix_s() as u64;
        let entry = PilotEntry { unix_s, drift, verdict, temperature_c };
        if let Err(error) = pilots::add(&self.folders, entry) {
            log::debug!("the pilot is not written down: {}", full_message(&error));
        }
    }

    /// A pilot, and what follows from it; `None` when photos may go on.
    fn prove(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        match rig.pilot() {
            Ok(Some(drift)) => self.judge(drift, rig),
            // The rig has no pilot.
            Ok(None) => self.good(),
            Err(failure) => help(failure),
        }
    }

    fn judge(&mut self, drift: Drift, rig: &mut dyn Restorer) -> Option<Turn> {
        let Some(complaint) = drift.complaint(&DriftLimits::of(&self.nights)) else {
            self.note(drift, PilotVerdict::Good);
            self.calibrations = 0;
            return self.good();
        };
        self.note(drift, PilotVerdict::Drifted);
        if let Some(night) = &mut self.night {
            night.drifted = true;
        }
        self.record.doubted |= !self.record.unproven.is_empty();
        self.keep();
        let calibrations = self.calibrations;
        if !self.nights.recalibrate || calibrations >= CALIBRATIONS_MAX {
            return Some(Turn::Help(DaemonError::Drifted { complaint, calibrations }));
        }
        self.calibrations += 1;
        log::warn!("the rig has drifted: {complaint}; it is calibrated anew");
        if let Err(failure) = rig.mend(Remedy::Recalibrate) {
            if failure.was_asked_for() {
                log::info!("measuring the lens was given up: the photos wait for the button");
                self.given_up = true;
                self.calibrations -= 1;
                return self.hold(Awaited::Button, GIVEN_UP, None);
            }
            let why = format!("the rig has drifted ({complaint}) and ");
            return Some(Turn::Help(DaemonError::Calibration { why, failure }));
        }
        self.prove(rig)
    }

    /// The rig is what was calibrated: what came before is proven, unless it was doubted in
    /// between.
    fn good(&mut self) -> Option<Turn> {
        if let Some(night) = &mut self.night {
            (night.photos, night.drifted) = (0, false);
        }
        if self.record.unproven.is_empty() {
            return None;
        }
        let again = self.record.doubted.then(|| Turn::Again(self.record.unproven.clone()));
        match &again {
            Some(_) => self.record.again = true,
            None => self.record.unproven.clear(),
        }
        self.keep();
        again
    }

    /// Photos that are being put back: until none is left in its old place.
    fn putting_back(&mut self) -> Option<Turn> {
        if !self.record.again {
            return None;
        }
        let mut left = self.record.unproven.clone();
        left.retain(|photo| is_in_place(&self.folders, photo));
        if !left.is_empty() {
            return Some(Turn::Again(left));
        }
        let waiting = std::mem::take(&mut self.record.waiting);
        self.record = NightRecord { waiting, ..NightRecord::default() };
        self.keep();
        None
    }

    /// Warm-up; `None` when it is over.
    fn warm_up(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        const REASON: &str = "the rig is warming up";
        let now = self.now();
        let night = self.night.as_ref()?;
        night.warm_up.as_ref()?;
        if now.0 < night.next_pilot.0 {
            let until = Some(night.next_pilot);
            return self.hold(Awaited::Rig, REASON, until);
        }
        let drift = match rig.pilot() {
            Ok(Some(drift)) => drift,
            Ok(None) => {
                self.night.as_mut()?.warm_up = None;
                return self.good();
            }
            Err(failure) => return help(failure),
        };
        let (limits, max_s) = (DriftLimits::of(&self.nights), 60.0 * self.nights.warm_up_max_min);
        let night = self.night.as_mut()?;
        let warmth = night.warm_up.as_mut()?.take(drift, &limits, now.0, max_s);
        if warmth == Warmth::Warming {
            let until = Moment(now.0 + WARM_UP_STEP_S);
            night.next_pilot = until;
            self.note(drift, PilotVerdict::Warming);
            return self.hold(Awaited::Rig, REASON, Some(until));
        }
        night.warm_up = None;
        if warmth == Warmth::OutOfTime {
            log::warn!("the rig did not become steady within {} min", self.nights.warm_up_max_min);
        }
        self.judge(drift, rig)
    }

    /// Nothing is left to take: the pilot after the last photo, when that has lasted for a while.
    fn after_the_last(&mut self, rig: &mut dyn Restorer) -> Option<Turn> {
        let now = self.now();
        let since = *self.lull_since.get_or_insert(now);
        if self.record.unproven.is_empty() || now.0 - since.0 < LULL_S {
            return None;
        }
        // After a reboot the rig is cold, and what it says is not to be held against the photos.
        let cold = self.night.as_ref().is_some_and(|night| night.warm_up.is_some());
        if cold { self.warm_up(rig) } else { self.prove(rig) }
    }
}

impl Schedule for Nightly<'_> {
    fn turn(&mut self, asked: Question, rig: &mut dyn Restorer) -> Turn {
        self.look(Some(asked.waiting));
        let mut turn = self.putting_back().or_else(|| self.hours(rig));
        if self.given_up {
            turn = turn.or_else(|| self.hold(Awaited::Button, GIVEN_UP, None));
        }
        if asked.is_ready {
            self.lull_since = None;
            turn = turn.or_else(|| self.warm_up(rig));
            let every = self.nights.pilot_every_photos;
            let is_due = |night: &Night| night.drifted || night.photos >= every;
            if turn.is_none() && self.night.as_ref().is_some_and(is_due) {
                turn = self.prove(rig);
            }
        } else {
            turn = turn.or_else(|| self.after_the_last(rig));
        }
        turn.unwrap_or(Turn::Go)
    }

    fn told(&mut self, event: Event<'_>, _: &mut dyn Restorer) {
        match event {
            Event::Begun { .. } | Event::Ended(JobEnd::Gone) => {}
            Event::Pressed => self.given_up = false,
            Event::Ended(JobEnd::Left { left, .. }) => self.hindered(&left.reason),
            Event::Ended(JobEnd::Failed(_)) => {
                self.alarm.served(self.now());
                self.keep();
            }
            Event::Ended(JobEnd::Done { delivered, .. }) => {
                self.alarm.served(self.now());
                self.record.unproven.push(delivered.clone());
                if let Some(night) = &mut self.night {
                    night.photos += 1;
                }
                self.keep();
            }
            Event::Held(error) => {
                self.look(None);
                self.hindered(&full_message(error));
            }
            Event::KeptWaiting { waiting, why } => {
                self.look(Some(waiting));
                if waiting > 0 {
                    self.hindered(why);
                }
            }
        }
    }

    fn unproven(&self) -> &[Delivered] {
        &self.record.unproven
    }

    fn attention(&self) -> Vec<Notice> {
        self.alarm.missed().cloned().into_iter().collect()
    }
}
