//! State shared by the daemon and the front panel's loop: the daemon sets the state of the box, the
//! loop passes on presses.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::press::Press;

/// State of the box for lamps and button.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BoxState {
    /// Devices are being opened or measured.
    #[default]
    Starting,
    /// No photo waits.
    Ready,
    /// No photo waits; the last one was restored.
    Done,
    /// No photo waits; the last one was returned unchanged or rejected.
    Refused,
    /// Photos wait for the button.
    Waiting,
    /// The button was pressed; work follows.
    Heard,
    /// Countdown to a photo.
    Counting,
    /// A photo is being taken or restored, or the lens measured.
    Working,
    /// Photos wait until the panel is before the lens.
    Asking,
    /// Photos wait for the night.
    Resting,
    /// The operator is needed.
    Trouble,
    /// Maintenance.
    Maintenance,
}

/// Requests made with the button that the daemon has not taken yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Requests {
    /// Restore waiting photos, or take a photo.
    pub go: bool,
    /// Try again after trouble.
    pub again: bool,
    /// Stop asking for the panel, or cancel the countdown.
    pub postpone: bool,
    /// Enter maintenance (true: the button was held at the start) or leave it (false).
    pub maintenance: Option<bool>,
    /// Calibrate; in maintenance only.
    pub calibrate: bool,
}

#[derive(Debug, Default)]
struct Inner {
    state: BoxState,
    requests: Requests,
    /// Whether the button went down in [`BoxState::Asking`], where short and long presses differ.
    asked_when_down: bool,
}

/// The shared state.
#[derive(Debug, Clone, Default)]
pub struct FrontPanel {
    inner: Arc<Mutex<Inner>>,
    cancel: Arc<AtomicBool>,
    /// Number of rounds of the loop; 0 if no loop runs.
    rounds: Arc<AtomicU64>,
}

impl BoxState {
    fn accepts_press(self) -> bool {
        use BoxState::{Done, Ready, Refused, Waiting};
        matches!(self, Ready | Done | Refused | Waiting)
    }
}

impl FrontPanel {
    /// Locks the state, even after a panic elsewhere: each value is consistent at any time.
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a round of the loop. The first is counted before the devices are opened, which may
    /// hang.
    pub fn count_round(&self) {
        self.rounds.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of rounds of the loop; `None` if no loop runs.
    pub fn rounds(&self) -> Option<u64> {
        Some(self.rounds.load(Ordering::Relaxed)).filter(|&rounds| rounds > 0)
    }

    /// State of the box.
    pub fn state(&self) -> BoxState {
        self.inner().state
    }

    /// Sets the state; called by the daemon.
    pub fn set(&self, state: BoxState) {
        let mut inner = self.inner();
        // A pending press stays acknowledged.
        let heard = inner.requests.go && state.accepts_press();
        inner.state = if heard { BoxState::Heard } else { state };
    }

    /// Processes a press according to the state; called by the loop.
    pub fn press(&self, press: Press) {
        let mut inner = self.inner();
        let was_asked = match press {
            Press::Down => {
                inner.asked_when_down = inner.state == BoxState::Asking;
                inner.asked_when_down
            }
            Press::Short | Press::Long => std::mem::take(&mut inner.asked_when_down),
            Press::HeldAtStart => false,
        };
        match (press, inner.state) {
            (Press::HeldAtStart, _) => inner.requests.maintenance = Some(true),
            (Press::Short, BoxState::Maintenance) => inner.requests.maintenance = Some(false),
            (Press::Long, BoxState::Maintenance) => inner.requests.calibrate = true,
            (Press::Down, _) if was_asked => inner.state = BoxState::Heard,
            (Press::Short, _) if was_asked => {
                inner.requests.go = true;
                inner.state = BoxState::Heard;
            }
            (Press::Long, _) if was_asked => inner.requests.postpone = true,
            (Press::Down, state) if state.accepts_press() || state == BoxState::Heard => {
                inner.requests.go = true;
                inner.state = BoxState::Heard;
            }
            (Press::Down, BoxState::Trouble) => {
                inner.requests.again = true;
                inner.state = BoxState::Heard;
            }
            (Press::Down | Press::Long, BoxState::Counting) => {
                inner.requests.postpone = true;
                inner.state = BoxState::Heard;
            }
            (Press::Long, BoxState::Working) => {
                inner.requests.go = false;
                self.cancel.store(true, Ordering::Release);
            }
            (Press::Long, _) if inner.requests.go => {
                // Cancelled before work began; the daemon sets the next state.
                inner.requests.go = false;
                inner.state = BoxState::Ready;
            }
            // A press during a job or at rest has no effect.
            (Press::Down | Press::Short | Press::Long, _) => {}
        }
    }

    /// Whether requests are pending.
    pub fn has_requests(&self) -> bool {
        self.inner().requests != Requests::default()
    }

    /// Takes the pending requests.
    pub fn take_requests(&self) -> Requests {
        std::mem::take(&mut self.inner().requests)
    }

    /// Whether the job is to be cancelled.
    pub fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Acquire)
    }

    /// Whether a job was to be cancelled; clears the request.
    pub fn take_cancelled(&self) -> bool {
        self.cancel.swap(false, Ordering::AcqRel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_presses_during_a_job_have_no_effect() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Working);
        for _ in 0..10 {
            panel.press(Press::Down);
        }
        assert!(!panel.has_requests() && !panel.cancelled());
        assert_eq!(panel.state(), BoxState::Working);
    }

    #[test]
    fn a_press_in_trouble_tries_again_and_takes_no_photo() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Trouble);
        panel.press(Press::Down);
        panel.press(Press::Short);
        assert_eq!(panel.state(), BoxState::Heard);
        assert_eq!(panel.take_requests(), Requests { again: true, ..Requests::default() });
        panel.set(BoxState::Trouble);
        assert_eq!(panel.state(), BoxState::Trouble, "still in trouble");
    }

    #[test]
    fn a_long_press_cancels_the_job_once() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Working);
        panel.press(Press::Down);
        panel.press(Press::Long);
        assert!(panel.cancelled() && panel.take_cancelled() && !panel.take_cancelled());
    }

    #[test]
    fn a_press_is_pending_until_the_daemon_takes_it() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Waiting);
        panel.press(Press::Down);
        assert_eq!(panel.state(), BoxState::Heard);
        panel.set(BoxState::Waiting);
        assert_eq!(panel.state(), BoxState::Heard, "not taken yet");
        assert!(panel.take_requests().go);
        panel.set(BoxState::Waiting);
        assert_eq!(panel.state(), BoxState::Waiting);
    }

    #[test]
    fn while_asking_short_takes_a_photo_and_long_postpones() {
        let panel = FrontPanel::default();
        for (press, go, postpone) in [(Press::Short, true, false), (Press::Long, false, true)] {
            panel.set(BoxState::Asking);
            panel.press(Press::Down);
            assert_eq!((panel.state(), panel.has_requests()), (BoxState::Heard, false));
            // The daemon sets the state again meanwhile.
            panel.set(BoxState::Asking);
            panel.press(press);
            assert_eq!(panel.take_requests(), Requests { go, postpone, ..Requests::default() });
        }
        // Releasing the button after a press that took a photo has no effect.
        panel.set(BoxState::Ready);
        panel.press(Press::Down);
        assert!(panel.take_requests().go);
        panel.set(BoxState::Asking);
        panel.press(Press::Short);
        assert!(!panel.has_requests());
    }

    #[test]
    fn a_second_or_long_press_cancels_the_countdown() {
        let panel = FrontPanel::default();
        for second in [Press::Down, Press::Long] {
            panel.set(BoxState::Ready);
            panel.press(Press::Down);
            assert!(panel.take_requests().go);
            panel.set(BoxState::Counting);
            panel.press(second);
            assert_eq!(panel.state(), BoxState::Heard);
            let back = Requests { postpone: true, ..Requests::default() };
            assert_eq!(panel.take_requests(), back);
            panel.set(BoxState::Ready);
            panel.press(Press::Short);
            assert!(!panel.has_requests(), "its release has no effect");
        }
    }

    #[test]
    fn in_maintenance_short_leaves_and_long_calibrates() {
        let panel = FrontPanel::default();
        panel.press(Press::HeldAtStart);
        assert_eq!(panel.take_requests().maintenance, Some(true));
        panel.set(BoxState::Maintenance);
        panel.press(Press::Down);
        panel.press(Press::Long);
        assert_eq!(panel.take_requests(), Requests { calibrate: true, ..Requests::default() });
        panel.press(Press::Down);
        assert!(!panel.has_requests(), "short or long is unknown yet");
        panel.press(Press::Short);
        assert_eq!(panel.take_requests().maintenance, Some(false));
    }
}
