//! The block-matching stage, which improves a solved picture by alternating data steps and a
//! block-matching filter.
//!
//! Minimises ‖K̂L − B‖²/ν² + ‖L − Z‖²/τ² for L by the lens's local inverse, ν being the photo's
//! noise σ. The next Z is L filtered by [`block_matching`](crate::deconvolution::block_matching)
//! with the noise spectrum of L, and with the previous Z as its guide. τ shrinks from round to
//! round (half-quadratic splitting with a filter as the prior: Venkatakrishnan, Bouman & Wohlberg
//! 2013, "Plug-and-play priors"; Danielyan, Katkovnik & Egiazarian 2012, "BM3D frames and
//! variational image deblurring").

use rayon::prelude::*;

use super::problem::Target;
use super::record::Course;
use super::{About, ResidualOf, Watch};
use crate::deconvolution::block_matching::{BlockNoise, Groups, Passed, Search, filter};
use crate::deconvolution::data_term::{self, NOISE_MIN};
use crate::deconvolution::opponent::{from_opponent, to_opponent};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Work};

/// τ of the first round, in noise σ of the photo: a constant τ loses where there is little noise.
/// Measured, as all below.
const TAU_FIRST: f32 = 20.0;
/// τ of the last round, in noise σ of the photo.
const TAU_LAST: f32 = 6.0;
/// Largest τ, grey levels: the error of details that the lens does not pass is as large as those
/// details, however noisy the photo. A larger τ removes texture as faint as the noise.
pub const TAU_MAX: f32 = 14.0;
/// Share of the lens model's error that counts as noise.
const MODEL_ERROR_SHARE: f32 = 0.5;
/// Factor on the noise that the filter assumes. The guide has less power than the scene, and
/// Wiener's rule with such a guide shrinks too much.
const ASSUMED_NOISE: f32 = 0.5;
/// The search for similar blocks.
const SEARCH: Search = Search { step_px: 4, reach_px: 8, group_max: 16, difference_max: 400.0 };

/// The properties of [`super::digital`] or [`super::hybrid`] with block matching.
pub const ABOUT: About = About { name: "block-matching", starts_from_lens: true };

/// The parameters of the stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blocks {
    /// Rounds of data step and filter.
    pub rounds: u32,
    /// Known error of the lens model in each channel, RMS in grey levels; adds to the photo's
    /// noise.
    pub model_error: [f32; 3],
}

impl Blocks {
    /// Improves `start`, a solution of `target`; records the green channel's residuals in `course`.
    pub(super) fn solve(
        self,
        target: Target<'_>,
        start: Frame<Work>,
        course: &mut Course<'_>,
        watch: &mut Watch<'_>,
    ) -> Frame<Work> {
        let problem = target.problem;
        let observation = problem.observation;
        let channels = observation.channels.list();
        let noise = |c: Channel| observation.pixel_noise(c).max(NOISE_MIN);
        let residual_of = |picture: &Frame<Work>| {
            problem.frame_of(|c| {
                let mut seen = Plane::zeros(problem.size());
                problem.model.forward(c, picture.plane(c), &mut seen);
                let trust = observation.trust.plane(c);
                data_term::residual_in_place(&mut seen, target.data.plane(c), trust);
                seen
            })
        };
        let residual = residual_of(&start);
        let rms = |residual: &Frame<Work>, c: Channel| {
            data_term::rms_over_data(residual.plane(c), observation.trust.plane(c))
        };
        let errors = channels.iter().map(|&c| {
            // A residual above the noise is the model's error.
            let unexplained = rms(&residual, c) * observation.weight(c).sqrt();
            let unexplained = unexplained.max(noise(c));
            (c, unexplained.max(MODEL_ERROR_SHARE * self.model_error[c.index()]))
        });
        let errors: Vec<(Channel, f32)> = errors.collect();
        let passed =
            channels.iter().map(|&c| Passed::of(problem.model.functions(), c)).collect::<Vec<_>>();
        let mut picture = start;
        let mut first = Some(residual);
        for round in 0..self.rounds {
            let done = round as f32 / (self.rounds - 1).max(1) as f32;
            let over_noise = TAU_FIRST * (TAU_LAST / TAU_FIRST).powf(done);
            let tau = |c: Channel| (noise(c) * over_noise).min(TAU_MAX);
            let residual = first.take().unwrap_or_else(|| residual_of(&picture));
            if channels.contains(&Channel::Green) {
                let rms = rms(&residual, Channel::Green);
                watch(&course.step(rms, ResidualOf::Model, 0), None);
            }
            let ratio = |c: Channel| {
                let error = errors.iter().find(|(other, _)| *other == c).map_or(0.0, |(_, e)| *e);
                observation.pixels_a_datum(c) * (error / tau(c)).powi(2)
            };
            let mut uncertain = residual;
            let planes = uncertain.planes_mut().par_iter_mut().zip(Channel::ALL);
            planes.filter(|(_, c)| channels.contains(c)).for_each(|(plane, c)| {
                let residual = std::mem::take(plane);
                *plane = problem.data_step(c, picture.plane(c), residual, ratio(c));
            });
            let noises = passed.iter().zip(&errors).map(|(passed, &(c, error))| {
                let undone = BlockNoise::deconvolved(passed, error.powi(2), tau(c).powi(2));
                undone.scaled(ASSUMED_NOISE).within(problem.model.field().x).masked(target.mask)
            });
            let noises: Vec<BlockNoise<'_>> = noises.collect();
            filter_colours(channels, uncertain, &mut picture, &noises, round as usize);
        }
        picture
    }
}

/// Replaces `guide` by `picture` filtered with it, in opponent colours where all three `channels`
/// are solved.
fn filter_colours(
    channels: &[Channel],
    mut picture: Frame<Work>,
    guide: &mut Frame<Work>,
    noises: &[BlockNoise<'_>],
    turn: usize,
) {
    if let ([r, g, b], 3) = (noises, channels.len()) {
        let (third, half, sixth) = ((1.0f32 / 3.0).sqrt(), 0.5f32.sqrt(), (1.0f32 / 6.0).sqrt());
        let noises = [
            BlockNoise::mixed(&[(third, r), (third, g), (third, b)]),
            BlockNoise::mixed(&[(half, r), (half, b)]),
            BlockNoise::mixed(&[(sixth, r), (2.0 * sixth, g), (sixth, b)]),
        ];
        let mut planes = Channel::ALL.map(|c| std::mem::take(picture.plane_mut(c)));
        let mut guides = Channel::ALL.map(|c| std::mem::take(guide.plane_mut(c)));
        to_opponent(&mut planes);
        to_opponent(&mut guides);
        // Blocks similar in brightness are taken to be similar in colour.
        let groups = Groups::find(&guides[0], SEARCH, turn);
        let [luma, chroma_red, chroma_green] = &mut guides;
        *luma = filter(&groups, &planes[0], luma, &noises[0]);
        // Colours have little detail of their own.
        let groups = groups.thinned();
        *chroma_red = filter(&groups, &planes[1], chroma_red, &noises[1]);
        *chroma_green = filter(&groups, &planes[2], chroma_green, &noises[2]);
        from_opponent(&mut guides);
        for (c, plane) in Channel::ALL.into_iter().zip(guides) {
            *guide.plane_mut(c) = plane;
        }
    } else {
        for (&c, noise) in channels.iter().zip(noises) {
            let groups = Groups::find(guide.plane(c), SEARCH, turn);
            *guide.plane_mut(c) = filter(&groups, picture.plane(c), guide.plane(c), noise);
        }
    }
    for &c in channels {
        guide.plane_mut(c).data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
    }
}
