//! The lens model alone: what the box does when the camera is unplugged, and a baseline.
//!
//! Minimises ½‖K̂L − B‖² + μ‖W L‖ over 0 ≤ L ≤ 255 by proximal steps with momentum. Five things
//! make it fast and good (measured, see `tests/tables/README.md`):
//!
//! * it starts from Wiener's filter, which costs as much as a few steps and saves eight;
//! * a step of its own for each wavelet level ([`LevelNorms`]): less than half the steps;
//! * details judged in clusters ([`Shrinkage::in_clusters`]);
//! * of a colour photo start and prior see details along its colours' axes ([`ColourAxes`]), which
//!   saves a quarter of the steps; at a mosaic's sites, opponent colours ([`to_opponent`]);
//! * cycle spinning (Coifman & Donoho 1995) in two gears. One shift a step, another at each, is
//!   cheap but leaves a trace of the last shift; the mean over all shifts leaves none but costs
//!   many transforms. So the first steps turn, and the last [`SETTLING_STEPS`] spin.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::blocks::{self, Blocks};
use super::problem::{Certificate, Target};
use super::record::Course;
use super::wiener::Wiener;
use super::{
    About, IterationRecord, Method, MethodError, Momentum, Problem, ResidualOf, Solution, Step,
    Strength, Watch,
};
use crate::deconvolution::colour_axis::{AlongAxes, ColourAxes, Thresholds};
use crate::deconvolution::data_term;
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::opponent::{from_opponent, to_opponent};
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, STRETCH, Size, Work};

/// Noise-to-signal power of the start at one grey level of noise. With less, night comes out noisy.
const START_NOISE_TO_SIGNAL: f32 = 0.01;
/// Last steps of a solve, at most half of them, in which the shrinkage is averaged over shifts.
pub const SETTLING_STEPS: u32 = 3;
/// By how much the threshold grows from one level to the next coarser one. Measured; nearly flat.
const GROWTH_PER_LEVEL: f32 = 1.7;

/// By how much more the two finest levels are shrunk of a photo known at a mosaic's sites, in each
/// opponent colour: nothing but the prior speaks of details that fall between sites, and colours
/// have few of their own. Set on astronaut and coffee.
const SITES_MORE: [[f32; 2]; 3] = [[3.0, 2.0], [10.0, 4.0], [10.0, 4.0]];

/// Starts along the axes of a colour photo, one after the other.
const STARTS: usize = 2;
/// Noise-to-signal power of these at one grey level of noise: what the photo has beyond the axes is
/// mostly noise.
const AGAIN_NOISE_TO_SIGNAL: f32 = 0.05;
/// By how much more details are shrunk in these than in a step. Set on astronaut, coffee, rocket
/// and charts in ink, as the last.
const START_MORE: f32 = 3.0;

/// How the channels of a photo are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Colours {
    /// Together: start and prior see details along the axes of the photo's colours. At a mosaic's
    /// sites, and of a photo in which a JPEG's blocks are seen, as `Together`.
    AlongAxes,
    /// Together: the prior sees opponent colours.
    Together,
    /// Each for itself.
    Apart,
}

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Digital {
    /// Proximal steps.
    pub steps: u32,
    /// Soft threshold of each step.
    pub strength: Strength,
    /// Wavelet levels.
    pub levels: usize,
    /// Whether the shrinkage is cycle-spun.
    pub cycle_spun: bool,
    /// How the channels are solved.
    pub colours: Colours,
    /// How the picture is solved further with block matching, if it is.
    pub blocks: Option<Blocks>,
}

/// What it is.
pub const ABOUT: About =
    About { name: "digital", starts_from_lens: true, by_patches: false, by_steps: true };

impl Method for Digital {
    fn about(&self) -> &'static About {
        if self.blocks.is_some() { &blocks::ABOUT } else { &ABOUT }
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        _optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let model = problem.needs_model(self.name())?;
        let course = Course::new(problem.stopwatch);
        let (mask, axes) = (self.mask(problem), self.axes(problem, model));
        let (picture, record) = self.solve_photo(problem, model, (&mask, axes.as_ref()), watch);
        if let Some(&last) = record.steps().last() {
            watch(&Step { seconds: course.seconds(), ..last }, Some(&picture));
        }
        let model_residual = problem.model_residual(&picture);
        let certificate = Certificate { model_residual, ..Certificate::uncertified(problem) };
        Ok(Solution::of(picture, record, certificate))
    }
}

impl Digital {
    /// The photo of `problem` solved from Wiener's filter, and from the axes of its colours where
    /// there are any.
    pub(super) fn solve_photo(
        &self,
        problem: &Problem<'_>,
        model: &LensModel,
        (mask, axes): (&DetailMask, Option<&ColourAxes>),
        watch: &mut Watch<'_>,
    ) -> (Frame<Work>, IterationRecord) {
        let norms = problem.level_norms;
        let target = Target { problem, model, data: problem.photo, mask, axes, norms };
        let start = Wiener { noise_to_signal: START_NOISE_TO_SIGNAL }.start(problem, model);
        if axes.is_none() {
            return self.solve_for(target, &start, watch);
        }
        let mut prior = ColourPrior::new(self, target);
        let start = (0..STARTS).fold(start, |picture, _| prior.start(target, picture));
        let steps = (3 * self.steps).div_ceil(4);
        Digital { steps, ..*self }.solve_for(target, &start, watch)
    }

    /// Along which axes the colours of `problem`'s photo lie, where they are solved so.
    pub(super) fn axes(&self, problem: &Problem<'_>, model: &LensModel) -> Option<ColourAxes> {
        let colour = problem.channels.list().len() == Channel::ALL.len();
        // What coding did to colours is no colour of the scene, and no axis to follow.
        let data = problem.mosaic.is_none() && !problem.coded;
        let along = colour && data && self.colours == Colours::AlongAxes;
        along.then(|| ColourAxes::of(model, problem.photo, mean_noise(problem), self.levels))
    }

    /// Where the photo of `problem` has details.
    pub(super) fn mask(&self, problem: &Problem<'_>) -> DetailMask {
        let of = |&c: &Channel| {
            (problem.photo.plane(c), problem.trust.plane(c), problem.photo_noise[c.index()])
        };
        let planes: Vec<_> = problem.channels.list().iter().map(of).collect();
        DetailMask::of(&planes, self.levels, problem.mosaic.is_some())
    }

    /// All channels of `target` solved from `start`; the record is the green channel's.
    pub(super) fn solve_for(
        &self,
        target: Target<'_>,
        start: &Frame<Work>,
        watch: &mut Watch<'_>,
    ) -> (Frame<Work>, IterationRecord) {
        let problem = target.problem;
        let mut course = Course::new(problem.stopwatch);
        let mut prior = ColourPrior::new(self, target);
        let mut solves: Vec<ChannelSolve> =
            problem.channels.list().iter().map(|&c| ChannelSolve::new(c, start)).collect();
        let settling = if self.cycle_spun { SETTLING_STEPS.min(self.steps / 2) } else { 0 };
        for iteration in 1..=self.steps {
            let turn = prior.shrinkage.shift(iteration as usize);
            solves.par_iter_mut().for_each(|solve| solve.descend(target, &prior, turn));
            prior.apply(&mut solves, iteration as usize, iteration + settling > self.steps);
            solves.par_iter_mut().for_each(ChannelSolve::look_ahead);
            if let Some(green) = solves.iter().find(|solve| solve.channel == Channel::Green) {
                watch(&course.step(green.residual, ResidualOf::Model, 0), None);
            }
        }
        let mut picture = Frame::zeros(problem.size());
        for solve in solves {
            *picture.plane_mut(solve.channel) = solve.stepped;
        }
        if let Some(blocks) = self.blocks {
            picture = blocks.solve(target, picture, &mut course, watch);
        }
        (picture, course.record)
    }
}

/// Root mean square of the channels' noise, grey levels.
fn mean_noise(problem: &Problem<'_>) -> f32 {
    let channels = problem.channels.list();
    let power: f32 = channels.iter().map(|&c| problem.solving_noise(c).powi(2)).sum();
    (power / channels.len() as f32).sqrt()
}

/// One channel on its way.
struct ChannelSolve {
    channel: Channel,
    /// Where the gradient is taken.
    looked_at: Plane,
    /// K̂ of it, then its residual.
    predicted: Plane,
    /// The picture after the step.
    stepped: Plane,
    momentum: Momentum,
    /// RMS of the residual before the step.
    residual: f32,
}

impl ChannelSolve {
    fn new(channel: Channel, start: &Frame<Work>) -> Self {
        let start = start.plane(channel);
        ChannelSolve {
            channel,
            looked_at: start.clone(),
            predicted: Plane::zeros(start.size()),
            stepped: start.clone(),
            momentum: Momentum::new(start),
            residual: 0.0,
        }
    }

    /// `stepped` = the point looked at less its gradient, each wavelet level of it as long as it
    /// may be.
    fn descend(&mut self, target: Target<'_>, prior: &ColourPrior<'_>, shift: (usize, usize)) {
        let (c, trust) = (self.channel, target.problem.trust.plane(self.channel));
        target.model.forward(c, &self.looked_at, &mut self.predicted);
        data_term::residual_in_place(&mut self.predicted, target.data.plane(c), trust);
        if c == Channel::Green {
            self.residual = data_term::rms_over_data(&self.predicted, trust);
        }
        data_term::count(&mut self.predicted, target.problem.weight(c));
        target.model.adjoint(c, &self.predicted, &mut self.stepped);
        let steps = target.norms[c.index()].steps();
        prior.lend(|scratch| {
            prior.shrinkage.scale_levels(&mut self.stepped, &steps, shift, scratch);
        });
        let pairs = self
            .stepped
            .data_mut()
            .par_chunks_mut(STRETCH)
            .zip(self.looked_at.data().par_chunks(STRETCH));
        pairs.for_each(|(s, y)| s.iter_mut().zip(y).for_each(|(s, y)| *s = y - *s));
    }

    /// Keeps the picture within what light can be, and goes on to the next point to look at.
    fn look_ahead(&mut self) {
        let stretches = self.stepped.data_mut().par_chunks_mut(STRETCH);
        stretches
            .for_each(|stretch| stretch.iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE)));
        self.momentum.next(&mut self.looked_at, &self.stepped);
    }
}

/// The prior over all channels of a photo.
struct ColourPrior<'a> {
    shrinkage: Shrinkage,
    /// Per solved channel, or per opponent colour: the threshold of each level.
    thresholds: Vec<Vec<f32>>,
    together: bool,
    along: Option<Along<'a>>,
    mask: &'a DetailMask,
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
    passed: Vec<[f32; 3]>,
}

impl<'a> ColourPrior<'a> {
    fn new(digital: &Digital, target: Target<'a>) -> Self {
        let Target { problem, mask, norms, axes, .. } = target;
        let channels = problem.channels.list();
        let together = digital.colours != Colours::Apart && channels.len() == Channel::ALL.len();
        let noise = |c: Channel| problem.solving_noise(c);
        let along = axes.map(|axes| {
            let base = digital.strength.threshold(mean_noise(problem));
            let levels = 0..digital.levels;
            Along {
                axes,
                transforms: AlongAxes::new(problem.size(), digital.levels),
                weights: levels.clone().map(|l| base * GROWTH_PER_LEVEL.powi(l as i32)).collect(),
                passed: levels.map(|l| norms.each_ref().map(|norms| norms.at(l))).collect(),
            }
        });
        let norms = |c: Channel| &norms[c.index()];
        let levels_of = |noise: f32, norms: &LevelNorms| -> Vec<f32> {
            let base = digital.strength.threshold(noise);
            (0..digital.levels)
                .map(|l| base * GROWTH_PER_LEVEL.powi(l as i32) / norms.at(l))
                .collect()
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
        let shrinkage =
            super::shrinkage(problem.size(), digital.levels, digital.cycle_spun).in_clusters();
        ColourPrior {
            shrinkage,
            thresholds,
            together,
            along,
            mask,
            scratch: ShrinkageScratch::default(),
            free: Mutex::default(),
        }
    }

    /// Lends memory to `work`.
    fn lend(&self, work: impl FnOnce(&mut ShrinkageScratch)) {
        // Whatever is in it will do, so a poisoned list is as good as any.
        let free = || self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let mut scratch = free().pop().unwrap_or_default();
        work(&mut scratch);
        free().push(scratch);
    }

    /// `picture` with its details along the axes, and with what Wiener's filter makes of what the
    /// photo of `target` still has beyond that.
    fn start(&mut self, target: Target<'_>, mut picture: Frame<Work>) -> Frame<Work> {
        let Target { problem, model, data, mask, norms, .. } = target;
        let Some(Along { axes, transforms, weights, passed }) = &mut self.along else {
            return picture;
        };
        axes.project(&mut picture, norms, transforms);
        let weights: Vec<f32> = weights.iter().map(|weight| START_MORE * weight).collect();
        let thresholds = Thresholds { weights: &weights, passed, mask };
        transforms.shrink(picture.planes_mut(), axes, thresholds, (0, 0));
        let wiener = Wiener { noise_to_signal: AGAIN_NOISE_TO_SIGNAL };
        let light = |v: &mut f32| *v = v.clamp(0.0, FULL_SCALE);
        picture.planes_mut().par_iter_mut().zip(Channel::ALL).for_each(|(plane, c)| {
            plane.data_mut().iter_mut().for_each(light);
            let mut missed = Plane::zeros(problem.size());
            model.forward(c, plane, &mut missed);
            data_term::residual_in_place(&mut missed, data.plane(c), problem.trust.plane(c));
            plane.add_scaled(-1.0, &wiener.undone(problem, model, c, &missed));
            plane.data_mut().iter_mut().for_each(light);
        });
        picture
    }

    /// Draws the stepped pictures towards the prior, spun or at the shift of the step.
    fn apply(&mut self, solves: &mut [ChannelSolve], step: usize, spun: bool) {
        if let Some(along) = &mut self.along {
            let (shift, mask) = (self.shrinkage.shift(step), self.mask);
            in_colours(solves, |planes| {
                let Along { axes, transforms, weights, passed } = along;
                let thresholds = Thresholds { weights, passed, mask };
                match spun {
                    true => transforms.shrink_everywhere(planes, axes, thresholds, step),
                    false => transforms.shrink(planes, axes, thresholds, shift),
                }
            });
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
                    Some(self.mask),
                    step,
                    &mut self.scratch,
                );
            }
        } else {
            let shift = self.shrinkage.shift(step);
            solves.par_iter_mut().zip(&self.thresholds).for_each(|(solve, thresholds)| {
                self.lend(|scratch| {
                    let (plane, mask) = (&mut solve.stepped, Some(self.mask));
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
