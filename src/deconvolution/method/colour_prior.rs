//! The prior over the channels of a photo: along its colour axes, along a JPEG's luma, in opponent
//! colours, or each channel by itself.

use std::borrow::Cow;

use rayon::prelude::*;

use super::problem::Target;
use super::wiener::Wiener;
use crate::deconvolution::colour_axis::{AlongAxes, AxisWeights, ColourAxes, Thresholds, width_px};
use crate::deconvolution::data_term;
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::jpeg::AlongLuma;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::observation::{AxisStarts, Observation};
use crate::deconvolution::opponent::{from_opponent, to_opponent};
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Work};

/// Growth of the threshold from one level to the next coarser one. Measured; nearly flat.
const GROWTH_PER_LEVEL: f32 = 1.7;

/// Number of the finest levels of a colour photo whose thresholds have a minimum: a narrow lens
/// passes fine noise with the details, and without a minimum that noise would be sharpened with
/// them.
const FINEST: usize = 2;
/// Minimum threshold of the finest levels, in noise σ. Set on the group of limits of `lab judging`.
const LEAST_THRESHOLD: f32 = 0.45;
/// Minimum threshold of the finest levels where faint texture is protected
/// ([`DetailMask::protect_texture`]), in noise σ. Guess: smaller by as much as all thresholds could
/// be with little loss.
const LEAST_THRESHOLD_OF_TEXTURE: f32 = 0.2;
/// Exponent of α, the power that the lens passes, in the factor on the σ of [`LEAST_THRESHOLD`]. ½
/// corresponds to the noise that a step adds to a detail, and costs wide lenses 0.2 dB; 1
/// corresponds to the photo's own noise, and costs narrow lenses as much.
const NOISE_EXPONENT: f32 = 0.75;
/// Factor on the thresholds of a step for a start along the axes. Set on astronaut, coffee, rocket
/// and charts in ink.
const START_THRESHOLD: f32 = 3.0;

/// The parameters of the prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PriorSetting {
    /// Soft threshold of each step at one grey level of noise.
    pub(super) strength: f32,
    /// Wavelet levels.
    pub(super) levels: usize,
}

impl PriorSetting {
    /// The threshold of each level for a step of length 1, grey levels, by the rule for all levels;
    /// `noise` is the data's σ.
    fn common_thresholds(&self, noise: f32) -> impl Iterator<Item = f32> {
        let base = super::soft_threshold(self.strength, noise);
        (0..self.levels).map(move |level| base * GROWTH_PER_LEVEL.powi(level as i32))
    }

    /// The [common thresholds](PriorSetting::common_thresholds), but for the [`FINEST`] levels at
    /// least `least` · σ · α^[`NOISE_EXPONENT`], where α = `alpha` is the share of a level's power
    /// that the lens passes.
    fn thresholds(&self, noise: f32, least: f32, alpha: impl Fn(usize) -> f32) -> Vec<f32> {
        let with_least = |(level, common): (usize, f32)| {
            let least = least * noise * alpha(level).powf(NOISE_EXPONENT);
            if level < FINEST { common.max(least) } else { common }
        };
        self.common_thresholds(noise).enumerate().map(with_least).collect()
    }
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
    /// Scratch memory for spinning.
    scratch: ShrinkageScratch,
}

/// The prior along a photo's axes.
struct Along<'a> {
    axes: &'a ColourAxes,
    transforms: AlongAxes,
    /// Thresholds of each level for a step of length 1, see [`Thresholds`].
    weights: Vec<AxisWeights>,
    /// For each of the finest levels, the share of its threshold that applies to protected texture.
    texture_shares: Vec<f32>,
    passed: Vec<[f32; 3]>,
    starts: AxisStarts,
}

impl<'a> Along<'a> {
    fn new(axes: &'a ColourAxes, setting: PriorSetting, target: Target<'a>) -> Along<'a> {
        let Target { problem, norms, .. } = target;
        let observation = problem.observation;
        // A site of any channel counts alike along an axis, relative to green's.
        let weight = |c: Channel| observation.weight(Channel::Green) / observation.weight(c);
        let rms = |noise: [f32; 3]| (noise.iter().map(|v| v * v).sum::<f32>() / 3.0).sqrt();
        // Data of all colours measure the component along the axis, those of one what is off it.
        let noise = rms(observation.noise);
        let pixel_noise = rms(Channel::ALL.map(|c| observation.pixel_noise(c) * weight(c).sqrt()));
        let passed = |l: usize| Channel::ALL.map(|c| weight(c) * norms[c.index()].at(l));
        let alpha =
            |l: usize| Channel::ALL.map(|c| norms[c.index()].at(l)).iter().sum::<f32>() / 3.0;
        let along = setting.thresholds(noise, LEAST_THRESHOLD, alpha);
        let off = setting.thresholds(pixel_noise, LEAST_THRESHOLD, alpha);
        let of_texture = setting.thresholds(noise, LEAST_THRESHOLD_OF_TEXTURE, alpha);
        let finest = of_texture.into_iter().zip(&along).take(FINEST);
        Along {
            axes,
            transforms: AlongAxes::new(problem.size(), setting.levels),
            texture_shares: finest.map(|(least, w)| least / w.max(f32::MIN_POSITIVE)).collect(),
            weights: along
                .into_iter()
                .zip(off)
                .map(|(along, off)| AxisWeights { along, off })
                .collect(),
            passed: (0..setting.levels).map(passed).collect(),
            starts: observation.sampling.axis_starts(width_px(problem.model.functions())),
        }
    }
}

impl<'a> ColourPrior<'a> {
    pub(super) fn new(setting: PriorSetting, target: Target<'a>) -> Self {
        let Target { problem, mask, norms, axes, .. } = target;
        let observation = problem.observation;
        let channels = observation.channels.list();
        let together = channels.len() == Channel::ALL.len();
        let thresholds = match together {
            true => opponent_thresholds(setting, observation, norms),
            false => {
                let own = |&c: &Channel| {
                    let common = setting.common_thresholds(observation.threshold_noise(c));
                    over_norms(common.collect(), &norms[c.index()])
                };
                channels.iter().map(own).collect()
            }
        };
        let luma = (together && axes.is_none())
            .then(|| observation.sampling.luma_prior(problem.size(), &thresholds[0]))
            .flatten();
        ColourPrior {
            shrinkage: Shrinkage::new(problem.size(), setting.levels).in_clusters(),
            thresholds,
            together,
            along: axes.map(|axes| Along::new(axes, setting, target)),
            luma,
            mask: Cow::Borrowed(mask),
            scratch: ShrinkageScratch::default(),
        }
    }

    /// Whether faint textures can be protected: only the prior along axes has thresholds for them,
    /// and only white noise can be distinguished from texture.
    pub(super) fn can_protect_texture(&self, observation: &Observation) -> bool {
        self.along.is_some() && observation.sampling.interpolated().is_none()
    }

    /// Protects from now on the faint textures found in the `residuals` of the solved channels,
    /// grey levels.
    pub(super) fn protect_texture(&mut self, observation: &Observation, residuals: &[Plane]) {
        if let Some(along) = &self.along {
            let planes = observation.noisy_planes();
            self.mask =
                Cow::Owned(self.mask.protect_texture(&planes, residuals, &along.texture_shares));
        }
    }

    /// Refines a start along the axes: repeatedly draws its details to the axes and subtracts its
    /// residual through Wiener's filter.
    pub(super) fn refine_start(&self, target: Target<'_>, picture: &mut Frame<Work>) {
        let Target { problem, data, mask, .. } = target;
        let model = problem.model;
        let Some(Along { axes, transforms, weights, passed, starts, .. }) = &self.along else {
            return;
        };
        let start = |of: &AxisWeights| AxisWeights {
            along: START_THRESHOLD * of.along,
            off: START_THRESHOLD * of.off,
        };
        let weights: Vec<AxisWeights> = weights.iter().map(start).collect();
        let thresholds = Thresholds { weights: &weights, passed, mask };
        let wiener = Wiener { noise_to_signal: starts.noise_to_signal };
        let observation = problem.observation;
        let clamp = |v: &mut f32| *v = v.clamp(0.0, FULL_SCALE);
        for _ in 0..starts.count {
            axes.project(picture, passed, transforms);
            transforms.shrink(picture.planes_mut(), axes, thresholds, (0, 0));
            picture.planes_mut().par_iter_mut().zip(Channel::ALL).for_each(|(plane, c)| {
                plane.data_mut().iter_mut().for_each(clamp);
                let mut residual = Plane::zeros(problem.size());
                model.forward(c, plane, &mut residual);
                let trust = observation.trust.plane(c);
                data_term::residual_in_place(&mut residual, data.plane(c), trust);
                let residual = observation.interpolate(c, residual);
                plane.add_scaled(-1.0, &wiener.filter(observation, model, c, &residual));
                plane.data_mut().iter_mut().for_each(clamp);
            });
        }
    }

    /// Draws the `planes` of the solved channels towards the prior, averaged over shifts if `spun`,
    /// otherwise at the shift of step `step`.
    pub(super) fn apply(&mut self, planes: &mut [Plane], step: usize, spun: bool) {
        let (shift, mask) = (self.shrinkage.shift(step), &*self.mask);
        if let Ok(planes) = <&mut [Plane; 3]>::try_from(&mut *planes) {
            if let Some(Along { axes, transforms, weights, passed, .. }) = &self.along {
                let thresholds = Thresholds { weights, passed, mask };
                match spun {
                    true => transforms.shrink_spun(planes, axes, thresholds, step),
                    false => transforms.shrink(planes, axes, thresholds, shift),
                }
                return;
            }
            if let Some(luma) = &self.luma {
                luma.shrink(planes, mask, ((!spun).then_some(shift), step));
                return;
            }
            if self.together {
                to_opponent(planes);
                self.shrink_each(planes, step, spun);
                from_opponent(planes);
                return;
            }
        }
        self.shrink_each(planes, step, spun);
    }

    /// Shrinks each of `planes` by its own thresholds.
    fn shrink_each(&mut self, planes: &mut [Plane], step: usize, spun: bool) {
        let (shrinkage, mask) = (&self.shrinkage, Some(&*self.mask));
        if spun {
            // One plane after the other: spinning needs much memory, and keeps all cores busy by
            // itself.
            for (plane, thresholds) in planes.iter_mut().zip(&self.thresholds) {
                shrinkage.shrink_everywhere(plane, thresholds, mask, step, &mut self.scratch);
            }
        } else {
            let shift = shrinkage.shift(step);
            planes.par_iter_mut().zip(&self.thresholds).for_each(|(plane, thresholds)| {
                let scratch = &mut ShrinkageScratch::default();
                shrinkage.shrink_levels(plane, thresholds, mask, shift, scratch);
            });
        }
    }
}

/// Thresholds for steps as long as the norms allow: the `weights` of each level over its norm.
fn over_norms(weights: Vec<f32>, norms: &LevelNorms) -> Vec<f32> {
    weights.into_iter().enumerate().map(|(level, weight)| weight / norms.at(level)).collect()
}

/// Thresholds of each opponent colour. An opponent colour mixes the channels' steps; its threshold
/// is that of the shortest one.
fn opponent_thresholds(
    setting: PriorSetting,
    observation: &Observation,
    norms: &[LevelNorms; 3],
) -> Vec<Vec<f32>> {
    let [red, green, blue] = norms;
    let shortest = red.clone().or_larger(green).or_larger(blue);
    let weights = setting.thresholds(observation.mean_noise(), LEAST_THRESHOLD, |l| shortest.at(l));
    let all = over_norms(weights, &shortest);
    let factors = observation.sampling.finest_thresholds();
    let of_colour = |factors: [f32; 2]| {
        let mut thresholds = all.clone();
        thresholds.iter_mut().zip(factors).for_each(|(t, factor)| *t *= factor);
        thresholds
    };
    factors.map(of_colour).into()
}
