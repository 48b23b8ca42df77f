//! Operator norms of a lens per wavelet level, and the level-dependent step sizes they allow.
//!
//! A lens attenuates fine details far more than coarse ones: a few per cent of the finest level's
//! power arrive, nearly all of the coarsest's. A single proximal step size 1/‖K‖² is bounded by the
//! coarsest level, and the finest converges slowly. Each level j may have its own step 1/αⱼ with
//! threshold μ/αⱼ and the same fixed point, provided that diag(α) − W KᵀK Wᵀ is positive
//! semidefinite (Vonesch & Unser 2009, "A fast multilevel algorithm for wavelet-regularized image
//! restoration"; Bayram & Selesnick 2010).
//!
//! αⱼ = ρ ‖K Wⱼᵀ‖², where ρ is the largest eigenvalue of the operator scaled level by level. Both
//! are computed by Lanczos iteration, so the bound accounts for the overlap of levels.

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use super::lens_model::LensModel;
use super::wavelet::{Coefficients, Scratch, Sym8};
use crate::frame::{Channel, Mosaic, Plane};

/// Safety factor on Lanczos estimates, which converge from below; a test checks that the
/// calibration's number of rounds comes within it.
const RAISED: f32 = 1.02;
/// Minimum norm of a level; bounds the step size of a level that hardly passes the lens.
const LEAST: f32 = 1e-3;
/// Largest share of a level's norm that remains on pixels binned by two: 0.46 to 0.70 for Gaussians
/// of σ 1.5 pixels (test).
const BINNED_SHARE: f32 = 0.7;
/// Seed of the random initial picture of [`LevelNorms::at_sites`].
const SITES_SEED: u64 = 18;

/// Norms αⱼ of the levels of details, finest first, and of the approximation, last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LevelNorms(Vec<f32>);

impl LevelNorms {
    /// The same α = ‖K‖² for all levels: a single step size.
    pub fn uniform(levels: usize, norm_squared: f32) -> Self {
        LevelNorms(vec![norm_squared; levels + 1])
    }

    /// Measures `model` in one channel for `levels` levels of details, by `rounds` of Lanczos
    /// iteration each, started from random numbers of `seed`.
    pub fn measure(
        model: &LensModel,
        channel: Channel,
        levels: usize,
        rounds: usize,
        seed: u64,
    ) -> Self {
        let lens = SampledLens { model, channel, mosaic: None };
        Lanczos::new(lens, levels, rounds, seed).norms(levels)
    }

    /// The norms of √w · K at the sites of `mosaic` over the canvas, where w is
    /// [`Mosaic::pixels_a_site`], and ‖√w · K‖².
    pub fn at_sites(
        model: &LensModel,
        channel: Channel,
        mosaic: Mosaic,
        levels: usize,
        rounds: usize,
    ) -> (Self, f32) {
        let lens = SampledLens { model, channel, mosaic: Some(mosaic) };
        let mut lanczos = Lanczos::new(lens, levels, rounds, SITES_SEED);
        let norms = lanczos.norms(levels);
        (norms, RAISED * lanczos.largest(&vec![1.0; levels + 1]))
    }

    /// Bounds on the norms of the same lens on pixels binned by two, which have no finest level.
    #[must_use]
    pub fn binned(&self) -> LevelNorms {
        LevelNorms(self.0.iter().skip(1).map(|norm| BINNED_SHARE * norm).collect())
    }

    /// Number of levels of details.
    pub fn levels(&self) -> usize {
        self.0.len().saturating_sub(1)
    }

    /// Norm of `level`, 0 being the finest; the approximation's is at [`LevelNorms::levels`].
    pub fn at(&self, level: usize) -> f32 {
        self.0[level]
    }

    /// All norms times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> LevelNorms {
        LevelNorms(self.0.iter().map(|norm| factor * norm).collect())
    }

    /// The larger norm of each level.
    #[must_use]
    pub fn or_larger(&self, other: &LevelNorms) -> LevelNorms {
        LevelNorms(self.0.iter().zip(&other.0).map(|(a, b)| a.max(*b)).collect())
    }

    /// Norms raised to the minimum that `least` gives for their level, if any.
    #[must_use]
    pub fn at_least(&self, least: &[f32]) -> LevelNorms {
        let mut raised = self.clone();
        raised.0.iter_mut().zip(least).for_each(|(norm, &least)| *norm = norm.max(least));
        raised
    }

    /// Whether all norms are finite and positive.
    pub fn is_whole(&self) -> bool {
        self.0.len() > 1 && self.0.iter().all(|norm| norm.is_finite() && *norm > 0.0)
    }

    /// The step sizes 1/α of each level, and of the approximation.
    pub fn steps(&self) -> Vec<f32> {
        self.0.iter().map(|norm| 1.0 / norm).collect()
    }
}

/// One channel of a lens model, sampled everywhere or at a mosaic's sites.
struct SampledLens<'a> {
    model: &'a LensModel,
    channel: Channel,
    mosaic: Option<Mosaic>,
}

impl SampledLens<'_> {
    /// `seen` = w K `shown` with the sites' weights w; `back` = Kᵀ `seen`.
    fn apply_normal(&self, shown: &Plane, seen: &mut Plane, back: &mut Plane) {
        self.model.forward(self.channel, shown, seen);
        if let Some(mosaic) = self.mosaic {
            let weight = Mosaic::pixels_a_site(self.channel);
            let weighted = |x, y| {
                if mosaic.colour_at(x, y) == self.channel { weight * seen.at(x, y) } else { 0.0 }
            };
            *seen = Plane::from_fn(seen.size(), weighted);
        }
        self.model.adjoint(self.channel, seen, back);
    }
}

/// Lanczos iteration with scaled levels.
struct Lanczos<'a> {
    lens: SampledLens<'a>,
    transform: Sym8,
    scratch: Scratch,
    rounds: usize,
    seed: u64,
}

impl<'a> Lanczos<'a> {
    fn new(lens: SampledLens<'a>, levels: usize, rounds: usize, seed: u64) -> Self {
        let transform = Sym8::new(lens.model.canvas(), levels);
        Lanczos { lens, transform, scratch: Scratch::default(), rounds, seed }
    }

    fn norms(&mut self, levels: usize) -> LevelNorms {
        let alone: Vec<f32> = (0..=levels)
            .map(|level| {
                let only: Vec<f32> =
                    (0..=levels).map(|l| if l == level { 1.0 } else { 0.0 }).collect();
                self.largest(&only).max(LEAST)
            })
            .collect();
        let scales: Vec<f32> = alone.iter().map(|norm| 1.0 / norm.sqrt()).collect();
        let overlap = self.largest(&scales).max(1.0);
        LevelNorms(alone.iter().map(|norm| norm * overlap * RAISED).collect())
    }

    /// Largest eigenvalue of S W KᵀK Wᵀ S, where S scales the levels by `scales` (Golub & Van Loan,
    /// "Matrix Computations", section 10.1). The power method takes several times the rounds,
    /// because the largest eigenvalues lie close together.
    fn largest(&mut self, scales: &[f32]) -> f32 {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        let canvas = self.lens.model.canvas();
        let mut next = Plane::from_fn(canvas, |_, _| random.random::<f32>() - 0.5);
        let (mut seen, mut found) = (Plane::zeros(canvas), self.transform.zeros());
        self.scale(&mut next, &mut found, scales);
        let mut before = Plane::zeros(canvas);
        // Unused rows add eigenvalues 0, below all others.
        let mut tridiagonal = DMatrix::<f64>::zeros(self.rounds, self.rounds);
        for round in 0..self.rounds {
            let length = next.dot(&next).sqrt();
            if length <= f64::from(f32::MIN_POSITIVE) {
                break;
            }
            let mut here = next.clone();
            here.data_mut().iter_mut().for_each(|v| *v = (f64::from(*v) / length) as f32);
            let mut scaled = here.clone();
            self.scale(&mut scaled, &mut found, scales);
            self.lens.apply_normal(&scaled, &mut seen, &mut next);
            self.scale(&mut next, &mut found, scales);
            let along = here.dot(&next);
            tridiagonal[(round, round)] = along;
            if round > 0 {
                tridiagonal[(round, round - 1)] = length;
                tridiagonal[(round - 1, round)] = length;
            }
            let others = here.data().iter().zip(before.data());
            for (v, (here, before)) in next.data_mut().iter_mut().zip(others) {
                *v -= along as f32 * here + length as f32 * before;
            }
            before = here;
        }
        tridiagonal.symmetric_eigenvalues().max() as f32
    }

    fn scale(&mut self, picture: &mut Plane, found: &mut Coefficients, scales: &[f32]) {
        self.transform.analyse(picture, found, &mut self.scratch);
        found.scale_levels(scales);
        self.transform.synthesise(found, picture, &mut self.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::LensFunctions;
    use crate::frame::{Size, SquarePlace};

    fn model() -> LensModel {
        let taps: Vec<f32> = (0..81)
            .map(|t| {
                let (x, y) = ((t % 9) as f32 - 4.0, (t / 9) as f32 - 4.0);
                (-(x * x + y * y) / (2.0 * 1.5 * 1.5)).exp()
            })
            .collect();
        let total: f32 = taps.iter().sum();
        let taps: Vec<f32> = taps.iter().map(|t| t / total).collect();
        let functions = LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 9,
            taps: [taps.clone(), taps.clone(), taps],
        };
        LensModel::new(Size::new(64, 48), 0, &functions).unwrap()
    }

    #[test]
    fn binned_pixels_pass_a_share_of_each_level() {
        let model = model();
        let kinds = [
            Channel::each(|_| SquarePlace::pixels()),
            Channel::each(|c| SquarePlace::sites(Mosaic::Rggb, c)),
            Channel::each(|c| SquarePlace::interpolated(Mosaic::Rggb, c)),
        ];
        for places in kinds {
            let binned = model.binned(&places).unwrap();
            for c in Channel::ALL {
                let own = LevelNorms::measure(&model, c, 3, 20, 1).binned();
                let measured = LevelNorms::measure(&binned, c, 2, 20, 1);
                let shares = [0, 1, 2].map(|level| measured.at(level) / own.at(level));
                assert!(shares.iter().all(|share| (0.6..1.02).contains(share)), "{c:?} {shares:?}");
            }
        }
    }

    #[test]
    fn level_dependent_steps_satisfy_the_bound() {
        let model = model();
        let norms = LevelNorms::measure(&model, Channel::Green, 3, 12, 1);
        assert!(norms.at(0) < 0.3 * norms.at(3), "fine details arrive with less power: {norms:?}");
        // xᵀ(diag α − W KᵀK Wᵀ)x ≥ 0 for any x.
        let transform = Sym8::new(model.canvas(), 3);
        let (mut scratch, mut found) = (Scratch::default(), transform.zeros());
        let mut seen = Plane::zeros(model.canvas());
        for seed in 0..20 {
            let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
            let period = 1 + seed as usize % 7;
            let picture = Plane::from_fn(model.canvas(), |x, y| {
                random.random::<f32>()
                    * if (x / period + y / period).is_multiple_of(2) { 1.0 } else { -1.0 }
            });
            model.forward(Channel::Green, &picture, &mut seen);
            transform.analyse(&picture, &mut found, &mut scratch);
            let weights: Vec<f32> = (0..=3).map(|l| norms.at(l).sqrt()).collect();
            found.scale_levels(&weights);
            let mut weighted = Plane::zeros(model.canvas());
            transform.synthesise(&found, &mut weighted, &mut scratch);
            assert!(weighted.dot(&weighted) >= seen.dot(&seen), "seed {seed}");
        }
    }
}
