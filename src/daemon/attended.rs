//! The schedule of a box that somebody stands before: the button says when, lamps and panel say
//! what.
//!
//! Another schedule, the night's or none, is asked after the button.

use std::sync::Arc;

use super::schedule::{Ended, Schedule, Turn};
use super::vigil::Missed;
use super::withdrawal::Delivered;
use super::{DaemonError, ReportedOutcome, Restorer};
use crate::config::Mode;
use crate::kiosk::front::{Front, State};
use crate::kiosk::screen::Screen;
use crate::remedy::{Remedy, full_message};
use crate::rig::{Clock, Moment};

/// How long a result stays on the panel when nothing else happens. Guess: time to walk up and look.
const RESULT_S: f64 = 120.0;

/// A screen is shown again after this long: a panel that was switched off and on has forgotten it.
const SHOW_AGAIN_S: f64 = 60.0;

/// A desk that has not come round for this long hangs, or has ended: it comes round many times a
/// second. Guess.
const STILL_S: f64 = 30.0;

/// What is said of it.
const STILL: &str = "the button and the lamps do not answer: what attends to them hangs or has \
 ended; switch the box off and on";

/// Button, lamps and panel around another schedule.
pub struct Attended<'a> {
    front: Front,
    mode: Mode,
    clock: &'a dyn Clock,
    inner: Box<dyn Schedule + 'a>,
    /// Photos the last press has asked for.
    asked: usize,
    maintenance: Option<String>,
    result: Option<(String, String, Moment)>,
    shown: Option<(Screen, Moment)>,
    /// The desk's rounds when they were last seen to change.
    rounds: Option<(u64, Moment)>,
    desk_is_still: bool,
}

impl<'a> Attended<'a> {
    /// The schedule of a box in `mode`, whose desk is at `front`.
    pub fn new(
        front: Front,
        mode: Mode,
        clock: &'a dyn Clock,
        inner: Box<dyn Schedule + 'a>,
    ) -> Self {
        Attended {
            front,
            mode,
            clock,
            inner,
            asked: 0,
            maintenance: None,
            result: None,
            shown: None,
            rounds: None,
            desk_is_still: false,
        }
    }

    fn show(&mut self, screen: Screen, state: State, rig: &mut dyn Restorer) {
        self.front.set(state);
        let now = self.clock.now();
        let stays =
            |(shown, at): &(Screen, Moment)| *shown == screen && now.0 - at.0 < SHOW_AGAIN_S;
        if !self.shown.as_ref().is_some_and(stays) {
            rig.show(&screen);
            self.shown = Some((screen, now));
        }
    }

    /// Whether the desk still comes round.
    fn watch_desk(&mut self) {
        let Some(rounds) = self.front.rounds() else { return };
        let now = self.clock.now();
        match self.rounds {
            Some((seen, since)) if seen == rounds => self.desk_is_still = now.0 - since.0 > STILL_S,
            _ => {
                self.rounds = Some((rounds, now));
                self.desk_is_still = false;
            }
        }
    }

    /// The screen of a box that waits to be told: that nobody will hear it, if so.
    fn or_still(&self, screen: Screen) -> Screen {
        if !self.desk_is_still {
            return screen;
        }
        let what = "the button and the lamps do not answer".to_owned();
        Screen::Trouble { what, to_do: "Switch the box off and on.".to_owned() }
    }

    /// What the button asked for. Returns whether the box is in maintenance.
    fn answer(&mut self, waiting: usize, rig: &mut dyn Restorer) -> bool {
        if self.front.take_cancelled() {
            self.asked = 0;
        }
        let wishes = self.front.take_wishes();
        if wishes.go {
            self.asked = waiting;
        }
        match wishes.maintenance {
            Some(true) => {
                log::info!("maintenance: the button was held at the start");
                self.maintenance = Some("The box does no work until you say so.".to_owned());
            }
            Some(false) if self.maintenance.take().is_some() => log::info!("maintenance is over"),
            _ => {}
        }
        if wishes.calibrate && self.maintenance.is_some() {
            let words = "The lens is being measured.".to_owned();
            self.show(
                Screen::Maintenance { words: words.clone() },
                State::Working { photo: words },
                rig,
            );
            let outcome = match rig.mend(Remedy::Recalibrate) {
                Ok(()) => "The lens has been measured anew.".to_owned(),
                Err(error) => format!("The lens could not be measured: {}", full_message(&*error)),
            };
            log::info!("maintenance: {outcome}");
            self.maintenance = Some(outcome);
            self.shown = None;
        }
        let Some(words) = self.maintenance.clone() else { return false };
        self.show(Screen::Maintenance { words: words.clone() }, State::Maintenance { words }, rig);
        true
    }

    /// The last result while it is fresh, else nothing.
    fn fresh_result(&mut self, hint: String) -> Option<Screen> {
        let now = self.clock.now();
        self.result.take_if(|(_, _, at)| now.0 - at.0 > RESULT_S);
        let (photo, words, _) = self.result.clone()?;
        Some(Screen::Result { photo, words, hint })
    }

    fn rest(&mut self, reason: &str, waiting: usize, rig: &mut dyn Restorer) {
        let mut words = reason.to_owned();
        if let Some(first) = words.get(..1).map(str::to_uppercase) {
            words.replace_range(..1, &first);
        }
        let (screen, state) = match self.inner.missed() {
            Some(missed) => {
                let state = State::Trouble { reason: missed.to_string() };
                (Screen::Missed { what: missed.what, why: missed.why, photos: waiting }, state)
            }
            None => (
                Screen::Resting { words: words + ".", photos: waiting },
                State::Resting { reason: reason.to_owned() },
            ),
        };
        self.show(screen, state, rig);
    }
}

impl Schedule for Attended<'_> {
    fn before(&mut self, waiting: usize, rig: &mut dyn Restorer) -> Turn {
        self.watch_desk();
        if self.answer(waiting, rig) {
            self.inner.kept_waiting(waiting, "the box is in maintenance");
            return Turn::Hold { reason: "maintenance".to_owned(), until: None };
        }
        if self.mode == Mode::Button && self.asked == 0 {
            let hint = match waiting {
                1 => "1 photo waits: press the button.".to_owned(),
                n => format!("{n} photos wait: press the button."),
            };
            let screen = self.fresh_result(hint).unwrap_or(Screen::Waiting { photos: waiting });
            self.show(self.or_still(screen), State::Waiting { photos: waiting }, rig);
            return Turn::Hold { reason: "photos wait for the button".to_owned(), until: None };
        }
        let turn = self.inner.before(waiting, rig);
        match &turn {
            Turn::Go => self.asked = self.asked.saturating_sub(1),
            Turn::Hold { reason, .. } => self.rest(reason, waiting, rig),
            Turn::Help { .. } | Turn::Again(_) | Turn::Stop => {}
        }
        turn
    }

    fn begun(&mut self, photo: &str, number: usize, of: usize, rig: &mut dyn Restorer) {
        let screen = Screen::Working { photo: photo.to_owned(), number, of };
        self.shown = None;
        self.show(screen, State::Working { photo: photo.to_owned() }, rig);
        self.inner.begun(photo, number, of, rig);
    }

    fn after(&mut self, ended: Ended<'_>, rig: &mut dyn Restorer) {
        // The job's last capture is on the panel.
        self.shown = None;
        if let Ended::Restored { report, .. } = ended {
            let words = match (&report.meaning, report.outcome) {
                (_, ReportedOutcome::Untouched) => {
                    format!("Left as it was: {}", report.rung_reason)
                }
                (Some(meaning), _) => meaning.clone(),
                (None, _) => "Restored; not photographed again.".to_owned(),
            };
            self.result = Some((report.photo.clone(), words, self.clock.now()));
        }
        self.inner.after(ended, rig);
    }

    fn idle(&mut self, waiting: usize, rig: &mut dyn Restorer) -> Turn {
        self.watch_desk();
        if self.answer(waiting, rig) {
            self.inner.kept_waiting(waiting, "the box is in maintenance");
            return Turn::Hold { reason: "maintenance".to_owned(), until: None };
        }
        self.asked = 0;
        let turn = self.inner.idle(waiting, rig);
        if let Turn::Hold { reason, .. } = &turn {
            self.rest(reason, waiting, rig);
            return turn;
        }
        let hint = match self.mode {
            Mode::Button => "Put photos into the inbox, then press the button.",
            Mode::Folder => "Put photos into the inbox.",
        };
        let hint = hint.to_owned();
        let screen = self.fresh_result("The result is in the outbox.".to_owned());
        let screen = self.or_still(screen.unwrap_or(Screen::Ready { hint }));
        self.show(screen, State::Ready, rig);
        turn
    }

    fn held(&mut self, error: &DaemonError, rig: &mut dyn Restorer) {
        self.watch_desk();
        let what = full_message(error);
        let screen = Screen::Trouble { what: what.clone(), to_do: to_do(error).to_owned() };
        self.show(screen, State::Trouble { reason: what }, rig);
        self.inner.held(error, rig);
    }

    fn unproven(&self) -> &[Delivered] {
        self.inner.unproven()
    }

    fn kept_waiting(&mut self, waiting: usize, why: &str) {
        self.inner.kept_waiting(waiting, why);
    }

    fn missed(&self) -> Option<Missed> {
        self.inner.missed()
    }

    fn attention(&self) -> Vec<String> {
        let still = self.desk_is_still.then(|| STILL.to_owned());
        still.into_iter().chain(self.inner.attention()).collect()
    }

    fn impatient(&self) -> bool {
        self.front.wishes_something() || self.inner.impatient()
    }
}

/// What one may do about it, for the panel.
fn to_do(error: &DaemonError) -> &'static str {
    use std::io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem, StorageFull};
    match error {
        DaemonError::Files { source, .. } => match source.kind() {
            StorageFull => {
                "Make room on the disk: take results out of the outbox and originals out of done."
            }
            PermissionDenied | ReadOnlyFilesystem => {
                "Look after the disk: relens may not write to it."
            }
            _ => "Look after the disk or the network share.",
        },
        _ => "Look after camera, panel and their cables. The box tries again every minute.",
    }
}

/// What the restorer's interruption asks: a long press in a job, or a stop of the service.
pub fn interruption(
    front: Front,
    stopped: Arc<std::sync::atomic::AtomicBool>,
) -> crate::pipeline::Interruption {
    Arc::new(move || front.cancelled() || stopped.load(std::sync::atomic::Ordering::Acquire))
}
