//! Deconvolution with total variation as the prior and the measured lens: a baseline, and the
//! reference solution that results are judged by. No capture.
//!
//! Minimises ½‖K̂L − B‖² + μ TV(L) over 0 ≤ L ≤ 255 by proximal steps with momentum. The proximal
//! point of the isotropic total variation is computed by a few steps on its dual (Beck & Teboulle
//! 2009, "Fast gradient-based algorithms for constrained total variation image denoising and
//! deblurring problems"), which continue from the dual of the last proximal step.

use super::record::Course;
use super::{
    About, IterationRecord, Method, MethodError, Momentum, Problem, ResidualOf, STRENGTH, Solution,
    Watch, soft_threshold,
};
use crate::deconvolution::data_term;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::frame::{Channel, FULL_SCALE, Plane, Size};

/// Dual steps in each proximal step; they continue from those of the last one, so few suffice.
/// Guess.
const DUAL_STEPS: usize = 5;

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TotalVariation {
    /// Proximal steps.
    pub steps: u32,
    /// μ at one grey level of noise, for steps of 1/‖K‖².
    pub strength: f32,
}

impl Default for TotalVariation {
    /// Parameters of the reference solution, the best of the chart of speed against accuracy.
    /// Results are judged by it because it keeps flat areas flat.
    fn default() -> TotalVariation {
        TotalVariation { steps: 40, strength: 3.0 * STRENGTH }
    }
}

/// The method's properties.
pub const ABOUT: About = About { name: "total-variation", starts_from_lens: false };

impl Method for TotalVariation {
    fn about(&self) -> &'static About {
        &ABOUT
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        _optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let solve = |problem: &Problem<'_>, watch: &mut Watch<'_>| {
            problem.solve_by_channel(|c| self.solve_channel(problem, c), watch)
        };
        let first = solve(problem, watch);
        let observation = problem.observation;
        // A JPEG's data depend on the prediction, so it is solved again for those of the first
        // solution.
        let prediction = first.prediction.as_ref();
        let data = prediction.and_then(|of_first| observation.sampling.expected_data(of_first));
        let Some(data) = data else { return Ok(first) };
        let noise = Channel::ALL.map(|c| observation.data_noise(c));
        let observation = observation.with_data(data, noise);
        Ok(solve(&Problem { observation: &observation, ..*problem }, watch))
    }
}

impl TotalVariation {
    /// Solves channel `c` of `problem`; returns its light and the record of its steps.
    fn solve_channel(&self, problem: &Problem<'_>, c: Channel) -> (Plane, IterationRecord) {
        let mut course = Course::new(problem.stopwatch);
        let (observation, model) = (problem.observation, problem.model);
        let (data, trust) = (observation.light.plane(c), observation.trust.plane(c));
        let step = 1.0 / problem.norm_squared[c.index()];
        let weight = step * soft_threshold(self.strength, observation.pixel_noise(c));
        let (mut point, mut stepped) = (data.clone(), data.clone());
        let (mut residual, mut gradient) = (data.clone(), data.clone());
        let mut momentum = Momentum::default();
        let mut dual = Dual::new(data.size());
        for _ in 0..self.steps {
            model.forward(c, &point, &mut residual);
            data_term::residual_in_place(&mut residual, data, trust);
            let rms = data_term::rms_over_data(&residual, trust);
            residual.scale(observation.weight(c));
            model.adjoint(c, &residual, &mut gradient);
            stepped.clone_from(&point);
            stepped.add_scaled(-step, &gradient);
            dual.shrink(&mut stepped, weight);
            stepped.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
            momentum.next(&mut point, stepped.clone());
            course.step(rms, ResidualOf::Model, 0);
        }
        (stepped, course.record)
    }
}

/// The dual variable: one vector a pixel, no longer than 1.
struct Dual {
    across: Plane,
    down: Plane,
}

impl Dual {
    fn new(size: Size) -> Self {
        Dual { across: Plane::zeros(size), down: Plane::zeros(size) }
    }

    /// Replaces `plane` by its proximal point, approximately the minimiser of
    /// ½‖x − plane‖² + `weight` TV(x).
    fn shrink(&mut self, plane: &mut Plane, weight: f32) {
        if weight <= 0.0 {
            return;
        }
        let noisy = plane.clone();
        self.primal(&noisy, weight, plane);
        // The squared norm of the differences is at most 8.
        let step = 1.0 / (8.0 * weight);
        for _ in 0..DUAL_STEPS {
            self.ascend(plane, step);
            self.primal(&noisy, weight, plane);
        }
    }

    /// x = noisy + weight · div p. By rows and without branches, since half of a solution's time is
    /// spent here.
    fn primal(&self, noisy: &Plane, weight: f32, out: &mut Plane) {
        let (width, height) = (noisy.width(), noisy.height());
        let nothing = vec![0.0; width];
        for y in 0..height {
            let (across, down) = (self.across.row(y), self.down.row(y));
            let above = if y > 0 { self.down.row(y - 1) } else { &nothing };
            let (noisy, out) = (noisy.row(y), out.row_mut(y));
            out[0] = noisy[0] + weight * (across[0] + down[0] - above[0]);
            let vertical = down[1..].iter().zip(&above[1..]);
            let horizontal = across[1..].iter().zip(across);
            let all = out[1..].iter_mut().zip(&noisy[1..]).zip(horizontal).zip(vertical);
            for (((out, noisy), (here, left)), (down, up)) in all {
                *out = noisy + weight * (here - left + down - up);
            }
        }
    }

    /// p ← (p + step · ∇x), each vector cut to length 1; differences across the border are zero.
    fn ascend(&mut self, picture: &Plane, step: f32) {
        let (width, height) = (picture.width(), picture.height());
        let climb = |a: &mut f32, d: &mut f32, here: f32, right: f32, below: f32| {
            let (up, along) = (*a + step * (right - here), *d + step * (below - here));
            let length = (up * up + along * along).sqrt().max(1.0);
            (*a, *d) = (up / length, along / length);
        };
        for y in 0..height {
            let (here, below) = (picture.row(y), picture.row((y + 1).min(height - 1)));
            let (across, down) = (self.across.row_mut(y), self.down.row_mut(y));
            let pairs = here.iter().zip(&here[1..]).zip(below);
            for (((here, right), below), (a, d)) in pairs.zip(across.iter_mut().zip(&mut *down)) {
                climb(a, d, *here, *right, *below);
            }
            let last = width - 1;
            climb(&mut across[last], &mut down[last], here[last], here[last], below[last]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrinkage_keeps_an_edge_and_removes_noise() {
        let size = Size::new(40, 30);
        let noisy = Plane::from_fn(size, |x, y| {
            let noise = ((x * 7 + y * 13) % 5) as f32 - 2.0;
            noise + if x < 20 { 50.0 } else { 150.0 }
        });
        let (mut shrunk, mut dual) = (noisy, Dual::new(size));
        let source = shrunk.clone();
        for _ in 0..40 {
            shrunk.clone_from(&source);
            dual.shrink(&mut shrunk, 4.0);
        }
        // A step of 100 between halves 20 wide shrinks by weight/20 on either side; the noise is
        // removed.
        assert!((shrunk.at(10, 15) - 50.2).abs() < 0.3, "{}", shrunk.at(10, 15));
        assert!((shrunk.at(30, 15) - 149.8).abs() < 0.3, "{}", shrunk.at(30, 15));
        assert!((shrunk.at(5, 5) - shrunk.at(6, 6)).abs() < 0.2);
    }
}
