//! The schedule of a box that somebody stands before: the button says when, lamps and panel say
//! what.
//!
//! Another schedule, the night's or none, is asked after the button.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

use super::before_box::BeforeBox;
use super::shooting::{ShootTurn, Shooting};
use super::{Event, Notice, Question, Schedule, Turn};
use crate::config::{Mode, Nights};
use crate::daemon::job::JobEnd;
use crate::daemon::store::folders::Folders;
use crate::daemon::store::report_file::{Delivered, Report, ResultKind, plain};
use crate::daemon::store::waiting::Awaited;
use crate::kiosk::front_panel::{BoxState, FrontPanel};
use crate::kiosk::screen::{Screen, sentence};
use crate::pipeline::Interruption;
use crate::remedy::{Remediable, Remedy, full_message};
use crate::restorer::Restorer;
use crate::rig::{Clock, Moment};

/// How long a result stays on the panel when nothing else happens. Guess: time to walk up and look.
const RESULT_S: f64 = 120.0;

/// A front panel whose loop has not come round for this long hangs, or has ended: it comes round
/// many times a second. Guess.
const STILL_S: f64 = 30.0;

/// What to do after a result, where photos are dropped …
const RESULT_HINT: &str = "The result is in the outbox.";

/// … and where they are taken.
const AIM: &str = "Aim at what you want to keep, then press the button.";

/// What ends a trouble.
const AGAIN: &str = "A press of the button tries again at once.";

/// What is said of it.
const STILL: &str = "the button and the lamps do not answer";

/// The photo done last, for the panel.
struct Shown {
    photo: String,
    /// The photo itself is the result.
    untouched: bool,
    words: String,
    at: Moment,
}

/// Button, lamps and panel around another schedule.
pub struct Attended<'a> {
    before: BeforeBox<'a>,
    mode: Mode,
    /// Of a box that takes photos.
    shooting: Option<Shooting<'a>>,
    inner: Box<dyn Schedule + 'a>,
    /// Photos the last press has asked for.
    asked_for: usize,
    maintenance: Option<String>,
    result: Option<Shown>,
    /// How the last photo ended, and when.
    ended: Option<(BoxState, Moment)>,
    /// Photos that cannot be taken yet, in words.
    beside: String,
    /// The rounds of the front panel's loop when they were last seen to change.
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
            asked_for: 0,
            maintenance: None,
            result: None,
            ended: None,
            beside: String::new(),
            rounds: None,
        }
    }

    /// The same schedule of a box that takes photos into the inbox of `folders`, each so many
    /// seconds after a press, dated by `calendar`. What a rig may drift by, and whether it may be
    /// measured anew, is said by `nights` if the box has any.
    #[must_use]
    pub fn shooting(
        mut self,
        folders: &Folders,
        nights: Option<&Nights>,
        countdown_s: f64,
        calendar: &'a dyn Fn() -> SystemTime,
    ) -> Self {
        self.shooting = Some(Shooting::new(folders.clone(), nights, countdown_s, calendar));
        self
    }

    fn show(&mut self, screen: Screen, state: BoxState, rig: &mut dyn Restorer) {
        self.before.show(screen, state, rig);
    }

    /// Sees whether the front panel's loop still comes round.
    fn watch_front_panel(&mut self) {
        let rounds = self.before.front_panel.rounds();
        if rounds != self.rounds.map(|(seen, _)| seen) {
            self.rounds = rounds.map(|rounds| (rounds, self.before.clock.now()));
        }
    }

    fn is_still(&self) -> bool {
        self.rounds.is_some_and(|(_, since)| self.before.clock.now().0 - since.0 > STILL_S)
    }

    /// The screen of a box that waits to be told: that nobody will hear it, if so.
    fn or_still(&self, screen: Screen) -> Screen {
        let to_do = "Switch the box off and on.".to_owned();
        if self.is_still() { Screen::Trouble { what: STILL.to_owned(), to_do } } else { screen }
    }

    /// What the button asked for. The turn of a box in maintenance.
    fn answer(&mut self, waiting: usize, rig: &mut dyn Restorer) -> Option<Turn> {
        let requests = self.before.front_panel.take_requests();
        let cancelled = self.before.front_panel.take_cancelled();
        if cancelled {
            self.asked_for = 0;
        }
        let pressed = requests.go || requests.again;
        if pressed {
            self.inner.told(Event::Pressed, rig);
        }
        match &mut self.shooting {
            Some(shooting) => shooting.heard(requests.go, requests.put_off || cancelled),
            None if pressed => self.asked_for = waiting,
            None => {}
        }
        match requests.maintenance {
            Some(true) => {
                log::info!("maintenance: the button was held at the start");
                self.maintenance = Some("The box does no work until you say so.".to_owned());
            }
            Some(false) if self.maintenance.take().is_some() => log::info!("maintenance is over"),
            _ => {}
        }
        if requests.calibrate && self.maintenance.is_some() {
            let words = "The lens is being measured.".to_owned();
            self.show(Screen::Maintenance { words }, BoxState::Working, rig);
            let outcome = match rig.mend(Remedy::Recalibrate) {
                Ok(()) => "The lens has been measured anew.".to_owned(),
                Err(end) if end.was_asked_for() => {
                    "Measuring the lens was given up: it is taken as it was before.".to_owned()
                }
                Err(error) => format!("The lens could not be measured: {}", full_message(&*error)),
            };
            log::info!("maintenance: {outcome}");
            self.maintenance = Some(outcome);
            self.before.forget_screen();
        }
        let words = self.maintenance.clone()?;
        self.show(Screen::Maintenance { words }, BoxState::Maintenance, rig);
        self.inner.told(Event::KeptWaiting { waiting, why: "the box is in maintenance" }, rig);
        Some(Turn::Hold { reason: "maintenance".to_owned(), awaited: Awaited::Rig, until: None })
    }

    /// The last result while it is fresh, else `other`.
    fn fresh_result(&mut self, hint: &str, other: Screen) -> Screen {
        let now = self.before.clock.now();
        self.result.take_if(|result| now.0 - result.at.0 > RESULT_S);
        let Some(Shown { photo, untouched, words, .. }) = &self.result else { return other };
        let (photo, words, hint) = (photo.clone(), words.clone(), hint.to_owned());
        Screen::Result { photo, untouched: *untouched, words, hint }
    }

    /// Photos wait for their time: that, or the night that passed them by.
    fn rest(&mut self, reason: &str, awaited: Awaited, waiting: usize, rig: &mut dyn Restorer) {
        let others = self.beside.clone();
        let (screen, state) = match self.inner.attention().into_iter().next() {
            Some(Notice { what, why }) => {
                (Screen::Missed { what, why, photos: waiting, others }, BoxState::Trouble)
            }
            None => {
                let words = reason.to_owned();
                (Screen::Resting { words, photos: waiting, others }, BoxState::Resting)
            }
        };
        // What waits for the button is to hear it.
        let state = if awaited == Awaited::Button { BoxState::Waiting } else { state };
        self.show(screen, state, rig);
    }

    /// The button was not pressed for the photos that wait.
    fn wait_for_button(&mut self, photos: usize, rig: &mut dyn Restorer) -> Turn {
        let hint = match photos {
            1 => "1 photo waits: press the button.".to_owned(),
            n => format!("{n} photos wait: press the button."),
        };
        let others = self.beside.clone();
        let screen = self.fresh_result(&hint, Screen::Waiting { photos, others });
        self.show(self.or_still(screen), BoxState::Waiting, rig);
        let reason = "photos wait for the button".to_owned();
        Turn::Hold { reason, awaited: Awaited::Button, until: None }
    }

    /// Nothing is under way; `put_off` photos wait for the panel.
    fn be_ready(&mut self, put_off: usize, rig: &mut dyn Restorer) {
        let (hint, after) = match self.mode {
            Mode::Button => ("Put photos into the inbox, then press the button.", RESULT_HINT),
            Mode::Folder => ("Put photos into the inbox.", RESULT_HINT),
            Mode::Shoot => (AIM, AIM),
        };
        let hint = match put_off {
            0 => hint.to_owned(),
            1 => format!("{hint} 1 photo waits for the panel."),
            n => format!("{hint} {n} photos wait for the panel."),
        };
        let hint = format!("{hint} {}", self.beside).trim_end().to_owned();
        let screen = self.fresh_result(after, Screen::Ready { hint });
        let state = match self.ended {
            _ if put_off > 0 => BoxState::Waiting,
            // Whoever took the photo is there to see.
            Some((ended, at)) if self.is_fresh(at) && self.mode == Mode::Shoot => ended,
            _ => BoxState::Ready,
        };
        self.show(self.or_still(screen), state, rig);
    }

    fn is_fresh(&self, at: Moment) -> bool {
        self.before.clock.now().0 - at.0 <= RESULT_S
    }

    fn remember(&mut self, report: &Report) {
        let untouched = report.outcome == ResultKind::Untouched;
        let words = match &report.meaning {
            _ if untouched => sentence(plain(&report.reason)),
            Some(meaning) => meaning.clone(),
            None => "Restored; not photographed again.".to_owned(),
        };
        let (photo, at) = (report.photo.clone(), self.before.clock.now());
        self.result = Some(Shown { photo, untouched, words, at });
    }
}

impl Schedule for Attended<'_> {
    fn turn(&mut self, asked: Question, rig: &mut dyn Restorer) -> Turn {
        let Question { waiting, is_ready, parts } = asked;
        self.beside = parts.beside();
        self.watch_front_panel();
        if let Some(turn) = self.answer(waiting, rig) {
            return turn;
        }
        if let Some(shooting) = &mut self.shooting {
            match shooting.turn(asked, &mut self.before, rig) {
                ShootTurn::Photos => {}
                ShootTurn::Aim => {
                    self.be_ready(waiting, rig);
                    // Whoever brings the panel now, and does not see it, would wait for nothing.
                    let reason = "photos were put off; press the button to take another, and the \
                                  panel is asked for again"
                        .to_owned();
                    return Turn::Hold { reason, awaited: Awaited::Panel, until: None };
                }
                ShootTurn::Other(turn) => return turn,
            }
        }
        if !is_ready {
            self.asked_for = 0;
        } else if self.mode == Mode::Button && self.asked_for == 0 {
            return self.wait_for_button(waiting, rig);
        }
        let turn = self.inner.turn(asked, rig);
        match &turn {
            Turn::Hold { reason, awaited, .. } => self.rest(reason, *awaited, waiting, rig),
            Turn::Go if is_ready => self.asked_for = self.asked_for.saturating_sub(1),
            Turn::Go => self.be_ready(0, rig),
            Turn::Help(_) | Turn::Again(_) | Turn::Stop => {}
        }
        turn
    }

    fn told(&mut self, event: Event<'_>, rig: &mut dyn Restorer) {
        match event {
            Event::Begun { photo, number, of } => {
                self.before.forget_screen();
                let screen = Screen::Working { photo: photo.to_owned(), number, of };
                self.show(screen, BoxState::Working, rig);
            }
            Event::Ended(end) => {
                // The job's last capture is on the panel.
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
                    JobEnd::Left { .. } | JobEnd::Gone => None,
                };
                self.ended = state.map(|state| (state, self.before.clock.now()));
            }
            Event::Held(error) => {
                self.watch_front_panel();
                if let Some(shooting) = &mut self.shooting {
                    shooting.held();
                }
                let (what, to_do) = (full_message(error), error.what_to_do());
                let to_do = format!("{to_do} {AGAIN}");
                self.show(Screen::Trouble { what, to_do }, BoxState::Trouble, rig);
            }
            Event::KeptWaiting { .. } | Event::Pressed => {}
        }
        self.inner.told(event, rig);
    }

    fn unproven(&self) -> &[Delivered] {
        self.inner.unproven()
    }

    fn attention(&self) -> Vec<Notice> {
        let why = "what attends to them hangs or has ended; switch the box off and on".to_owned();
        let still = self.is_still().then(|| Notice { what: STILL.to_owned(), why });
        still.into_iter().chain(self.inner.attention()).collect()
    }

    fn impatient(&self) -> bool {
        let now = self.before.clock.now();
        let counts = self.shooting.as_ref().is_some_and(|shooting| shooting.is_due(now));
        counts || self.before.front_panel.has_requests() || self.inner.impatient()
    }
}

/// What the restorer's interruption asks: a long press in a job, or a stop of the service.
pub fn interruption(front_panel: FrontPanel, stopped: Arc<AtomicBool>) -> Interruption {
    Arc::new(move || front_panel.cancelled() || stopped.load(Ordering::Acquire))
}
