//! The loop of the front panel, on its own thread: reads the button and drives the lamps.

use super::front_panel::FrontPanel;
use super::lamp;
use super::press::Presses;
use crate::rig::{ButtonLevel, Clock, Lamp, LampRow, Moment, RigError};

/// Longest delay from a change of the box's state to that of the lamps.
const POLL_S: f64 = 0.05;

/// Shortest interval between two rounds of the loop.
const POLL_MIN_S: f64 = 0.001;

/// Serves button and lamps until `ended` returns true, then switches the lamps off. A failure is
/// logged once and retried, since photos depend on neither.
pub fn attend(
    panel: &FrontPanel,
    mut button: Option<&mut (dyn ButtonLevel + '_)>,
    lamps: &mut dyn LampRow,
    clock: &dyn Clock,
    ended: &dyn Fn() -> bool,
) {
    let mut presses = Presses::new(clock.now());
    let (mut state, mut since) = (panel.state(), clock.now());
    let mut shown: Option<&[Lamp]> = None;
    let (mut lamp_failed, mut button_failed) = (false, false);
    while !ended() {
        panel.count_round();
        let now = clock.now();
        let state_now = panel.state();
        if state_now != state {
            (state, since) = (state_now, now);
        }
        let (lights, remaining_s) = lamp::lit(state, now.0 - since.0);
        if shown != Some(lights) {
            shown = Some(lights);
            once(lamps.show(lights), &mut lamp_failed);
        }
        let mut deadline = (now.0 + remaining_s.min(POLL_S)).min(presses.look_again_at());
        let Some(button) = button.as_deref_mut() else {
            clock.wait_until(Moment(deadline));
            continue;
        };
        // Never in the past: the loop must not spin.
        deadline = deadline.max(now.0 + POLL_MIN_S);
        match button.level_by(Moment(deadline)) {
            Ok(level) => {
                button_failed = false;
                if let Some(press) = presses.read(level, clock.now()) {
                    panel.press(press);
                }
            }
            failed => {
                once(failed.map(|_| ()), &mut button_failed);
                clock.wait_until(Moment(deadline));
            }
        }
    }
    let _ = lamps.show(&[]);
}

/// Logs a failure unless one was `logged` already.
fn once(outcome: Result<(), RigError>, logged: &mut bool) {
    if let Err(error) = outcome
        && !std::mem::replace(logged, true)
    {
        log::warn!("{}", crate::remedy::full_message(&error));
    }
}

#[cfg(test)]
mod tests {
    use std::cell::{Cell, RefCell};

    use super::*;
    use crate::kiosk::front_panel::BoxState;

    #[derive(Default)]
    struct TestClock(Cell<f64>);
    impl Clock for TestClock {
        fn now(&self) -> Moment {
            Moment(self.0.get())
        }
        fn wait_until(&self, moment: Moment) {
            self.0.set(self.0.get().max(moment.0));
        }
    }

    /// A button that changes its level at given times. Edges end a wait, unless they are lost.
    struct Finger<'a> {
        clock: &'a TestClock,
        changes: &'a [(f64, bool)],
        edges_lost: bool,
    }
    impl ButtonLevel for Finger<'_> {
        fn level_by(&mut self, deadline: Moment) -> Result<bool, RigError> {
            let now = self.clock.0.get();
            let next = self.changes.iter().map(|c| c.0).find(|&at| at > now && !self.edges_lost);
            self.clock.0.set(next.map_or(deadline.0, |at| at.min(deadline.0)));
            let now = self.clock.0.get();
            Ok(self.changes.iter().rev().find(|c| c.0 <= now).is_some_and(|c| c.1))
        }
    }

    struct LampRecord<'a>(&'a TestClock, &'a RefCell<Vec<(f64, Vec<Lamp>)>>);
    impl LampRow for LampRecord<'_> {
        fn show(&mut self, lit: &[Lamp]) -> Result<(), RigError> {
            self.1.borrow_mut().push((self.0.0.get(), lit.to_vec()));
            Ok(())
        }
    }

    fn attended(
        panel: &FrontPanel,
        changes: &[(f64, bool)],
        edges_lost: bool,
        until_s: f64,
    ) -> Vec<(f64, Vec<Lamp>)> {
        let (clock, seen) = (TestClock::default(), RefCell::default());
        let mut finger = Finger { clock: &clock, changes, edges_lost };
        let ended = || clock.0.get() > until_s;
        attend(panel, Some(&mut finger), &mut LampRecord(&clock, &seen), &clock, &ended);
        seen.into_inner()
    }

    #[test]
    fn a_press_is_acknowledged_within_100_ms() {
        // Bounces for 12 ms; debounced 30 ms after the last bounce.
        let bouncing = [(2.0, true), (2.004, false), (2.009, true), (2.5, false)];
        for edges_lost in [false, true] {
            let panel = FrontPanel::default();
            panel.set(BoxState::Waiting);
            let seen = attended(&panel, &bouncing, edges_lost, 3.0);
            let at = seen.iter().find(|(_, lit)| lit == &[Lamp::Busy]).map(|s| s.0).unwrap();
            assert!((2.03..=2.139).contains(&at), "lit at {at}, edges lost: {edges_lost}");
            assert!(panel.take_requests().go);
        }
    }

    #[test]
    fn a_state_is_shown_at_once_and_the_lamps_end_dark() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Trouble);
        let seen = attended(&panel, &[], false, 1.0);
        assert_eq!(seen.first().unwrap().1, [Lamp::Trouble]);
        assert!(seen.last().unwrap().1.is_empty());
    }

    #[test]
    fn only_a_long_press_cancels_a_job() {
        let panel = FrontPanel::default();
        panel.set(BoxState::Working);
        attended(&panel, &[(1.0, true), (1.2, false), (1.5, true), (1.7, false)], false, 3.0);
        assert!(!panel.cancelled());
        attended(&panel, &[(1.0, true), (4.0, false)], false, 5.0);
        assert!(panel.cancelled());
    }

    #[test]
    fn the_lamps_work_without_the_button() {
        struct Dead;
        impl ButtonLevel for Dead {
            fn level_by(&mut self, _: Moment) -> Result<bool, RigError> {
                Err(RigError::Gone { device: "button", what: "pulled off".into() })
            }
        }
        let (clock, seen, panel) =
            (TestClock::default(), RefCell::default(), FrontPanel::default());
        let ended = || clock.0.get() > 3.0;
        attend(&panel, Some(&mut Dead), &mut LampRecord(&clock, &seen), &clock, &ended);
        assert!(seen.into_inner().len() > 2, "the start goes on flashing");
    }
}
