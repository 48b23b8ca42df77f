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
        target.model.forward(self.channel, &self.point, &mut self.prediction);
    }

    /// Takes a known `prediction` of the point.
    pub(super) fn set_prediction(&mut self, prediction: &Plane) {
        self.prediction.clone_from(prediction);
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
        data_term::scale(&mut self.prediction, observation.weight(c));
        target.model.adjoint(c, &self.prediction, stepped);
        self.hold(stepped);
        let steps = target.norms[c.index()].steps();
        prior.with_scratch(|scratch| {
            prior.shrinkage.scale_levels(stepped, &steps, shift, scratch);
        });
        let stretches = stepped
            .data_mut()
            .par_chunks_mut(STRETCH)
            .zip(self.point.data().par_chunks(STRETCH))
            .zip(self.held.data().par_chunks(STRETCH));
        stretches.for_each(|((step, from), held)| {
            for ((s, y), held) in step.iter_mut().zip(from).zip(held) {
                *s = if *held { *y } else { y - *s };
            }
        });
    }

    /// Zeroes the `gradient` at pixels on a bound of light that it would lead past.
    ///
    /// Step lengths differ by wavelet level, bounds hold by pixel. With a clamp alone such a step
    /// need not descend, however short: dark places of a channel whose finest details hardly pass
    /// the lens fill with stripes. With these pixels held it descends (two-metric projection:
    /// Bertsekas 1982, "Projected Newton methods for optimization problems with simple
    /// constraints").
    fn hold(&mut self, gradient: &mut Plane) {
        let stretches = gradient
            .data_mut()
            .par_chunks_mut(STRETCH)
            .zip(self.point.data().par_chunks(STRETCH))
            .zip(self.held.data_mut().par_chunks_mut(STRETCH));
        stretches.for_each(|((gradient, at), held)| {
            for ((g, &y), held) in gradient.iter_mut().zip(at).zip(held) {
                *held = (y <= 0.0 && *g > 0.0) || (y >= FULL_SCALE && *g < 0.0);
                if *held {
                    *g = 0.0;
                }
            }
        });
    }

    /// Clamps `stepped` to the bounds of light, and moves the point on with momentum.
    pub(super) fn advance(&mut self, stepped: &mut Plane) {
        let stretches = stepped.data_mut().par_chunks_mut(STRETCH);
        stretches
            .for_each(|stretch| stretch.iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE)));
        self.momentum.next(&mut self.point, stepped);
    }
}
