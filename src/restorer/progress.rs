//! The progress of a restoration, from the steps and captures of its method.

use super::Progress;
use crate::deconvolution::method::{Method, Step};
use crate::pipeline::Setting;

/// Progress after the first solve and its capture, 0..1; most photos need no more.
const FIRST_SHARE: f32 = 0.8;
/// Largest progress before the result is judged.
const UNJUDGED_MAX: f32 = 0.99;

/// The progress before any step.
pub(super) const STARTED: Progress = Progress { done: 0.0, doing: "solving", captures: 0 };

#[derive(Debug, Clone)]
pub(super) struct ProgressCounter {
    /// Steps of the first solve and its capture; 0 for a method that solves by captures alone.
    first_steps: f32,
    /// Steps of all corrections with their captures.
    more_steps: f32,
    captures_max: f32,
    steps: f32,
    shown: Progress,
}

impl ProgressCounter {
    /// Creates the counter for `method` with `setting`. Progress is measured in steps if the method
    /// starts from the lens model, else in captures.
    pub(super) fn new(setting: &Setting, method: &dyn Method) -> Self {
        let captures_max = method.captures_max() as f32;
        let starts_from_lens = method.about().starts_from_lens;
        ProgressCounter {
            first_steps: if starts_from_lens { setting.steps as f32 + 1.0 } else { 0.0 },
            more_steps: captures_max.max(1.0) * (1 + setting.correction_steps) as f32,
            captures_max,
            steps: 0.0,
            shown: STARTED,
        }
    }

    /// The progress after `step`.
    pub(super) fn count(&mut self, step: &Step) -> Progress {
        self.steps += 1.0;
        let captures = self.shown.captures.max(step.captures as usize);
        let share = match self.first_steps {
            0.0 => captures as f32 / self.captures_max,
            first if self.steps <= first => FIRST_SHARE * self.steps / first,
            first => FIRST_SHARE + (1.0 - FIRST_SHARE) * (self.steps - first) / self.more_steps,
        };
        let doing = if step.captures > 0 { "showing and seeing" } else { self.shown.doing };
        let done = self.shown.done.max(share.min(UNJUDGED_MAX));
        self.shown = Progress { done, doing, captures };
        self.shown
    }
}
