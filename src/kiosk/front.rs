//! What the desk and the daemon tell each other: the state one way, presses the other.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::press::Press;

/// What the box is doing, as far as somebody before it cares.
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    /// Devices are being opened or measured.
    Starting,
    /// Nothing to do.
    Ready,
    /// Photos wait for the button.
    Waiting {
        /// How many.
        photos: usize,
    },
    /// The button was pressed, work is about to begin.
    Heard,
    /// A photo is being restored.
    Working {
        /// Its name.
        photo: String,
    },
    /// Photos wait for their time.
    Resting {
        /// For what.
        reason: String,
    },
    /// Somebody is needed.
    Trouble {
        /// What is wrong.
        reason: String,
    },
    /// The button was held at the start.
    Maintenance {
        /// What is going on.
        words: String,
    },
}

/// What the button asked for and the daemon has not answered yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wishes {
    /// Restore what is waiting.
    pub go: bool,
    /// Leave maintenance, or enter it (held at start).
    pub maintenance: Option<bool>,
    /// Calibrate; asked for in maintenance only.
    pub calibrate: bool,
}

#[derive(Debug)]
struct Inner {
    state: State,
    /// Counts the changes of state.
    change: u64,
    wishes: Wishes,
}

/// Both sides of the counter.
#[derive(Debug, Clone)]
pub struct Front {
    inner: Arc<Mutex<Inner>>,
    cancel: Arc<AtomicBool>,
    /// Rounds of the desk's loop, from 1; 0 for a box whose desk nobody attends.
    rounds: Arc<AtomicU64>,
}

impl Default for Front {
    fn default() -> Self {
        let inner = Inner { state: State::Starting, change: 0, wishes: Wishes::default() };
        Front { inner: Arc::new(Mutex::new(inner)), cancel: Arc::default(), rounds: Arc::default() }
    }
}

impl Front {
    /// Also after a panic elsewhere: each value is whole at any time.
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The desk's side: its loop comes round once more. Called for the first time before the desk's
    /// devices are opened, which may hang as well.
    pub fn comes_round(&self) {
        self.rounds.fetch_add(1, Ordering::Relaxed);
    }

    /// How often the desk's loop came round; `None` for a box whose desk nobody attends.
    pub fn rounds(&self) -> Option<u64> {
        Some(self.rounds.load(Ordering::Relaxed)).filter(|&rounds| rounds > 0)
    }

    /// The state and the number of its last change.
    pub fn state(&self) -> (State, u64) {
        let inner = self.inner();
        (inner.state.clone(), inner.change)
    }

    /// The daemon's side: the box now is in `state`.
    pub fn set(&self, state: State) {
        let mut inner = self.inner();
        // A press that came just before the daemon looked must not seem to have been forgotten.
        let heard = inner.wishes.go && matches!(state, State::Waiting { .. } | State::Ready);
        let state = if heard { State::Heard } else { state };
        if inner.state != state {
            inner.state = state;
            inner.change += 1;
        }
    }

    /// The desk's side: what a press means in the state the box is in.
    pub fn press(&self, press: Press) {
        let mut inner = self.inner();
        let working = matches!(inner.state, State::Working { .. });
        match (press, &inner.state) {
            (Press::HeldAtStart, _) => inner.wishes.maintenance = Some(true),
            (Press::Short, State::Maintenance { .. }) => inner.wishes.maintenance = Some(false),
            (Press::Long, State::Maintenance { .. }) => inner.wishes.calibrate = true,
            (Press::Down, State::Ready | State::Waiting { .. } | State::Heard) => {
                inner.wishes.go = true;
                inner.state = State::Heard;
                inner.change += 1;
            }
            (Press::Long, _) if working || inner.wishes.go => {
                inner.wishes.go = false;
                if working {
                    self.cancel.store(true, Ordering::Release);
                } else {
                    // Taken back before it began: the daemon says what comes next.
                    inner.state = State::Ready;
                    inner.change += 1;
                }
            }
            // A press during a job, while resting or in trouble changes nothing.
            (Press::Down | Press::Short | Press::Long, _) => {}
        }
    }

    /// Whether the button asked for something.
    pub fn wishes_something(&self) -> bool {
        self.inner().wishes != Wishes::default()
    }

    /// What the button asked for, which counts as answered from now on.
    pub fn take_wishes(&self) -> Wishes {
        std::mem::take(&mut self.inner().wishes)
    }

    /// Whether the job under way is to be given up.
    pub fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Acquire)
    }

    /// Whether a job was to be given up; the wish counts as answered.
    pub fn take_cancelled(&self) -> bool {
        self.cancel.swap(false, Ordering::AcqRel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presses_during_a_job_ask_for_nothing() {
        let front = Front::default();
        front.set(State::Working { photo: "a".into() });
        for _ in 0..10 {
            front.press(Press::Down);
        }
        assert!(!front.wishes_something() && !front.cancelled());
        assert_eq!(front.state().0, State::Working { photo: "a".into() });
    }

    #[test]
    fn a_long_press_gives_the_job_up_once() {
        let front = Front::default();
        front.set(State::Working { photo: "a".into() });
        front.press(Press::Down);
        front.press(Press::Long);
        assert!(front.cancelled() && front.take_cancelled() && !front.take_cancelled());
    }

    #[test]
    fn a_press_is_kept_until_the_daemon_looks() {
        let front = Front::default();
        front.set(State::Waiting { photos: 1 });
        front.press(Press::Down);
        assert_eq!(front.state().0, State::Heard);
        front.set(State::Waiting { photos: 1 });
        assert_eq!(front.state().0, State::Heard, "the daemon has not looked yet");
        assert!(front.take_wishes().go);
        front.set(State::Waiting { photos: 1 });
        assert_eq!(front.state().0, State::Waiting { photos: 1 });
    }

    #[test]
    fn in_maintenance_short_leaves_and_long_calibrates() {
        let front = Front::default();
        front.press(Press::HeldAtStart);
        assert_eq!(front.take_wishes().maintenance, Some(true));
        front.set(State::Maintenance { words: String::new() });
        front.press(Press::Down);
        front.press(Press::Long);
        assert_eq!(front.take_wishes(), Wishes { calibrate: true, ..Wishes::default() });
        front.press(Press::Down);
        assert!(!front.wishes_something(), "short or long is not known yet");
        front.press(Press::Short);
        assert_eq!(front.take_wishes().maintenance, Some(false));
    }
}
