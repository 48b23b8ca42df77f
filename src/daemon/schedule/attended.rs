//! The schedule of a box with button, lamps and panel. It wraps another schedule (the night's or
//! none).

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::before_box::{BeforeBox, Front};
use super::shooting::Shooting;
use super::{Event, Question, Schedule, Turn};
use crate::config::Mode;
use crate::daemon::job::JobEnd;
use crate::daemon::store::report_file::{Report, ResultKind, without_numbers};
use crate::daemon::store::waiting::Awaited;
use crate::kiosk::front_panel::{BoxState, FrontPanel};
use crate::kiosk::screen::{
    AIM, DROP, DROP_AND_PRESS, IDLE, RESULT_IN_OUTBOX, Screen, photos_wait, sentence,
};
use crate::pipeline::Interruption;
use crate::remedy::{Remediable, Remedy, full_message};
use crate::restorer::Restorer;
use crate::rig::{Clock, Moment};

/// Time a result stays on the panel. Guess: time to walk up and read.
const RESULT_S: f64 = 120.0;

/// Time without a round after which the front panel's loop is taken to hang. Guess: it makes many
/// rounds a second.
const STALLED_S: f64 = 30.0;

/// Sentence appended to the instruction shown in trouble.
const TRY_AGAIN: &str = "Press the button to try again at once.";

/// Reason to hold photos because the panel was not put before the lens.
const POSTPONED: &str =
    "the waiting photos will be restored after the next photo: press the button to take one";

/// The last photo, for the panel.
struct LastResult {
    photo: String,
    untouched: bool,
    words: String,
    at: Moment,
}

/// The schedule of a box with button, lamps and panel.
pub struct Attended<'a> {
    before: BeforeBox<'a>,
    mode: Mode,
    /// Set if the box takes photos itself.
    shooting: Option<Shooting<'a>>,
    inner: Box<dyn Schedule + 'a>,
    /// Number of photos that the last press still allows to be restored.
    requested: usize,
    maintenance: Option<String>,
    result: Option<LastResult>,
    /// Outcome of the last photo, and its time.
    ended: Option<(BoxState, Moment)>,
    incomplete: String,
    /// Rounds of the front panel's loop, and the time of their last change.
    rounds: Option<(u64, Moment)>,
}

impl<'a> Attended<'a> {
    /// The schedule of a box in `mode`, with this front panel.
    pub fn new(
        front_panel: FrontPanel,
        mode: Mode,
        clock: &'a dyn Clock,
        inner: Box<dyn Schedule + 'a>,
    ) -> Self {
        Attended {
            before: BeforeBox::new(front_panel, clock),
            mode,
            shooting: None,
            inner,
            requested: 0,
            maintenance: None,
            result: None,
            ended: None,
            incomplete: String::new(),
            rounds: None,
        }
    }

    /// Lets the box take photos.
    #[must_use]
    pub fn shooting(self, shooting: Shooting<'a>) -> Self {
        Attended { shooting: Some(shooting), ..self }
    }

    /// Whether the front panel's loop hangs or has ended.
    fn is_stalled(&mut self) -> bool {
        let (rounds, now) = (self.before.front_panel.rounds(), self.before.clock.now());
        if rounds != self.rounds.map(|(seen, _)| seen) {
            self.rounds = rounds.map(|rounds| (rounds, now));
        }
        self.rounds.is_some_and(|(_, since)| now.0 - since.0 > STALLED_S)
    }

    /// Serves the requests of the button; returns a turn if the box is in maintenance.
    fn serve_requests(&mut self, waiting: usize, rig: &mut dyn Restorer) -> Option<Turn> {
        let requests = self.before.front_panel.take_requests();
        let cancelled = self.before.front_panel.take_cancelled();
        if cancelled {
            self.requested = 0;
        }
        let pressed = requests.go || requests.again;
        if pressed {
            self.inner.notify(Event::Pressed, rig);
        }
        match &mut self.shooting {
            Some(shooting) => shooting.request(requests.go, requests.postpone || cancelled),
            None if pressed => self.requested = waiting,
            None => {}
        }
        match requests.maintenance {
            Some(true) => {
                log::info!("maintenance: the button was held at the start");
                self.maintenance = Some(IDLE.to_owned());
            }
            Some(false) if self.maintenance.take().is_some() => log::info!("maintenance is over"),
            _ => {}
        }
        if requests.calibrate && self.maintenance.is_some() {
            let words = "The lens is being measured.".to_owned();
            self.before.show(Screen::Maintenance { words }, BoxState::Working, rig);
            let outcome = match rig.mend(Remedy::Recalibrate) {
                Ok(()) => "The lens has been measured.".to_owned(),
                Err(end) if end.was_asked_for() => {
                    "Measuring the lens was cancelled: the previous measurement stays.".to_owned()
                }
                Err(error) => format!("The lens could not be measured: {}", full_message(&*error)),
            };
            log::info!("maintenance: {outcome}");
            self.maintenance = Some(outcome);
            self.before.forget_screen();
        }
        let words = self.maintenance.clone()?;
        self.before.show(Screen::Maintenance { words }, BoxState::Maintenance, rig);
        Some(Turn::hold(Awaited::Rig, "maintenance", None))
    }

    /// Screen of the last result while that is recent, else `other`.
    fn recent_result(&mut self, hint: &str, other: Screen) -> Screen {
        let now = self.before.clock.now();
        self.result.take_if(|result| now.0 - result.at.0 > RESULT_S);
        let Some(LastResult { photo, untouched, words, .. }) = &self.result else { return other };
        let (photo, words, hint) = (photo.clone(), words.clone(), hint.to_owned());
        Screen::Result { photo, untouched: *untouched, words, hint }
    }

    fn rest(&mut self, reason: &str, awaited: Awaited, waiting: usize, rig: &mut dyn Restorer) {
        let (words, others) = (reason.to_owned(), self.incomplete.clone());
        let screen = Screen::Resting { words, photos: waiting, others };
        // The lamps must ask for the button if photos wait for it.
        let is_button = awaited == Awaited::Button;
        self.before.show(
            screen,
            if is_button { BoxState::Waiting } else { BoxState::Resting },
            rig,
        );
    }

    fn wait_for_button(&mut self, photos: usize, rig: &mut dyn Restorer) -> Turn {
        let hint = format!("{}: press the button.", photos_wait(photos));
        let others = self.incomplete.clone();
        let screen = self.recent_result(&hint, Screen::Waiting { photos, others });
        self.before.show(screen, BoxState::Waiting, rig);
        Turn::hold(Awaited::Button, "press the button to restore the photos", None)
    }

    /// Shows that the box is idle; `postponed` photos wait for the panel.
    fn be_ready(&mut self, postponed: usize, rig: &mut dyn Restorer) {
        let (hint, after) = match self.mode {
            Mode::Button => (DROP_AND_PRESS, RESULT_IN_OUTBOX),
            Mode::Folder => (DROP, RESULT_IN_OUTBOX),
            Mode::Shoot => (AIM, AIM),
        };
        let hint = match postponed {
            0 => hint.to_owned(),
            n => format!("{hint} {} for the panel.", photos_wait(n)),
        };
        let hint = format!("{hint} {}", self.incomplete).trim_end().to_owned();
        let screen = self.recent_result(after, Screen::Ready { hint });
        let state = match self.ended {
            _ if postponed > 0 => BoxState::Waiting,
            // The user who took the photo is there to see how it ended.
            Some((ended, at)) if self.is_recent(at) && self.mode == Mode::Shoot => ended,
            _ => BoxState::Ready,
        };
        self.before.show(screen, state, rig);
    }

    fn is_recent(&self, at: Moment) -> bool {
        self.before.clock.now().0 - at.0 <= RESULT_S
    }

    fn remember(&mut self, report: &Report) {
        let untouched = report.outcome == ResultKind::Untouched;
        let words = match &report.meaning {
            _ if untouched => sentence(without_numbers(&report.reason)),
            Some(meaning) => meaning.clone(),
            None => "Restored; not photographed again.".to_owned(),
        };
        let (photo, at) = (report.photo.clone(), self.before.clock.now());
        self.result = Some(LastResult { photo, untouched, words, at });
    }
}

impl Schedule for Attended<'_> {
    fn turn(&mut self, asked: Question, rig: &mut dyn Restorer) -> Turn {
        let Question { waiting, is_ready, parts } = asked;
        self.incomplete = parts.describe_incomplete();
        if self.is_stalled() {
            log::error!("the button and the lamps do not respond: relens ends, to be restarted");
            return Turn::Stop;
        }
        if let Some(turn) = self.serve_requests(waiting, rig) {
            return turn;
        }
        if let Some(shooting) = &mut self.shooting {
            match shooting.turn(asked, &mut Front { before: &mut self.before, rig }) {
                Ok(true) => {}
                Ok(false) => {
                    self.be_ready(waiting, rig);
                    // A user who puts the panel before the lens now cannot read it: the status says
                    // what to do.
                    return Turn::hold(Awaited::Panel, POSTPONED, None);
                }
                Err(turn) => return turn,
            }
        }
        if !is_ready {
            self.requested = 0;
        } else if self.mode == Mode::Button && self.requested == 0 {
            return self.wait_for_button(waiting, rig);
        }
        let turn = self.inner.turn(asked, rig);
        match &turn {
            Turn::Hold { reason, awaited, .. } => self.rest(reason, *awaited, waiting, rig),
            Turn::Go if is_ready => self.requested = self.requested.saturating_sub(1),
            Turn::Go => self.be_ready(0, rig),
            Turn::Help(_) | Turn::Again(_) | Turn::Stop => {}
        }
        turn
    }

    fn notify(&mut self, event: Event<'_>, rig: &mut dyn Restorer) {
        match event {
            Event::Begun { photo, number, of } => {
                self.before.forget_screen();
                let screen = Screen::Working { photo: photo.to_owned(), number, of };
                self.before.show(screen, BoxState::Working, rig);
            }
            Event::Ended(end) => {
                // The job's last capture has replaced the screen.
                self.before.forget_screen();
                let state = match end {
                    JobEnd::Done { report, .. } => {
                        self.remember(report);
                        match report.outcome {
                            ResultKind::Restored => Some(BoxState::Done),
                            ResultKind::Untouched => Some(BoxState::Refused),
                        }
                    }
                    JobEnd::Failed(_) => Some(BoxState::Refused),
                    JobEnd::Deferred { .. } | JobEnd::Gone => None,
                };
                self.ended = state.map(|state| (state, self.before.clock.now()));
            }
            Event::Held(error) => {
                if let Some(shooting) = &mut self.shooting {
                    shooting.reset();
                }
                let (what, to_do) = (full_message(error), error.what_to_do());
                let to_do = format!("{to_do} {TRY_AGAIN}");
                self.before.show(Screen::Trouble { what, to_do }, BoxState::Trouble, rig);
            }
            Event::Pressed => {}
        }
        self.inner.notify(event, rig);
    }

    fn impatient(&self) -> bool {
        let now = self.before.clock.now();
        let counts = self.shooting.as_ref().is_some_and(|shooting| shooting.is_due(now));
        counts || self.before.front_panel.has_requests() || self.inner.impatient()
    }
}

/// Interruption of the restorer by a long press during a job, or by a stop of the service.
pub fn interruption(front_panel: FrontPanel, stopped: Arc<AtomicBool>) -> Interruption {
    Arc::new(move || front_panel.cancelled() || stopped.load(Ordering::Acquire))
}
