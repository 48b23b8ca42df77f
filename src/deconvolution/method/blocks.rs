//! A picture solved further with block matching for the prior: by turns what the photo says and
//! what like blocks say.
//!
//! Minimises ‖K̂L − B‖²/ν² + ‖L − Z‖²/τ² for L by conjugate gradients, ν the photo's noise, then
//! takes for Z what [`block_matching`](crate::deconvolution::block_matching) makes of L, told how
//! uncertain L is at every frequency, with the Z before for its guide; τ shrinks from round to
//! round (half-quadratic splitting with a filter for the prior: Venkatakrishnan, Bouman & Wohlberg
//! 2013, "Plug-and-play priors"; Danielyan, Katkovnik & Egiazarian 2012, "BM3D frames and
//! variational image deblurring").
//!
//! Measured 2026-11-21 on study.toml, no capture, mean SSIM/PSNR of the photographs; wavelets alone
//! have 0.941/32.4:
//!
//! | in place of what is here, six rounds | |
//! |---|---|
//! | as it is | 0.951/33.0 |
//! | a hard threshold for the guide in every round; in the first one only | 0.946/32.7 (eight rounds); 0.948/33.0 |
//! | a hard threshold alone; groups as matrices of low rank | 0.942/32.4; 0.936/32.8 (eight rounds) |
//! | noise taken for white (guide by threshold) | 0.943/32.6 |
//! | alternating directions in place of splitting | 0.940/32.8 |
//! | τ wider where the picture is lively | 0.950/32.9 |
//! | a fifth of the wavelets' picture mixed in | 0.950/32.9 |

use rayon::prelude::*;

use super::{About, IterationRecord, Problem, ResidualOf, Step, Watch};
use crate::deconvolution::block_matching::{BlockNoise, Groups, Passed, Search, filter};
use crate::deconvolution::data_term::{self, NOISE_MIN, SATURATED, TRUSTED};
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::opponent::{from_opponent, to_opponent};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Work};

/// τ of the first and of the last round over the photo's noise. Measured 2026-11-21 on study.toml,
/// two captures, eight rounds, mean SSIM/PSNR of the photographs and of the chart for 12 to 4 and
/// 20 to 6: 0.953/34.2 and 0.951/24.8, 0.953/34.3 and 0.956/25.3. In proportion to the noise, since
/// the same τ for all loses on simulated.toml with half a grey level of noise in green (coffee, no
/// capture, four rounds, 20 to 6, 10 to 3 and 5 to 1.5 grey levels: 0.926/33.8, 0.929/34.2,
/// 0.931/34.2).
const TAU_FIRST: f32 = 20.0;
const TAU_LAST: f32 = 6.0;
/// How much of what the lens model misses counts as noise. Measured 2026-11-21 on study.toml with
/// four captures, mean SSIM/PSNR for 0, 0.5 and 1: with one function for the field and four rounds
/// 0.875/24.8, 0.875/24.8 and (with 12 to 4) 0.884/25.9, where `hybrid` has 0.888/27.0; astronaut
/// with 10 % of glare 0.953/32.9, 0.953/32.9 and 0.951/32.5.
const MISSED_COUNTS: f32 = 0.5;
/// Share of what is uncertain that the filter is told. The guide has less power than the scene, and
/// Wiener's rule with such a guide draws too much. Measured 2026-11-21 on study.toml, no capture,
/// six rounds from 12 to 5, mean SSIM/PSNR for 0.25, 0.4 and 0.6: 0.946/32.9, 0.950/33.0,
/// 0.950/32.9; from 8 to 3 for 0.6, 1 and 1.5: 0.950/32.9, 0.948/32.8, 0.946/32.6.
const TOLD: f32 = 0.5;
/// Steps of conjugate gradients a round; 16 gain less than 0.0002.
const CONJUGATE_STEPS: u32 = 8;
/// How like blocks are looked for. Measured 2026-11-21 as above: reach 16 gains nothing, groups of
/// 8 lose 0.001, of 32 as much; step 3 gains 0.0001 and step 5 loses 0.0002; a limit of 150 or 1200
/// changes less than 0.0002.
const SEARCH: Search = Search { step_px: 4, reach_px: 12, group_max: 16, difference_max: 400.0 };

/// What a method with block matching for its prior is: [`super::digital`] or [`super::hybrid`].
pub const ABOUT: About =
    About { name: "block-matching", starts_from_lens: true, by_patches: false, by_steps: true };

/// How a picture is solved with block matching.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blocks {
    /// Rounds of data and filter.
    pub rounds: u32,
    /// What the lens model is known to miss in each channel, RMS in grey levels; counts as noise of
    /// the photo.
    pub missed: [f32; 3],
}

impl Blocks {
    /// `start` solved further for `data`; the green channel's residuals go to `record`.
    pub(super) fn solve(
        self,
        problem: &Problem<'_>,
        model: &LensModel,
        (data, mask): (&Frame<Work>, &DetailMask),
        start: Frame<Work>,
        record: &mut IterationRecord,
        watch: &mut Watch<'_>,
    ) -> Frame<Work> {
        let begun = (problem.stopwatch)();
        let before = record.steps().last().map_or((0, 0.0), |step| (step.captures, step.seconds));
        let channels = problem.channels.list();
        let noise = |c: Channel| problem.photo_noise[c.index()].max(NOISE_MIN);
        let doubt = channels.par_iter().map(|&c| {
            let mut seen = Plane::zeros(problem.size());
            model.forward(c, start.plane(c), &mut seen);
            let trust = problem.trust.plane(c);
            data_term::residual_in_place(&mut seen, data.plane(c), trust);
            // A residual above the noise is the model's fault.
            let unexplained = data_term::rms_over_data(&seen, trust).max(noise(c));
            (c, unexplained.max(MISSED_COUNTS * self.missed[c.index()]))
        });
        let doubt: Vec<(Channel, f32)> = doubt.collect();
        let passed = channels.iter().map(|&c| Passed::of(model.functions(), c)).collect::<Vec<_>>();
        let mut picture = start;
        for round in 0..self.rounds {
            let done = round as f32 / (self.rounds - 1).max(1) as f32;
            let tau = |c: Channel| noise(c) * TAU_FIRST * (TAU_LAST / TAU_FIRST).powf(done);
            let towards_data = |&(c, doubt): &(Channel, f32)| {
                let ratio = (doubt / tau(c)).powi(2);
                (c, towards_data(problem, model, (c, data.plane(c)), picture.plane(c), ratio))
            };
            let solved: Vec<(Channel, (Plane, f32))> = doubt.par_iter().map(towards_data).collect();
            let mut uncertain = Frame::zeros(problem.size());
            for (c, (plane, residual)) in solved {
                *uncertain.plane_mut(c) = plane;
                if c == Channel::Green {
                    let iteration = record.steps().len() as u32 + 1;
                    let seconds = before.1 + (problem.stopwatch)() - begun;
                    let (of, captures) = (ResidualOf::Model, before.0);
                    let step = Step { iteration, residual, of, captures, seconds };
                    record.push(step);
                    watch(&step, None);
                }
            }
            let noises = passed.iter().zip(&doubt).map(|(passed, &(c, doubt))| {
                let undone = BlockNoise::undone(passed, doubt.powi(2), tau(c).powi(2));
                undone.scaled(TOLD).within(problem.rect.x).masked(mask)
            });
            filter_colours(
                channels,
                uncertain,
                &mut picture,
                &noises.collect::<Vec<_>>(),
                round as usize,
            );
        }
        picture
    }
}

/// `guide` = `picture` filtered with it, in the opponent colours when all three `channels` are
/// solved.
fn filter_colours(
    channels: &[Channel],
    picture: Frame<Work>,
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
        let mut planes = Channel::ALL.map(|c| picture.plane(c).clone());
        drop(picture);
        let mut guides = Channel::ALL.map(|c| guide.plane(c).clone());
        to_opponent(&mut planes);
        to_opponent(&mut guides);
        // What is alike in brightness is taken to be alike in colour, too.
        let groups = Groups::find(&guides[0], SEARCH, turn);
        for ((guide, plane), noise) in guides.iter_mut().zip(&planes).zip(&noises) {
            *guide = filter(&groups, plane, guide, noise);
        }
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

/// argmin ‖K̂L − B‖² + `ratio` ‖L − `near`‖² by conjugate gradients from `near`, and RMS(K̂ near −
/// B).
fn towards_data(
    problem: &Problem<'_>,
    model: &LensModel,
    (c, data): (Channel, &Plane),
    near: &Plane,
    ratio: f32,
) -> (Plane, f32) {
    let trust = problem.trust.plane(c);
    let mut seen = Plane::zeros(near.size());
    model.forward(c, near, &mut seen);
    // A saturated pixel counts while it is predicted too dark.
    let pixels = seen.data().iter().zip(data.data()).zip(trust.data());
    let counts = |((p, b), &t): ((&f32, &f32), &u8)| t == TRUSTED || (t == SATURATED && p < b);
    let counts: Vec<bool> = pixels.map(counts).collect();
    data_term::residual_in_place(&mut seen, data, trust);
    let residual = data_term::rms_over_data(&seen, trust);
    // (KᵀK + ratio) correction = Kᵀ(B − K near).
    let mut left = Plane::zeros(near.size());
    model.adjoint(c, &seen, &mut left);
    left.data_mut().iter_mut().for_each(|v| *v = -*v);
    let (mut picture, mut along, mut turned) = (near.clone(), left.clone(), seen.clone());
    let mut power = left.dot(&left);
    for _ in 0..CONJUGATE_STEPS {
        if power <= f64::from(f32::MIN_POSITIVE) {
            break;
        }
        model.forward(c, &along, &mut seen);
        seen.data_mut()
            .iter_mut()
            .zip(&counts)
            .for_each(|(v, counts)| *v = if *counts { *v } else { 0.0 });
        model.adjoint(c, &seen, &mut turned);
        turned.add_scaled(ratio, &along);
        let step = (power / along.dot(&turned)) as f32;
        picture.add_scaled(step, &along);
        left.add_scaled(-step, &turned);
        let next = left.dot(&left);
        let kept = (next / power) as f32;
        along.data_mut().iter_mut().zip(left.data()).for_each(|(a, l)| *a = l + kept * *a);
        power = next;
    }
    (picture, residual)
}
