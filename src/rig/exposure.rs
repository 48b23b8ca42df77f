//! Show, settle, trigger, see, and prove that the frame is the picture's own: one capture, or many
//! overlapped.
//!
//! No latency is trusted. The camera's frame counter and clock tell repeated and early frames; what
//! they cannot tell (a late panel, a torn frame, a buffer handed out twice with a new number) the
//! frame mark does, on rigs that have room for one. Waiting times decide how fast a rig is, never
//! whether its frames are right.

use super::frame_mark::{FrameMarks, MarkPlace, MarkReading, MarkShares};
use super::mark_search::find_marks;
use super::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger};
use crate::config;
use crate::frame::Codes;
use crate::remedy::{Remediable, Remedy};

/// How long a rig waits, and how often it tries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// From the flip to the trigger.
    pub settle_ms: f64,
    /// From the flip to the first change on the panel, at the least.
    pub latency_ms: f64,
    /// Exposure time.
    pub exposure_ms: f64,
    /// From the trigger to the latest moment a frame may come.
    pub deadline_ms: f64,
    /// Exposures of one picture at the most.
    pub exposures_max: u32,
}

impl Timing {
    /// The timing a rig file asks for.
    pub fn of(rig: &config::RigFile) -> Timing {
        Timing {
            settle_ms: rig.panel.settle_ms,
            latency_ms: rig.panel.latency_ms.unwrap_or(0.0),
            exposure_ms: rig.camera.exposure_ms,
            deadline_ms: rig.camera.deadline_ms,
            exposures_max: rig.camera.exposures_max,
        }
    }
}

/// With a mark as proof, a camera's stamp may be this much too early: drivers of USB cameras
/// estimate it (guess).
const STAMP_ERROR_MS: f64 = 2.0;

/// Frames that were not what was asked for, by kind, since the rig was opened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rejected {
    /// None came in time.
    pub missing: u64,
    /// The camera's counter did not move.
    pub repeated: u64,
    /// Taken before the trigger, by the camera's clock.
    pub early: u64,
    /// Marked as another picture.
    pub another: u64,
    /// Marked as parts of two pictures.
    pub mixed: u64,
    /// Without a readable mark.
    pub unmarked: u64,
}

impl Rejected {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.missing + self.repeated + self.early + self.another + self.mixed + self.unmarked
    }
}

/// An exposure on its way.
#[derive(Debug, Clone, Copy)]
struct ExposureUnderWay {
    index: usize,
    flip: Flip,
    fired: Moment,
    /// The mark shown, on a rig with marks.
    number: u8,
    /// What the picture has of that mark by itself, where it has vanished since.
    vanished: Option<MarkShares>,
}

/// Panel, trigger, camera and clock, bolted down.
pub struct Devices {
    /// The display.
    pub panel: Box<dyn Panel + Send>,
    /// The line that starts an exposure.
    pub trigger: Box<dyn Trigger + Send>,
    /// The image sensor.
    pub camera: Box<dyn Camera + Send>,
    /// The time.
    pub clock: Box<dyn Clock + Send>,
    /// How long to wait, how often to try.
    pub timing: Timing,
    marks: Option<FrameMarks>,
    number: u8,
    /// The picture with its mark painted in; kept, so that no capture allocates a panel's worth.
    marked: Codes,
    rejected: Rejected,
    captures: usize,
    seconds: f64,
    last_sequence: Option<u32>,
    /// How long exposures are against the rig file's.
    exposure_times: f64,
}

impl Devices {
    /// A rig of four devices, without marks as yet.
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

    /// Makes exposures `times` as long as the rig file says, until it is called again; false where
    /// this camera's exposure cannot be set.
    ///
    /// # Errors
    /// When the camera does not take it.
    pub fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        let can = self.camera.expose_times(times)?;
        if can {
            let longer_ms = self.timing.exposure_ms * (times / self.exposure_times - 1.0);
            self.timing.exposure_ms += longer_ms;
            self.timing.deadline_ms += longer_ms;
            self.exposure_times = times;
        }
        Ok(can)
    }

    /// Makes counts `times` what the rig file's gain makes of the same light, until it is called
    /// again; how many times it is, or `None` where this camera's gain cannot be set. Noise that
    /// was measured is of the rig file's gain: [`super::shoot::SiteNoise::amplified`].
    ///
    /// # Errors
    /// When the camera does not take it.
    pub fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        self.camera.amplify_times(times)
    }

    /// Finds the places of the frame marks by some thirty captures; from then on every frame is
    /// proven.
    ///
    /// # Errors
    /// [`RigError::NoMarks`] when the panel is not in view; else as [`Devices::capture`].
    pub fn find_marks(&mut self, place: MarkPlace) -> Result<(), RigError> {
        self.marks = None;
        let panel = self.panel.size();
        let marks = find_marks(place, panel, &mut |codes| {
            self.capture(codes).map(|exposed| exposed.counts)
        })?;
        self.marks = Some(marks);
        Ok(())
    }

    /// Whether frames are proven by marks.
    pub fn has_marks(&self) -> bool {
        self.marks.is_some()
    }

    /// Shows `codes`, lets them settle, and returns a frame of them. A frame that does not come, or
    /// that is not of this picture, is shot again, up to [`Timing::exposures_max`] exposures in
    /// all. Where marks vanish, the frame is of a second exposure without them.
    ///
    /// # Errors
    /// [`RigError::NoFrame`] or [`RigError::NotThisPicture`] when no exposure brought the picture's
    /// frame; at once when a device is gone or refuses.
    pub fn capture(&mut self, codes: &Codes) -> Result<Exposed, RigError> {
        let begin = self.clock.now();
        let result = self.shoot(codes).and_then(|exposed| self.bared(exposed, codes));
        self.seconds += self.clock.now().0 - begin.0;
        result
    }

    /// [`Devices::capture`] of a panel that may not be in view: no mark is painted or asked for.
    ///
    /// # Errors
    /// As [`Devices::capture`].
    pub fn capture_unproven(&mut self, codes: &Codes) -> Result<Exposed, RigError> {
        let marks = self.marks.take();
        let outcome = self.capture(codes);
        self.marks = marks;
        outcome
    }

    /// Exposes what is before the lens, nothing shown: the photo itself. Frames from before the
    /// trigger are passed over; a frame that does not come is shot again, up to
    /// [`Timing::exposures_max`] exposures in all.
    ///
    /// # Errors
    /// As [`Devices::capture`].
    pub fn expose(&mut self) -> Result<Exposed, RigError> {
        // No panel is in view, or none that shows a mark.
        let marks = self.marks.take();
        let mut outcome = Err(RigError::NoFrame { waited_ms: 0.0 });
        for _ in 0..self.timing.exposures_max {
            outcome = self.trigger.fire().and_then(|fired| {
                self.captures += 1;
                let flip = Flip { at: fired, vblank: 0 };
                self.receive(&ExposureUnderWay { index: 0, flip, fired, number: 0, vanished: None })
            });
            let again = matches!(&outcome, Err(error) if error.remedy() == Remedy::ShootAgain);
            if !again {
                break;
            }
        }
        self.marks = marks;
        outcome
    }

    /// Captures pictures that are all known beforehand, and hands `take` each one's frame by its
    /// index, not necessarily in order. While one frame is exposed and read out, the next picture
    /// is already on its way to the panel, unless marks vanish. A frame that is not its picture's
    /// is shot again at the end.
    ///
    /// # Errors
    /// As [`Devices::capture`], for the first picture that cannot be had.
    pub fn capture_all(
        &mut self,
        pictures: &[&Codes],
        take: &mut dyn FnMut(usize, Exposed),
    ) -> Result<(), RigError> {
        if self.marks.as_ref().is_some_and(FrameMarks::vanish) {
            for (index, codes) in pictures.iter().enumerate() {
                take(index, self.capture(codes)?);
            }
            return Ok(());
        }
        let begin = self.clock.now();
        let result = self.shoot_all(pictures, take);
        self.seconds += self.clock.now().0 - begin.0;
        result
    }

    /// In place of `exposed`, which shows `codes` under a mark, a frame of them alone where marks
    /// vanish: one that comes later, and has nothing left of the mark, is of nothing else.
    fn bared(&mut self, exposed: Exposed, codes: &Codes) -> Result<Exposed, RigError> {
        let Some(marks) = self.marks.as_ref().filter(|marks| marks.vanish()) else {
            return Ok(exposed);
        };
        let (number, own) = (self.number, marks.own_shares(codes, self.number));
        self.camera.give_back(exposed.counts);
        let flip = self.panel.show(codes)?;
        self.shot(flip, number, Some(own))
    }

    fn shoot(&mut self, codes: &Codes) -> Result<Exposed, RigError> {
        let (flip, number) = self.show(codes)?;
        self.shot(flip, number, None)
    }

    /// Exposes what is shown since `flip` until its frame comes.
    fn shot(
        &mut self,
        flip: Flip,
        number: u8,
        vanished: Option<MarkShares>,
    ) -> Result<Exposed, RigError> {
        let mut failure = RigError::NoFrame { waited_ms: 0.0 };
        for tries in 1..=self.timing.exposures_max {
            let shot = ExposureUnderWay { vanished, ..self.fire(0, flip, number)? };
            match self.receive(&shot) {
                Err(RigError::NotThisPicture { last, .. }) => {
                    failure = RigError::NotThisPicture { tries, last }
                }
                Err(missing @ RigError::NoFrame { .. }) => failure = missing,
                outcome => return outcome,
            }
        }
        Err(failure)
    }

    fn shoot_all(
        &mut self,
        pictures: &[&Codes],
        take: &mut dyn FnMut(usize, Exposed),
    ) -> Result<(), RigError> {
        let mut on_its_way: Option<ExposureUnderWay> = None;
        let mut again = Vec::new();
        for index in 0..=pictures.len() {
            let next = match pictures.get(index) {
                Some(codes) => {
                    if let Some(shot) = on_its_way {
                        // The new picture must not be seen before this exposure ends.
                        let free_ms = self.timing.exposure_ms - self.timing.latency_ms;
                        self.clock.wait_until(after(shot.fired, free_ms.max(0.0)));
                    }
                    let (flip, number) = self.show(codes)?;
                    Some(self.fire(index, flip, number)?)
                }
                None => None,
            };
            if let Some(shot) = std::mem::replace(&mut on_its_way, next) {
                match self.receive(&shot) {
                    Ok(exposed) => take(shot.index, exposed),
                    Err(RigError::NotThisPicture { .. } | RigError::NoFrame { .. }) => {
                        again.push(shot.index);
                    }
                    Err(grave) => return Err(grave),
                }
            }
        }
        for index in again {
            let exposed = self.shoot(pictures[index])?;
            take(index, exposed);
        }
        Ok(())
    }

    /// Puts a picture up under the next number.
    fn show(&mut self, codes: &Codes) -> Result<(Flip, u8), RigError> {
        let Some(marks) = &self.marks else { return Ok((self.panel.show(codes)?, 0)) };
        self.number = self.number.wrapping_add(1);
        for (to, from) in self.marked.planes_mut().iter_mut().zip(codes.planes()) {
            if to.size() != from.size() {
                // The panel refuses it in its own words.
                return Ok((self.panel.show(codes)?, self.number));
            }
            to.data_mut().copy_from_slice(from.data());
        }
        marks.paint(&mut self.marked, self.number);
        Ok((self.panel.show(&self.marked)?, self.number))
    }

    /// Triggers once the picture has settled.
    fn fire(&mut self, index: usize, flip: Flip, number: u8) -> Result<ExposureUnderWay, RigError> {
        self.clock.wait_until(after(flip.at, self.timing.settle_ms));
        let fired = self.trigger.fire()?;
        self.captures += 1;
        Ok(ExposureUnderWay { index, flip, fired, number, vanished: None })
    }

    /// The frame of `shot`. Frames of the past are passed over until its deadline; the first one
    /// that can be its own decides.
    fn receive(&mut self, shot: &ExposureUnderWay) -> Result<Exposed, RigError> {
        let deadline = after(shot.fired, self.timing.deadline_ms);
        let mut passed_over = None;
        loop {
            let exposed = match self.camera.frame(deadline) {
                Err(missing @ RigError::NoFrame { .. }) => {
                    self.rejected.missing += 1;
                    return Err(match passed_over {
                        Some(last) => RigError::NotThisPicture { tries: 1, last },
                        None => missing,
                    });
                }
                outcome => outcome?,
            };
            if self.last_sequence.replace(exposed.sequence) == Some(exposed.sequence) {
                self.rejected.repeated += 1;
                passed_over = Some(format!("frame {} a second time", exposed.sequence));
                self.camera.give_back(exposed.counts);
                continue;
            }
            let grace_s = if self.marks.is_some() { STAMP_ERROR_MS / 1e3 } else { 0.0 };
            if exposed.at.0 + grace_s < shot.fired.0.max(shot.flip.at.0) {
                self.rejected.early += 1;
                let early_ms = (shot.fired.0 - exposed.at.0) * 1e3;
                passed_over = Some(format!("exposed {early_ms:.1} ms before the trigger"));
                self.camera.give_back(exposed.counts);
                continue;
            }
            // A late frame of an earlier trigger is followed by the right one: fired again now, the
            // rig would be one frame behind for ever.
            let Some(last) = self.doubt(&exposed, shot) else { return Ok(exposed) };
            passed_over = Some(last);
            self.camera.give_back(exposed.counts);
        }
    }

    /// What the mark says against the frame; `None` when nothing.
    fn doubt(&mut self, exposed: &Exposed, shot: &ExposureUnderWay) -> Option<String> {
        let marks = self.marks.as_ref()?;
        if let Some(own) = &shot.vanished {
            if marks.is_gone(&exposed.counts, shot.number, own) {
                return None;
            }
            self.rejected.another += 1;
            return Some("a mark that should be gone".to_owned());
        }
        let reading = marks.read(&exposed.counts);
        match reading {
            MarkReading::Number(number) if number == shot.number => return None,
            MarkReading::Number(_) => self.rejected.another += 1,
            MarkReading::Mixed => self.rejected.mixed += 1,
            MarkReading::Nothing => self.rejected.unmarked += 1,
        }
        Some(format!("{reading}, wanted number {}", shot.number))
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

    /// Frames thrown away so far, by kind.
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
