//! What happened in each iteration: residual, captures, seconds.

use serde::{Deserialize, Serialize};

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
