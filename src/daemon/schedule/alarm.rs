//! The missed-night alarm: notices when photos wait through a whole night without one being
//! restored, with the reason. A box that is held, has no trusted time or was switched off must not
//! look idle.
//!
//! Waiting is timed by the monotonic clock, so that a jump of the calendar has no effect on it.

use super::Notice;
use crate::daemon::store::night_record::NightRecord;
use crate::nights::window::Window;
use crate::rig::Moment;

/// The inbox must be empty for this long to end the waiting: a photo just dropped or put back is
/// counted later. Longer than the inbox's quiet time; guess.
const EMPTY_S: f64 = 60.0;

const DAY_S: f64 = 86_400.0;

/// A reading of the clocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Time {
    /// Monotonic clock.
    pub(super) now: Moment,
    /// Calendar, seconds since 1970 UTC, while trusted.
    pub(super) unix_s: Option<f64>,
}

impl Time {
    fn date(self, moment: Moment) -> Option<f64> {
        Some(self.unix_s? - (self.now.0 - moment.0))
    }

    fn moment(self, unix_s: f64) -> Option<Moment> {
        Some(Moment(self.now.0 - (self.unix_s? - unix_s)))
    }
}

/// What keeps photos from being restored.
#[derive(Debug)]
struct Obstacle {
    /// When it was last met.
    at: Moment,
    words: String,
}

/// Photos that waited before the restart.
#[derive(Debug)]
struct BeforeRestart {
    since_unix_s: f64,
    obstacle: String,
    /// When this was recorded.
    at_unix_s: f64,
}

/// The alarm of one box.
#[derive(Debug)]
pub(super) struct Alarm {
    /// Start of this process.
    started: Moment,
    /// Since when photos wait without one being restored.
    since: Option<Moment>,
    empty_since: Option<Moment>,
    obstacle: Option<Obstacle>,
    /// Missed nights notified.
    nights: usize,
    missed: Option<Notice>,
    /// State before the restart, until photos are seen waiting and the calendar is trusted.
    recorded: Option<BeforeRestart>,
}

impl Alarm {
    /// The alarm of a process started `now`, resuming from `record`.
    pub(super) fn new(now: Moment, record: &NightRecord) -> Alarm {
        let recorded = record.waiting_since_unix_s.map(|since_unix_s| BeforeRestart {
            since_unix_s,
            obstacle: record.obstacle.clone(),
            at_unix_s: record.floor_unix_s,
        });
        Alarm { recorded, ..Alarm::quiet(now, None) }
    }

    fn quiet(started: Moment, empty_since: Option<Moment>) -> Alarm {
        let (since, obstacle, nights, missed, recorded) = (None, None, 0, None, None);
        Alarm { started, since, empty_since, obstacle, nights, missed, recorded }
    }

    /// Since when photos wait, seconds since 1970 UTC; `before` while the calendar is not trusted.
    pub(super) fn since_unix_s(&self, time: Time, before: Option<f64>) -> Option<f64> {
        match &self.recorded {
            Some(recorded) => Some(recorded.since_unix_s),
            None => self.since.and_then(|since| time.date(since).or(before)),
        }
    }

    /// The last obstacle; empty without one.
    pub(super) fn obstacle(&self) -> &str {
        match (&self.obstacle, &self.recorded) {
            (Some(obstacle), _) => &obstacle.words,
            (None, Some(recorded)) => &recorded.obstacle,
            (None, None) => "",
        }
    }

    /// The notice of missed nights.
    pub(super) fn missed(&self) -> Option<&Notice> {
        self.missed.as_ref()
    }

    /// Updates the alarm with the number of photos `waiting`, if known.
    pub(super) fn update(&mut self, time: Time, waiting: Option<usize>, window: &Window) {
        match waiting {
            Some(0) => {
                let since = *self.empty_since.get_or_insert(time.now);
                if time.now.0 - since.0 >= EMPTY_S {
                    *self = Alarm::quiet(self.started, self.empty_since);
                }
                return;
            }
            Some(_) => {
                self.empty_since = None;
                self.since.get_or_insert(time.now);
                self.resume(time);
            }
            None => {}
        }
        self.judge(time, window);
    }

    /// Notes the reason why waiting photos are not restored.
    pub(super) fn set_obstacle(&mut self, now: Moment, words: &str) {
        if self.since.is_some() || self.recorded.is_some() {
            self.obstacle = Some(Obstacle { at: now, words: words.to_owned() });
        }
    }

    /// Restarts the waiting time: a photo was restored or rejected.
    pub(super) fn restart(&mut self, now: Moment) {
        *self = Alarm { since: Some(now), ..Alarm::quiet(self.started, None) };
    }

    /// Adds the waiting time before the restart, once the calendar is trusted.
    fn resume(&mut self, time: Time) {
        if time.unix_s.is_none() {
            return;
        }
        let Some(recorded) = self.recorded.take() else { return };
        let since = time.moment(recorded.since_unix_s);
        self.since = [self.since, since].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
        if self.obstacle.is_none() && !recorded.obstacle.is_empty() {
            let at = time.moment(recorded.at_unix_s);
            self.obstacle = at.map(|at| Obstacle { at, words: recorded.obstacle });
        }
    }

    fn judge(&mut self, time: Time, window: &Window) {
        let Some(since) = self.since else { return };
        let waited_s = time.now.0 - since.0;
        let (nights, last) = match time.unix_s {
            Some(unix_s) => match window.whole_between(unix_s - waited_s, unix_s) {
                Some(whole) => (whole.count, Some(whole)),
                None => return,
            },
            // Without a calendar: this long contains whole nights, whenever they are.
            None => (((waited_s - window.longest_s()) / DAY_S).max(0.0) as usize, None),
        };
        if nights <= self.nights {
            return;
        }
        self.nights = nights;
        let since = time.date(since).map(|since| window.local_time(since)).unwrap_or_default();
        let what = match last.as_ref().map(|last| window.local_time(last.ends_unix_s)) {
            Some(ends) if nights == 1 => format!(
                "no photo was restored in the night up to {ends}, though photos wait since {since}"
            ),
            Some(ends) => format!(
                "no photo was restored in {nights} nights, the last up to {ends}, though photos \
                 wait since {since}"
            ),
            None => format!(
                "no photo was restored for {:.0} hours, though photos wait",
                waited_s / 3600.0
            ),
        };
        let begins = last.and_then(|last| time.moment(last.begins_unix_s));
        self.missed = Some(Notice { what, why: self.explain(time, begins, window) });
    }

    /// The reason why the night that began at `begins` was missed.
    fn explain(&self, time: Time, begins: Option<Moment>, window: &Window) -> String {
        let during_night = |at: Moment| begins.is_none_or(|begins| at >= begins);
        if let Some(obstacle) = self.obstacle.as_ref().filter(|obstacle| during_night(obstacle.at))
        {
            return obstacle.words.clone();
        }
        match time.date(self.started) {
            Some(started) if begins.is_some_and(|begins| self.started > begins) => format!(
                "the box was off, or relens did not run, before {}",
                window.local_time(started)
            ),
            _ => "the reason is unknown".to_owned(),
        }
    }
}
