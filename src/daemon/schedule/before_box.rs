//! What is shown to the one who stands before the box: lamps by state, a screen on the panel.

use super::Restorer;
use crate::kiosk::front_panel::{BoxState, FrontPanel};
use crate::kiosk::screen::Screen;
use crate::rig::{Clock, Moment};

/// A screen is shown again after this long: a panel that was switched off and on has forgotten it.
const SHOW_AGAIN_S: f64 = 60.0;

/// The front panel, and the screen shown last.
pub(super) struct BeforeBox<'a> {
    pub(super) front_panel: FrontPanel,
    pub(super) clock: &'a dyn Clock,
    screen: Option<(Screen, Moment)>,
}

impl<'a> BeforeBox<'a> {
    pub(super) fn new(front_panel: FrontPanel, clock: &'a dyn Clock) -> BeforeBox<'a> {
        BeforeBox { front_panel, clock, screen: None }
    }

    /// Shows `screen`, unless it is there already, and `state` on the lamps.
    pub(super) fn show(&mut self, screen: Screen, state: BoxState, rig: &mut dyn Restorer) {
        self.front_panel.set(state);
        let now = self.clock.now();
        let stays =
            |(shown, at): &(Screen, Moment)| *shown == screen && now.0 - at.0 < SHOW_AGAIN_S;
        if !self.screen.as_ref().is_some_and(stays) {
            rig.show(&screen);
            self.screen = Some((screen, now));
        }
    }

    /// A capture has taken the screen's place on the panel.
    pub(super) fn forget_screen(&mut self) {
        self.screen = None;
    }
}
