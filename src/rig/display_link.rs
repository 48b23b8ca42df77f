//! When a display's mode has to be set again: the cable was out, the link must be trained anew,
//! another program had the display. The kernel is behind a trait, for no virtual display has a link
//! that can be lost.
//!
//! The kernel's rule for `link-status`: a link that failed its training is black, and stays so
//! until the mode is set again with the word Good (Linux DRM documentation, "Standard Connector
//! Properties"). A commit by a program that is no longer DRM master is refused with EACCES.

use super::RigError;

/// "Good" in the kernel's enumeration of `link-status`.
const GOOD: u64 = 0;

/// A link that fails this often in a row, each time right after the mode was set again, is told of.
/// Guess.
const TRAININGS_MAX: u32 = 3;

/// What the kernel says of the connector, nothing probed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ConnectorState {
    /// Whether a display is plugged in.
    pub(super) plugged_in: bool,
    /// The property `link-status`, where the driver has it.
    pub(super) link_status: Option<u64>,
}

/// What may be asked of the kernel.
pub(super) trait Display {
    /// The connector's name.
    fn name(&self) -> &str;
    /// A look at the connector.
    fn look(&mut self) -> Result<ConnectorState, RigError>;
    /// Whether a display is plugged in, found out afresh.
    fn probe(&mut self) -> Result<bool, RigError>;
    /// Becomes DRM master, or stays so.
    fn take(&mut self) -> Result<(), RigError>;
    /// Sets the mode.
    fn light(&mut self) -> Result<(), RigError>;
}

/// What is known of the way to one display.
#[derive(Debug, Default)]
pub(super) struct Link {
    /// The mode has to be set before the next picture.
    dark: bool,
    /// Bad links in a row.
    bad: u32,
}

impl Link {
    /// A commit was refused, or no refresh came: the mode has to be set again.
    pub(super) fn lose(&mut self) {
        self.dark = true;
    }

    /// Looks at cable and link, and sets the mode again after a loss; returns whether it did.
    ///
    /// # Errors
    /// [`RigError::Gone`] without a display or with a link that fails again and again; whatever the
    /// kernel has against it, as that another program drives the display.
    pub(super) fn keep(&mut self, display: &mut dyn Display) -> Result<bool, RigError> {
        let look = display.look()?;
        if !look.plugged_in {
            self.dark = true;
            return Err(unplugged(display.name()));
        }
        let bad = look.link_status.is_some_and(|status| status != GOOD);
        self.bad = if bad { self.bad + 1 } else { 0 };
        if !bad && !self.dark {
            return Ok(false);
        }
        self.dark = true;
        // Whoever took the display meanwhile may have given it back.
        display.take()?;
        if !display.probe()? {
            return Err(unplugged(display.name()));
        }
        display.light()?;
        self.dark = false;
        if self.bad > TRAININGS_MAX {
            let name = display.name();
            let what = format!(
                "the link to {name} fails as often as its mode is set; another cable or a lower \
                 mode?"
            );
            return Err(RigError::Gone { device: "panel", what });
        }
        Ok(true)
    }
}

/// Nothing is plugged into the connector called `name`.
pub(super) fn unplugged(name: &str) -> RigError {
    RigError::Gone { device: "panel", what: format!("nothing is plugged into {name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A display that a script does things to.
    struct Fake {
        look: ConnectorState,
        /// Another program is DRM master.
        taken: bool,
        /// The next so many trainings fail.
        failures: u32,
        lit: u32,
    }

    const WELL: ConnectorState = ConnectorState { plugged_in: true, link_status: Some(GOOD) };

    fn fake() -> Fake {
        Fake { look: WELL, taken: false, failures: 0, lit: 0 }
    }

    impl Display for Fake {
        fn name(&self) -> &str {
            "HDMI-A-1"
        }
        fn look(&mut self) -> Result<ConnectorState, RigError> {
            Ok(self.look)
        }
        fn probe(&mut self) -> Result<bool, RigError> {
            Ok(self.look.plugged_in)
        }
        fn take(&mut self) -> Result<(), RigError> {
            let what = "another program drives the display".to_owned();
            if self.taken { Err(RigError::Held { device: "panel", what }) } else { Ok(()) }
        }
        fn light(&mut self) -> Result<(), RigError> {
            assert!(!self.taken, "only a master sets modes");
            self.lit += 1;
            self.look.link_status = self.look.link_status.map(|_| u64::from(self.failures > 0));
            self.failures = self.failures.saturating_sub(1);
            Ok(())
        }
    }

    /// Twenty pictures, then how often the mode was set.
    fn pictures(link: &mut Link, display: &mut Fake) -> u32 {
        let before = display.lit;
        (0..20).for_each(|_| drop(link.keep(display)));
        display.lit - before
    }

    #[test]
    fn a_bad_link_has_its_mode_set_again_once() {
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
    fn a_link_that_fails_a_few_times_heals_and_one_that_always_fails_is_told_of() {
        let (mut link, mut display) = (Link::default(), fake());
        (display.look.link_status, display.failures) = (Some(1), 2);
        let healed: Vec<bool> = (0..20).map(|_| link.keep(&mut display).is_ok()).collect();
        assert!(healed.iter().all(|&ok| ok) && display.lit == 3, "{healed:?} {}", display.lit);
        (display.look.link_status, display.failures) = (Some(1), 10);
        let told: Vec<String> =
            (0..10).filter_map(|_| link.keep(&mut display).err().map(|e| e.to_string())).collect();
        assert!(told.len() == 7 && told[0].contains("the link to HDMI-A-1 fails"), "{told:?}");
        assert!(told.iter().all(|words| *words == told[0]), "the same words: they are logged once");
        // It is tried each time, so that a cable that is changed heals it.
        link.keep(&mut display).unwrap_err();
        assert_eq!((link.keep(&mut display).ok(), display.look), (Some(false), WELL));
    }

    #[test]
    fn a_cable_that_is_out_is_told_of_and_the_mode_set_once_when_it_is_back() {
        let (mut link, mut display) = (Link::default(), fake());
        display.look.plugged_in = false;
        assert!(
            link.keep(&mut display)
                .is_err_and(|e| e.to_string().contains("nothing is plugged into HDMI-A-1"))
        );
        assert_eq!(pictures(&mut link, &mut display), 0);
        display.look.plugged_in = true;
        assert_eq!(pictures(&mut link, &mut display), 1);
    }

    #[test]
    fn a_display_that_another_program_has_is_waited_for_in_the_same_words_and_then_lit_once() {
        let (mut link, mut display) = (Link::default(), fake());
        display.taken = true;
        link.lose();
        let told: Vec<String> =
            (0..5).map(|_| link.keep(&mut display).unwrap_err().to_string()).collect();
        assert!(
            told[0].contains("the panel is held: another program drives the display"),
            "{told:?}"
        );
        assert!(told.iter().all(|words| *words == told[0]), "the same words: they are logged once");
        display.taken = false;
        assert_eq!(pictures(&mut link, &mut display), 1);
    }
}
