//! Cycle spinning level by level: the mean of shrunk planes over all shifts of the finest levels.
//!
//! A transform of n levels has 4ⁿ shifts, a single level has four. Averaging each of the finest
//! [`EVERYWHERE`] levels over its four shifts, and coarser levels over one, costs four one-level
//! transforms of the plane per averaged level: 16 shifts for the price of seven whole transforms.
//! The averaged levels are translation-invariant.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::shrink_band;
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::wavelet::{Coefficients, Put, Scratch, Sym8};
use crate::frame::{Plane, STRETCH, Size};

/// Number of levels averaged over all shifts. Coarser levels change their shift with the step.
pub(in crate::deconvolution) const EVERYWHERE: usize = 2;

/// The four shifts of one level; the first two and the last two are quincunxes.
pub(in crate::deconvolution) const SHIFTS: [(usize, usize); 4] = [(0, 0), (1, 1), (1, 0), (0, 1)];

/// One-level transforms, finest level first.
#[derive(Debug, Clone)]
pub(super) struct Spinning {
    levels: Vec<Sym8>,
}

/// Buffers of cycle spinning.
#[derive(Debug, Default)]
pub(super) struct SpinningScratch {
    /// The plane shrunk at each of the four shifts.
    shrunk: Vec<Plane>,
    /// A pool of level buffers, one set per concurrent task.
    free: Mutex<Vec<Vec<LevelScratch>>>,
}

impl Clone for SpinningScratch {
    fn clone(&self) -> Self {
        SpinningScratch::default()
    }
}

#[derive(Debug, Clone)]
struct LevelScratch {
    coefficients: Coefficients,
    sum: Plane,
    rows: Vec<f32>,
}

/// Thresholds of one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Thresholding<'a> {
    /// Threshold of each level, finest first, the last one for all coarser levels.
    pub(super) thresholds: &'a [f32],
    /// Whether details are shrunk in clusters.
    pub(super) clusters: bool,
    pub(super) mask: Option<&'a DetailMask>,
    /// Selects the shifts of the coarser levels.
    pub(super) step_index: usize,
}

impl Spinning {
    pub(super) fn new(size: Size, levels: usize) -> Self {
        let mut of_level = size;
        let levels = (0..levels).map(|_| {
            let transform = Sym8::new(of_level, 1);
            of_level = Size::new(of_level.width.div_ceil(2), of_level.height.div_ceil(2));
            transform
        });
        Spinning { levels: levels.collect() }
    }

    /// Replaces `plane` by the mean of its shrunk versions; the four shifts of the finest level run
    /// in parallel.
    pub(super) fn shrink(
        &self,
        plane: &mut Plane,
        thresholding: Thresholding<'_>,
        scratch: &mut SpinningScratch,
    ) {
        let (shrunk, free) = (&mut scratch.shrunk, &scratch.free);
        if shrunk.first().is_none_or(|first| first.size() != plane.size()) {
            *shrunk = SHIFTS.map(|_| Plane::zeros(plane.size())).into();
        }
        let source = &*plane;
        shrunk.par_iter_mut().zip(SHIFTS).for_each(|(shrunk, shift)| {
            // The pool is consistent even when poisoned.
            let mut levels =
                free.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
            self.fit(&mut levels);
            std::mem::swap(&mut levels[0].sum, shrunk);
            self.sum_shrunk(0, source, thresholding, &[shift], &mut levels);
            std::mem::swap(&mut levels[0].sum, shrunk);
            free.lock().unwrap_or_else(PoisonError::into_inner).push(levels);
        });
        let [a, b, c, d] = &shrunk[..] else { return };
        let pixels = (plane.data_mut(), a.data(), b.data(), c.data(), d.data()).into_par_iter();
        let mean = pixels.with_min_len(STRETCH);
        mean.for_each(|(mean, a, b, c, d)| *mean = 0.25 * ((a + b) + (c + d)));
    }

    /// `scratch[0].sum` = the sum of `plane`, the input of level `level`, shrunk at each of
    /// `shifts`.
    fn sum_shrunk(
        &self,
        level: usize,
        plane: &Plane,
        thresholding: Thresholding<'_>,
        shifts: &[(usize, usize)],
        scratch: &mut [LevelScratch],
    ) {
        let (transform, deeper_exists) = (&self.levels[level], level + 1 < self.levels.len());
        let Some((here, deeper)) = scratch.split_first_mut() else { return };
        // A transform of one level needs no scratch memory.
        let mut unused = Scratch::default();
        for (k, &shift) in shifts.iter().enumerate() {
            transform.analyse_shifted(plane, shift, &mut here.coefficients, &mut unused);
            let threshold =
                thresholding.thresholds[level.min(thresholding.thresholds.len() - 1)].max(0.0);
            for band in here.coefficients.details[0].bands_mut() {
                let factors = thresholding.mask.and_then(|mask| mask.factors(level));
                shrink_band(band, threshold, thresholding.clusters, factors, &mut here.rows);
            }
            if deeper_exists {
                let approximation = &mut here.coefficients.approximation;
                if level + 1 < EVERYWHERE {
                    self.sum_shrunk(level + 1, approximation, thresholding, &SHIFTS, deeper);
                    let sums = deeper[0].sum.data().iter();
                    approximation
                        .data_mut()
                        .iter_mut()
                        .zip(sums)
                        .for_each(|(a, sum)| *a = sum * 0.25);
                } else {
                    let step = thresholding.step_index + k;
                    let shift = SHIFTS[(step >> (2 * (level + 1 - EVERYWHERE))) % 4];
                    self.sum_shrunk(level + 1, approximation, thresholding, &[shift], deeper);
                    std::mem::swap(approximation, &mut deeper[0].sum);
                }
            }
            let LevelScratch { coefficients, sum, .. } = &mut *here;
            let put = if k == 0 { Put::Set } else { Put::Add };
            transform.synthesise_shifted(coefficients, shift, (sum, put), &mut unused);
        }
    }

    fn fit(&self, scratch: &mut Vec<LevelScratch>) {
        let fits = scratch.len() == self.levels.len()
            && self.levels.iter().zip(&*scratch).all(|(t, level)| t.size() == level.sum.size());
        if !fits {
            let made = self.levels.iter().map(|transform| LevelScratch {
                coefficients: transform.zeros(),
                sum: Plane::zeros(transform.size()),
                rows: Vec::new(),
            });
            *scratch = made.collect();
        }
    }
}
