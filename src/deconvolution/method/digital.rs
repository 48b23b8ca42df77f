//! The lens model alone: what the box does when the camera is unplugged, and a baseline.
//!
//! Minimises ½‖K̂L − B‖² + μ‖W L‖ over 0 ≤ L ≤ 255 by proximal steps with momentum. Five things
//! make it fast and good (measured, see `tests/tables/README.md`):
//!
//! * it starts from Wiener's filter, which costs as much as a few steps and saves eight;
//! * a step of its own for each wavelet level
//!   ([`LevelNorms`](crate::deconvolution::level_norms::LevelNorms)): less than half the steps;
//! * details judged in clusters
//!   ([`crate::deconvolution::wavelet_shrinkage::Shrinkage::in_clusters`]);
//! * of a colour photo start and prior see details along its colours' axes ([`ColourAxes`]), which
//!   saves a quarter of the steps;
//! * cycle spinning (Coifman & Donoho 1995) in two gears. One shift a step, another at each, is
//!   cheap but leaves a trace of the last shift; the mean over all shifts leaves none but costs
//!   many transforms. So the first steps turn, and the last [`SETTLING_STEPS`] spin.

use rayon::prelude::*;

use super::blocks::{self, Blocks};
use super::colour_prior::{ColourPrior, mean_noise, noisy_planes};
use super::problem::{Certificate, Target};
use super::record::Course;
use super::wiener::Wiener;
use super::{
    About, IterationRecord, Method, MethodError, Momentum, Problem, ResidualOf, Solution, Step,
    Strength, Watch,
};
use crate::deconvolution::colour_axis::ColourAxes;
use crate::deconvolution::data_term;
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::jpeg::JpegTerm;
use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, STRETCH, Work};

/// Noise-to-signal power of the start at one grey level of noise. With less, night comes out noisy.
const START_NOISE_TO_SIGNAL: f32 = 0.01;
/// By how much more the noise of a JPEG counts there: its errors lie about edges, and what is
/// made of them stays where the file does not speak. Set on coffee and rocket; between 3 and 8 it
/// hardly matters.
const START_OF_CODED: f32 = 6.0;
/// Steps at which a photo that is a JPEG is decoded again: the independent study's.
const DECODED_AT: [u32; 6] = [1, 2, 4, 7, 10, 13];
/// Last steps of a solve, at most half of them, in which the shrinkage is averaged over shifts.
pub const SETTLING_STEPS: u32 = 3;

/// How the channels of a photo are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Colours {
    /// Together: start and prior see details along the axes of the photo's colours. Of a photo in
    /// which a JPEG's blocks are seen, as `Together`.
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
        let predicted = model.seen(problem.channels.list(), &picture);
        let model_residual = Some(problem.model_residual(&predicted));
        let certificate = Certificate { model_residual, ..Certificate::uncertified(problem) };
        let predicted = Some(predicted);
        Ok(Solution { predicted, ..Solution::of(picture, record, certificate) })
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
        let noise_to_signal = match problem.stated {
            Some(_) => START_OF_CODED * START_NOISE_TO_SIGNAL,
            None => START_NOISE_TO_SIGNAL,
        };
        let start = Wiener { noise_to_signal }.start(problem, model);
        if axes.is_none() {
            return self.solve_for(target, Begun::Start(&start), watch);
        }
        let start = ColourPrior::new(self, target).start(target, start);
        // Between a mosaic's sites steps are shorter, and as many are needed as without axes.
        let steps =
            if problem.mosaic.is_some() { self.steps } else { (3 * self.steps).div_ceil(4) };
        Digital { steps, ..*self }.solve_for(target, Begun::Start(&start), watch)
    }

    /// Along which axes the colours of `problem`'s photo lie, where they are solved so.
    pub(super) fn axes(&self, problem: &Problem<'_>, model: &LensModel) -> Option<ColourAxes> {
        let colour = problem.channels.list().len() == Channel::ALL.len();
        // What coding did to colours is no colour of the scene, and no axis to follow.
        let along = colour
            && !problem.coded
            && problem.stated.is_none()
            && self.colours == Colours::AlongAxes;
        along.then(|| ColourAxes::of(model, problem.photo, mean_noise(problem), self.levels))
    }

    /// Where the photo of `problem` has details.
    pub(super) fn mask(&self, problem: &Problem<'_>) -> DetailMask {
        let planes = noisy_planes(problem);
        DetailMask::of(&planes, self.levels, problem.mosaic.is_some())
    }

    /// All channels of `target` solved from what was `begun`; the record is the green channel's.
    pub(super) fn solve_for(
        &self,
        target: Target<'_>,
        begun: Begun<'_>,
        watch: &mut Watch<'_>,
    ) -> (Frame<Work>, IterationRecord) {
        let problem = target.problem;
        let (start, predicted, sparing_step) = match begun {
            Begun::Start(start) => (start, None, (self.steps / 2).max(1)),
            Begun::Picture { picture, predicted } => (picture, Some(predicted), 1),
        };
        let mut course = Course::new(problem.stopwatch);
        let mut prior = ColourPrior::new(self, target);
        let mut solves: Vec<ChannelSolve> =
            problem.channels.list().iter().map(|&c| ChannelSolve::new(c, start)).collect();
        let settling = if self.cycle_spun { SETTLING_STEPS.min(self.steps / 2) } else { 0 };
        let mut decoded: Option<Frame<Work>> = None;
        for iteration in 1..=self.steps {
            let turn = prior.shrinkage.shift(iteration as usize);
            match predicted.filter(|_| iteration == 1) {
                Some(known) => solves.iter_mut().for_each(|solve| solve.is_predicted(known)),
                None => solves.par_iter_mut().for_each(|solve| solve.predict(target)),
            }
            let stated = problem.stated.filter(|stated| stated.is_data());
            if let Some(stated) = stated.filter(|_| DECODED_AT.contains(&iteration)) {
                decoded = Some(decoded_again(stated, target, &solves));
            }
            let target = Target { data: decoded.as_ref().unwrap_or(target.data), ..target };
            if iteration == sparing_step && prior.spares(problem) {
                let left: Vec<Plane> = solves.iter().map(|solve| solve.left(target)).collect();
                prior.spare(problem, &left);
            }
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
        let target = Target { data: decoded.as_ref().unwrap_or(target.data), ..target };
        if let Some(blocks) = self.blocks {
            picture = blocks.solve(target, picture, &mut course, watch);
        }
        if let Some(stated) = problem.stated {
            stated.mix_colours(&mut picture, problem.photo);
        }
        (picture, course.record)
    }
}

/// What a solve goes on from.
#[derive(Clone, Copy)]
pub(super) enum Begun<'a> {
    /// A first guess. Half of the steps are taken before it is asked which textures the prior drew
    /// away.
    Start(&'a Frame<Work>),
    /// A picture that was solved already, and is asked at once.
    Picture {
        /// It.
        picture: &'a Frame<Work>,
        /// K̂ of it.
        predicted: &'a Frame<Work>,
    },
}

/// The data of `target` as its photo's file states them, now that the photo of `solves` is known.
///
/// A correction solves for the photo less a defect that captures showed. What the camera saw has
/// it, and so has what the file states.
fn decoded_again(stated: &JpegTerm, target: Target<'_>, solves: &[ChannelSolve]) -> Frame<Work> {
    let mut seen: Frame<Work> = target.problem.photo.clone();
    for solve in solves {
        let plane = seen.plane_mut(solve.channel);
        plane.add_scaled(-1.0, target.data.plane(solve.channel));
        plane.add_scaled(1.0, &solve.predicted);
    }
    let mut data = stated.redecoded(&seen);
    for solve in solves {
        let c = solve.channel;
        data.plane_mut(c).add_scaled(-1.0, target.problem.photo.plane(c));
        data.plane_mut(c).add_scaled(1.0, target.data.plane(c));
    }
    data
}

/// One channel on its way.
pub(super) struct ChannelSolve {
    channel: Channel,
    /// Where the gradient is taken.
    looked_at: Plane,
    /// K̂ of it, then its residual.
    predicted: Plane,
    /// Whether a pixel is kept where it is, at a bound of light.
    held: Plane<bool>,
    /// The picture after the step.
    pub(super) stepped: Plane,
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
            held: Plane::zeros(start.size()),
            stepped: start.clone(),
            momentum: Momentum::new(start),
            residual: 0.0,
        }
    }

    /// `predicted` = K̂ of the point looked at.
    fn predict(&mut self, target: Target<'_>) {
        target.model.forward(self.channel, &self.looked_at, &mut self.predicted);
    }

    /// The same where K̂ of it is `known`.
    fn is_predicted(&mut self, known: &Frame<Work>) {
        self.predicted.clone_from(known.plane(self.channel));
    }

    /// What the point looked at leaves of the data, grey levels; before [`ChannelSolve::descend`].
    fn left(&self, target: Target<'_>) -> Plane {
        let mut left = self.predicted.clone();
        let trust = target.problem.trust.plane(self.channel);
        data_term::residual_in_place(&mut left, target.data.plane(self.channel), trust);
        left
    }

    /// `stepped` = the point looked at less its gradient, each wavelet level of it as long as it
    /// may be.
    fn descend(&mut self, target: Target<'_>, prior: &ColourPrior<'_>, shift: (usize, usize)) {
        let (c, trust) = (self.channel, target.problem.trust.plane(self.channel));
        data_term::residual_in_place(&mut self.predicted, target.data.plane(c), trust);
        if c == Channel::Green {
            self.residual = data_term::rms_over_data(&self.predicted, trust);
        }
        data_term::count(&mut self.predicted, target.problem.weight(c));
        target.model.adjoint(c, &self.predicted, &mut self.stepped);
        self.hold();
        let steps = target.norms[c.index()].steps();
        prior.lend(|scratch| {
            prior.shrinkage.scale_levels(&mut self.stepped, &steps, shift, scratch);
        });
        let stretches = self
            .stepped
            .data_mut()
            .par_chunks_mut(STRETCH)
            .zip(self.looked_at.data().par_chunks(STRETCH))
            .zip(self.held.data().par_chunks(STRETCH));
        stretches.for_each(|((step, from), held)| {
            for ((s, y), held) in step.iter_mut().zip(from).zip(held) {
                *s = if *held { *y } else { y - *s };
            }
        });
    }

    /// Takes out of the gradient the pixels at a bound of light that it leads past.
    ///
    /// Each level has a step of its own, and the bound is one of pixels. Kept by a clamp alone,
    /// such a step need not descend, however short it is: dark places of a channel whose finest
    /// details hardly arrive fill with stripes. With these pixels held it does (two-metric
    /// projection: Bertsekas 1982, "Projected Newton methods for optimization problems with simple
    /// constraints").
    fn hold(&mut self) {
        let stretches = self
            .stepped
            .data_mut()
            .par_chunks_mut(STRETCH)
            .zip(self.looked_at.data().par_chunks(STRETCH))
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

    /// Keeps the picture within what light can be, and goes on to the next point to look at.
    fn look_ahead(&mut self) {
        let stretches = self.stepped.data_mut().par_chunks_mut(STRETCH);
        stretches
            .for_each(|stretch| stretch.iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE)));
        self.momentum.next(&mut self.looked_at, &self.stepped);
    }
}
