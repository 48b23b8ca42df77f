//! Recovery of a display after its cable was out, its link failed, or another program used it.
//!
//! A link that failed its training stays black until the mode is set again with `link-status` Good
//! (Linux DRM documentation, "Standard Connector Properties"). A monitor that was off may need the
//! same. Committing an equal mode does not set it (`drm_mode_equal` in drm_atomic_helper.c), so the
//! display is switched off first. A commit by a program that is not DRM master is refused with
//! EACCES. The kernel is behind a trait for tests, since no virtual display loses its link.

use super::RigError;

/// Value "Good" of `link-status`.
const GOOD: u64 = 0;

/// Maximum number of failures of a link in a row, each after setting the mode. Guess.
const TRAININGS_MAX: u32 = 3;

/// State of a connector as known to the kernel, without probing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ConnectorState {
    pub(super) plugged_in: bool,
    /// Property `link-status`, if the driver has it.
    pub(super) link_status: Option<u64>,
}

/// Access to a display through the kernel.
pub(super) trait Display {
    /// Name of the connector.
    fn name(&self) -> &str;
    /// State of the connector, without probing it.
    fn state(&mut self) -> Result<ConnectorState, RigError>;
    /// Probes whether a display is plugged in.
    fn probe(&mut self) -> Result<bool, RigError>;
    /// Becomes DRM master.
    fn take(&mut self) -> Result<(), RigError>;
    /// Switches the output off.
    fn darken(&mut self) -> Result<(), RigError>;
    /// Commits the mode.
    fn light(&mut self) -> Result<(), RigError>;
}

/// State of the link to a display.
#[derive(Debug, Default)]
pub(super) struct Link {
    /// Whether the mode must be set before the next picture.
    dark: bool,
    /// Consecutive failures of the link.
    bad: u32,
}

impl Link {
    /// Records a refused commit or a missing refresh; the mode must then be set again.
    pub(super) fn lose(&mut self) {
        self.dark = true;
    }

    /// Checks cable and link, and sets the mode again after a loss; returns whether it did.
    ///
    /// # Errors
    /// [`RigError::Gone`] without a display or with a link that keeps failing; [`RigError::Held`]
    /// while another program drives the display.
    pub(super) fn keep(&mut self, display: &mut dyn Display) -> Result<bool, RigError> {
        let state = display.state()?;
        if !state.plugged_in {
            self.dark = true;
            return Err(unplugged(display.name()));
        }
        let bad = state.link_status.is_some_and(|status| status != GOOD);
        self.bad = if bad { self.bad + 1 } else { 0 };
        if !bad && !self.dark {
            return Ok(false);
        }
        self.dark = true;
        // Another program may have released the display.
        display.take()?;
        if !display.probe()? {
            return Err(unplugged(display.name()));
        }
        display.darken()?;
        display.light()?;
        self.dark = false;
        if self.bad > TRAININGS_MAX {
            let name = display.name();
            let what = "fails whenever its mode is set; try another cable or a lower mode";
            return Err(RigError::gone("panel", format!("the link to {name} {what}")));
        }
        Ok(true)
    }
}

pub(super) fn unplugged(name: &str) -> RigError {
    RigError::gone("panel", format!("nothing is plugged into {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A display with scripted faults and the kernel's rule for equal modes.
    struct Fake {
        look: ConnectorState,
        /// Whether the CRTC is active.
        active: bool,
        /// Whether the monitor receives a picture.
        shows: bool,
        /// Whether another program is DRM master.
        taken: bool,
        /// Number of link trainings that will fail.
        failures: u32,
        lit: u32,
    }

    const WELL: ConnectorState = ConnectorState { plugged_in: true, link_status: Some(GOOD) };

    fn fake() -> Fake {
        Fake { look: WELL, active: true, shows: true, taken: false, failures: 0, lit: 0 }
    }

    impl Display for Fake {
        fn name(&self) -> &str {
            "HDMI-A-1"
        }
        fn state(&mut self) -> Result<ConnectorState, RigError> {
            Ok(self.look)
        }
        fn probe(&mut self) -> Result<bool, RigError> {
            Ok(self.look.plugged_in)
        }
        fn take(&mut self) -> Result<(), RigError> {
            let what = "another program drives the display".to_owned();
            if self.taken { Err(RigError::Held { device: "panel", what }) } else { Ok(()) }
        }
        fn darken(&mut self) -> Result<(), RigError> {
            assert!(!self.taken, "only a master sets modes");
            (self.active, self.shows) = (false, false);
            Ok(())
        }
        fn light(&mut self) -> Result<(), RigError> {
            assert!(!self.taken, "only a master sets modes");
            if self.active && self.look.link_status.is_none_or(|status| status == GOOD) {
                return Ok(());
            }
            (self.active, self.shows) = (true, true);
            self.lit += 1;
            self.look.link_status = self.look.link_status.map(|_| u64::from(self.failures > 0));
            self.failures = self.failures.saturating_sub(1);
            Ok(())
        }
    }

    /// Shows twenty pictures; returns how often the mode was set.
    fn pictures(link: &mut Link, display: &mut Fake) -> u32 {
        let before = display.lit;
        (0..20).for_each(|_| drop(link.keep(display)));
        display.lit - before
    }

    #[test]
    fn the_mode_of_a_bad_link_is_set_once() {
        let (mut link, mut display) = (Link::default(), fake());
        assert_eq!(pictures(&mut link, &mut display), 0, "all is well");
        display.look.link_status = Some(1);
        assert_eq!(link.keep(&mut display).ok(), Some(true));
        assert_eq!((display.lit, display.look), (1, WELL));
        assert_eq!(pictures(&mut link, &mut display), 0);
        // A driver without the property has no link that can be bad.
        display.look.link_status = None;
        assert_eq!(pictures(&mut link, &mut display), 0);
    }

    #[test]
    fn a_link_that_fails_a_few_times_recovers_and_one_that_keeps_failing_is_an_error() {
        let (mut link, mut display) = (Link::default(), fake());
        (display.look.link_status, display.failures) = (Some(1), 2);
        let healed: Vec<bool> = (0..20).map(|_| link.keep(&mut display).is_ok()).collect();
        assert!(healed.iter().all(|&ok| ok) && display.lit == 3, "{healed:?} {}", display.lit);
        (display.look.link_status, display.failures) = (Some(1), 10);
        let errors: Vec<String> =
            (0..10).filter_map(|_| link.keep(&mut display).err().map(|e| e.to_string())).collect();
        assert!(
            errors.len() == 7 && errors[0].contains("the link to HDMI-A-1 fails"),
            "{errors:?}"
        );
        assert!(
            errors.iter().all(|words| *words == errors[0]),
            "a constant message is logged once"
        );
        // Each picture tries again, so that another cable solves it.
        link.keep(&mut display).unwrap_err();
        assert_eq!((link.keep(&mut display).ok(), display.look), (Some(false), WELL));
    }

    #[test]
    fn a_missing_cable_is_an_error_and_the_mode_is_set_once_when_it_is_back() {
        let (mut link, mut display) = (Link::default(), fake());
        (display.look.plugged_in, display.shows) = (false, false);
        assert!(
            link.keep(&mut display)
                .is_err_and(|e| e.to_string().contains("nothing is plugged into HDMI-A-1"))
        );
        assert_eq!(pictures(&mut link, &mut display), 0);
        display.look.plugged_in = true;
        assert_eq!(pictures(&mut link, &mut display), 1);
        assert!(display.shows, "an equal mode was committed");
    }

    #[test]
    fn a_display_in_use_gives_a_constant_error_and_is_lit_once_when_released() {
        let (mut link, mut display) = (Link::default(), fake());
        display.taken = true;
        link.lose();
        let errors: Vec<String> =
            (0..5).map(|_| link.keep(&mut display).unwrap_err().to_string()).collect();
        assert!(
            errors[0].contains("the panel is in use: another program drives the display"),
            "{errors:?}"
        );
        assert!(
            errors.iter().all(|words| *words == errors[0]),
            "a constant message is logged once"
        );
        display.taken = false;
        assert_eq!(pictures(&mut link, &mut display), 1);
    }
}
