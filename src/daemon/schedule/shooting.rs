//! The journey of a box that takes its photos itself.
//!
//! ```text
//! aim ─ press ─► take, keep in the inbox ─► ask for the panel ─► seen ─► pilot good ─► photos
//!  ▲                  ▲                        │  │  ▲             ▲       │ past a limit
//!  │ put off, or      └────── short press ─────┘  │  └ not measured ┴ measure anew
//!  └ nobody came ◄────────────────────────────────┘
//! ```
//!
//! Before each photo the box counts down; a press meanwhile, or trouble, and it is not taken.
//! What was taken is in the inbox before anything else is asked for: from there on it is a photo
//! like any other, also after a power cut.

use std::time::{SystemTime, UNIX_EPOCH};

use super::before_box::BeforeBox;
use super::{Question, Turn};
use crate::config::Nights;
use crate::daemon::error::DaemonError;
use crate::daemon::store::folders::Folders;
use crate::daemon::store::taken;
use crate::daemon::store::waiting::{Awaited, Waiting};
use crate::kiosk::front_panel::BoxState;
use crate::kiosk::screen::Screen;
use crate::nights::pilot::DriftLimits;
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};
use crate::restorer::photo_file::TakenPhoto;
use crate::restorer::{PanelView, Restorer};
use crate::rig::Moment;
use crate::rig::shoot::CLIPPED_SHARE_MAX;

/// Who is asked for the panel and does not bring it in this time is not coming. Guess.
const ASK_S: f64 = 900.0;

/// Between two looks for the panel: they show test pictures in place of what it says. Guess.
const LOOK_S: f64 = 5.0;

/// The same where the lens could not be measured, which takes a minute each time. Guess.
const MEASURE_AGAIN_S: f64 = 30.0;

/// Calibrations in a row after which the panel does not hold still. Guess.
const CALIBRATIONS_MAX: u32 = 2;

/// Times a photo is begun again when the camera stumbles. Guess.
const TRIES_MAX: u32 = 3;

/// What is asked for at first.
const ASK: &str = "The photo is kept. Put this panel before the lens, or the camera into its dock.";

/// Where the journey is.
#[derive(Debug, PartialEq)]
enum Stage {
    /// Photos that wait were put off.
    Aim,
    /// Since when, when to look next, and what to say.
    Ask { since: Moment, look_at: Moment, words: String },
    /// The panel stands otherwise than it did, by what `why` says, and still does after so many
    /// calibrations: the lens is to be measured. A stage of its own, so that whoever does not see
    /// the panel reads it on the page meanwhile.
    Measure { why: String, calibrations: u32 },
    /// The panel is before the lens, as it was when the lens was measured.
    There,
}

/// A photo is about to be taken.
struct Countdown {
    shutter: Moment,
    /// The seconds that are on the panel.
    shown: u32,
}

impl Countdown {
    /// Whole seconds left, begun ones too.
    fn left(&self, now: Moment) -> u32 {
        // What rounding adds is not a second.
        (self.shutter.0 - now.0 - 1e-6).max(0.0).ceil() as u32
    }
}

/// What may happen next.
pub(super) enum ShootTurn {
    /// Photos may be taken from the inbox, as far as this is asked.
    Photos,
    /// Those that wait do so for a later press.
    Aim,
    /// Something else.
    Other(Turn),
}

/// The journey.
pub(super) struct Shooting<'a> {
    folders: Folders,
    calendar: &'a dyn Fn() -> SystemTime,
    limits: DriftLimits,
    recalibrate: bool,
    stage: Stage,
    countdown_s: f64,
    countdown: Option<Countdown>,
    /// The button asked for a photo, or for no waiting, since the last turn.
    go: bool,
    put_off: bool,
    /// Taken, and not yet on the disk.
    unkept: Option<TakenPhoto>,
    /// How many of the photos that wait were put off.
    waiting_put_off: usize,
}

impl<'a> Shooting<'a> {
    pub(super) fn new(
        folders: Folders,
        nights: Option<&Nights>,
        countdown_s: f64,
        calendar: &'a dyn Fn() -> SystemTime,
    ) -> Shooting<'a> {
        Shooting {
            folders,
            calendar,
            limits: nights.map_or_else(DriftLimits::default, DriftLimits::of),
            recalibrate: nights.is_none_or(|nights| nights.recalibrate),
            stage: Stage::Aim,
            countdown_s,
            countdown: None,
            go: false,
            put_off: false,
            unkept: None,
            waiting_put_off: 0,
        }
    }

    /// What the button asked for.
    pub(super) fn heard(&mut self, go: bool, put_off: bool) {
        self.go |= go;
        self.put_off |= put_off;
    }

    /// Whether what is counted down differs from what was said of it, or the lens is to be
    /// measured, which has been said.
    pub(super) fn is_due(&self, now: Moment) -> bool {
        match &self.countdown {
            Some(countdown) => countdown.left(now) != countdown.shown,
            None => matches!(self.stage, Stage::Measure { .. }),
        }
    }

    /// Somebody was needed: the panel may be elsewhere by now, and whoever pressed is not aiming.
    pub(super) fn held(&mut self) {
        self.countdown = None;
        if self.stage == Stage::There {
            self.stage = Stage::Aim;
        }
    }

    /// What is next, with so many photos in the inbox.
    pub(super) fn turn(
        &mut self,
        asked: Question,
        before: &mut BeforeBox<'_>,
        rig: &mut dyn Restorer,
    ) -> ShootTurn {
        self.waiting_put_off = self.waiting_put_off.min(asked.waiting);
        if std::mem::take(&mut self.put_off) {
            match self.countdown.take() {
                Some(_) => log::info!("the photo was taken back before it was taken"),
                None => self.give_way(asked.waiting),
            }
        }
        let kept = if self.unkept.is_some() { self.keep() } else { Ok(false) };
        let is_time = matches!(kept, Ok(false)) && self.count_down(before, rig);
        if let Some(Countdown { shutter, .. }) = self.countdown {
            let reason = "a photo is about to be taken".to_owned();
            let awaited = Awaited::Panel;
            return ShootTurn::Other(Turn::Hold { reason, awaited, until: Some(shutter) });
        }
        let kept = match kept {
            Ok(false) if is_time => {
                before.show(Screen::Taking, BoxState::Working, rig);
                before.forget_screen();
                self.take(rig).and_then(|()| self.keep())
            }
            kept => kept,
        };
        let now = before.clock.now();
        match kept {
            Err(error) => return ShootTurn::Other(Turn::Help(error)),
            Ok(true) => {
                self.ask(now, ASK);
                // It is seen at the next look at the inbox.
                return self.wait((asked.waiting + 1, asked.parts), now, before, rig);
            }
            Ok(false) => {}
        }
        if asked.waiting == 0 {
            self.stage = Stage::Aim;
            return ShootTurn::Photos;
        }
        match &self.stage {
            Stage::Aim if asked.waiting > self.waiting_put_off => self.ask(now, ASK),
            Stage::Ask { since, .. } if now.0 - since.0 > ASK_S => {
                log::info!("nobody put the panel before the lens within {ASK_S} s");
                self.give_way(asked.waiting);
            }
            // What is left rests; until then the panel may go.
            Stage::There | Stage::Measure { .. } if !asked.is_ready => self.ask(now, ASK),
            _ => {}
        }
        let went_on = match &self.stage {
            Stage::Ask { look_at, .. } if asked.is_ready && now.0 >= look_at.0 => {
                self.look(before, rig)
            }
            Stage::Measure { why, calibrations } => {
                let (why, calibrations) = (why.clone(), calibrations + 1);
                self.measure(why, calibrations, before, rig)
            }
            _ => Ok(()),
        };
        match went_on {
            // Whoever gave the measuring up does not want the photos now.
            Err(error) if error.was_asked_for() => {
                log::info!("measuring the lens was given up");
                self.give_way(asked.waiting);
            }
            Err(error) => return ShootTurn::Other(Turn::Help(error)),
            Ok(()) => {}
        }
        match &self.stage {
            Stage::There => ShootTurn::Photos,
            _ => self.wait((asked.waiting, asked.parts), now, before, rig),
        }
    }

    /// Counts down from a press; true when the photo is to be taken.
    fn count_down(&mut self, before: &mut BeforeBox<'_>, rig: &mut dyn Restorer) -> bool {
        let now = before.clock.now();
        if std::mem::take(&mut self.go) && self.countdown.is_none() {
            let shutter = Moment(now.0 + self.countdown_s);
            self.countdown = Some(Countdown { shutter, shown: 0 });
        }
        let Some(countdown) = &mut self.countdown else { return false };
        countdown.shown = countdown.left(now);
        if countdown.shown == 0 {
            self.countdown = None;
            return true;
        }
        let screen = Screen::Counting { seconds: countdown.shown };
        before.show(screen, BoxState::Counting, rig);
        false
    }

    /// The photos that wait are not asked for again.
    fn give_way(&mut self, waiting: usize) {
        (self.stage, self.waiting_put_off) = (Stage::Aim, waiting);
    }

    fn ask(&mut self, now: Moment, words: &str) {
        self.stage = Stage::Ask { since: now, look_at: now, words: words.to_owned() };
    }

    /// Takes a photo; where that fails there is none.
    fn take(&mut self, rig: &mut dyn Restorer) -> Result<(), DaemonError> {
        let failed = |failure: AnyFailure| DaemonError::Rig {
            about: "no photo was taken: ".to_owned(),
            failure,
        };
        let mut tries = 1;
        loop {
            let failure = match rig.take() {
                Ok(taken) => {
                    self.unkept = taken;
                    return Ok(());
                }
                Err(failure) => failure,
            };
            let remedy = failure.remedy();
            if tries == TRIES_MAX || !matches!(remedy, Remedy::ShootAgain | Remedy::ReopenRig) {
                return Err(failed(failure));
            }
            if remedy == Remedy::ReopenRig {
                rig.mend(remedy).map_err(failed)?;
            }
            tries += 1;
        }
    }

    /// Puts what was taken into the inbox; false when there is nothing. It is kept in mind until
    /// that is done.
    fn keep(&mut self) -> Result<bool, DaemonError> {
        let Some(photo) = &self.unkept else { return Ok(false) };
        let unix_s =
            (self.calendar)().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let name = taken::keep(&self.folders, photo, unix_s)?;
        if photo.clipped_share > CLIPPED_SHARE_MAX {
            log::warn!("{name}: {:.2} % of it is full", 100.0 * photo.clipped_share);
        }
        log::info!("{name}: taken");
        self.unkept = None;
        Ok(true)
    }

    /// Looks for the panel, and whether it stands as it did.
    fn look(
        &mut self,
        before: &mut BeforeBox<'_>,
        rig: &mut dyn Restorer,
    ) -> Result<(), DaemonError> {
        // Test pictures are on the panel from here on.
        before.forget_screen();
        let seen = match rig.look_for_panel() {
            Err(failure) if failure.remedy() == Remedy::ReopenRig => {
                rig.mend(Remedy::ReopenRig).map_err(of_rig)?;
                rig.look_for_panel()
            }
            seen => seen,
        };
        let said = match seen.map_err(of_rig)? {
            PanelView::Absent => ASK.to_owned(),
            PanelView::Askew(what) => format!("The panel is seen, but not well: {what}."),
            PanelView::There => {
                let proved = self.prove(0, rig);
                return self.or_ask(proved, before);
            }
        };
        self.look_again(LOOK_S, said, before);
        Ok(())
    }

    /// The pilot, after so many calibrations, and what follows from it.
    fn prove(&mut self, calibrations: u32, rig: &mut dyn Restorer) -> Result<(), DaemonError> {
        let drift = rig.pilot().map_err(of_rig)?;
        let Some(complaint) = drift.and_then(|drift| drift.complaint(&self.limits)) else {
            self.stage = Stage::There;
            return Ok(());
        };
        if !self.recalibrate || calibrations == CALIBRATIONS_MAX {
            return Err(DaemonError::Drifted { complaint, calibrations });
        }
        log::info!("the panel stands otherwise than it did: {complaint}; the lens is measured");
        self.stage = Stage::Measure { why: complaint, calibrations };
        Ok(())
    }

    /// Measures the lens, which takes a while, and looks whether that was enough.
    fn measure(
        &mut self,
        complaint: String,
        calibrations: u32,
        before: &mut BeforeBox<'_>,
        rig: &mut dyn Restorer,
    ) -> Result<(), DaemonError> {
        before.forget_screen();
        let measured = rig.mend(Remedy::Recalibrate).map_err(|failure| {
            let why = format!("the panel stands otherwise than it did ({complaint}) and ");
            DaemonError::Calibration { why, failure }
        });
        let proved = measured.and_then(|()| self.prove(calibrations, rig));
        self.or_ask(proved, before)
    }

    /// What keeps the lens from being measured is asked for with the panel.
    fn or_ask(
        &mut self,
        proved: Result<(), DaemonError>,
        before: &BeforeBox<'_>,
    ) -> Result<(), DaemonError> {
        match proved {
            Err(error) if !error.was_asked_for() => {
                log::warn!("{}", full_message(&error));
                let said = format!("{}. {}", full_message(&error), error.what_to_do());
                self.look_again(MEASURE_AGAIN_S, said, before);
                Ok(())
            }
            proved => proved,
        }
    }

    /// The panel is asked for in these words, and looked for after so many seconds.
    fn look_again(&mut self, in_s: f64, said: String, before: &BeforeBox<'_>) {
        let now = before.clock.now();
        let since = match &self.stage {
            Stage::Ask { since, .. } => *since,
            _ => now,
        };
        self.stage = Stage::Ask { since, look_at: Moment(now.0 + in_s), words: said };
    }

    /// Asks for the panel, or says that the lens is measured.
    fn wait(
        &self,
        (photos, parts): (usize, Waiting),
        now: Moment,
        before: &mut BeforeBox<'_>,
        rig: &mut dyn Restorer,
    ) -> ShootTurn {
        match &self.stage {
            Stage::Aim | Stage::There => ShootTurn::Aim,
            Stage::Measure { why, .. } => {
                before.show(Screen::Measuring { why: why.clone() }, BoxState::Working, rig);
                let reason = format!(
                    "the lens is being measured, for the panel stands otherwise than it did \
                     ({why}): leave it where it is"
                );
                ShootTurn::Other(Turn::Hold { reason, awaited: Awaited::Rig, until: Some(now) })
            }
            Stage::Ask { look_at, words, .. } => {
                let screen =
                    Screen::Asking { photos, words: words.clone(), others: parts.beside() };
                before.show(screen, BoxState::Asking, rig);
                let reason = format!("photos wait for the panel: {words}");
                let until = (look_at.0 > now.0).then_some(*look_at);
                ShootTurn::Other(Turn::Hold { reason, awaited: Awaited::Panel, until })
            }
        }
    }
}

fn of_rig(failure: AnyFailure) -> DaemonError {
    DaemonError::Rig { about: String::new(), failure }
}
