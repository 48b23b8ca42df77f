//! Keeps an iteration by captures from diverging.
//!
//! The step length is bounded by the measured ‖K‖, but the rig may have changed since, and
//! flip–FC–flip over too large patches is no adjoint. When the residual of a picture's photograph
//! exceeds the least one so far by a quarter, the iteration returns to the best picture and halves
//! the step length.

use crate::frame::{Frame, Work};

/// Ratio of the residual to the least one so far above which the iteration diverges. Guess: noise
/// and momentum change the residual by a few per cent, too long a step doubles it within a few
/// iterations.
const DIVERGED: f32 = 1.25;

/// The step length and the best picture so far.
#[derive(Debug, Clone)]
pub(super) struct Brake {
    step: f32,
    least: f32,
    best: Option<Frame<Work>>,
}

impl Brake {
    pub(super) fn new() -> Self {
        Brake { step: 1.0, least: f32::INFINITY, best: None }
    }

    /// Factor on the step length, at most 1.
    pub(super) fn step(&self) -> f32 {
        self.step
    }

    /// Whether the iteration diverged at `picture`, by its optical `residual`. If so, `picture` is
    /// reset to the best one so far, and the step length is halved.
    pub(super) fn has_diverged(&mut self, residual: f32, picture: &mut Frame<Work>) -> bool {
        if residual < self.least {
            self.least = residual;
            match &mut self.best {
                Some(best) => best.clone_from(picture),
                None => self.best = Some(picture.clone()),
            }
            return false;
        }
        // NaN counts as diverged.
        if residual <= DIVERGED * self.least {
            return false;
        }
        if let Some(best) = &self.best {
            picture.clone_from(best);
        }
        self.step /= 2.0;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    #[test]
    fn a_diverging_iteration_returns_to_its_best_picture_with_half_the_step() {
        let level = |v: f32| Frame::<Work>::filled(Size::new(4, 4), v);
        let mut brake = Brake::new();
        for (residual, expected) in
            [(10.0, false), (8.0, false), (9.0, false), (11.0, true), (f32::NAN, true)]
        {
            let mut picture = level(residual);
            assert_eq!(brake.has_diverged(residual, &mut picture), expected, "{residual}");
            if expected {
                assert_eq!(picture, level(8.0));
            }
        }
        assert_eq!(brake.step(), 0.25);
    }
}
