//! Keeps an iteration that looks through the lens from running away.
//!
//! A step is bounded by the measured ‖K‖, but the rig may no longer be the one that was measured,
//! and flip–FC–flip over patches too large is no adjoint at all. The light tells: when a picture's
//! photograph is further from the photo than one before it, the iteration goes back to that one and
//! on with half the step.

use crate::frame::{Frame, Work};

/// Residual over the least one so far at which an iteration has turned up. Guess: noise and
/// momentum move it by a few per cent, a step too long doubles it within a few iterations.
const TURNED_UP: f32 = 1.25;

/// The length of the steps, and the picture to go back to.
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

    /// What the steps are multiplied by, at most 1.
    pub(super) fn step(&self) -> f32 {
        self.step
    }

    /// Given a picture and the optical residual of it, tells whether the iteration turned up. Then
    /// `picture` is the best one so far again, and steps are half as long.
    pub(super) fn turned_up(&mut self, residual: f32, picture: &mut Frame<Work>) -> bool {
        if residual < self.least {
            self.least = residual;
            match &mut self.best {
                Some(best) => best.clone_from(picture),
                None => self.best = Some(picture.clone()),
            }
            return false;
        }
        // Not a number is past every limit.
        if residual <= TURNED_UP * self.least {
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
    fn a_runaway_goes_back_to_its_best_with_half_the_step() {
        let level = |v: f32| Frame::<Work>::filled(Size::new(4, 4), v);
        let mut brake = Brake::new();
        for (residual, expected) in
            [(10.0, false), (8.0, false), (9.0, false), (11.0, true), (f32::NAN, true)]
        {
            let mut picture = level(residual);
            assert_eq!(brake.turned_up(residual, &mut picture), expected, "{residual}");
            if expected {
                assert_eq!(picture, level(8.0));
            }
        }
        assert_eq!(brake.step(), 0.25);
    }
}
