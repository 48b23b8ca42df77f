//! A capture: show a picture, let it settle, trigger, receive a frame and verify its picture.
//!
//! No latency is trusted. The camera's frame counter and clock reveal repeated and early frames. On
//! rigs with frame marks, these reveal the rest: a late panel, a torn frame, a buffer delivered
//! twice under a new number. Waiting times decide how fast a rig is, never whether its frames are
//! right.

use super::frame_mark::{FrameMarks, MarkPlace, MarkReading, MarkShares};
use super::mark_search::find_marks;
use super::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger};
use crate::config::{CameraTable, PanelTable};
use crate::frame::Codes;

/// Waiting times and the number of tries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Wait from flip to trigger.
    pub settle_ms: f64,
    /// Exposure time.
    pub exposure_ms: f64,
    /// Latest arrival of a frame after its trigger.
    pub deadline_ms: f64,
    /// Maximum number of exposures per picture.
    pub exposures_max: u32,
}

impl Timing {
    /// Timing of a rig file.
    pub fn of(panel: &PanelTable, camera: &CameraTable) -> Timing {
        Timing {
            settle_ms: panel.settle_ms,
            exposure_ms: camera.exposure_ms,
            deadline_ms: camera.deadline_ms,
            exposures_max: EXPOSURES_MAX,
        }
    }
}

/// Exposures of one picture before the rig gives up. Guess.
const EXPOSURES_MAX: u32 = 3;
/// Tolerance for early time stamps on rigs whose marks identify frames: drivers of USB cameras only
/// estimate the stamps. Guess.
const STAMP_ERROR_MS: f64 = 2.0;

/// Watch for untriggered frames, plus one exposure: five of a slow camera's 15 frames a second.
const UNPULSED_MS: f64 = 300.0;

/// Explanation of frames that are early each time (raspberrypi/linux, pull request 6010).
const ONE_LATE: &str = ", as each time: kernels before March 2024 deliver the IMX296's frames one \
                        trigger late; update the board";

/// Numbers of frames rejected since the rig was opened, by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rejected {
    /// Frames that did not arrive by the deadline.
    pub missing: u64,
    /// Frames that repeat the frame counter of the frame before.
    pub repeated: u64,
    /// Frames exposed before the trigger, by the camera's clock.
    pub early: u64,
    /// Frames that carry the mark of another picture.
    pub another: u64,
    /// Frames that carry marks of two pictures.
    pub mixed: u64,
    /// Frames without a readable mark.
    pub unmarked: u64,
    /// Frames exposed by a pulse of the wrong length.
    pub mistimed: u64,
}

#[derive(Debug, Clone, Copy)]
struct PendingExposure {
    flip: Flip,
    fired: Moment,
    /// Number of the mark shown; 0 on a rig without marks.
    number: u8,
    /// Likeness of the unmarked picture to that mark, if the frame must show it without the mark.
    vanished: Option<MarkShares>,
}

/// Panel, trigger, camera and clock of a rig.
pub struct Devices {
    /// Display.
    pub panel: Box<dyn Panel + Send>,
    /// Device that starts exposures.
    pub trigger: Box<dyn Trigger + Send>,
    /// Image sensor.
    pub camera: Box<dyn Camera + Send>,
    /// Clock.
    pub clock: Box<dyn Clock + Send>,
    /// Waiting times and the number of tries.
    pub timing: Timing,
    marks: Option<FrameMarks>,
    number: u8,
    /// Buffer for the picture with its mark, reused so that captures allocate nothing.
    marked: Codes,
    rejected: Rejected,
    captures: usize,
    seconds: f64,
    last_sequence: Option<u32>,
    /// Exposure as a multiple of the rig file's.
    exposure_times: f64,
}

impl Devices {
    /// Creates a rig of four devices, without frame marks.
    pub fn new(
        panel: Box<dyn Panel + Send>,
        trigger: Box<dyn Trigger + Send>,
        camera: Box<dyn Camera + Send>,
        clock: Box<dyn Clock + Send>,
        timing: Timing,
    ) -> Devices {
        let marked = Codes::zeros(panel.size());
        Devices {
            panel,
            trigger,
            camera,
            clock,
            timing,
            marks: None,
            number: 0,
            marked,
            rejected: Rejected::default(),
            captures: 0,
            seconds: 0.0,
            last_sequence: None,
            exposure_times: 1.0,
        }
    }

    /// Sets the exposure to `times` the rig file's. Returns false if this camera's exposure cannot
    /// be set.
    pub fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        let is_set = self.camera.expose_times(times)?;
        if is_set {
            self.trigger.expose_times(times);
            let longer_ms = self.timing.exposure_ms * (times / self.exposure_times - 1.0);
            self.timing.exposure_ms += longer_ms;
            self.timing.deadline_ms += longer_ms;
            self.exposure_times = times;
        }
        Ok(is_set)
    }

    /// Checks that a triggered camera delivers no frame while no pulse is sent.
    ///
    /// # Errors
    /// [`RigError::Refused`] if a frame is exposed meanwhile; else those of [`Camera::frame`].
    pub fn refuse_free_running(&mut self) -> Result<(), RigError> {
        let began = self.clock.now();
        let deadline = after(began, UNPULSED_MS + self.timing.exposure_ms);
        loop {
            match self.camera.frame(deadline) {
                Err(RigError::NoFrame { .. }) => return Ok(()),
                Ok(exposed) if exposed.at > began => {
                    let found = "a frame without a trigger pulse: the camera runs free";
                    let allowed = "frames on pulses alone: switch the camera's trigger mode on \
                                   (hardware.md), or write kind = \"free-running\" in \
                                   [hardware.trigger]";
                    return Err(RigError::refused("camera", found, allowed));
                }
                earlier => self.camera.give_back(earlier?.counts),
            }
        }
    }

    /// Fires the trigger. After a pulse of the wrong length, discards its frame and fires again, up
    /// to [`Timing::exposures_max`] pulses in all.
    pub(crate) fn pulse(&mut self) -> Result<Moment, RigError> {
        for _ in 1..self.timing.exposures_max {
            match self.trigger.fire() {
                Err(RigError::PulseLength { .. }) => self.rejected.mistimed += 1,
                outcome => return outcome,
            }
            let deadline = after(self.clock.now(), self.timing.deadline_ms);
            match self.camera.frame(deadline) {
                Ok(exposed) => self.camera.give_back(exposed.counts),
                Err(RigError::NoFrame { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        self.trigger.fire()
    }

    /// Locates the frame marks with about thirty captures; from then on they identify every frame.
    ///
    /// # Errors
    /// [`RigError::NoMarks`] if the panel is not in view; else those of [`Devices::capture`].
    pub fn find_marks(&mut self, place: MarkPlace) -> Result<(), RigError> {
        self.marks = None;
        let panel = self.panel.size();
        let marks = find_marks(place, panel, &mut |codes| {
            self.capture(codes).map(|exposed| exposed.counts)
        })?;
        self.marks = Some(marks);
        Ok(())
    }

    /// Whether marks identify frames.
    pub fn has_marks(&self) -> bool {
        self.marks.is_some()
    }

    /// Shows `codes`, waits until they have settled, and returns a frame that shows them. After a
    /// missing or wrong frame it exposes again, up to [`Timing::exposures_max`] exposures in all.
    /// If marks vanish, the returned frame is of a second exposure without them.
    ///
    /// # Errors
    /// [`RigError::NoFrame`] or [`RigError::NotThisPicture`] if no exposure gave a frame of the
    /// picture; another error at once if a device fails.
    pub fn capture(&mut self, codes: &Codes) -> Result<Exposed, RigError> {
        let begin = self.clock.now();
        let result = self.shoot(codes).and_then(|exposed| self.expose_bare(exposed, codes));
        self.seconds += self.clock.now().0 - begin.0;
        result
    }

    /// Captures as [`Devices::capture`] does, without marks, for a panel that may not be in view.
    pub fn capture_unproven(&mut self, codes: &Codes) -> Result<Exposed, RigError> {
        self.without_marks(|devices| devices.capture(codes))
    }

    /// Takes a photo: exposes without showing a picture. Skips frames from before the trigger, and
    /// exposes again after a missing frame, up to [`Timing::exposures_max`] exposures in all.
    pub fn expose(&mut self) -> Result<Exposed, RigError> {
        let shown_always = Flip { at: Moment(f64::NEG_INFINITY), vblank: 0 };
        self.without_marks(|devices| devices.expose_shown(shown_always, 0, None))
    }

    fn without_marks<T>(&mut self, run: impl FnOnce(&mut Self) -> T) -> T {
        let marks = self.marks.take();
        let outcome = run(self);
        self.marks = marks;
        outcome
    }

    /// If marks vanish, replaces `exposed`, a frame of `codes` with a mark, by one of `codes`
    /// alone. A later frame without the mark can only show `codes`.
    fn expose_bare(&mut self, exposed: Exposed, codes: &Codes) -> Result<Exposed, RigError> {
        let Some(marks) = self.marks.as_ref().filter(|marks| marks.vanish()) else {
            return Ok(exposed);
        };
        let (number, own) = (self.number, marks.own_shares(codes, self.number));
        self.camera.give_back(exposed.counts);
        let flip = self.panel.show(codes)?;
        self.expose_shown(flip, number, Some(own))
    }

    fn shoot(&mut self, codes: &Codes) -> Result<Exposed, RigError> {
        let (flip, number) = self.show(codes)?;
        self.expose_shown(flip, number, None)
    }

    /// Exposes the picture shown since `flip` until its frame arrives.
    fn expose_shown(
        &mut self,
        flip: Flip,
        number: u8,
        vanished: Option<MarkShares>,
    ) -> Result<Exposed, RigError> {
        let mut failure = RigError::NoFrame { waited_ms: 0.0 };
        let early_before = self.rejected.early;
        for tries in 1..=self.timing.exposures_max {
            self.clock.wait_until(after(flip.at, self.timing.settle_ms));
            let fired = self.pulse()?;
            self.captures += 1;
            match self.receive(&PendingExposure { flip, fired, number, vanished }) {
                Err(RigError::NotThisPicture { mut last, .. }) => {
                    let early = self.rejected.early - early_before;
                    // On such a kernel the first trigger after opening gives no frame: hence the 1.
                    if tries > 2 && early + 1 >= u64::from(tries) {
                        last.push_str(ONE_LATE);
                    }
                    failure = RigError::NotThisPicture { tries, last }
                }
                Err(missing @ RigError::NoFrame { .. }) => failure = missing,
                outcome => return outcome,
            }
        }
        Err(failure)
    }

    fn show(&mut self, codes: &Codes) -> Result<(Flip, u8), RigError> {
        let Some(marks) = &self.marks else { return Ok((self.panel.show(codes)?, 0)) };
        self.number = self.number.wrapping_add(1);
        for (to, from) in self.marked.planes_mut().iter_mut().zip(codes.planes()) {
            if to.size() != from.size() {
                // Let the panel report the wrong size.
                return Ok((self.panel.show(codes)?, self.number));
            }
            to.data_mut().copy_from_slice(from.data());
        }
        marks.paint(&mut self.marked, self.number);
        Ok((self.panel.show(&self.marked)?, self.number))
    }

    /// Receives the frame of `pending`, skipping other frames until its deadline.
    fn receive(&mut self, pending: &PendingExposure) -> Result<Exposed, RigError> {
        let deadline = after(pending.fired, self.timing.deadline_ms);
        let mut skipped = None;
        loop {
            let exposed = match self.camera.frame(deadline) {
                Err(missing @ RigError::NoFrame { .. }) => {
                    self.rejected.missing += 1;
                    return Err(match skipped {
                        Some(last) => RigError::NotThisPicture { tries: 1, last },
                        None => missing,
                    });
                }
                outcome => outcome?,
            };
            // After a late frame of an earlier trigger, the right one follows. Another trigger now
            // would leave the rig one frame behind for good.
            let Some(fault) = self.fault(&exposed, pending) else { return Ok(exposed) };
            skipped = Some(fault);
            self.camera.give_back(exposed.counts);
        }
    }

    /// Returns why the frame is not that of `pending`, and counts the fault; `None` if it is.
    fn fault(&mut self, exposed: &Exposed, pending: &PendingExposure) -> Option<String> {
        if self.last_sequence.replace(exposed.sequence) == Some(exposed.sequence) {
            self.rejected.repeated += 1;
            return Some(format!("frame {} a second time", exposed.sequence));
        }
        let grace_s = if self.marks.is_some() { STAMP_ERROR_MS / 1e3 } else { 0.0 };
        if exposed.at.0 + grace_s < pending.fired.0.max(pending.flip.at.0) {
            self.rejected.early += 1;
            let early_ms = (pending.fired.0 - exposed.at.0) * 1e3;
            return Some(format!("exposed {early_ms:.1} ms before the trigger"));
        }
        let marks = self.marks.as_ref()?;
        if let Some(own) = &pending.vanished {
            if marks.is_gone(&exposed.counts, pending.number, own) {
                return None;
            }
            self.rejected.another += 1;
            return Some("a frame that still shows the frame mark after it was removed".to_owned());
        }
        let reading = marks.read(&exposed.counts);
        match reading {
            MarkReading::Number(number) if number == pending.number => return None,
            MarkReading::Number(_) => self.rejected.another += 1,
            MarkReading::Mixed => self.rejected.mixed += 1,
            MarkReading::Nothing => self.rejected.unmarked += 1,
        }
        Some(format!("{reading}, not number {}", pending.number))
    }

    /// Closes and opens the camera again.
    pub fn reopen(&mut self) -> Result<(), RigError> {
        self.last_sequence = None;
        self.camera.reopen()
    }

    /// Number of exposures so far, including those whose frames were rejected.
    pub fn captures(&self) -> usize {
        self.captures
    }

    /// Duration of all captures so far on the rig's clock, in seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Rejected frames so far, by reason.
    pub fn rejected(&self) -> Rejected {
        self.rejected
    }
}

fn after(moment: Moment, wait_ms: f64) -> Moment {
    Moment(moment.0 + wait_ms / 1000.0)
}

#[cfg(test)]
#[path = "exposure_tests.rs"]
mod tests;
#[cfg(test)]
#[path = "trigger_tests.rs"]
mod trigger_tests;
