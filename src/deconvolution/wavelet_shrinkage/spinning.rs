//! Cycle spinning level by level: the mean of the shrunk pictures over all shifts of the finest
//! levels.
//!
//! A transform of n levels has 4ⁿ shifts, but one level alone has four. Spinning each of the finest
//! [`EVERYWHERE`] levels over its four, and the approximations below them over one each, costs four
//! one-level transforms of the plane for every spun level: over 16 shifts for the price of seven
//! whole ones. What is spun this way does not see where the grid lies; no choice of shifts is left
//! to do well or badly.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::draw;
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::wavelet::{Coefficients, Scratch, Sym8};
use crate::frame::{Plane, STRETCH, Size};

/// Levels spun over all their shifts. Coarser ones turn with the step.
pub(in crate::deconvolution) const EVERYWHERE: usize = 2;

/// The four shifts of one level; any two neighbours make a quincunx or complete it.
pub(in crate::deconvolution) const SHIFTS: [(usize, usize); 4] = [(0, 0), (1, 1), (1, 0), (0, 1)];

/// The levels' transforms, each of one level, the plane's own first.
#[derive(Debug, Clone)]
pub(super) struct Spinning {
    levels: Vec<Sym8>,
}

/// Memory to spin in: the plane shrunk at each of the four shifts, and as many sets of levels as
/// threads ask for.
#[derive(Debug, Default)]
pub(super) struct SpinningScratch {
    shrunk: Vec<Plane>,
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
    one: Plane,
    transform: Scratch,
    rows: Vec<f32>,
}

/// What is done to details.
#[derive(Debug, Clone, Copy)]
pub(super) struct Thresholding<'a> {
    /// Threshold of each level, finest first; the last one holds for all coarser ones.
    pub(super) thresholds: &'a [f32],
    /// Whether details are judged in clusters.
    pub(super) clusters: bool,
    pub(super) mask: Option<&'a DetailMask>,
    /// Which shift of the levels that are not spun everywhere.
    pub(super) turn: usize,
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
    /// side by side.
    pub(super) fn shrink(
        &self,
        plane: &mut Plane,
        drawing: Thresholding<'_>,
        scratch: &mut SpinningScratch,
    ) {
        if self.levels.is_empty() {
            return;
        }
        let (shrunk, free) = (&mut scratch.shrunk, &scratch.free);
        if shrunk.first().is_none_or(|first| first.size() != plane.size()) {
            *shrunk = SHIFTS.map(|_| Plane::zeros(plane.size())).into();
        }
        let source = &*plane;
        shrunk.par_iter_mut().zip(SHIFTS).for_each(|(shrunk, shift)| {
            // A set of levels is only put back whole, so a poisoned list is as good as any.
            let mut levels =
                free.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
            self.fit(&mut levels);
            std::mem::swap(&mut levels[0].sum, shrunk);
            self.sum_shrunk(0, source, drawing, &[shift], &mut levels);
            std::mem::swap(&mut levels[0].sum, shrunk);
            free.lock().unwrap_or_else(PoisonError::into_inner).push(levels);
        });
        let [a, b, c, d] = &shrunk[..] else { return };
        let stretches = plane.data_mut().par_chunks_mut(STRETCH).enumerate();
        stretches.for_each(|(n, mean)| {
            let [a, b, c, d] =
                [a, b, c, d].map(|shrunk| &shrunk.data()[n * STRETCH..][..mean.len()]);
            let four = (a.iter().zip(b)).zip(c.iter().zip(d));
            mean.iter_mut()
                .zip(four)
                .for_each(|(m, ((a, b), (c, d)))| *m = 0.25 * ((a + b) + (c + d)));
        });
    }

    /// `scratch[0].sum` = the sum of `plane`, of level `level`, shrunk at each of `shifts`.
    fn sum_shrunk(
        &self,
        level: usize,
        plane: &Plane,
        drawing: Thresholding<'_>,
        shifts: &[(usize, usize)],
        scratch: &mut [LevelScratch],
    ) {
        let (transform, deeper_exists) = (&self.levels[level], level + 1 < self.levels.len());
        let Some((here, deeper)) = scratch.split_first_mut() else { return };
        for (k, &shift) in shifts.iter().enumerate() {
            transform.analyse_shifted(plane, shift, &mut here.coefficients, &mut here.transform);
            let threshold = drawing.thresholds[level.min(drawing.thresholds.len() - 1)].max(0.0);
            for band in here.coefficients.details[0].bands_mut() {
                draw(
                    band,
                    threshold,
                    drawing.clusters,
                    drawing.mask.and_then(|c| c.factors(level)),
                    &mut here.rows,
                );
            }
            if deeper_exists {
                let approximation = &mut here.coefficients.approximation;
                if level + 1 < EVERYWHERE {
                    self.sum_shrunk(level + 1, approximation, drawing, &SHIFTS, deeper);
                    let sums = deeper[0].sum.data().iter();
                    approximation
                        .data_mut()
                        .iter_mut()
                        .zip(sums)
                        .for_each(|(a, sum)| *a = sum * 0.25);
                } else {
                    let turn = drawing.turn + k;
                    let shift = SHIFTS[(turn >> (2 * (level + 1 - EVERYWHERE))) % 4];
                    self.sum_shrunk(level + 1, approximation, drawing, &[shift], deeper);
                    std::mem::swap(approximation, &mut deeper[0].sum);
                }
            }
            match k {
                0 => transform.synthesise_shifted(
                    &here.coefficients,
                    shift,
                    &mut here.sum,
                    &mut here.transform,
                ),
                _ => {
                    transform.synthesise_shifted(
                        &here.coefficients,
                        shift,
                        &mut here.one,
                        &mut here.transform,
                    );
                    here.sum.add_scaled(1.0, &here.one);
                }
            }
        }
    }

    fn fit(&self, scratch: &mut Vec<LevelScratch>) {
        let fits = scratch.len() == self.levels.len()
            && self.levels.iter().zip(&*scratch).all(|(t, level)| t.size() == level.sum.size());
        if !fits {
            let made = self.levels.iter().enumerate().map(|(level, transform)| LevelScratch {
                coefficients: transform.zeros(),
                sum: Plane::zeros(transform.size()),
                // Each task sees one shift of the finest level.
                one: Plane::zeros(if level == 0 { Size::new(0, 0) } else { transform.size() }),
                transform: Scratch::default(),
                rows: Vec::new(),
            });
            *scratch = made.collect();
        }
    }
}
