//! The solve with the lens model alone: the first stage of [`hybrid`](super::hybrid), and a method
//! of its own without captures.
//!
//! Minimises ½‖K̂L − B‖² + μ‖W L‖₁ over 0 ≤ L ≤ 255 by proximal gradient steps with momentum. Six
//! things make it fast and accurate (measured, see `tests/tables/constants.md`):
//!
//! * most steps on binned pixels, where the lens is wide and they carry the scene
//!   ([`BinnedProblem`]);
//! * a start from Wiener's filter, which costs as much as a few steps and saves eight;
//! * a step length for each wavelet level
//!   ([`LevelNorms`](crate::deconvolution::level_norms::LevelNorms)): less than half the steps;
//! * shrinkage of details in clusters
//!   ([`crate::deconvolution::wavelet_shrinkage::Shrinkage::in_clusters`]);
//! * start and prior along the axes of a photo's colours ([`ColourAxes`]): three quarters of the
//!   steps;
//! * cycle spinning (Coifman & Donoho 1995) in two stages. A single shift, another one at each
//!   step, is cheap but leaves a trace of the last shift; the mean over all shifts leaves none but
//!   costs many transforms. The first steps use single shifts, the last [`SETTLING_STEPS`] the
//!   mean.

use std::borrow::Cow;

use rayon::prelude::*;

use super::binned::BinnedProblem;
use super::blocks::{self, Blocks};
use super::channel_solve::ChannelSolve;
use super::colour_prior::{ColourPrior, PriorSetting};
use super::problem::{Certificate, Target};
use super::record::Course;
use super::wiener::Wiener;
use super::{
    About, IterationRecord, Method, MethodError, Problem, ResidualOf, STRENGTH, Solution, Step,
    WAVELET_LEVELS, Watch,
};
use crate::deconvolution::colour_axis::ColourAxes;
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::frame::resample::resize;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, STRETCH, Work};

/// Noise-to-signal power of the start at one grey level of noise. Less makes night scenes noisy.
const START_NOISE_TO_SIGNAL: f32 = 0.01;
/// Number of final steps of a solve, at most half of them rounded up, in which the shrinkage is
/// averaged over shifts.
pub const SETTLING_STEPS: u32 = 3;

/// Number of steps on the photo's own grid after those on binned pixels. If block matching follows,
/// more gain nothing; if not, two gain 0.001 SSIM (`tests/tables/tried.md`).
const OWN_STEPS: u32 = 1;
/// Maximum residual of a picture on binned pixels, in σ of the photo's noise. Above it binned
/// pixels are too coarse for the scene: a raw photo is then solved on its own grid from the start,
/// another one by [`OWN_STEPS_OF_COARSE`] steps from that picture. Nine photographs, raw or
/// developed, have at most 1.21; a page and a chart of fine strokes have 1.47 and 1.86
/// (`tests/tables/tried.md`).
const BINNED_RESIDUAL_MAX: f32 = 1.35;
const OWN_STEPS_OF_COARSE: u32 = 4;

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Digital {
    /// Proximal steps, at least 1.
    pub steps: u32,
    /// Soft threshold of each step at one grey level of noise, for a step of length 1, grey levels.
    pub strength: f32,
    /// Wavelet levels.
    pub levels: usize,
    /// Block-matching stage after the steps, if any.
    pub blocks: Option<Blocks>,
}

impl Default for Digital {
    /// Parameters by which rigs restore; more steps gain nothing.
    fn default() -> Digital {
        Digital { steps: 16, strength: STRENGTH, levels: WAVELET_LEVELS, blocks: None }
    }
}

/// The method's properties.
pub const ABOUT: About = About { name: "digital", starts_from_lens: true };

/// Starting point of a solve.
pub(super) enum Start<'a> {
    /// A first guess; faint texture is detected halfway.
    Guess(Frame<Work>),
    /// A solved picture; faint texture is detected at the first step.
    Picture {
        /// The picture on the canvas.
        picture: &'a Frame<Work>,
        /// Prediction K̂ of the picture.
        prediction: &'a Frame<Work>,
    },
}

impl<'a> Start<'a> {
    /// The start of one channel; to be called once for each.
    fn of_channel(&mut self, c: Channel) -> ChannelSolve<'a> {
        match self {
            Start::Guess(guess) => {
                let point = Cow::Owned(std::mem::take(guess.plane_mut(c)));
                ChannelSolve::new(c, point, Cow::default())
            }
            Start::Picture { picture, prediction } => {
                let [point, prediction] = [&**picture, prediction].map(|of| of.plane(c));
                ChannelSolve::new(c, Cow::Borrowed(point), Cow::Borrowed(prediction))
            }
        }
    }
}

/// Structure of the photo, computed before a solve.
pub(super) struct PhotoStructure {
    /// Detail mask of the photo.
    pub(super) mask: DetailMask,
    /// Colour axes of the photo, if it is solved along them.
    pub(super) axes: Option<ColourAxes>,
}

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
        let course = Course::new(problem.stopwatch);
        let structure = self.analyse(problem);
        let (picture, record) = self.solve_photo(problem, &structure, watch);
        if let Some(&last) = record.steps().last() {
            watch(&Step { seconds: course.seconds(), ..last }, Some(&picture));
        }
        let prediction = problem.predict(&picture);
        let certificate = Certificate::of_model(problem, &prediction);
        let prediction = Some(prediction);
        Ok(Solution { prediction, ..Solution::of(picture, record, certificate) })
    }
}

impl Digital {
    /// The detail mask and the colour axes of the photo of `problem`.
    pub(super) fn analyse(&self, problem: &Problem<'_>) -> PhotoStructure {
        let observation = problem.observation;
        let mask = observation.detail_mask(self.levels);
        let has_axes = observation.channels.list().len() == Channel::ALL.len()
            && observation.sampling.has_colour_axes();
        let axes = has_axes.then(|| {
            let noise = observation.mean_noise();
            ColourAxes::of(problem.model, &observation.light, noise, self.levels)
        });
        PhotoStructure { mask, axes }
    }

    /// Solves the photo of `problem`: on binned pixels and then in few steps on its own grid, or on
    /// its own grid alone.
    pub(super) fn solve_photo(
        &self,
        problem: &Problem<'_>,
        structure: &PhotoStructure,
        watch: &mut Watch<'_>,
    ) -> (Frame<Work>, IterationRecord) {
        let mut course = Course::new(problem.stopwatch);
        let Some((picture, steps)) = self.solve_binned(problem, watch) else {
            return self.solve_at_own_grid(problem, structure, watch);
        };
        course.extend(&steps, 0, 0.0);
        let prediction = problem.predict(&picture);
        let seconds = course.seconds();
        let residual = problem.residual_over_noise(&prediction);
        log::debug!("the picture on binned pixels leaves {residual:.2} σ of the photo");
        let is_coarse = residual > BINNED_RESIDUAL_MAX;
        let (picture, steps) = if is_coarse && problem.observation.sampling.mosaic().is_some() {
            drop((picture, prediction));
            self.solve_at_own_grid(problem, structure, watch)
        } else {
            let PhotoStructure { mask, axes } = structure;
            let (data, norms) = (&problem.observation.light, problem.level_norms);
            let target = Target { problem, data, mask, axes: axes.as_ref(), norms };
            let start = Start::Picture { picture: &picture, prediction: &prediction };
            let steps = if is_coarse { OWN_STEPS_OF_COARSE } else { OWN_STEPS };
            Digital { steps, ..*self }.solve_from(target, start, watch)
        };
        course.extend(&steps, 0, seconds);
        (picture, course.record)
    }

    /// Solves the photo of `problem` on binned pixels and enlarges the picture to the photo's own
    /// grid; `None` if the problem cannot be binned.
    fn solve_binned(
        &self,
        problem: &Problem<'_>,
        watch: &mut Watch<'_>,
    ) -> Option<(Frame<Work>, IterationRecord)> {
        let binned = BinnedProblem::of(problem)?;
        let binned = binned.problem(problem);
        let method = Digital { levels: self.levels - 1, ..*self };
        let structure = method.analyse(&binned);
        let (picture, steps) = method.solve_from_filter(&binned, &structure, watch);
        Some((problem.frame_of(|c| resize(picture.plane(c), problem.size())), steps))
    }

    /// Solves the photo of `problem` on its own grid alone.
    fn solve_at_own_grid(
        &self,
        problem: &Problem<'_>,
        structure: &PhotoStructure,
        watch: &mut Watch<'_>,
    ) -> (Frame<Work>, IterationRecord) {
        let sampling = &problem.observation.sampling;
        let steps = sampling.solve_steps(self.steps, structure.axes.is_some());
        Digital { steps, ..*self }.solve_from_filter(problem, structure, watch)
    }

    /// Solves the photo of `problem` from Wiener's filter, refined along its colour axes if it has
    /// any.
    fn solve_from_filter(
        &self,
        problem: &Problem<'_>,
        PhotoStructure { mask, axes }: &PhotoStructure,
        watch: &mut Watch<'_>,
    ) -> (Frame<Work>, IterationRecord) {
        let (observation, axes) = (problem.observation, axes.as_ref());
        let norms = problem.level_norms;
        let target = Target { problem, data: &observation.light, mask, axes, norms };
        let noise_to_signal = observation.sampling.start_noise_factor() * START_NOISE_TO_SIGNAL;
        let wiener = Wiener { noise_to_signal };
        let mut start = problem.frame_of(|c| wiener.filter_channel(problem, c));
        if axes.is_none() {
            return self.solve_from(target, Start::Guess(start), watch);
        }
        ColourPrior::new(self.prior(), target).refine_start(target, &mut start);
        self.solve_from(target, Start::Guess(start), watch)
    }

    /// Solves all channels of `target` from `start`; the record is the green channel's.
    pub(super) fn solve_from(
        &self,
        target: Target<'_>,
        mut start: Start<'_>,
        watch: &mut Watch<'_>,
    ) -> (Frame<Work>, IterationRecord) {
        let problem = target.problem;
        let observation = problem.observation;
        let channels = observation.channels.list();
        let is_solved = matches!(start, Start::Picture { .. });
        let texture_step = if is_solved { 1 } else { (self.steps / 2).max(1) };
        let mut course = Course::new(problem.stopwatch);
        let mut prior = ColourPrior::new(self.prior(), target);
        let mut solves: Vec<_> = channels.iter().map(|&c| start.of_channel(c)).collect();
        let settling = SETTLING_STEPS.min(self.steps.div_ceil(2));
        let mut expected: Option<Frame<Work>> = None;
        let mut stepped: Vec<Plane> = Vec::new();
        for step in 1..=self.steps {
            let shift = prior.shrinkage.shift(step as usize);
            let before = solves.par_iter_mut().zip(std::mem::take(&mut stepped));
            before.for_each(|(solve, stepped)| solve.advance(stepped, step == self.steps));
            if step > 1 || !is_solved {
                solves.par_iter_mut().for_each(|solve| solve.predict(target));
            }
            if observation.sampling.updates_data_at(step) {
                drop(expected.take());
                expected = expected_data(target, &solves);
            }
            let target = Target { data: expected.as_ref().unwrap_or(target.data), ..target };
            if step == texture_step && prior.can_protect_texture(observation) {
                let residuals: Vec<Plane> = solves.iter().map(|s| s.residual(target)).collect();
                prior.protect_texture(observation, &residuals);
            }
            let descended = solves.par_iter_mut().map(|s| s.descend(target, &prior, shift));
            stepped = descended.collect();
            if step == self.steps {
                solves.iter_mut().for_each(|solve| solve.point = Cow::default());
            }
            prior.apply(&mut stepped, step as usize, step + settling > self.steps);
            for plane in &mut stepped {
                let pixels = plane.data_mut().par_iter_mut().with_min_len(STRETCH);
                pixels.for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
            }
            if let Some(green) = solves.iter().find(|solve| solve.channel == Channel::Green) {
                watch(&course.step(green.residual_rms, ResidualOf::Model, 0), None);
            }
        }
        let mut picture = Frame::zeros(problem.size());
        channels.iter().zip(stepped).for_each(|(&c, plane)| *picture.plane_mut(c) = plane);
        // Block matching needs the memory.
        drop((prior, solves));
        let target = Target { data: expected.as_ref().unwrap_or(target.data), ..target };
        if let Some(blocks) = self.blocks {
            picture = blocks.solve(target, picture, &mut course, watch);
        }
        observation.sampling.finish(&mut picture, &observation.light);
        (picture, course.record)
    }

    fn prior(&self) -> PriorSetting {
        PriorSetting { strength: self.strength, levels: self.levels }
    }
}

/// Expected data of `target`, given the predictions of `solves`; `None` if the data do not depend
/// on them.
///
/// The data of a correction are the photo less a defect that captures showed. The camera saw that
/// defect, so it is added to the predictions and subtracted from the expected data again.
fn expected_data(target: Target<'_>, solves: &[ChannelSolve<'_>]) -> Option<Frame<Work>> {
    let observation = target.problem.observation;
    let mut seen: Frame<Work> = observation.light.clone();
    for solve in solves {
        let plane = seen.plane_mut(solve.channel);
        plane.add_scaled(-1.0, target.data.plane(solve.channel));
        plane.add_scaled(1.0, &solve.prediction);
    }
    let mut data = observation.sampling.expected_data(&seen)?;
    for solve in solves {
        let c = solve.channel;
        data.plane_mut(c).add_scaled(-1.0, observation.light.plane(c));
        data.plane_mut(c).add_scaled(1.0, target.data.plane(c));
    }
    Some(data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::example_lens::{gaussians, lens, photo, scene};
    use crate::deconvolution::level_norms::LevelNorms;
    use crate::deconvolution::observation::{Raw, Sampling};
    use crate::frame::{Channels, Mosaic};
    use std::sync::Arc;

    #[test]
    fn binned_pixels_before_the_own_grid_lose_nothing_where_they_carry_the_scene() {
        let model = lens(&gaussians([2.5, 2.4, 2.6]));
        let mut observation = photo(&model, 8, Channels::Colour);
        let method = Digital::default();
        let norms = Channel::ALL.map(|c| LevelNorms::measure(&model, c, method.levels, 12, 1));
        let developed = Arc::clone(&observation.sampling);
        let raw: Arc<dyn Sampling> = Arc::new(Raw { mosaic: Mosaic::Rggb });
        for (sampling, noise, own_steps) in [
            (&developed, 1.0, OWN_STEPS),
            (&developed, 0.1, OWN_STEPS_OF_COARSE),
            (&raw, 0.1, method.steps),
        ] {
            observation.noise = [noise; 3];
            observation.sampling = Arc::clone(sampling);
            let problem = Problem {
                observation: &observation,
                model: &model,
                norm_squared: [1.0; 3],
                level_norms: &norms,
                pixel_norms: &norms,
                capture_mosaic: None,
                capture_noise: observation.noise,
                is_hopeless: None,
                stopwatch: &|| 0.0,
            };
            let structure = method.analyse(&problem);
            let truth = scene(&model, 8).crop(observation.rect);
            let error = |(picture, record): (Frame<Work>, IterationRecord)| {
                let mut off = picture.crop(observation.rect);
                let planes = off.planes_mut().iter_mut().zip(truth.planes());
                let power: f64 = planes
                    .map(|(plane, truth)| {
                        plane.add_scaled(-1.0, truth);
                        plane.rms().powi(2)
                    })
                    .sum();
                (power.sqrt(), record.steps().len())
            };
            let (on_two, steps) = error(method.solve_photo(&problem, &structure, &mut |_, _| {}));
            let on_one = error(method.solve_at_own_grid(&problem, &structure, &mut |_, _| {})).0;
            assert_eq!(steps, (method.steps + own_steps) as usize, "noise {noise}");
            let blurred = error((observation.light.clone(), IterationRecord::default())).0;
            let words = format!("noise {noise}: {on_two} {on_one} {blurred}");
            assert!(on_two < 1.02 * on_one, "{words}");
            // Not so for the raw photo, whose light is given at all pixels here.
            assert!(sampling.mosaic().is_some() || on_two < 0.8 * blurred, "{words}");
        }
    }
}
