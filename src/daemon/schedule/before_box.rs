//! Lamps and panel for the user in front of the box.

use super::Restorer;
use crate::kiosk::front_panel::{BoxState, FrontPanel};
use crate::kiosk::screen::Screen;
use crate::rig::{Clock, Moment};

/// Interval after which a screen is shown again: a panel switched off and on has lost it.
const SHOW_AGAIN_S: f64 = 60.0;

/// The front panel, and the last screen.
pub(super) struct BeforeBox<'a> {
    pub(super) front_panel: FrontPanel,
    pub(super) clock: &'a dyn Clock,
    screen: Option<(Screen, Moment)>,
}

impl<'a> BeforeBox<'a> {
    pub(super) fn new(front_panel: FrontPanel, clock: &'a dyn Clock) -> BeforeBox<'a> {
        BeforeBox { front_panel, clock, screen: None }
    }

    /// Shows `screen`, unless it is shown already, and `state` on the lamps.
    pub(super) fn show(&mut self, screen: Screen, state: BoxState, rig: &mut dyn Restorer) {
        self.front_panel.set(state);
        let now = self.clock.now();
        let is_shown =
            |(shown, at): &(Screen, Moment)| *shown == screen && now.0 - at.0 < SHOW_AGAIN_S;
        if !self.screen.as_ref().is_some_and(is_shown) {
            rig.show(&screen);
            self.screen = Some((screen, now));
        }
    }

    /// Notes that a capture has replaced the screen.
    pub(super) fn forget_screen(&mut self) {
        self.screen = None;
    }
}

/// What the user in front of the box sees, and the rig behind it.
pub(super) struct Front<'a, 'b> {
    pub(super) before: &'a mut BeforeBox<'b>,
    pub(super) rig: &'a mut dyn Restorer,
}

impl Front<'_, '_> {
    pub(super) fn show(&mut self, screen: Screen, state: BoxState) {
        self.before.show(screen, state, self.rig);
    }

    pub(super) fn now(&self) -> Moment {
        self.before.clock.now()
    }
}
