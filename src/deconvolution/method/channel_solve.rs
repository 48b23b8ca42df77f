//! One channel of a solve with the lens model: proximal gradient steps with momentum.

use std::borrow::Cow;

use rayon::prelude::*;

use super::Momentum;
use super::colour_prior::ColourPrior;
use super::problem::Target;
use crate::deconvolution::data_term;
use crate::deconvolution::wavelet_shrinkage::ShrinkageScratch;
use crate::frame::{Channel, FULL_SCALE, Plane, STRETCH};

/// State of the solve in one channel.
pub(super) struct ChannelSolve<'a> {
    pub(super) channel: Channel,
    /// The point at which the gradient is taken; borrowed until the first step.
    pub(super) point: Cow<'a, Plane>,
    /// Prediction K̂ of the point; consumed by [`ChannelSolve::descend`].
    pub(super) prediction: Cow<'a, Plane>,
    momentum: Momentum,
    /// RMS of the residual before the step, grey levels; computed for the green channel only.
    pub(super) residual_rms: f32,
}

impl<'a> ChannelSolve<'a> {
    /// Starts at `point` with its `prediction`, which is empty if unknown.
    pub(super) fn new(channel: Channel, point: Cow<'a, Plane>, prediction: Cow<'a, Plane>) -> Self {
        ChannelSolve {
            channel,
            point,
            prediction,
            momentum: Momentum::default(),
            residual_rms: 0.0,
        }
    }

    /// Computes K̂ of the point.
    pub(super) fn predict(&mut self, target: Target<'_>) {
        let mut prediction = Plane::zeros(self.point.size());
        target.problem.model.forward(self.channel, &self.point, &mut prediction);
        self.prediction = Cow::Owned(prediction);
    }

    /// Residual at the point, grey levels; to be called before [`ChannelSolve::descend`].
    pub(super) fn residual(&self, target: Target<'_>) -> Plane {
        let mut residual = Plane::clone(&self.prediction);
        let trust = target.problem.observation.trust.plane(self.channel);
        data_term::residual_in_place(&mut residual, target.data.plane(self.channel), trust);
        residual
    }

    /// Returns the point after a gradient step that has its own length for each wavelet level of a
    /// transform at `shift`.
    pub(super) fn descend(
        &mut self,
        target: Target<'_>,
        prior: &ColourPrior<'_>,
        shift: (usize, usize),
    ) -> Plane {
        let (c, observation) = (self.channel, target.problem.observation);
        let trust = observation.trust.plane(c);
        let mut residual = std::mem::take(&mut self.prediction).into_owned();
        data_term::residual_in_place(&mut residual, target.data.plane(c), trust);
        if c == Channel::Green {
            self.residual_rms = data_term::rms_over_data(&residual, trust);
        }
        residual.scale(observation.weight(c));
        let mut stepped = Plane::zeros(residual.size());
        target.problem.model.adjoint(c, &residual, &mut stepped);
        drop(residual);
        let held = self.hold(&mut stepped);
        let steps = target.norms[c.index()].steps();
        let scratch = &mut ShrinkageScratch::default();
        prior.shrinkage.scale_levels(&mut stepped, &steps, shift, scratch);
        let pixels = (stepped.data_mut(), self.point.data(), held.data()).into_par_iter();
        let pixels = pixels.with_min_len(STRETCH);
        pixels.for_each(|(step, from, held)| *step = if *held { *from } else { from - *step });
        stepped
    }

    /// Zeroes the `gradient` at pixels on a bound of light that it would lead past, and returns
    /// their mask.
    ///
    /// Step lengths differ by wavelet level, bounds hold by pixel. With a clamp alone such a step
    /// need not descend, however short: dark places of a channel whose finest details hardly pass
    /// the lens fill with stripes. With these pixels held it descends (two-metric projection:
    /// Bertsekas 1982, "Projected Newton methods for optimization problems with simple
    /// constraints").
    fn hold(&self, gradient: &mut Plane) -> Plane<bool> {
        let mut held = Plane::zeros(gradient.size());
        let pixels = (gradient.data_mut(), self.point.data(), held.data_mut()).into_par_iter();
        pixels.with_min_len(STRETCH).for_each(|(gradient, &at, held)| {
            *held = (at <= 0.0 && *gradient > 0.0) || (at >= FULL_SCALE && *gradient < 0.0);
            if *held {
                *gradient = 0.0;
            }
        });
        held
    }

    /// Moves the point on from `stepped` with momentum, whose memory is freed before the last step.
    pub(super) fn advance(&mut self, stepped: Plane, is_last: bool) {
        let mut point = match std::mem::take(&mut self.point) {
            Cow::Owned(point) => point,
            // The first step has no momentum and replaces the point.
            Cow::Borrowed(_) => Plane::default(),
        };
        self.momentum.next(&mut point, stepped);
        self.point = Cow::Owned(point);
        if is_last {
            self.momentum = Momentum::default();
        }
    }
}
