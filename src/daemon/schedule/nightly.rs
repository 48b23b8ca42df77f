//! The schedule of unattended nights: hours, a trusted calendar, warm-up, and pilots that check the
//! rig for drift.
//!
//! ```text
//! outside the hours ─► inside: warm up ─► pilot good ─► photos, a pilot every N ─► a last pilot
//!                                             │ past a limit: calibrate if allowed, pilot again,
//!                                             ▼ and repeat the photos since the last good pilot;
//!                                               else call for help
//! ```
//!
//! Photos restored since the last good pilot are *unproven*, and recorded as such: after a reboot
//! the first pilot decides on them, too.

use std::time::SystemTime;

use super::{Event, Question, Schedule, Turn};
use crate::config::Nights;
use crate::daemon::error::DaemonError;
use crate::daemon::job::JobEnd;
use crate::daemon::store::folders::Folders;
use crate::daemon::store::night_record::NightRecord;
use crate::daemon::store::waiting::Awaited;
use crate::daemon::store::withdraw::is_in_place;
use crate::nights::pilot::Drift;
use crate::nights::trust::{Calendar, unix_s};
use crate::nights::warm_up::{WARM_UP_MAX_MIN, WarmUp, Warmth};
use crate::nights::window::{Hours, Window};
use crate::remedy::{Remedy, full_message};
use crate::restorer::Restorer;
use crate::rig::{Clock, Moment};

/// Seconds between two pilots of a warm-up. Guess: a panel takes an hour.
const WARM_UP_STEP_S: f64 = 30.0;

/// The inbox must be empty for this long before the pilot after the last photo. Guess.
const LULL_S: f64 = 60.0;

/// Calibrations in a row after which a rig that drifts again counts as unsteady. Guess.
const CALIBRATIONS_MAX: u32 = 3;

/// Reason to hold photos after a calibration was cancelled at the button.
const CANCELLED: &str = "the rig has drifted, and measuring the lens was cancelled at the button: \
                         press it to measure now; otherwise the next night does";

/// Sources of time.
#[derive(Clone, Copy)]
pub struct Times<'a> {
    /// The monotonic clock.
    pub clock: &'a dyn Clock,
    /// The calendar.
    pub calendar: &'a dyn Fn() -> SystemTime,
    /// Whether the network has set the calendar.
    pub is_set: &'a dyn Fn() -> bool,
}

impl Times<'_> {
    fn unix_s(&self) -> f64 {
        unix_s((self.calendar)())
    }
}

struct Night {
    warm_up: Option<WarmUp>,
    next_pilot: Moment,
    /// Photos since the last pilot.
    photos: usize,
    /// Whether the drift by the last pilot was past a limit.
    drifted: bool,
}

/// The schedule of nights.
pub struct Nightly<'a> {
    nights: Nights,
    window: Window,
    times: Times<'a>,
    calendar: Calendar,
    folders: Folders,
    record: NightRecord,
    night: Option<Night>,
    calibrations: u32,
    /// Whether a calibration was cancelled at the button; it is not repeated before a press or the
    /// next night.
    is_cancelled: bool,
    /// Time since which no photo has been ready.
    lull_since: Option<Moment>,
}

/// `Ok` if photos may be restored, else what to do instead.
type MayRestore = Result<(), Turn>;

fn hold(awaited: Awaited, reason: &str, until: Option<Moment>) -> MayRestore {
    Err(Turn::hold(awaited, reason, until))
}

impl<'a> Nightly<'a> {
    /// The schedule `nights` of a rig file; `None` for an invalid window or time zone, which the
    /// check of the rig file excludes.
    pub fn new(nights: &Nights, folders: &Folders, times: Times<'a>) -> Option<Nightly<'a>> {
        let record = NightRecord::load(folders).unwrap_or_default();
        Some(Nightly {
            nights: nights.clone(),
            window: Window::new(nights)?,
            times,
            calendar: Calendar::new(nights.clock, record.floor_unix_s),
            folders: folders.clone(),
            record,
            night: None,
            calibrations: 0,
            is_cancelled: false,
            lull_since: None,
        })
    }

    fn now(&self) -> Moment {
        self.times.clock.now()
    }

    /// Saves the state that survives a reboot. Errors are logged only: a full disk is reported with
    /// the photos.
    fn save(&mut self) {
        self.record.floor_unix_s = self.calendar.floor_unix_s;
        if let Err(error) = self.record.save(&self.folders) {
            log::debug!("cannot save the state of the night: {}", full_message(&error));
        }
    }

    /// Begins or ends the night according to the hours.
    fn hours(&mut self, rig: &mut dyn Restorer) -> MayRestore {
        let (now, unix_s) = (self.now(), self.times.unix_s());
        if let Err(why) = self.calendar.judge(unix_s, (self.times.is_set)()) {
            self.night = None;
            return hold(Awaited::Window, &format!("the time is unknown: {why}"), None);
        }
        match self.window.at(unix_s) {
            Hours::Closed { opens_in_s, words } => {
                self.end(rig)?;
                hold(Awaited::Window, &words, Some(Moment(now.0 + opens_in_s)))
            }
            Hours::Open => {
                if self.night.is_none() {
                    log::info!("the night begins");
                    self.night = Some(Night {
                        warm_up: Some(WarmUp::new(now.0)),
                        next_pilot: now,
                        photos: 0,
                        drifted: false,
                    });
                    self.is_cancelled = false;
                }
                Ok(())
            }
        }
    }

    /// Ends the night with a last pilot.
    fn end(&mut self, rig: &mut dyn Restorer) -> MayRestore {
        let Some(night) = self.night.take() else { return Ok(()) };
        log::info!("the night is over: {} photos since the last pilot", night.photos);
        let proven = self.record.unproven.is_empty() || night.warm_up.is_some();
        let end = if proven { Ok(()) } else { self.prove(rig) };
        self.save();
        end
    }

    fn prove(&mut self, rig: &mut dyn Restorer) -> MayRestore {
        match rig.pilot().map_err(DaemonError::of_rig)? {
            Some(drift) => self.judge(drift, rig),
            // The rig has no pilots.
            None => self.good(),
        }
    }

    fn judge(&mut self, drift: Drift, rig: &mut dyn Restorer) -> MayRestore {
        let Some(complaint) = drift.complaint() else {
            log::debug!("pilot: {drift:?}");
            self.calibrations = 0;
            return self.good();
        };
        if let Some(night) = &mut self.night {
            night.drifted = true;
        }
        self.record.must_repeat |= !self.record.unproven.is_empty();
        self.save();
        let calibrations = self.calibrations;
        if !self.nights.recalibrate || calibrations >= CALIBRATIONS_MAX {
            return Err(DaemonError::Drifted { complaint, calibrations }.into());
        }
        self.calibrations += 1;
        log::warn!("the rig has drifted: {complaint}; calibrating");
        if let Err(failure) = rig.mend(Remedy::Recalibrate) {
            if failure.was_asked_for() {
                log::info!("measuring the lens was cancelled: photos wait for the button");
                self.is_cancelled = true;
                self.calibrations -= 1;
                return hold(Awaited::Button, CANCELLED, None);
            }
            let cause = format!("the rig has drifted ({complaint}) and");
            return Err(DaemonError::Calibration { cause, failure }.into());
        }
        self.prove(rig)
    }

    /// Acts on a good pilot: photos since the last good one are proven, unless a pilot in between
    /// was past a limit.
    fn good(&mut self) -> MayRestore {
        if let Some(night) = &mut self.night {
            (night.photos, night.drifted) = (0, false);
        }
        if self.record.unproven.is_empty() {
            return Ok(());
        }
        if self.record.must_repeat {
            self.record.is_withdrawing = true;
            self.save();
            return Err(Turn::Again(self.record.unproven.clone()));
        }
        self.record.unproven.clear();
        self.save();
        Ok(())
    }

    fn continue_withdrawal(&mut self) -> MayRestore {
        if !self.record.is_withdrawing {
            return Ok(());
        }
        let mut remaining = self.record.unproven.clone();
        remaining.retain(|photo| is_in_place(&self.folders, photo));
        if !remaining.is_empty() {
            return Err(Turn::Again(remaining));
        }
        self.record = NightRecord::default();
        self.save();
        Ok(())
    }

    fn warm_up(&mut self, rig: &mut dyn Restorer) -> MayRestore {
        const REASON: &str = "the rig is warming up";
        let now = self.now();
        let Some(Night { warm_up: Some(_), next_pilot, .. }) = self.night else { return Ok(()) };
        if now.0 < next_pilot.0 {
            return hold(Awaited::Rig, REASON, Some(next_pilot));
        }
        let drift = rig.pilot().map_err(DaemonError::of_rig)?;
        let Some(night) = &mut self.night else { return Ok(()) };
        let (Some(drift), Some(warm_up)) = (drift, &mut night.warm_up) else {
            night.warm_up = None;
            return self.good();
        };
        let warmth = warm_up.add(drift, now.0);
        if warmth == Warmth::Warming {
            night.next_pilot = Moment(now.0 + WARM_UP_STEP_S);
            return hold(Awaited::Rig, REASON, Some(night.next_pilot));
        }
        night.warm_up = None;
        if warmth == Warmth::OutOfTime {
            log::warn!("the rig is not steady after {WARM_UP_MAX_MIN} min");
        }
        self.judge(drift, rig)
    }

    /// Shows the pilot after the last photo, once no photo has been ready for a while.
    fn prove_last_photos(&mut self, rig: &mut dyn Restorer) -> MayRestore {
        let now = self.now();
        let since = *self.lull_since.get_or_insert(now);
        if self.record.unproven.is_empty() || now.0 - since.0 < LULL_S {
            return Ok(());
        }
        // After a reboot the rig is cold, and its drift says nothing about the photos.
        let cold = self.night.as_ref().is_some_and(|night| night.warm_up.is_some());
        if cold { self.warm_up(rig) } else { self.prove(rig) }
    }

    fn may_restore(&mut self, is_ready: bool, rig: &mut dyn Restorer) -> MayRestore {
        if is_ready {
            self.lull_since = None;
        }
        self.continue_withdrawal()?;
        self.hours(rig)?;
        if self.is_cancelled {
            return hold(Awaited::Button, CANCELLED, None);
        }
        if !is_ready {
            return self.prove_last_photos(rig);
        }
        self.warm_up(rig)?;
        let every = self.nights.pilot_every_photos;
        let is_due = |night: &Night| night.drifted || night.photos >= every;
        if self.night.as_ref().is_some_and(is_due) { self.prove(rig) } else { Ok(()) }
    }
}

impl Schedule for Nightly<'_> {
    fn turn(&mut self, asked: Question, rig: &mut dyn Restorer) -> Turn {
        self.may_restore(asked.is_ready, rig).err().unwrap_or(Turn::Go)
    }

    fn notify(&mut self, event: Event<'_>, _: &mut dyn Restorer) {
        match event {
            Event::Pressed => self.is_cancelled = false,
            Event::Ended(JobEnd::Done { delivered, .. }) => {
                self.record.unproven.push(delivered.clone());
                if let Some(night) = &mut self.night {
                    night.photos += 1;
                }
                self.save();
            }
            _ => {}
        }
    }
}
