//! The default: solve with the lens model, certify the result by a capture, and correct what the
//! model misses while captures show that it misses something (defect correction, Böhmer & Stetter
//! 1984).
//!
//! A capture y of the candidate L shows the model's *defect* at L: d = y − K̂L, which is (K − K̂)L
//! plus the capture's noise. The corrected problem is K̂L = B − d. Each capture adds to d what it
//! shows beyond the known d, shrunk by its noise: a defect below the noise is not corrected, and
//! when a capture shows nothing new, d is complete.
//!
//! With a poor model the corrected candidate can overshoot. Light is linear: the photograph of
//! L + α(L′ − L) is y + α(y′ − y), so the best α follows from the two captures, and the optical
//! residual never grows. α may exceed 1 after a correction of a few steps, which has not converged,
//! but not after one by block matching, which has.

use rayon::prelude::*;

use super::blocks::{self, Blocks};
use super::candidate::Candidate;
use super::digital::{Digital, PhotoStructure, Start};
use super::problem::{Certificate, Target};
use super::record::Course;
use super::{About, Method, MethodError, Problem, ResidualOf, Solution, Watch};
use crate::deconvolution::data_term::{self, TRUSTED};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::wavelet::{Details, Scratch, Sym8};
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, Frame, Mosaic, Plane, Size, Work};

/// Proximal steps of each correction. More steps gain nothing if the model is right, and build on
/// its errors if it is wrong (`tests/tables/truthful-wrong-models.md`).
pub const CORRECTION_STEPS: u32 = 4;
/// Proximal steps of each correction that block matching follows and completes
/// (`tests/tables/constants.md`).
pub const STEPS_BEFORE_BLOCKS: u32 = 2;
/// Soft threshold of the measured defect, in σ of its noise; measured.
const DEFECT_THRESHOLD: f32 = 2.0;
/// Largest defect at which the model is taken to be right, as a share of the noise floor in the
/// channel where that share is largest. Measured on the laboratory's group of limits: correcting
/// less than 0.26 gains nothing or loses, from 0.3 on it gains (`tests/tables/constants.md`).
const DEFECT_FLOOR: f32 = 0.28;
/// Factor by which a wrong model shortens the steps of a correction: each level's α is at least
/// this times the defect's share of the picture's power; measured.
const CAREFULNESS: f32 = 25.0;
/// Soft threshold of a defect at a mosaic's sites, in σ of the sensor's noise there.
const SITES_THRESHOLD: f32 = 1.0;
/// Largest α along a correction by wavelets, whose few steps do not converge. Beyond it the line
/// through two captures follows their noise.
const STEP_MAX: f64 = 1.5;
/// Largest α along a correction by block matching. With 1.5 a second capture through a lens that
/// was touched loses half of the first one's gain (`tests/tables/truthful-worth.md`).
const STEP_MAX_BY_BLOCKS: f64 = 1.0;
/// Levels of the defect's shrinkage. The approximation is not shrunk: it averages 16×16 pixels, so
/// its noise is a sixteenth of a pixel's.
const DEFECT_LEVELS: usize = 4;

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hybrid {
    /// The solve with the lens model.
    pub digital: Digital,
    /// Proximal steps of each correction. Few are better than many: stopping early keeps a poor
    /// model from building on its own errors.
    pub correction_steps: u32,
    /// Maximum number of captures per photo, at least 1. With 1 the first correction is not
    /// confirmed by a capture.
    pub captures_max: u32,
}

/// The method's properties.
pub const ABOUT: About = About { name: "hybrid", starts_from_lens: true };

impl Method for Hybrid {
    fn about(&self) -> &'static About {
        if self.digital.blocks.is_some() { &blocks::ABOUT } else { &ABOUT }
    }

    fn captures_max(&self) -> u32 {
        self.captures_max.max(1)
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let mut run = Run::new(self, problem, optics);
        let mut candidate = run.first_candidate(optics, watch)?;
        let last = self.captures_max();
        for capture in 1..=last {
            run.record_capture(&candidate, optics, watch);
            // The last of several captures only certifies.
            if capture == last && last > 1 {
                break;
            }
            let Some(mut defect) = run.find_defect(&candidate, capture == 1) else { break };
            let (picture, prediction) = run.correct(&candidate, &mut defect, watch);
            if capture == last {
                // The only capture is used up, and none certifies the correction.
                run.certificate.optical_residual = None;
                (candidate.picture, candidate.prediction) = (picture, prediction);
                break;
            }
            // Only a further correction needs it, and captures need memory.
            let defect = (capture + 1 < last).then_some(defect);
            let seen = problem.capture(optics, &prediction, &picture)?;
            let longest = if self.digital.blocks.is_some() { STEP_MAX_BY_BLOCKS } else { STEP_MAX };
            let corrected = Candidate { picture, prediction, seen, defect };
            candidate.step_towards(&corrected, problem, longest);
        }
        Ok(run.finish(candidate))
    }
}

impl Hybrid {
    /// Power of the details of `plane`, level by level, finest first.
    fn detail_powers(&self, plane: &Plane) -> Vec<f64> {
        let transform = Sym8::new(plane.size(), self.digital.levels);
        let mut coefficients = transform.zeros();
        transform.analyse(plane, &mut coefficients, &mut Scratch::default());
        let power =
            |details: &mut Details| details.bands_mut().iter().map(|b| b.dot(b)).sum::<f64>();
        coefficients.details.iter_mut().map(power).collect()
    }
}

/// The run of the method on one photo.
struct Run<'a> {
    method: &'a Hybrid,
    problem: &'a Problem<'a>,
    structure: PhotoStructure,
    course: Course<'a>,
    certificate: Certificate,
}

impl<'a> Run<'a> {
    fn new(
        method: &'a Hybrid,
        problem: &'a Problem<'a>,
        optics: &dyn ForwardConvolution,
    ) -> Run<'a> {
        let course = Course::by(problem.stopwatch, optics);
        Run {
            method,
            problem,
            structure: method.digital.analyse(problem),
            course,
            certificate: Certificate::uncertified(problem),
        }
    }

    fn channels(&self) -> &'static [Channel] {
        self.problem.observation.channels.list()
    }

    /// Solves with the measured lens and captures the picture.
    fn first_candidate(
        &mut self,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Candidate, MethodError> {
        let digital = self.method.digital;
        let (picture, steps) = digital.solve_photo(self.problem, &self.structure, watch);
        self.course.extend(&steps, 0, 0.0);
        let prediction = self.problem.predict(&picture);
        let seen = self.problem.capture(optics, &prediction, &picture)?;
        Ok(Candidate { picture, prediction, seen, defect: None })
    }

    /// Records the residual of the candidate's capture.
    fn record_capture(
        &mut self,
        candidate: &Candidate,
        optics: &dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) {
        let light = &candidate.seen.light;
        let residual = self.problem.capture_rms(Channel::Green, light.plane(Channel::Green));
        self.certificate.measure(self.problem, light);
        let step = self.course.step(residual, ResidualOf::Optics, optics.captures());
        watch(&step, Some(&candidate.picture));
    }

    /// Defect d of the model at `candidate`, including the known one, on the canvas, linear light;
    /// `None` if there is nothing more to correct or the photo is hopeless
    /// ([`Problem::is_hopeless`]).
    fn find_defect(&self, candidate: &Candidate, is_first: bool) -> Option<Frame<Work>> {
        let (problem, channels) = (self.problem, self.channels());
        let unexplained = candidate.seen.unexplained(&candidate.prediction, channels);
        if is_first && problem.is_hopeless.is_some_and(|test| test(&candidate.prediction)) {
            return None;
        }
        let mut light = self.measure_defect(unexplained, candidate);
        // Interpolated pixels share the noise of their datum.
        let over_floor = |&c: &Channel| {
            let shared = problem.observation.pixels_a_datum(c).sqrt();
            light.plane(c).rms() as f32 / (shared * problem.noise_floor(c))
        };
        if channels.iter().map(over_floor).fold(0.0, f32::max) <= DEFECT_FLOOR {
            return None;
        }
        if let Some(known) = &candidate.defect {
            for &c in channels {
                light.plane_mut(c).add_scaled(1.0, known.plane(c));
            }
        }
        Some(light)
    }

    /// New part of the defect, (y − K̂L) − d, with its noise shrunk away: what is `unexplained`
    /// less the known defect. Pixels that the capture does not trust enter as zero; the result is
    /// zero where the photo has no data.
    fn measure_defect(&self, mut unexplained: Frame<Work>, candidate: &Candidate) -> Frame<Work> {
        let problem = self.problem;
        let shrinkage = Shrinkage::new(problem.size(), DEFECT_LEVELS);
        let mut scratch = ShrinkageScratch::default();
        // One plane after the other: spinning needs much memory, and keeps all cores busy by
        // itself.
        for &channel in self.channels() {
            let plane = unexplained.plane_mut(channel);
            if let Some(defect) = &candidate.defect {
                let values = plane.data_mut().iter_mut().zip(defect.plane(channel).data());
                for ((v, d), &t) in values.zip(candidate.seen.trusted.plane(channel).data()) {
                    *v -= if t == TRUSTED { *d } else { 0.0 };
                }
            }
            if let Some(mosaic) = problem.capture_mosaic {
                let noise = problem.capture_noise[channel.index()];
                shrink_sites(plane, channel, mosaic, SITES_THRESHOLD * noise, &mut scratch);
            } else {
                let thresholds = [DEFECT_THRESHOLD * data_term::noise_of(plane)];
                shrinkage.shrink_everywhere(plane, &thresholds, None, 0, &mut scratch);
            }
            problem.observation.mask(channel, plane);
        }
        unexplained
    }

    /// Solves K̂L = B − d from `candidate`; returns the picture and its prediction.
    fn correct(
        &mut self,
        candidate: &Candidate,
        defect: &mut Frame<Work>,
        watch: &mut Watch<'_>,
    ) -> (Frame<Work>, Frame<Work>) {
        let (method, problem) = (self.method, self.problem);
        let observation = problem.observation;
        // A coarse defect hardly changes with the picture; a fine one does, and its error counts as
        // noise.
        let fine_power = |c: Channel| {
            let power: f64 = method.detail_powers(defect.plane(c)).iter().sum();
            (power / problem.size().area() as f64).sqrt() as f32
        };
        let blocks = method.digital.blocks;
        let blocks =
            blocks.map(|blocks| Blocks { model_error: Channel::ALL.map(fine_power), ..blocks });
        let correction = Digital { steps: method.correction_steps, blocks, ..method.digital };
        let norms = &self.careful_norms(&candidate.picture, defect);
        let PhotoStructure { mask, axes } = &self.structure;
        // Replaces d by B − d; called again, it restores d.
        let subtract_from_photo = |defect: &mut Frame<Work>| {
            for &c in observation.channels.list() {
                let photo = observation.light.plane(c);
                defect.plane_mut(c).update(photo, |value, photo| *value = photo - *value);
            }
        };
        subtract_from_photo(defect);
        let target = Target { problem, data: defect, mask, axes: axes.as_ref(), norms };
        let Candidate { picture, prediction, .. } = candidate;
        let start = Start::Picture { picture, prediction };
        let (picture, steps) = correction.solve_from(target, start, watch);
        subtract_from_photo(defect);
        let prediction = problem.predict(&picture);
        let last = self.course.record.steps().last();
        let (captures, seconds) = last.map_or((0, 0.0), |last| (last.captures, last.seconds));
        self.course.extend(&steps, captures, seconds);
        self.certificate.corrections += 1;
        (picture, prediction)
    }

    /// The level norms for a correction: raised where the defect's power shows that the model is
    /// wrong.
    ///
    /// With a wrong model a correction overshoots in the levels where (K − K̂) is not small against
    /// what K̂ passes. The ratio of the defect's power to the picture's measures it, level by
    /// level.
    fn careful_norms(&self, picture: &Frame<Work>, defect: &Frame<Work>) -> [LevelNorms; 3] {
        let method = self.method;
        let mut norms = self.problem.level_norms.clone();
        let raised = self.channels().par_iter().map(|&c| {
            let wrong = method.detail_powers(defect.plane(c)).into_iter();
            let shares = wrong.zip(method.detail_powers(picture.plane(c)));
            let least = |(wrong, shown): (f64, f64)| {
                CAREFULNESS * (wrong / shown.max(f64::MIN_POSITIVE)) as f32
            };
            let least: Vec<f32> = shares.map(least).collect();
            (c, norms[c.index()].at_least(&least))
        });
        let raised: Vec<(Channel, LevelNorms)> = raised.collect();
        raised.into_iter().for_each(|(c, raised)| norms[c.index()] = raised);
        norms
    }

    /// Turns `candidate` into the solution.
    fn finish(mut self, candidate: Candidate) -> Solution {
        let Candidate { picture, prediction, .. } = candidate;
        self.certificate.model_residual = Some(self.problem.model_residual(&prediction));
        Solution {
            picture,
            prediction: Some(prediction),
            record: self.course.record,
            certificate: self.certificate,
        }
    }
}

/// Shrinks `plane` at the sites of one channel and interpolates between them. Each phase of the
/// mosaic is shrunk as a plane of its own, in which noise is white.
fn shrink_sites(
    plane: &mut Plane,
    channel: Channel,
    mosaic: Mosaic,
    threshold: f32,
    scratch: &mut ShrinkageScratch,
) {
    let phases = [(0, 0), (1, 0), (0, 1), (1, 1)];
    for (x0, y0) in phases.into_iter().filter(|&(x, y)| mosaic.colour_at(x, y) == channel) {
        let half = |side: usize, first: usize| (side - first).div_ceil(2);
        let size = Size::new(half(plane.width(), x0), half(plane.height(), y0));
        let mut phase = Plane::from_fn(size, |x, y| plane.at(2 * x + x0, 2 * y + y0));
        // At half the resolution one level fewer is as coarse.
        let shrinkage = Shrinkage::new(size, DEFECT_LEVELS - 1);
        shrinkage.shrink_everywhere(&mut phase, &[threshold], None, 0, scratch);
        for y in 0..size.height {
            for x in 0..size.width {
                plane.set(2 * x + x0, 2 * y + y0, phase.at(x, y));
            }
        }
    }
    *plane = mosaic.filled(channel, plane);
}
