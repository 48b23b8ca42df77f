//! The record of a solve: residual, captures and seconds of each iteration.

use serde::{Deserialize, Serialize};

use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::frame::{Frame, Work};

/// Callback after each step, with its record and, if the method has it at hand, the current
/// picture. It reports progress, and proves to a watchdog that a long solve is alive.
pub type Watch<'a> = dyn FnMut(&Step, Option<&Frame<Work>>) + 'a;

/// Maximum number of recorded steps; of a longer run the first ones are kept.
pub(super) const STEPS_MAX: usize = 256;

/// Kind of residual that a step reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResidualOf {
    /// RMS(FC(L) − B), by a capture.
    Optics,
    /// RMS(K̂L − B), by the lens model.
    Model,
}

/// One iteration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Number of the iteration, from 1.
    pub iteration: u32,
    /// RMS residual *before* the step over the pixels with data of the green channel, grey levels.
    pub residual: f32,
    /// The kind of `residual`.
    pub of: ResidualOf,
    /// Captures of this photo so far.
    pub captures: u32,
    /// Seconds since the start of the method, computing and captures, on the caller's stopwatch.
    pub seconds: f64,
}

/// The steps of one photo, with a fixed capacity.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct IterationRecord {
    steps: heapless::Vec<Step, STEPS_MAX>,
}

impl IterationRecord {
    /// Adds `step`; beyond [`STEPS_MAX`] it is dropped.
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

/// The record of a running solve: numbers and times its steps.
pub(super) struct Course<'a> {
    stopwatch: Seconds<'a>,
    begun: f64,
    /// Number of captures before the solve.
    pub(super) captures_before: usize,
    iterations: u32,
    pub(super) record: IterationRecord,
}

impl<'a> Course<'a> {
    /// Starts the record of a solve by the model alone.
    pub(super) fn new(stopwatch: Seconds<'a>) -> Self {
        let record = IterationRecord::default();
        Course { stopwatch, begun: stopwatch(), captures_before: 0, iterations: 0, record }
    }

    /// Starts the record of a solve that counts the captures of `optics` from now on.
    pub(super) fn by(stopwatch: Seconds<'a>, optics: &dyn ForwardConvolution) -> Self {
        Course { captures_before: optics.captures(), ..Course::new(stopwatch) }
    }

    /// Seconds since the start.
    pub(super) fn seconds(&self) -> f64 {
        (self.stopwatch)() - self.begun
    }

    /// Records a step, where `captures` is the total number of captures by the optics.
    pub(super) fn step(&mut self, residual: f32, of: ResidualOf, captures: usize) -> Step {
        self.iterations += 1;
        let captures = captures.saturating_sub(self.captures_before) as u32;
        let seconds = self.seconds();
        let step = Step { iteration: self.iterations, residual, of, captures, seconds };
        self.record.push(step);
        step
    }

    /// Appends the steps of an inner solve that started after so many `captures` and `seconds`.
    pub(super) fn extend(&mut self, steps: &IterationRecord, captures: u32, seconds: f64) {
        for step in steps.steps() {
            self.iterations += 1;
            let (iteration, seconds) = (self.iterations, seconds + step.seconds);
            self.record.push(Step { iteration, captures, seconds, ..*step });
        }
    }
}
