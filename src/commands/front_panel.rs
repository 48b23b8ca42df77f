//! The thread of button and lamps, of a board or a simulated rig.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use relens::config::{Kind, RigFile};
use relens::kiosk::attend::{ButtonTiming, attend};
use relens::kiosk::front_panel::FrontPanel;
use relens::rig::monotonic::Monotonic;
use relens::rig::{Clock, Moment};

use super::press::SimulatedButton;

/// Debounce time of a simulated button, which does not bounce.
const SIMULATED_DEBOUNCE_MS: f64 = 20.0;

/// Longest wait for the loop to end, seconds; it iterates many times a second. Guess.
const END_S: f64 = 2.0;

/// The front panel's thread, which runs until this is dropped.
pub(super) struct FrontPanelThread {
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl FrontPanelThread {
    /// Starts the thread for the button and lamps of `rig`, which works on `folder`.
    pub(super) fn start(rig: &RigFile, folder: &Path, front: FrontPanel) -> FrontPanelThread {
        let ended = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&ended);
        let (rig, folder) = (rig.clone(), folder.to_owned());
        front.count_round();
        let begun = std::thread::Builder::new().name("front panel".to_owned()).spawn(move || {
            run(&rig, &folder, &front, &|| asked.load(Ordering::Acquire));
        });
        if let Err(error) = &begun {
            log::warn!("button and lamps are off: cannot start their thread: {error}");
        }
        FrontPanelThread { ended, thread: begun.ok() }
    }
}

impl Drop for FrontPanelThread {
    /// Waits for the lamps to go dark, but not for a loop that hangs.
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else { return };
        let until = Monotonic.now().0 + END_S;
        while !thread.is_finished() && Monotonic.now().0 < until {
            Monotonic.wait_until(Moment(Monotonic.now().0 + 0.01));
        }
        if thread.is_finished() {
            // A panic was already printed.
            let _ = thread.join();
        }
    }
}

fn run(rig: &RigFile, folder: &Path, front: &FrontPanel, ended: &dyn Fn() -> bool) {
    let long_press_ms = rig.run.long_press_ms;
    match &rig.kind {
        Kind::Simulated(_) => {
            let mut button = SimulatedButton::new(folder);
            let timing = ButtonTiming { debounce_ms: SIMULATED_DEBOUNCE_MS, long_press_ms };
            attend(front, Some(&mut button), &mut (), &Monotonic, timing, ended);
        }
        #[cfg(feature = "hardware")]
        Kind::Hardware(hardware) => board::run(hardware, long_press_ms, front, ended),
        #[cfg(not(feature = "hardware"))]
        Kind::Hardware(_) => {}
    }
}

#[cfg(feature = "hardware")]
mod board {
    use relens::config::Hardware;
    use relens::kiosk::attend::{self, ButtonTiming, attend};
    use relens::kiosk::front_panel::FrontPanel;
    use relens::kiosk::lamp::LampColour;
    use relens::remedy::full_message;
    use relens::rig::lamps::Lamp;
    use relens::rig::monotonic::Monotonic;
    use relens::rig::{Moment, RigError, button, hardware, lamps};

    struct BoardButton(button::Button);

    impl attend::ButtonLevel for BoardButton {
        fn level_by(&mut self, deadline: Moment) -> Result<bool, RigError> {
            self.0.level_by(deadline)
        }
    }

    struct BoardLamps(lamps::Lamps);

    impl attend::LampRow for BoardLamps {
        fn show(&mut self, lit: &[LampColour]) -> Result<(), RigError> {
            let lamp = |light: &LampColour| match light {
                LampColour::Green => Lamp::Ready,
                LampColour::White => Lamp::Busy,
                LampColour::Red => Lamp::Trouble,
            };
            self.0.show(&lit.iter().map(lamp).collect::<Vec<_>>())
        }
    }

    /// Runs with those of button and lamps that the board has and that can be opened.
    pub(super) fn run(
        parts: &Hardware,
        long_press_ms: f64,
        front: &FrontPanel,
        ended: &dyn Fn() -> bool,
    ) {
        let warn = |error: RigError| log::warn!("{}", full_message(&error));
        let mut bulbs = hardware::open_lamps(&parts.lamps).map(BoardLamps).map_err(warn).ok();
        let button = parts.button.as_ref();
        let mut line =
            button.and_then(|b| hardware::open_button(b).map_err(warn).ok()).map(BoardButton);
        let debounce_ms = parts.button.as_ref().map_or(30.0, |button| button.debounce_ms);
        let timing = ButtonTiming { debounce_ms, long_press_ms };
        let button = line.as_mut().map(|line| line as &mut dyn attend::ButtonLevel);
        let mut none = ();
        let lamps: &mut dyn attend::LampRow = match &mut bulbs {
            Some(bulbs) => bulbs,
            None => &mut none,
        };
        attend(front, button, lamps, &Monotonic, timing, ended);
    }
}
