//! The missed-night alarm: photos that wait while a whole night passes without one being restored
//! are spoken of, with since when and why. A box that is held, never sure of the time, or switched
//! off must not look like one that has nothing to do.
//!
//! Everything is dated by the daemon's own clock, which only goes forward; a calendar that jumps
//! changes nothing about how long photos wait.

use super::Notice;
use crate::daemon::store::night_record::WaitingRecord;
use crate::nights::window::Window;
use crate::rig::Moment;

/// An inbox must be empty for this long before waiting is over: a photo that was just dropped or
/// put back is counted a moment later. Longer than the inbox's quiet time; guess.
const EMPTY_S: f64 = 60.0;

const DAY_S: f64 = 86_400.0;

/// A look at the clocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Time {
    /// The daemon's own clock.
    pub(super) now: Moment,
    /// The calendar, seconds since 1970 UTC, if it is believed.
    pub(super) unix_s: Option<f64>,
}

impl Time {
    /// What the calendar said, or will say, at `moment`.
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
    /// When that was so last; `None` for one from a time that is not known.
    at: Option<Moment>,
    words: String,
}

/// The alarm of one box.
#[derive(Debug)]
pub(super) struct Alarm {
    /// When this process began.
    started: Moment,
    /// Since when photos wait, none being restored.
    since: Option<Moment>,
    empty_since: Option<Moment>,
    obstacle: Option<Obstacle>,
    /// Nights that were spoken of.
    nights: usize,
    missed: Option<Notice>,
    /// What was written down before this process, until photos are seen to wait still and the
    /// calendar is believed.
    before: Option<WaitingRecord>,
}

impl Alarm {
    /// The alarm of a process that begins now, and goes on where the record `before` says.
    pub(super) fn new(now: Moment, before: WaitingRecord) -> Alarm {
        let before = before.since_unix_s.is_some().then_some(before);
        Alarm { before, ..Alarm::quiet(now, None) }
    }

    fn quiet(started: Moment, empty_since: Option<Moment>) -> Alarm {
        let (since, obstacle, nights, missed, before) = (None, None, 0, None, None);
        Alarm { started, since, empty_since, obstacle, nights, missed, before }
    }

    /// What must survive a reboot; `written` is what was written down last.
    pub(super) fn record(&self, time: Time, written: &WaitingRecord) -> WaitingRecord {
        let since = self.since.and_then(|since| time.date(since));
        let known = written.since_unix_s.filter(|_| self.since.is_some() || self.before.is_some());
        let since_unix_s = since.filter(|_| self.before.is_none()).or(known);
        let obstacle = match (&self.obstacle, &self.before) {
            (Some(Obstacle { at, words }), _) => {
                Some((at.and_then(|at| time.date(at)), words.clone()))
            }
            (None, before) => before.as_ref().and_then(|before| before.obstacle.clone()),
        };
        WaitingRecord { since_unix_s, obstacle }
    }

    /// What is to be said.
    pub(super) fn missed(&self) -> Option<&Notice> {
        self.missed.as_ref()
    }

    /// A look: `waiting` photos wait, or nobody knows whether any do.
    pub(super) fn look(&mut self, time: Time, waiting: Option<usize>, window: &Window) {
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
                self.go_on(time);
            }
            None => {}
        }
        self.judge(time, window);
    }

    /// Photos that wait are not taken because of `words`.
    pub(super) fn hindered(&mut self, now: Moment, words: &str) {
        if self.since.is_some() || self.before.is_some() {
            self.obstacle = Some(Obstacle { at: Some(now), words: words.to_owned() });
        }
    }

    /// A photo was restored, or set aside with its reason: others that wait do so since now.
    pub(super) fn served(&mut self, now: Moment) {
        *self = Alarm { since: Some(now), ..Alarm::quiet(self.started, None) };
    }

    /// Photos wait still: what was written down about them before this process counts on.
    fn go_on(&mut self, time: Time) {
        let Some(before) = self.before.take_if(|_| time.unix_s.is_some()) else { return };
        let since = before.since_unix_s.and_then(|at| time.moment(at));
        self.since = [self.since, since].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
        self.obstacle = self.obstacle.take().or_else(|| {
            let (at, words) = before.obstacle?;
            Some(Obstacle { at: at.and_then(|at| time.moment(at)), words })
        });
    }

    fn judge(&mut self, time: Time, window: &Window) {
        let Some(since) = self.since else { return };
        let waited_s = time.now.0 - since.0;
        // Without a calendar: wherever the hours lie, this long holds all of them.
        let unknown = ((waited_s - window.longest_s()) / DAY_S).max(0.0) as usize;
        let whole = time.unix_s.map(|unix_s| window.whole_between(unix_s - waited_s, unix_s));
        let (nights, last) = match whole {
            Some(Some((nights, last))) => (nights, Some(last)),
            Some(None) => return,
            None => (unknown, None),
        };
        if nights <= self.nights {
            return;
        }
        self.nights = nights;
        let since = time.date(since).map(|since| window.on_the_wall(since)).unwrap_or_default();
        let what = match last.map(|(_, ends)| window.on_the_wall(ends)) {
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
        let begins = last.and_then(|(begins, _)| time.moment(begins));
        self.missed = Some(Notice { what, why: self.why(time, begins, window) });
    }

    /// Why the night that began then was missed.
    fn why(&self, time: Time, begins: Option<Moment>, window: &Window) -> String {
        let recent = |at: Option<Moment>| at.zip(begins).is_none_or(|(at, begins)| at >= begins);
        if let Some(obstacle) = self.obstacle.as_ref().filter(|obstacle| recent(obstacle.at)) {
            return obstacle.words.clone();
        }
        match time.date(self.started) {
            Some(started) if begins.is_some_and(|begins| self.started > begins) => format!(
                "the box was off, or relens did not run, before {}",
                window.on_the_wall(started)
            ),
            _ => "the reason is not known".to_owned(),
        }
    }
}
