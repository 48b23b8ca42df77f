//! The prior over the channels of a photo: along the axes of its colours, in opponent colours, or
//! each channel for itself.

use std::borrow::Cow;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::Problem;
use super::digital::{ChannelSolve, Colours, Digital};
use super::problem::Target;
use super::wiener::Wiener;
use crate::deconvolution::colour_axis::{AlongAxes, ColourAxes, Thresholds, width_px};
use crate::deconvolution::data_term;
use crate::deconvolution::detail_mask::{DetailMask, NoisyPlane};
use crate::deconvolution::jpeg::AlongLuma;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::opponent::{from_opponent, to_opponent};
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, FULL_SCALE, Frame, Mosaic, Plane, Size, Work};

/// By how much the threshold grows from one level to the next coarser one. Measured; nearly flat.
const GROWTH_PER_LEVEL: f32 = 1.7;

/// Of a colour photo's finest levels so many
const FINEST: usize = 2;
/// are shrunk by at least so many standard deviations of noise. A narrow lens lets fine noise
/// through with the details; by the rule for all levels alone it was sharpened with them. Set on
/// the group of limits of `lab judging`.
const LEAST_NOISES: f32 = 0.45;
/// The same where a faint texture was drawn away by that ([`DetailMask::spared`]). Guess: by as
/// much less as was measured where all was shrunk more.
const LEAST_NOISES_SPARED: f32 = 0.2;
/// Of which noise: that of the data times this power of α, what the lens passes. A power of ½ is
/// what a step adds to a detail, which costs wide lenses 0.2 dB; 1 is the photo's own, which costs
/// narrow ones as much.
const NOISE_POWER: f32 = 0.75;

/// By how much more the two finest levels are shrunk of a photo known at a mosaic's sites, in each
/// opponent colour: nothing but the prior speaks of details that fall between sites, and colours
/// have few of their own. Set on astronaut and coffee.
const SITES_MORE: [[f32; 2]; 3] = [[3.0, 2.0], [10.0, 4.0], [10.0, 4.0]];

/// How the starts along the axes of a colour photo go, one after the other.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Starts {
    count: usize,
    /// Noise-to-signal power at one grey level of noise.
    noise_to_signal: f32,
}

/// What a photo has beyond the axes is mostly noise.
const STARTS: Starts = Starts { count: 2, noise_to_signal: 0.05 };
/// By how much more details are shrunk in these than in a step. Set on astronaut, coffee, rocket
/// and charts in ink, as [`STARTS`].
const START_MORE: f32 = 3.0;

impl Starts {
    /// Of a photo known at a mosaic's sites, for a lens of `width_px`.
    ///
    /// The wider the blur, the less of a scene is finer than the sites are apart, and the more of
    /// what they say may be believed. A Gaussian as wide as the lens lets through exp(−(πσ/2)²) of
    /// the power at the finest wave that sites two pixels apart can tell. What follows from it is
    /// set on astronaut, coffee, rocket and a chart, through small.toml's lens (0.056) and
    /// study.toml's (0.007).
    fn between_sites(width_px: f32) -> Starts {
        let sigma = width_px / (Channel::ALL.len() as f32).sqrt();
        let folded = (-(std::f32::consts::FRAC_PI_2 * sigma).powi(2)).exp().clamp(0.005, 0.1);
        Starts { count: 4, noise_to_signal: 16.0 * folded * folded }
    }
}

/// The weight of each of `levels` levels of details: its threshold for a step of length 1, where
/// the data have `noise`, grey levels, and the lens passes α of a level's power.
fn weights(
    digital: &Digital,
    levels: usize,
    noise: f32,
    passed: impl Fn(usize) -> f32,
) -> Vec<f32> {
    weights_with(LEAST_NOISES, digital, levels, noise, passed)
}

/// The same with another least.
fn weights_with(
    least_noises: f32,
    digital: &Digital,
    levels: usize,
    noise: f32,
    passed: impl Fn(usize) -> f32,
) -> Vec<f32> {
    let of_level = |(level, usual): (usize, f32)| {
        let least = least_noises * noise * passed(level).powf(NOISE_POWER);
        if level < FINEST { usual.max(least) } else { usual }
    };
    usual_weights(digital, levels, noise).enumerate().map(of_level).collect()
}

/// The weights of a channel that is solved for itself.
fn usual_weights(digital: &Digital, levels: usize, noise: f32) -> impl Iterator<Item = f32> {
    let base = digital.strength.threshold(noise);
    (0..levels).map(move |level| base * GROWTH_PER_LEVEL.powi(level as i32))
}

/// The prior over all channels of a photo.
pub(super) struct ColourPrior<'a> {
    pub(super) shrinkage: Shrinkage,
    /// Per solved channel, or per opponent colour: the threshold of each level.
    thresholds: Vec<Vec<f32>>,
    together: bool,
    along: Option<Along<'a>>,
    luma: Option<AlongLuma>,
    mask: Cow<'a, DetailMask>,
    /// For spinning.
    scratch: ShrinkageScratch,
    /// For single shifts; there come to be as many as threads ask at once.
    free: Mutex<Vec<ShrinkageScratch>>,
}

/// The prior along a photo's axes.
struct Along<'a> {
    axes: &'a ColourAxes,
    transforms: AlongAxes,
    /// What is drawn by in a step, see [`Thresholds`].
    weights: Vec<f32>,
    /// Of each of the finest levels the share of its weight that is left where texture is spared.
    spared: Vec<f32>,
    passed: Vec<[f32; 3]>,
    starts: Starts,
}

impl<'a> Along<'a> {
    fn of(axes: &'a ColourAxes, digital: &Digital, target: Target<'a>) -> Along<'a> {
        let Target { problem, model, norms, .. } = target;
        // Along an axis a site says as much as another, whatever its colour.
        let share = |c: Channel| match problem.mosaic {
            Some(_) => Mosaic::pixels_a_site(Channel::Green) / Mosaic::pixels_a_site(c),
            None => 1.0,
        };
        let noise = rms(Channel::ALL.map(|c| problem.solving_noise(c) * share(c).sqrt()));
        let passed = |l: usize| Channel::ALL.map(|c| share(c) * norms[c.index()].at(l));
        let mean =
            |l: usize| Channel::ALL.map(|c| norms[c.index()].at(l)).iter().sum::<f32>() / 3.0;
        let of = |least| weights_with(least, digital, digital.levels, noise, mean);
        let weights = of(LEAST_NOISES);
        let finest = of(LEAST_NOISES_SPARED).into_iter().zip(&weights).take(FINEST);
        Along {
            axes,
            transforms: AlongAxes::new(problem.size(), digital.levels),
            spared: finest.map(|(least, w)| least / w.max(f32::MIN_POSITIVE)).collect(),
            weights,
            passed: (0..digital.levels).map(passed).collect(),
            starts: match problem.mosaic {
                Some(_) => Starts::between_sites(width_px(model.functions())),
                None => STARTS,
            },
        }
    }
}

impl<'a> ColourPrior<'a> {
    pub(super) fn new(digital: &Digital, target: Target<'a>) -> Self {
        let Target { problem, mask, norms, axes, .. } = target;
        let channels = problem.channels.list();
        let together = digital.colours != Colours::Apart && channels.len() == Channel::ALL.len();
        let noise = |c: Channel| problem.noise_of_data(c);
        let along = axes.map(|axes| Along::of(axes, digital, target));
        let norms = |c: Channel| &norms[c.index()];
        let levels_of = |noise: f32, norms: &LevelNorms| -> Vec<f32> {
            let of_level = |(l, weight): (usize, &f32)| weight / norms.at(l);
            let weights: Vec<f32> = match together {
                true => weights(digital, digital.levels, noise, |l| norms.at(l)),
                false => usual_weights(digital, digital.levels, noise).collect(),
            };
            weights.iter().enumerate().map(of_level).collect()
        };
        let thresholds = if together {
            // In opponent colours the channels' steps mix. The threshold goes with the shortest of
            // them.
            let shortest = channels
                .iter()
                .skip(1)
                .fold(norms(channels[0]).clone(), |a, &c| a.or_larger(norms(c)));
            let of_light = levels_of(mean_noise(problem), &shortest);
            let mut all = vec![of_light; channels.len()];
            if problem.mosaic.is_some() {
                for (thresholds, more) in all.iter_mut().zip(SITES_MORE) {
                    thresholds.iter_mut().zip(more).for_each(|(t, more)| *t *= more);
                }
            }
            all
        } else {
            channels.iter().map(|&c| levels_of(noise(c), norms(c))).collect()
        };
        let stated = problem.stated.filter(|_| together && axes.is_none());
        let luma = stated.map(|stated| stated.along_luma(problem.size(), &thresholds[0]));
        let shrinkage =
            super::shrinkage(problem.size(), digital.levels, digital.cycle_spun).in_clusters();
        ColourPrior {
            shrinkage,
            thresholds,
            together,
            along,
            luma,
            mask: Cow::Borrowed(mask),
            scratch: ShrinkageScratch::default(),
            free: Mutex::default(),
        }
    }

    /// Spares from now on the faint textures that are `left` of the photo of `problem`, grey
    /// levels in each channel, by the picture as it is.
    pub(super) fn spare(&mut self, problem: &Problem<'_>, left: &[Plane]) {
        if let Some(along) = &self.along {
            let planes = noisy_planes(problem);
            self.mask = Cow::Owned(self.mask.spared(&planes, left, &along.spared));
        }
    }

    /// Whether textures of the photo of `problem` may be spared: only along axes are its finest
    /// details shrunk more than usual, and only white noise is told from a texture.
    pub(super) fn spares(&self, problem: &Problem<'_>) -> bool {
        self.along.is_some() && problem.white_noise
    }

    /// Lends memory to `work`.
    pub(super) fn lend(&self, work: impl FnOnce(&mut ShrinkageScratch)) {
        // Whatever is in it will do, so a poisoned list is as good as any.
        let free = || self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scratch = free().pop().unwrap_or_default();
        work(&mut scratch);
        free().push(scratch);
    }

    /// Starts from `picture`, several times: its details along the axes, and what Wiener's filter
    /// makes of what the photo of `target` still has beyond that.
    pub(super) fn start(&mut self, target: Target<'_>, picture: Frame<Work>) -> Frame<Work> {
        let count = self.along.as_ref().map_or(0, |along| along.starts.count);
        (0..count).fold(picture, |picture, _| self.start_once(target, picture))
    }

    fn start_once(&mut self, target: Target<'_>, mut picture: Frame<Work>) -> Frame<Work> {
        let Target { problem, model, data, mask, .. } = target;
        let Some(Along { axes, transforms, weights, passed, starts, .. }) = &mut self.along else {
            return picture;
        };
        axes.project(&mut picture, passed, transforms);
        let weights: Vec<f32> = weights.iter().map(|weight| START_MORE * weight).collect();
        let thresholds = Thresholds { weights: &weights, passed, mask };
        transforms.shrink(picture.planes_mut(), axes, thresholds, (0, 0));
        let wiener = Wiener { noise_to_signal: starts.noise_to_signal };
        let light = |v: &mut f32| *v = v.clamp(0.0, FULL_SCALE);
        picture.planes_mut().par_iter_mut().zip(Channel::ALL).for_each(|(plane, c)| {
            plane.data_mut().iter_mut().for_each(light);
            let mut missed = Plane::zeros(problem.size());
            model.forward(c, plane, &mut missed);
            data_term::residual_in_place(&mut missed, data.plane(c), problem.trust.plane(c));
            if let Some(mosaic) = problem.mosaic {
                missed = mosaic.filled(c, &missed);
            }
            plane.add_scaled(-1.0, &wiener.undone(problem, model, c, &missed));
            plane.data_mut().iter_mut().for_each(light);
        });
        picture
    }

    /// Draws the stepped pictures towards the prior, spun or at the shift of the step.
    pub(super) fn apply(&mut self, solves: &mut [ChannelSolve], step: usize, spun: bool) {
        if let Some(along) = &mut self.along {
            let (shift, mask) = (self.shrinkage.shift(step), &*self.mask);
            in_colours(solves, |planes| {
                let Along { axes, transforms, weights, passed, .. } = along;
                let thresholds = Thresholds { weights, passed, mask };
                match spun {
                    true => transforms.shrink_spun(planes, axes, thresholds, step),
                    false => transforms.shrink(planes, axes, thresholds, shift),
                }
            });
            return;
        }
        if let Some(luma) = &mut self.luma {
            let (shift, mask) = (self.shrinkage.shift(step), &*self.mask);
            let shift = (!spun).then_some(shift);
            in_colours(solves, |planes| luma.shrink(planes, mask, (shift, step)));
            return;
        }
        if self.together {
            in_colours(solves, to_opponent);
        }
        if spun {
            // One plane after the other: spinning needs much memory, and keeps all cores busy by
            // itself.
            for (solve, thresholds) in solves.iter_mut().zip(&self.thresholds) {
                self.shrinkage.shrink_everywhere(
                    &mut solve.stepped,
                    thresholds,
                    Some(&*self.mask),
                    step,
                    &mut self.scratch,
                );
            }
        } else {
            let shift = self.shrinkage.shift(step);
            solves.par_iter_mut().zip(&self.thresholds).for_each(|(solve, thresholds)| {
                self.lend(|scratch| {
                    let (plane, mask) = (&mut solve.stepped, Some(&*self.mask));
                    self.shrinkage.shrink_levels(plane, thresholds, mask, shift, scratch);
                });
            });
        }
        if self.together {
            in_colours(solves, from_opponent);
        }
    }
}

/// Applies `change` to the stepped pictures of the three channels.
fn in_colours(solves: &mut [ChannelSolve], change: impl FnOnce(&mut [Plane; 3])) {
    if let [r, g, b] = solves {
        let none = || Plane::zeros(Size::new(0, 0));
        let taken = [r, g, b];
        let mut planes = taken.map(|solve| std::mem::replace(&mut solve.stepped, none()));
        change(&mut planes);
        for (solve, plane) in solves.iter_mut().zip(planes) {
            solve.stepped = plane;
        }
    }
}

/// The channels of `problem`'s photo that are solved, with their noise.
pub(super) fn noisy_planes<'a>(problem: &Problem<'a>) -> Vec<NoisyPlane<'a>> {
    let of = |&c: &Channel| NoisyPlane {
        light: problem.photo.plane(c),
        trust: problem.trust.plane(c),
        noise: problem.photo_noise[c.index()],
        dark_light: problem.dark_light[c.index()],
    };
    problem.channels.list().iter().map(of).collect()
}

/// Root mean square of the channels' noise, grey levels.
pub(super) fn mean_noise(problem: &Problem<'_>) -> f32 {
    let channels = problem.channels.list();
    let power: f32 = channels.iter().map(|&c| problem.noise_of_data(c).powi(2)).sum();
    (power / channels.len() as f32).sqrt()
}

fn rms(values: [f32; 3]) -> f32 {
    (values.iter().map(|v| v * v).sum::<f32>() / 3.0).sqrt()
}
