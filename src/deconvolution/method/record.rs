//! What happened in each iteration: residual, captures, seconds.

use serde::{Deserialize, Serialize};

use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::frame::{Frame, Work};

/// Called after each step with the step's record and, where the method has it at hand, the picture
/// as it is now. Whoever looks after the program knows by it that a long solve is alive.
pub type Watch<'a> = dyn FnMut(&Step, Option<&Frame<Work>>) + 'a;

/// Steps kept; a longer run keeps its first ones.
pub(super) const STEPS_MAX: usize = 256;

/// Which residual a step reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResidualOf {
    /// RMS(FC(L) − B): what the light says.
    Optics,
    /// RMS(K̂L − B): what the lens model says.
    Model,
}

/// One iteration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// 1 for the first.
    pub iteration: u32,
    /// Root mean square over the pixels with data, green channel, grey levels, *before* the step.
    pub residual: f32,
    /// Which residual that is.
    pub of: ResidualOf,
    /// Captures made for this photo so far.
    pub captures: u32,
    /// Seconds since the method began, computing and captures on the caller's stopwatch.
    pub seconds: f64,
}

/// The steps of one photo, in fixed room.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct IterationRecord {
    steps: heapless::Vec<Step, STEPS_MAX>,
}

impl IterationRecord {
    /// Adds a step; past [`STEPS_MAX`] it is dropped.
    pub fn push(&mut self, step: Step) {
        // A full record loses late steps, whose residuals hardly differ, and never allocates.
        let _ = self.steps.push(step);
    }

    /// The steps, first to last.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }
}

/// The caller's clock.
type Seconds<'a> = &'a (dyn Fn() -> f64 + Sync);

/// The record of a solve under way, which numbers and times its steps.
pub(super) struct Course<'a> {
    stopwatch: Seconds<'a>,
    begun: f64,
    /// Captures that were made before, or do not count.
    pub(super) captures_before: usize,
    iterations: u32,
    pub(super) record: IterationRecord,
}

impl<'a> Course<'a> {
    /// A solve that begins now, by the model alone.
    pub(super) fn new(stopwatch: Seconds<'a>) -> Self {
        let record = IterationRecord::default();
        Course { stopwatch, begun: stopwatch(), captures_before: 0, iterations: 0, record }
    }

    /// One whose captures are those that `optics` makes from now on.
    pub(super) fn by(stopwatch: Seconds<'a>, optics: &dyn ForwardConvolution) -> Self {
        Course { captures_before: optics.captures(), ..Course::new(stopwatch) }
    }

    /// Seconds since it began.
    pub(super) fn seconds(&self) -> f64 {
        (self.stopwatch)() - self.begun
    }

    /// Takes down a step after so many `captures` of the optics.
    pub(super) fn step(&mut self, residual: f32, of: ResidualOf, captures: usize) -> Step {
        self.iterations += 1;
        let captures = captures.saturating_sub(self.captures_before) as u32;
        let seconds = self.seconds();
        let step = Step { iteration: self.iterations, residual, of, captures, seconds };
        self.record.push(step);
        step
    }

    /// Takes down the steps of a solve within this one, which began after `captures` and `seconds`.
    pub(super) fn extend(&mut self, steps: &IterationRecord, captures: u32, seconds: f64) {
        for step in steps.steps() {
            self.iterations += 1;
            let (iteration, seconds) = (self.iterations, seconds + step.seconds);
            self.record.push(Step { iteration, captures, seconds, ..*step });
        }
    }
}
