//! One channel of a solve with the lens model: proximal gradient steps with momentum.

use rayon::prelude::*;

use super::Momentum;
use super::colour_prior::ColourPrior;
use super::problem::Target;
use crate::deconvolution::data_term;
use crate::frame::{Channel, FULL_SCALE, Plane, STRETCH};

/// The state of one channel.
pub(super) struct ChannelSolve {
    pub(super) channel: Channel,
    /// The point at which the gradient is taken.
    point: Plane,
    /// K̂ of that point, then its residual.
    pub(super) prediction: Plane,
    /// Pixels that a step leaves at a bound of light.
    held: Plane<bool>,
    momentum: Momentum,
    /// RMS of the residual before the step, green channel, grey levels.
    pub(super) residual_rms: f32,
}

impl ChannelSolve {
    /// Starts at the plane of `channel` of `start`.
    pub(super) fn new(channel: Channel, start: &Plane) -> Self {
        ChannelSolve {
            channel,
            point: start.clone(),
            prediction: Plane::zeros(start.size()),
            held: Plane::zeros(start.size()),
            momentum: Momentum::new(start),
            residual_rms: 0.0,
        }
    }

    /// Computes K̂ of the point.
    pub(super) fn predict(&mut self, target: Target<'_>) {
        target.problem.model.forward(self.channel, &self.point, &mut self.prediction);
    }

    /// The residual at the point, grey levels; before [`ChannelSolve::descend`].
    pub(super) fn residual(&self, target: Target<'_>) -> Plane {
        let mut residual = self.prediction.clone();
        let trust = target.problem.observation.trust.plane(self.channel);
        data_term::residual_in_place(&mut residual, target.data.plane(self.channel), trust);
        residual
    }

    /// `stepped` = the point less its gradient, each wavelet level scaled to its own step length;
    /// the levels are those of a transform at `shift`.
    pub(super) fn descend(
        &mut self,
        stepped: &mut Plane,
        target: Target<'_>,
        prior: &ColourPrior<'_>,
        shift: (usize, usize),
    ) {
        let (c, observation) = (self.channel, target.problem.observation);
        let trust = observation.trust.plane(c);
        data_term::residual_in_place(&mut self.prediction, target.data.plane(c), trust);
        if c == Channel::Green {
            self.residual_rms = data_term::rms_over_data(&self.prediction, trust);
        }
        self.prediction.scale(observation.weight(c));
        target.problem.model.adjoint(c, &self.prediction, stepped);
        self.hold(stepped);
        let steps = target.norms[c.index()].steps();
        prior.with_scratch(|scratch| {
            prior.shrinkage.scale_levels(stepped, &steps, shift, scratch);
        });
        let pixels = (stepped.data_mut(), self.point.data(), self.held.data()).into_par_iter();
        let pixels = pixels.with_min_len(STRETCH);
        pixels.for_each(|(step, from, held)| *step = if *held { *from } else { from - *step });
    }

    /// Zeroes the `gradient` at pixels on a bound of light that it would lead past.
    ///
    /// Step lengths differ by wavelet level, bounds hold by pixel. With a clamp alone such a step
    /// need not descend, however short: dark places of a channel whose finest details hardly pass
    /// the lens fill with stripes. With these pixels held it descends (two-metric projection:
    /// Bertsekas 1982, "Projected Newton methods for optimization problems with simple
    /// constraints").
    fn hold(&mut self, gradient: &mut Plane) {
        let pixels = (gradient.data_mut(), self.point.data(), self.held.data_mut()).into_par_iter();
        pixels.with_min_len(STRETCH).for_each(|(gradient, &at, held)| {
            *held = (at <= 0.0 && *gradient > 0.0) || (at >= FULL_SCALE && *gradient < 0.0);
            if *held {
                *gradient = 0.0;
            }
        });
    }

    /// Clamps `stepped` to the bounds of light, and moves the point on with momentum.
    pub(super) fn advance(&mut self, stepped: &mut Plane) {
        let pixels = stepped.data_mut().par_iter_mut().with_min_len(STRETCH);
        pixels.for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
        self.momentum.next(&mut self.point, stepped);
    }
}
