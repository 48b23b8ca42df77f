//! Show, settle, trigger, see: one capture.

use super::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger};
use crate::config;
use crate::frame::Codes;

/// How long a rig waits, and how often it tries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// From the flip to the trigger.
    pub settle_ms: f64,
    /// From the trigger to the latest moment a frame may come.
    pub deadline_ms: f64,
    /// Exposures of one picture at the most.
    pub exposures_max: u32,
}

impl Timing {
    /// The timing a rig file asks for.
    pub fn of(rig: &config::Rig) -> Timing {
        Timing {
            settle_ms: rig.panel.settle_ms,
            deadline_ms: rig.camera.deadline_ms,
            exposures_max: rig.camera.exposures_max,
        }
    }
}

/// Panel, trigger, camera and clock, bolted down.
pub struct Rig {
    /// The display.
    pub panel: Box<dyn Panel + Send>,
    /// The line that starts an exposure.
    pub trigger: Box<dyn Trigger + Send>,
    /// The image sensor.
    pub camera: Box<dyn Camera + Send>,
    /// The time.
    pub clock: Box<dyn Clock + Send>,
    timing: Timing,
    captures: usize,
    seconds: f64,
    last_sequence: Option<u32>,
}

impl Rig {
    /// A rig of four devices.
    pub fn new(
        panel: Box<dyn Panel + Send>,
        trigger: Box<dyn Trigger + Send>,
        camera: Box<dyn Camera + Send>,
        clock: Box<dyn Clock + Send>,
        timing: Timing,
    ) -> Rig {
        Rig { panel, trigger, camera, clock, timing, captures: 0, seconds: 0.0, last_sequence: None }
    }

    /// Shows `codes`, lets them settle, and returns a frame of them. A frame that does not come, or that is
    /// not of this picture, is shot again, up to [`Timing::exposures_max`] exposures in all.
    ///
    /// # Errors
    /// [`RigError::NoFrame`] or [`RigError::NotThisPicture`] when no exposure brought the picture's frame;
    /// at once when a device is gone or refuses.
    pub fn capture(&mut self, codes: &Codes) -> Result<Exposed, RigError> {
        let begin = self.clock.now();
        let result = self.shoot(codes);
        self.seconds += self.clock.now().0 - begin.0;
        result
    }

    fn shoot(&mut self, codes: &Codes) -> Result<Exposed, RigError> {
        let flip = self.panel.show(codes)?;
        let mut failure = RigError::NoFrame { waited_ms: 0.0 };
        for tries in 1..=self.timing.exposures_max {
            self.clock.wait_until(after(flip.at, self.timing.settle_ms));
            let fired = self.trigger.fire()?;
            self.captures += 1;
            match self.camera.frame(after(fired, self.timing.deadline_ms)) {
                Ok(exposed) => match self.doubt(&exposed, flip, fired) {
                    None => {
                        self.last_sequence = Some(exposed.sequence);
                        return Ok(exposed);
                    }
                    Some(last) => failure = RigError::NotThisPicture { tries, last },
                },
                Err(missing @ RigError::NoFrame { .. }) => failure = missing,
                Err(grave) => return Err(grave),
            }
        }
        Err(failure)
    }

    /// Why `exposed` cannot be a frame of the picture that flipped at `flip` and was shot at `fired`; `None`
    /// when nothing speaks against it. The camera's number and time tell repeated and early frames; a
    /// late panel or a mixed frame shows only in the picture itself, and its marks are to be read here.
    fn doubt(&self, exposed: &Exposed, flip: Flip, fired: Moment) -> Option<String> {
        if self.last_sequence == Some(exposed.sequence) {
            return Some(format!("frame {} a second time", exposed.sequence));
        }
        if exposed.at < flip.at || exposed.at < fired {
            let early_ms = (fired.0 - exposed.at.0) * 1000.0;
            return Some(format!("exposed {early_ms:.1} ms before the trigger"));
        }
        None
    }

    /// Closes and opens the camera again.
    ///
    /// # Errors
    /// [`RigError::Gone`] while it is away.
    pub fn reopen(&mut self) -> Result<(), RigError> {
        self.last_sequence = None;
        self.camera.reopen()
    }

    /// Exposures made so far; those thrown away count too.
    pub fn captures(&self) -> usize {
        self.captures
    }

    /// Seconds all captures took so far, on the rig's clock.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}

fn after(moment: Moment, wait_ms: f64) -> Moment {
    Moment(moment.0 + wait_ms / 1000.0)
}
