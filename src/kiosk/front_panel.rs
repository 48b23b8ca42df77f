//! What the front panel's loop and the daemon tell each other: the state one way, presses the
//! other.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::press::Press;

/// What the box is doing, as far as somebody before it cares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BoxState {
    /// Devices are being opened or measured.
    #[default]
    Starting,
    /// Nothing to do.
    Ready,
    /// Nothing to do; the photo of before was restored.
    Done,
    /// Nothing to do; the photo of before was returned as it was, or refused.
    Refused,
    /// Photos wait for the button.
    Waiting,
    /// The button was pressed, work is about to begin.
    Heard,
    /// It counts down to the photo.
    Counting,
    /// A photo is being taken or restored, or the lens measured.
    Working,
    /// Photos wait for the panel to be put before the lens.
    Asking,
    /// Photos wait for their time.
    Resting,
    /// Somebody is needed.
    Trouble,
    /// The button was held at the start.
    Maintenance,
}

/// What the button asked for and the daemon has not answered yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Requests {
    /// Restore what is waiting, or take a photo.
    pub go: bool,
    /// Try again what somebody was needed for.
    pub again: bool,
    /// Do not wait for the panel, or do not take the photo that is counted down to.
    pub put_off: bool,
    /// Leave maintenance, or enter it (held at start).
    pub maintenance: Option<bool>,
    /// Calibrate; asked for in maintenance only.
    pub calibrate: bool,
}

#[derive(Debug, Default)]
struct Inner {
    state: BoxState,
    requests: Requests,
    /// The button went down while the panel was asked for: short or long tells what is meant.
    asked_when_down: bool,
}

/// Both sides of the front panel.
#[derive(Debug, Clone, Default)]
pub struct FrontPanel {
    inner: Arc<Mutex<Inner>>,
    cancel: Arc<AtomicBool>,
    /// Rounds of the loop, from 1; 0 for a box whose front panel nobody attends.
    rounds: Arc<AtomicU64>,
}

impl BoxState {
    /// Whether a press begins something.
    fn takes_a_press(self) -> bool {
        use BoxState::{Done, Ready, Refused, Waiting};
        matches!(self, Ready | Done | Refused | Waiting)
    }
}

impl FrontPanel {
    /// Also after a panic elsewhere: each value is whole at any time.
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The side of the loop: it comes round once more. Called for the first time before its
    /// devices are opened, which may hang as well.
    pub fn comes_round(&self) {
        self.rounds.fetch_add(1, Ordering::Relaxed);
    }

    /// How often the loop came round; `None` for a box whose front panel nobody attends.
    pub fn rounds(&self) -> Option<u64> {
        Some(self.rounds.load(Ordering::Relaxed)).filter(|&rounds| rounds > 0)
    }

    /// The state the box is in.
    pub fn state(&self) -> BoxState {
        self.inner().state
    }

    /// The daemon's side: the box now is in `state`.
    pub fn set(&self, state: BoxState) {
        let mut inner = self.inner();
        // A press that came just before the daemon looked must not seem to have been forgotten.
        let heard = inner.requests.go && state.takes_a_press();
        inner.state = if heard { BoxState::Heard } else { state };
    }

    /// The side of the loop: what a press means in the state the box is in.
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
            (Press::Long, _) if was_asked => inner.requests.put_off = true,
            (Press::Down, state) if state.takes_a_press() || state == BoxState::Heard => {
                inner.requests.go = true;
                inner.state = BoxState::Heard;
            }
            (Press::Down, BoxState::Trouble) => {
                inner.requests.again = true;
                inner.state = BoxState::Heard;
            }
            (Press::Down | Press::Long, BoxState::Counting) => {
                inner.requests.put_off = true;
                inner.state = BoxState::Heard;
            }
            (Press::Long, BoxState::Working) => {
                inner.requests.go = false;
                self.cancel.store(true, Ordering::Release);
            }
            (Press::Long, _) if inner.requests.go => {
                // Taken back before it began: the daemon says what comes next.
                inner.requests.go = false;
                inner.state = BoxState::Ready;
            }
            // A press during a job or while resting changes nothing.
            (Press::Down | Press::Short | Press::Long, _) => {}
        }
    }

    /// Whether the button asked for something.
    pub fn has_requests(&self) -> bool {
        self.inner().requests != Requests::default()
    }

    /// What the button asked for, which counts as answered from now on.
    pub fn take_requests(&self) -> Requests {
        std::mem::take(&mut self.inner().requests)
    }

    /// Whether the job under way is to be given up.
    pub fn cancelled(&self) -> bool {
        self.cancel.load(Ordering::Acquire)
    }

    /// Whether a job was to be given up; the request counts as answered.
    pub fn take_cancelled(&self) -> bool {
        self.cancel.swap(false, Ordering::AcqRel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presses_during_a_job_ask_for_nothing() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Working);
        for _ in 0..10 {
            panel.press(Press::Down);
        }
        assert!(!panel.has_requests() && !panel.cancelled());
        assert_eq!(panel.state(), BoxState::Working);
    }

    #[test]
    fn a_press_in_trouble_asks_to_try_again_and_for_no_photo() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Trouble);
        panel.press(Press::Down);
        panel.press(Press::Short);
        assert_eq!(panel.state(), BoxState::Heard);
        assert_eq!(panel.take_requests(), Requests { again: true, ..Requests::default() });
        panel.set(BoxState::Trouble);
        assert_eq!(panel.state(), BoxState::Trouble, "it was no use");
    }

    #[test]
    fn a_long_press_gives_the_job_up_once() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Working);
        panel.press(Press::Down);
        panel.press(Press::Long);
        assert!(panel.cancelled() && panel.take_cancelled() && !panel.take_cancelled());
    }

    #[test]
    fn a_press_is_kept_until_the_daemon_looks() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Waiting);
        panel.press(Press::Down);
        assert_eq!(panel.state(), BoxState::Heard);
        panel.set(BoxState::Waiting);
        assert_eq!(panel.state(), BoxState::Heard, "the daemon has not looked yet");
        assert!(panel.take_requests().go);
        panel.set(BoxState::Waiting);
        assert_eq!(panel.state(), BoxState::Waiting);
    }

    #[test]
    fn while_the_panel_is_asked_for_short_takes_a_photo_and_long_puts_off() {
        let panel = FrontPanel::default();
        for (press, go, put_off) in [(Press::Short, true, false), (Press::Long, false, true)] {
            panel.set(BoxState::Asking);
            panel.press(Press::Down);
            assert_eq!((panel.state(), panel.has_requests()), (BoxState::Heard, false));
            // The daemon goes on asking meanwhile.
            panel.set(BoxState::Asking);
            panel.press(press);
            assert_eq!(panel.take_requests(), Requests { go, put_off, ..Requests::default() });
        }
        // The release after a press that took a photo at once asks for nothing more.
        panel.set(BoxState::Ready);
        panel.press(Press::Down);
        assert!(panel.take_requests().go);
        panel.set(BoxState::Asking);
        panel.press(Press::Short);
        assert!(!panel.has_requests());
    }

    #[test]
    fn a_second_press_or_a_long_one_takes_the_photo_back_that_is_counted_down_to() {
        let panel = FrontPanel::default();
        for second in [Press::Down, Press::Long] {
            panel.set(BoxState::Ready);
            panel.press(Press::Down);
            assert!(panel.take_requests().go);
            panel.set(BoxState::Counting);
            panel.press(second);
            assert_eq!(panel.state(), BoxState::Heard);
            let back = Requests { put_off: true, ..Requests::default() };
            assert_eq!(panel.take_requests(), back);
            panel.set(BoxState::Ready);
            panel.press(Press::Short);
            assert!(!panel.has_requests(), "its release asks for nothing more");
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
        assert!(!panel.has_requests(), "short or long is not known yet");
        panel.press(Press::Short);
        assert_eq!(panel.take_requests().maintenance, Some(false));
    }
}
