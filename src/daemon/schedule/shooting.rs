//! The schedule of a box that takes its photos itself.
//!
//! ```text
//! aim ─ press ─► take, save to the inbox ─► ask for the panel ─► seen ─► pilot good ─► photos
//!  ▲                  ▲                        │  │  ▲             ▲       │ past a limit
//!  │ postponed, or    └────── short press ─────┘  │  └─── failed ───┴ measure the lens
//!  └ timed out ◄──────────────────────────────────┘
//! ```
//!
//! Before each photo the box counts down; a press or an error cancels the countdown. A photo is
//! saved to the inbox before anything else: from then on it is treated like any other, even after a
//! power cut.

use std::time::SystemTime;

use super::before_box::Front;
use super::{Question, Turn};
use crate::config::Nights;
use crate::daemon::error::DaemonError;
use crate::daemon::store::folders::Folders;
use crate::daemon::store::taken;
use crate::daemon::store::waiting::Awaited;
use crate::kiosk::front_panel::BoxState;
use crate::kiosk::screen::{ASK, Screen};
use crate::nights::trust::unix_s;
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};
use crate::restorer::PanelView;
use crate::restorer::photo_file::TakenPhoto;
use crate::rig::Moment;
use crate::rig::shoot::CLIPPED_SHARE_MAX;

/// Timeout for bringing the panel. Guess.
const ASK_S: f64 = 900.0;

/// Interval between two searches for the panel, which replace its screen by test pictures. Guess.
const SEARCH_S: f64 = 5.0;

/// Interval between two attempts to measure the lens, which take a minute each. Guess.
const MEASURE_AGAIN_S: f64 = 30.0;

/// Calibrations in a row after which the panel counts as unsteady. Guess.
const CALIBRATIONS_MAX: u32 = 2;

/// Attempts at a photo when the camera fails. Guess.
const TRIES_MAX: u32 = 3;

#[derive(Debug, PartialEq)]
enum Stage {
    /// The user aims the camera; waiting photos are postponed.
    Aim,
    /// The panel has been asked for since `since`, in these `words`; the next search is at
    /// `search_at`.
    Ask { since: Moment, search_at: Moment, words: String },
    /// The lens is to be measured because the panel was moved, as `why` describes, after this many
    /// `calibrations` in a row. A stage of its own, so that the page shows it meanwhile.
    Measure { why: String, calibrations: u32 },
    /// The panel is where it was when the lens was measured.
    There,
}

struct Countdown {
    shutter: Moment,
    /// Seconds shown on the panel.
    shown: u32,
}

impl Countdown {
    /// Seconds to go, rounded up.
    fn remaining(&self, now: Moment) -> u32 {
        // A rounding error must not add a second.
        (self.shutter.0 - now.0 - 1e-6).max(0.0).ceil() as u32
    }
}

/// The process of taking and restoring photos.
pub struct Shooting<'a> {
    folders: Folders,
    calendar: &'a dyn Fn() -> SystemTime,
    recalibrate: bool,
    stage: Stage,
    countdown_s: f64,
    countdown: Option<Countdown>,
    /// Whether the button asked for a photo since the last turn.
    go: bool,
    /// Whether the button asked to postpone since the last turn.
    postpone: bool,
    /// A photo taken and not yet saved.
    unsaved: Option<TakenPhoto>,
    /// Number of waiting photos that are postponed.
    postponed_photos: usize,
}

impl<'a> Shooting<'a> {
    /// Takes photos into the inbox of `folders`, `countdown_s` after a press, dated by `calendar`.
    /// `nights` states whether the lens may be measured again.
    pub fn new(
        folders: Folders,
        nights: Option<&Nights>,
        countdown_s: f64,
        calendar: &'a dyn Fn() -> SystemTime,
    ) -> Shooting<'a> {
        Shooting {
            folders,
            calendar,
            recalibrate: nights.is_none_or(|nights| nights.recalibrate),
            stage: Stage::Aim,
            countdown_s,
            countdown: None,
            go: false,
            postpone: false,
            unsaved: None,
            postponed_photos: 0,
        }
    }

    pub(super) fn request(&mut self, go: bool, postpone: bool) {
        self.go |= go;
        self.postpone |= postpone;
    }

    /// Whether the countdown has advanced, or the lens is to be measured.
    pub(super) fn is_due(&self, now: Moment) -> bool {
        match &self.countdown {
            Some(countdown) => countdown.remaining(now) != countdown.shown,
            None => matches!(self.stage, Stage::Measure { .. }),
        }
    }

    /// Resets after an error: the panel may have been moved, and the user may not be aiming.
    pub(super) fn reset(&mut self) {
        self.countdown = None;
        if self.stage == Stage::There {
            self.stage = Stage::Aim;
        }
    }

    /// `Ok(true)` if photos may be restored, `Ok(false)` to postpone them, or what to do instead.
    pub(super) fn turn(
        &mut self,
        asked: Question,
        front: &mut Front<'_, '_>,
    ) -> Result<bool, Turn> {
        self.postponed_photos = self.postponed_photos.min(asked.waiting);
        if std::mem::take(&mut self.postpone) {
            match self.countdown.take() {
                Some(_) => log::info!("the countdown was cancelled"),
                None => self.postpone(asked.waiting),
            }
        }
        if self.take_when_due(front)? {
            let now = front.now();
            self.ask(now, ASK);
            // The photo is counted here, as only the next scan of the inbox finds it.
            let asked = Question { waiting: asked.waiting + 1, ..asked };
            return self.wait(asked, now, front);
        }
        if asked.waiting == 0 {
            self.stage = Stage::Aim;
            return Ok(true);
        }
        self.restore_waiting(asked, front)
    }

    /// Saves a photo taken before, counts down, and takes a photo when the countdown ends. Returns
    /// whether a photo was saved to the inbox.
    fn take_when_due(&mut self, front: &mut Front<'_, '_>) -> Result<bool, Turn> {
        let saved = self.save();
        let is_due = matches!(saved, Ok(false)) && self.count_down(front);
        if let Some(Countdown { shutter, .. }) = self.countdown {
            return Err(Turn::hold(Awaited::Panel, "taking the photo", Some(shutter)));
        }
        if is_due {
            front.show(Screen::Taking, BoxState::Working);
            front.before.forget_screen();
            self.take(front)?;
            return Ok(self.save()?);
        }
        Ok(saved?)
    }

    /// Asks for the panel, measures the lens if necessary, and lets waiting photos be restored.
    fn restore_waiting(
        &mut self,
        asked: Question,
        front: &mut Front<'_, '_>,
    ) -> Result<bool, Turn> {
        let now = front.now();
        match &self.stage {
            Stage::Aim if asked.waiting > self.postponed_photos => self.ask(now, ASK),
            Stage::Ask { since, .. } if now.0 - since.0 > ASK_S => {
                log::info!("the panel was not put before the lens within {ASK_S} s");
                self.postpone(asked.waiting);
            }
            // All photos are deferred; the panel may be moved until they are tried again.
            Stage::There | Stage::Measure { .. } if !asked.is_ready => self.ask(now, ASK),
            _ => {}
        }
        let advanced = match &self.stage {
            Stage::Ask { search_at, .. } if asked.is_ready && now.0 >= search_at.0 => {
                self.search_panel(front)
            }
            Stage::Measure { why, calibrations } => {
                let (why, calibrations) = (why.clone(), calibrations + 1);
                self.measure(why, calibrations, front)
            }
            _ => Ok(()),
        };
        match advanced {
            // A user who cancels the measurement does not want the photos now.
            Err(error) if error.was_asked_for() => {
                log::info!("measuring the lens was cancelled");
                self.postpone(asked.waiting);
            }
            advanced => advanced?,
        }
        match &self.stage {
            Stage::There => Ok(true),
            _ => self.wait(asked, now, front),
        }
    }

    /// Starts or continues the countdown; returns true when it ends.
    fn count_down(&mut self, front: &mut Front<'_, '_>) -> bool {
        let now = front.now();
        if std::mem::take(&mut self.go) && self.countdown.is_none() {
            let shutter = Moment(now.0 + self.countdown_s);
            self.countdown = Some(Countdown { shutter, shown: 0 });
        }
        let Some(countdown) = &mut self.countdown else { return false };
        countdown.shown = countdown.remaining(now);
        if countdown.shown == 0 {
            self.countdown = None;
            return true;
        }
        let screen = Screen::Counting { seconds: countdown.shown };
        front.show(screen, BoxState::Counting);
        false
    }

    fn postpone(&mut self, waiting: usize) {
        (self.stage, self.postponed_photos) = (Stage::Aim, waiting);
    }

    fn ask(&mut self, now: Moment, words: &str) {
        self.stage = Stage::Ask { since: now, search_at: now, words: words.to_owned() };
    }

    fn take(&mut self, front: &mut Front<'_, '_>) -> Result<(), DaemonError> {
        let failed = |failure: AnyFailure| DaemonError::NotTaken { failure };
        let mut tries = 1;
        loop {
            let failure = match front.rig.take() {
                Ok(taken) => {
                    self.unsaved = taken;
                    return Ok(());
                }
                Err(failure) => failure,
            };
            let remedy = failure.remedy();
            if tries == TRIES_MAX || !matches!(remedy, Remedy::ShootAgain | Remedy::ReopenRig) {
                return Err(failed(failure));
            }
            if remedy == Remedy::ReopenRig {
                front.rig.mend(remedy).map_err(failed)?;
            }
            tries += 1;
        }
    }

    /// Saves the taken photo to the inbox; returns false if there is none. It stays in memory after
    /// an error.
    fn save(&mut self) -> Result<bool, DaemonError> {
        let Some(photo) = &self.unsaved else { return Ok(false) };
        let name = taken::keep(&self.folders, photo, unix_s((self.calendar)()) as u64)?;
        if photo.clipped_share > CLIPPED_SHARE_MAX {
            log::warn!("{name}: {:.2} % of it is saturated", 100.0 * photo.clipped_share);
        }
        log::info!("{name}: taken");
        self.unsaved = None;
        Ok(true)
    }

    fn search_panel(&mut self, front: &mut Front<'_, '_>) -> Result<(), DaemonError> {
        // Test pictures replace the screen.
        front.before.forget_screen();
        let seen = match front.rig.look_for_panel() {
            Err(failure) if failure.remedy() == Remedy::ReopenRig => {
                front.rig.mend(Remedy::ReopenRig).map_err(DaemonError::of_rig)?;
                front.rig.look_for_panel()
            }
            seen => seen,
        };
        let words = match seen.map_err(DaemonError::of_rig)? {
            PanelView::Absent => ASK.to_owned(),
            PanelView::Askew(what) => format!("The panel is not well placed: {what}."),
            PanelView::There => {
                let proved = self.prove(0, front);
                return self.ask_on_error(proved, front);
            }
        };
        self.ask_again(SEARCH_S, words, front);
        Ok(())
    }

    /// Shows a pilot, after this many `calibrations` in a row, and sets the stage.
    fn prove(&mut self, calibrations: u32, front: &mut Front<'_, '_>) -> Result<(), DaemonError> {
        let drift = front.rig.pilot().map_err(DaemonError::of_rig)?;
        let Some(complaint) = drift.and_then(|drift| drift.complaint()) else {
            self.stage = Stage::There;
            return Ok(());
        };
        if !self.recalibrate || calibrations == CALIBRATIONS_MAX {
            return Err(DaemonError::Drifted { complaint, calibrations });
        }
        log::info!("the panel was moved: {complaint}; measuring the lens");
        self.stage = Stage::Measure { why: complaint, calibrations };
        Ok(())
    }

    /// Measures the lens and checks the result with a pilot.
    fn measure(
        &mut self,
        complaint: String,
        calibrations: u32,
        front: &mut Front<'_, '_>,
    ) -> Result<(), DaemonError> {
        front.before.forget_screen();
        let measured =
            front.rig.mend(Remedy::Recalibrate).map_err(|failure| DaemonError::Calibration {
                cause: format!("the panel was moved ({complaint}) and"),
                failure,
            });
        let proved = measured.and_then(|()| self.prove(calibrations, front));
        self.ask_on_error(proved, front)
    }

    /// Turns an error of the measurement into a request to the user.
    fn ask_on_error(
        &mut self,
        proved: Result<(), DaemonError>,
        front: &Front<'_, '_>,
    ) -> Result<(), DaemonError> {
        match proved {
            Err(error) if !error.was_asked_for() => {
                log::warn!("{}", full_message(&error));
                let words = format!("{}. {}", full_message(&error), error.what_to_do());
                self.ask_again(MEASURE_AGAIN_S, words, front);
                Ok(())
            }
            proved => proved,
        }
    }

    /// Asks for the panel in these `words`, with the next search after `in_s` seconds.
    fn ask_again(&mut self, in_s: f64, words: String, front: &Front<'_, '_>) {
        let now = front.now();
        let since = match &self.stage {
            Stage::Ask { since, .. } => *since,
            _ => now,
        };
        self.stage = Stage::Ask { since, search_at: Moment(now.0 + in_s), words };
    }

    fn wait(&self, asked: Question, now: Moment, front: &mut Front<'_, '_>) -> Result<bool, Turn> {
        match &self.stage {
            Stage::Aim | Stage::There => Ok(false),
            Stage::Measure { why, .. } => {
                front.show(Screen::Measuring { why: why.clone() }, BoxState::Working);
                let reason = format!(
                    "measuring the lens, because the panel was moved ({why}): leave it where it is"
                );
                Err(Turn::hold(Awaited::Rig, reason, Some(now)))
            }
            Stage::Ask { search_at, words, .. } => {
                let (photos, others) = (asked.waiting, asked.parts.describe_incomplete());
                let screen = Screen::Asking { photos, words: words.clone(), others };
                front.show(screen, BoxState::Asking);
                let reason = format!("the panel is needed: {words}");
                let until = (search_at.0 > now.0).then_some(*search_at);
                Err(Turn::hold(Awaited::Panel, reason, until))
            }
        }
    }
}
