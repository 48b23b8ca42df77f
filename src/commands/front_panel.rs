//! The thread that attends to button and lamps, of a board or a simulated rig.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use relens::config::{Kind, RigFile};
use relens::kiosk::attend::attend;
use relens::kiosk::front_panel::FrontPanel;
use relens::rig::monotonic::Monotonic;
use relens::rig::{Clock, Moment};

use super::press::SimulatedButton;

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
    match &rig.kind {
        Kind::Simulated(_) => {
            let mut button = SimulatedButton::new(folder);
            attend(front, Some(&mut button), &mut (), &Monotonic, ended);
        }
        #[cfg(feature = "hardware")]
        Kind::Hardware(hardware) => run_on_board(hardware, front, ended),
        #[cfg(not(feature = "hardware"))]
        Kind::Hardware(_) => {}
    }
}

/// Attends to button and lamps, as far as the board has them and they can be opened.
#[cfg(feature = "hardware")]
fn run_on_board(parts: &relens::config::Hardware, front: &FrontPanel, ended: &dyn Fn() -> bool) {
    use relens::rig::button::Button;
    use relens::rig::lamps::Lamps;
    use relens::rig::{ButtonLevel, LampRow};

    let warn = |error| log::warn!("{}", relens::remedy::full_message(&error));
    let mut lamps: Box<dyn LampRow> = match Lamps::open(&parts.lamps).map_err(warn) {
        Ok(lamps) => Box::new(lamps),
        Err(()) => Box::new(()),
    };
    let mut button = parts.button.as_ref().and_then(|line| Button::open(line).map_err(warn).ok());
    let button = button.as_mut().map(|button| button as &mut dyn ButtonLevel);
    attend(front, button, &mut *lamps, &Monotonic, ended);
}
