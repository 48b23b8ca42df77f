//! Watches over the nights themselves: photos that wait while a whole night passes without one
//! being restored are spoken of, with since when and why. Held, never sure of the time, or switched
//! off: a box that does nothing must not look like one that has nothing to do.

use serde::{Deserialize, Serialize};

use crate::nights::window::Window;
use crate::rig::Moment;

/// Nothing waits any more when nothing has waited for this long: a photo that is being looked at
/// for the first time does not wait yet. Longer than the inbox's quiet time; guess.
const EMPTY_S: f64 = 60.0;

/// The same obstacle is written down again after this long, so that a reboot does not hide how long
/// it lasted. One small write an hour.
const AGAIN_S: f64 = 3600.0;

const DAY_S: f64 = 86_400.0;

/// Photos waited, and a whole night passed without one being restored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missed {
    /// Since when, and what passed: a sentence without its full stop.
    pub what: String,
    /// Why, as far as is known.
    pub why: String,
}

impl std::fmt::Display for Missed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.what, self.why)
    }
}

/// What survives a reboot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Kept {
    /// Since when photos wait, none being restored; `None` when none wait.
    since_unix_s: Option<f64>,
    /// What kept them from being restored, and when that was so last, if the time was known.
    obstacle: Option<(Option<f64>, String)>,
}

/// A look at the clocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Time {
    /// The daemon's own clock.
    pub(super) now: Moment,
    /// The calendar, seconds since 1970 UTC, if it is believed.
    pub(super) unix_s: Option<f64>,
    /// How far it jumped since the look before.
    pub(super) jumped_s: Option<f64>,
}

/// The watch over one box.
#[derive(Debug, Default)]
pub(super) struct Vigil {
    kept: Kept,
    /// Since when photos wait, as far as this process knows.
    waiting_since: Option<Moment>,
    empty_since: Option<Moment>,
    /// The first believed time of this process.
    started_unix_s: Option<f64>,
    /// Whether the look before believed the calendar.
    believed: bool,
    /// Nights that were spoken of.
    nights: usize,
    missed: Option<Missed>,
}

impl Vigil {
    /// The watch goes on where `kept` says.
    pub(super) fn new(kept: Kept) -> Vigil {
        Vigil { kept, ..Vigil::default() }
    }

    /// What must survive a reboot.
    pub(super) fn kept(&self) -> Kept {
        self.kept.clone()
    }

    /// What is to be said.
    pub(super) fn missed(&self) -> Option<&Missed> {
        self.missed.as_ref()
    }

    /// A look: `waiting` photos wait, or nobody knows whether any do. Returns whether what is kept
    /// has changed.
    pub(super) fn look(&mut self, time: Time, waiting: Option<usize>, window: &Window) -> bool {
        let before = self.kept.since_unix_s;
        let moved = |since: Option<f64>| match (before, since) {
            (Some(before), Some(since)) => (since - before).abs() > 60.0,
            (before, since) => before.is_some() != since.is_some(),
        };
        self.follow(time);
        match waiting {
            Some(0) => {
                let since = *self.empty_since.get_or_insert(time.now);
                if time.now.0 - since.0 >= EMPTY_S {
                    let changed = self.kept != Kept::default();
                    self.forget();
                    return changed;
                }
                return false;
            }
            Some(_) => {
                self.empty_since = None;
                self.waiting_since.get_or_insert(time.now);
            }
            None => {}
        }
        if let (Some(unix_s), Some(since)) = (time.unix_s, self.waiting_since) {
            // From before a reboot, or from before the time was known.
            let here = unix_s - (time.now.0 - since.0);
            self.kept.since_unix_s =
                Some(self.kept.since_unix_s.map_or(here, |kept| kept.min(here)));
        }
        if waiting.is_some() || self.waiting_since.is_some() {
            self.judge(time, window);
        }
        moved(self.kept.since_unix_s)
    }

    /// A calendar that jumps takes with it what was dated by it.
    fn follow(&mut self, time: Time) {
        let Some(unix_s) = time.unix_s else {
            self.believed = false;
            return;
        };
        if let Some(jump) = time.jumped_s.filter(|_| self.believed) {
            let dates = [&mut self.kept.since_unix_s, &mut self.started_unix_s];
            let obstacle = self.kept.obstacle.iter_mut().filter_map(|(at, _)| at.as_mut());
            dates.into_iter().flatten().chain(obstacle).for_each(|at| *at += jump);
        }
        self.believed = true;
        self.started_unix_s.get_or_insert(unix_s);
    }

    fn judge(&mut self, time: Time, window: &Window) {
        let known = time.unix_s.zip(self.kept.since_unix_s);
        let (nights, begins) = match (known, self.waiting_since) {
            (Some((unix_s, since)), _) => match window.whole_between(since, unix_s) {
                Some((nights, last)) => (nights, Some(last)),
                None => return,
            },
            // Wherever the hours lie, this long holds all of them.
            (None, Some(since)) => {
                let over_s = time.now.0 - since.0 - window.longest_s();
                ((over_s / DAY_S).max(0.0) as usize, None)
            }
            (None, None) => return,
        };
        if nights <= self.nights {
            return;
        }
        self.nights = nights;
        let what = match (known, begins) {
            (Some((_, since)), Some((_, ends))) => {
                let (since, ends) = (window.on_the_wall(since), window.on_the_wall(ends));
                match nights {
                    1 => format!(
                        "no photo was restored in the night up to {ends}, though photos wait \
                         since {since}"
                    ),
                    n => format!(
                        "no photo was restored in {n} nights, the last up to {ends}, though \
                         photos wait since {since}"
                    ),
                }
            }
            _ => {
                let hours = self.waiting_since.map_or(0.0, |since| (time.now.0 - since.0) / 3600.0);
                format!("no photo was restored for {hours:.0} hours, though photos wait")
            }
        };
        self.missed =
            Some(Missed { what, why: self.why(begins.map(|(begins, _)| begins), window) });
    }

    /// Why the night that began then was missed.
    fn why(&self, begins: Option<f64>, window: &Window) -> String {
        let recent = |at: &Option<f64>| at.zip(begins).is_none_or(|(at, begins)| at >= begins);
        if let Some((_, words)) = self.kept.obstacle.as_ref().filter(|(at, _)| recent(at)) {
            return words.clone();
        }
        match (self.started_unix_s, begins) {
            (Some(started), Some(begins)) if started > begins => {
                format!(
                    "the box was off, or relens did not run, before {}",
                    window.on_the_wall(started)
                )
            }
            _ => "the reason is not known".to_owned(),
        }
    }

    /// Photos that wait are not taken because of `words`. Returns whether what is kept has changed.
    pub(super) fn hindered(&mut self, unix_s: Option<f64>, words: &str) -> bool {
        if self.waiting_since.is_none() && self.kept.since_unix_s.is_none() {
            return false;
        }
        let same = |(at, found): &(Option<f64>, String)| {
            found == words
                && at.is_some() == unix_s.is_some()
                && at.zip(unix_s).is_none_or(|(at, unix_s)| unix_s - at < AGAIN_S)
        };
        let changed = !self.kept.obstacle.as_ref().is_some_and(same);
        if changed {
            self.kept.obstacle = Some((unix_s, words.to_owned()));
        }
        changed
    }

    /// A photo was restored, or set aside with its reason: others that wait do so since now.
    pub(super) fn served(&mut self, time: Time) {
        self.forget();
        self.waiting_since = Some(time.now);
        self.kept.since_unix_s = time.unix_s;
    }

    fn forget(&mut self) {
        let Vigil { started_unix_s, believed, empty_since, .. } = *self;
        *self = Vigil { started_unix_s, believed, empty_since, ..Vigil::default() };
    }
}
