//! The default: solve with the lens model, let a capture certify the result, and correct what the
//! model missed while captures show that it missed something (defect correction, Böhmer & Stetter
//! 1984).
//!
//! A capture y of the candidate L shows the model's *defect* at L: d = y − K̂L, which is (K − K̂)L
//! plus the capture's noise. The corrected problem is K̂L = B − d. Each capture adds to d what it
//! shows beyond the d already known, shrunk by its noise: what light cannot tell from noise is not
//! corrected, a right model is left alone, and when a capture shows nothing new, d is complete.
//!
//! Where the first capture shows that the lens is another than was measured, the model itself is
//! refined by it ([`crate::deconvolution::refinement`]), and d is what even that leaves.
//!
//! With block matching for the prior the first capture is of what wavelets alone make of the photo:
//! the defect there hardly differs, and block matching, most of the cost, runs once and not twice.
//! A scene of nothing but edges loses by it.
//!
//! With a poor model the corrected candidate can overshoot. The next capture tells, and light is
//! linear: the photograph of L + α(L′ − L) is y + α(y′ − y), so the best α is known without another
//! capture, and the optical residual never grows. A correction of a few steps may be followed
//! further than it went; one by block matching may not, for its prior is another than the first
//! candidate's, and what lies beyond it no prior has seen.

use rayon::prelude::*;

use super::blocks::{self, Blocks};
use super::digital::{Begun, Digital};
use super::problem::{Certificate, Target};
use super::record::Course;
use super::{About, Method, MethodError, Problem, ResidualOf, Solution, Watch};
use crate::deconvolution::data_term::{self, MISSING, TRUSTED};
use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::refinement::Measured;
use crate::deconvolution::wavelet::{Details, Scratch, Sym8};
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, FULL_SCALE, Frame, Mosaic, Plane, Size, Work};

/// Proximal steps of each correction. More gain nothing where the model is right, and build on its
/// errors where it is not (`tests/tables/truthful-wrong-models.md`).
pub const CORRECTION_STEPS: u32 = 4;
/// How much longer a correction of a photo is that its file states: its data are read anew as it
/// goes. With as many steps as of others the demo's JPEG loses 0.001 SSIM.
const STATED_LONGER: f32 = 2.5;
/// Shrinkage of the measured defect, in standard deviations of its noise; measured.
pub const DEFECT_THRESHOLD: f32 = 2.0;
/// Defect below this share of the noise floor, in the channel where it is largest, counts as none.
/// Measured on the laboratory's group of limits: what is corrected below 0.26 of it gains nothing
/// or loses, from 0.3 on it gains (`tests/tables/README.md`).
pub const DEFECT_FLOOR: f32 = 0.28;
/// How much shorter a wrong model makes the steps of a correction; measured.
pub const CAREFULNESS: f32 = 25.0;

/// The method and its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hybrid {
    /// The solve with the lens model.
    pub digital: Digital,
    /// Proximal steps of each correction. Few are better than many: stopping early keeps a poor
    /// model from building on its own errors.
    pub correction_steps: u32,
    /// Captures a photo may cost, at least 1. With 1 the first correction is not confirmed by
    /// light.
    pub captures_max: u32,
    /// Soft threshold of the defect, in standard deviations of its noise.
    pub defect_threshold: f32,
    /// Defect, as a share of the noise floor, below which the model counts as right; after the
    /// first correction more is let pass.
    pub defect_floor: f32,
    /// How much shorter a wrong model makes the steps of a correction: each level's α is at least
    /// this often the defect's share of the picture's power.
    pub carefulness: f32,
    /// Whether the first capture may refine the lens model for this photo
    /// ([`crate::deconvolution::refinement`]).
    pub refine: bool,
}

/// Shrinkage of a defect at a mosaic's sites, in standard deviations of the sensor's noise there.
const SITES_THRESHOLD: f32 = 1.0;
/// Longest step along a correction by wavelets: a few steps do not go all the way. Beyond it the
/// line through two captures says more about their noise.
const STEP_MAX: f64 = 1.5;
/// The same of one by block matching. With 1.5, too, a second capture of a lens that was touched
/// takes away half of what the first gained (`tests/tables/truthful-worth.md`).
const STEP_MAX_BY_BLOCKS: f64 = 1.0;
/// Levels of the defect's shrinkage: what stays unshrunk is averaged over 16×16 pixels, far below
/// its noise.
const DEFECT_LEVELS: usize = 4;

/// What it is.
pub const ABOUT: About =
    About { name: "hybrid", starts_from_lens: true, by_patches: false, by_steps: true };

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
        let model = problem.needs_model(self.name())?;
        let mut course = Course::by(problem.stopwatch, optics);
        let mask = self.digital.mask(problem);
        let by_wavelets = Digital { blocks: None, ..self.digital };
        let axes = self.digital.axes(problem, model);
        let prior = (&mask, axes.as_ref());
        let (picture, steps) = by_wavelets.solve_photo(problem, model, prior, watch);
        course.extend(&steps, 0, 0.0);
        let mut certificate = Certificate::uncertified(problem);
        let channels = problem.channels.list();
        let predicted = model.seen(channels, &picture);
        let seen = problem.seen(optics, Some(&predicted), &picture)?;
        let mut now = Candidate { picture, predicted, seen, defect: None };
        let (mut refined_lens, mut refined) = (None, None);
        for capture in 1..=self.captures_max.max(1) {
            let optical = problem.seen_rms(Channel::Green, now.seen.light.plane(Channel::Green));
            certificate.look(problem, &now.seen.light);
            let step = course.step(optical, ResidualOf::Optics, optics.captures());
            watch(&step, Some(&now.picture));
            let last = capture >= self.captures_max;
            if last && self.captures_max > 1 {
                break;
            }
            let mut unexplained = now.seen.unexplained(&now.predicted, channels);
            // The first picture is not yet the method's where block matching is still to come.
            let mut unsolved = capture == 1 && self.digital.blocks.is_some();
            if self.refine && capture == 1 {
                (refined_lens, refined) =
                    measured(problem, model).refine(&now.picture, &now.seen, &unexplained).unzip();
                if let Some(refined) = &refined {
                    now.predicted = refined.seen(channels, &now.picture);
                    unexplained = now.seen.unexplained(&now.predicted, channels);
                    unsolved = true;
                }
            }
            // With another lens than the measured one it may be another matter.
            if capture == 1
                && refined.is_none()
                && let Some(is_hopeless) = problem.is_hopeless
                && is_hopeless(&now.predicted)
            {
                break;
            }
            let model = refined.as_ref().unwrap_or(model);
            let norms = refined_lens.as_ref().map_or(problem.level_norms, |lens| &lens.level_norms);
            let mut known = self.new_defect(problem, unexplained, &now);
            let over = |&c: &Channel| known.plane(c).rms() as f32 / problem.noise_floor(c);
            let size = channels.iter().map(over).fold(0.0, f32::max);
            let is_corrected = size > self.defect_floor || refined.is_some();
            if size <= self.defect_floor {
                // What a refined model leaves no defect of is still to be solved for.
                if !unsolved {
                    break;
                }
                known = Frame::zeros(problem.size());
            }
            if let Some(before) = &now.defect {
                for &c in channels {
                    known.plane_mut(c).add_scaled(1.0, before.plane(c));
                }
            }
            let (mask, axes) = prior;
            let target = Target { problem, model, data: problem.photo, mask, axes, norms };
            let picture = self.corrected(target, &now, &known, &mut course, watch);
            let predicted = model.seen(channels, &picture);
            // Block matching without a defect is none.
            certificate.corrections += u32::from(is_corrected);
            if last {
                (now.picture, now.predicted) = (picture, predicted);
                certificate.optical_residual = None;
                break;
            }
            let seen = problem.seen(optics, Some(&predicted), &picture)?;
            let corrected = Candidate { picture, predicted, seen, defect: Some(known) };
            let longest = if self.digital.blocks.is_some() { STEP_MAX_BY_BLOCKS } else { STEP_MAX };
            now.step_towards(&corrected, problem, model, longest);
        }
        let by_measured = refined.map(|_| model.seen(&[Channel::Green], &now.picture));
        let by_measured = by_measured.as_ref().unwrap_or(&now.predicted);
        certificate.model_residual = Some(problem.model_residual(by_measured));
        let Candidate { picture, predicted, .. } = now;
        let predicted = Some(predicted);
        Ok(Solution {
            picture,
            predicted,
            record: course.record,
            certificate,
            refined: refined_lens,
        })
    }
}

impl Hybrid {
    /// The solution of K̂L = B − d, from the picture that there is `now`.
    fn corrected(
        &self,
        target: Target<'_>,
        now: &Candidate,
        defect: &Frame<Work>,
        course: &mut Course<'_>,
        watch: &mut Watch<'_>,
    ) -> Frame<Work> {
        let problem = target.problem;
        let mut data: Frame<Work> = problem.photo.clone();
        for &channel in problem.channels.list() {
            data.plane_mut(channel).add_scaled(-1.0, defect.plane(channel));
        }
        // A coarse defect hardly changes with the picture; a fine one does, and is known only so
        // far.
        let missed = |c: Channel| {
            let power: f64 = self.detail_powers(defect.plane(c)).iter().sum();
            (power / problem.size().area() as f64).sqrt() as f32
        };
        let doubtful = |blocks| Blocks { missed: Channel::ALL.map(missed), ..blocks };
        let blocks = self.digital.blocks.map(doubtful);
        let longer = if problem.stated.is_some() { STATED_LONGER } else { 1.0 };
        let steps = (longer * self.correction_steps as f32).round() as u32;
        let correction = Digital { steps, blocks, ..self.digital };
        let norms = &self.careful_norms(target, &now.picture, defect);
        let careful = Target { data: &data, norms, ..target };
        let begun = Begun::Picture { picture: &now.picture, predicted: &now.predicted };
        let (corrected, steps) = correction.solve_for(careful, begun, watch);
        let (captures, seconds) =
            course.record.steps().last().map_or((0, 0.0), |last| (last.captures, last.seconds));
        course.extend(&steps, captures, seconds);
        corrected
    }

    /// What is `unexplained` beyond the known defect, (y − K̂L) − d, with its noise shrunk away;
    /// zero where the capture cannot be trusted or the photo says nothing.
    fn new_defect(
        &self,
        problem: &Problem<'_>,
        mut unexplained: Frame<Work>,
        known: &Candidate,
    ) -> Frame<Work> {
        let shrinkage = Shrinkage::new(problem.size(), DEFECT_LEVELS);
        let mut scratch = ShrinkageScratch::default();
        // One plane after the other: spinning needs much memory, and keeps all cores busy by
        // itself.
        for &channel in problem.channels.list() {
            let plane = unexplained.plane_mut(channel);
            if let Some(defect) = &known.defect {
                let values = plane.data_mut().iter_mut().zip(defect.plane(channel).data());
                for ((v, d), &t) in values.zip(known.seen.trusted.plane(channel).data()) {
                    *v -= if t == TRUSTED { *d } else { 0.0 };
                }
            }
            if let Some(mosaic) = problem.capture_mosaic {
                let noise = problem.capture_noise[channel.index()];
                shrink_sites(plane, channel, mosaic, SITES_THRESHOLD * noise, &mut scratch);
            } else {
                let thresholds = [self.defect_threshold * data_term::noise_of(plane)];
                shrinkage.shrink_everywhere(plane, &thresholds, None, 0, &mut scratch);
            }
            problem.mask(channel, plane);
        }
        unexplained
    }

    /// Power of the details of `plane`, level by level, finest first.
    fn detail_powers(&self, plane: &Plane) -> Vec<f64> {
        let transform = Sym8::new(plane.size(), self.digital.levels);
        let mut found = transform.zeros();
        transform.analyse(plane, &mut found, &mut Scratch::default());
        let power =
            |details: &mut Details| details.bands_mut().iter().map(|b| b.dot(b)).sum::<f64>();
        found.details.iter_mut().map(power).collect()
    }

    /// The level norms for a correction: `norms` raised where the defect's power says that the
    /// model is wrong.
    ///
    /// With a wrong model a correction overshoots in the levels where (K − K̂) is not small against
    /// what K̂ lets through. The defect over the picture, level by level, is how large it is.
    fn careful_norms(
        &self,
        Target { problem, norms, .. }: Target<'_>,
        picture: &Frame<Work>,
        defect: &Frame<Work>,
    ) -> [LevelNorms; 3] {
        let raised = problem.channels.list().par_iter().map(|&c| {
            let (wrong, shown) =
                (self.detail_powers(defect.plane(c)), self.detail_powers(picture.plane(c)));
            let wrong = wrong.into_iter().zip(shown);
            let least: Vec<f32> = wrong
                .map(|(wrong, shown)| {
                    self.carefulness * (wrong / shown.max(f64::MIN_POSITIVE)) as f32
                })
                .collect();
            (c, norms[c.index()].at_least(&least))
        });
        let raised: Vec<(Channel, LevelNorms)> = raised.collect();
        let mut norms = norms.clone();
        raised.into_iter().for_each(|(c, raised)| norms[c.index()] = raised);
        norms
    }
}

/// Shrinks what is known at the sites of one channel, each phase of the mosaic as a plane of its
/// own, for noise is white there; between them what is left is interpolated.
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
        // One level fewer is as coarse.
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

/// What a refinement of `model` starts from.
fn measured<'a>(problem: &'a Problem<'_>, model: &'a LensModel) -> Measured<'a> {
    Measured {
        photo: problem.rect,
        channels: problem.channels.list(),
        trust: problem.trust,
        model,
        level_norms: problem.level_norms,
        capture_noise: problem.capture_noise,
    }
}

/// A picture, what the lens model predicts to be seen of it and what is, and the defect used for
/// it.
struct Candidate {
    picture: Frame<Work>,
    predicted: Frame<Work>,
    seen: Seen,
    /// None before the first correction.
    defect: Option<Frame<Work>>,
}

impl Candidate {
    /// Moves towards `corrected`, channel by channel, as far as brings the seen nearest to the
    /// photo, by at most the `longest` step. `model` is what both are predicted by.
    fn step_towards(
        &mut self,
        corrected: &Candidate,
        problem: &Problem<'_>,
        model: &LensModel,
        longest: f64,
    ) {
        for &c in problem.channels.list() {
            let alpha = best_step(problem, c, &self.seen.light, &corrected.seen.light);
            self.go(c, corrected, alpha.min(longest) as f32, model);
        }
    }

    /// Goes `alpha` of the way to `corrected` in one channel.
    fn go(&mut self, c: Channel, corrected: &Candidate, alpha: f32, model: &LensModel) {
        let towards = |plane: &mut Plane, target: &Plane| {
            let pairs = plane.data_mut().iter_mut().zip(target.data());
            pairs.for_each(|(v, &t)| *v += alpha * (t - *v));
        };
        let picture = self.picture.plane_mut(c);
        towards(picture, corrected.picture.plane(c));
        picture.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
        // Between two pictures nothing was clamped.
        match alpha <= 1.0 {
            true => towards(self.predicted.plane_mut(c), corrected.predicted.plane(c)),
            false => model.forward(c, picture, self.predicted.plane_mut(c)),
        }
        towards(self.seen.light.plane_mut(c), corrected.seen.light.plane(c));
        if let Some(defect) = &corrected.defect {
            let none = || Frame::zeros(defect.size());
            towards(self.defect.get_or_insert_with(none).plane_mut(c), defect.plane(c));
        }
        let trusted = self.seen.trusted.plane_mut(c).data_mut().iter_mut();
        trusted
            .zip(corrected.seen.trusted.plane(c).data())
            .for_each(|(t, &other)| *t = (*t).min(other));
    }
}

/// The α of at least 0 that minimises ‖y + α(y′ − y) − B‖, the captures' own noise taken out of
/// both sums; 1 when the captures differ by no more than noise.
fn best_step(
    problem: &Problem<'_>,
    channel: Channel,
    seen: &Frame<Work>,
    corrected: &Frame<Work>,
) -> f64 {
    let (mut along, mut square, mut count) = (0.0f64, 0.0f64, 0u32);
    let pairs = seen.plane(channel).data().iter().zip(corrected.plane(channel).data());
    let photo = problem.photo.plane(channel).data().iter().zip(problem.trust.plane(channel).data());
    let width = problem.size().width;
    let is_site = |n: usize| {
        let own = |mosaic: Mosaic| mosaic.colour_at(n % width, n / width) == channel;
        problem.capture_mosaic.is_none_or(own)
    };
    for (n, ((&y, &y_corrected), (&b, &trust))) in pairs.zip(photo).enumerate() {
        if trust != MISSING && is_site(n) {
            let step = f64::from(y_corrected - y);
            along += f64::from(b - y) * step;
            square += step * step;
            count += 1;
        }
    }
    let noise = f64::from(problem.capture_noise[channel.index()]).powi(2) * f64::from(count);
    let (along, square) = (along - noise, square - 2.0 * noise);
    // A difference of captures below a tenth of their noise power says nothing about the step.
    if square < 0.1 * noise { 1.0 } else { (along / square).max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::LensFunctions;

    #[test]
    fn what_is_predicted_of_a_picture_on_the_way_is_what_the_lens_makes_of_it() {
        let size = Size::new(24, 18);
        let tap = vec![0.0, 0.1, 0.0, 0.1, 0.5, 0.2, 0.0, 0.1, 0.0];
        let taps = [tap.clone(), tap.clone(), tap];
        let functions = LensFunctions { rows: 1, columns: 1, support_px: 3, taps };
        let model = LensModel::new(size, 0, &functions).unwrap();
        let green = [Channel::Green];
        let candidate = |of: fn(usize, usize) -> f32, defect: Option<f32>| {
            let picture: Frame<Work> = Frame::from_fn(|_| Plane::from_fn(size, of));
            let predicted = model.seen(&green, &picture);
            let trusted = Frame::filled(size, TRUSTED);
            let seen = Seen { light: predicted.clone(), trusted };
            let defect = defect.map(|level| Frame::filled(size, level));
            Candidate { picture, predicted, seen, defect }
        };
        let corrected =
            candidate(|x, y| if (x / 3 + y / 2) % 2 == 0 { 250.0 } else { 5.0 }, Some(4.0));
        for alpha in [0.25, 1.0, 1.5] {
            let mut now = candidate(|x, y| (7 * x + 3 * y) as f32, None);
            now.go(Channel::Green, &corrected, alpha, &model);
            let picture = now.picture.plane(Channel::Green).data();
            assert!(picture.iter().all(|v| (0.0..=FULL_SCALE).contains(v)), "{alpha}");
            let expected = model.seen(&green, &now.picture);
            let pairs = expected.plane(Channel::Green).data().iter();
            let off = pairs.zip(now.predicted.plane(Channel::Green).data());
            let off = off.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-3, "{alpha}: {off}");
            let defect = now.defect.unwrap();
            assert_eq!(defect.plane(Channel::Green).at(3, 3), 4.0 * alpha);
        }
    }
}
