//! The prior: wavelet details are few and large (paper Eqs. 3 and 6), by soft thresholding, plain
//! or cycle-spun, one by one or in clusters.
//!
//! Shrinking is done in whatever frame of the plane the shift says: the plane is thought turned
//! cyclically by `shift`, transformed, shrunk and turned back. One shift a step, another at each
//! step, is cycle spinning spread over the iteration; the mean over a set of shifts is cycle
//! spinning proper (Coifman and Donoho, "Translation-invariant de-noising", 1995).

mod clusters;
mod spinning;

use rayon::prelude::*;

use super::detail_mask::DetailMask;
use super::wavelet::{Coefficients, Scratch, Sym8};
use crate::frame::{Plane, Size};
pub(super) use spinning::{EVERYWHERE, SHIFTS};
use spinning::{Spinning, SpinningScratch, Thresholding};

/// A regulariser: what a candidate is drawn towards after each step.
pub trait Prior: Send + Sync {
    /// Replaces `plane` by its proximal point: the minimiser of ½‖x − plane‖² + `strength` ·
    /// prior(x). A prior that changes from step to step (cycle spinning) goes by `step_index`.
    fn apply(
        &self,
        plane: &mut Plane,
        strength: f32,
        step_index: usize,
        scratch: &mut ShrinkageScratch,
    );
}

/// Soft thresholding of the details of Symlets 8, one by one (the paper's) or in clusters; the
/// approximation is left alone.
#[derive(Debug, Clone)]
pub struct Shrinkage {
    transform: Sym8,
    spinning: Spinning,
    clusters: bool,
    spin: Vec<(usize, usize)>,
}

/// Memory shrinking works in; any may be used with any [`Shrinkage`] of the same size, or
/// `default()` to begin with.
#[derive(Debug, Clone, Default)]
pub struct ShrinkageScratch {
    coefficients: Option<Coefficients>,
    transform: Scratch,
    spinning: SpinningScratch,
}

impl Shrinkage {
    /// Shrinkage of planes of size `size` in `levels` levels, with no shift at any step (the
    /// paper's).
    pub fn new(size: Size, levels: usize) -> Self {
        Shrinkage {
            transform: Sym8::new(size, levels).divided(),
            spinning: Spinning::new(size, levels),
            clusters: false,
            spin: vec![(0, 0)],
        }
    }

    /// The same with the shift drawn for each step of [`Prior::apply`] from the periods of all
    /// levels, in a fixed order that spreads any few consecutive steps evenly over them.
    #[must_use]
    pub fn cycle_spun(mut self) -> Self {
        let period = 1usize << self.transform.levels();
        // Bit-reversed counting along both sides: the first 2ᵏ of them are the even spread of 2ᵏ
        // shifts.
        let reversed = |n: usize| {
            let bits = self.transform.levels();
            (0..bits).map(|b| (n >> b & 1) << (bits - 1 - b)).sum::<usize>()
        };
        self.spin = (0..period * period)
            .map(|n| {
                let (row, column) = interleaved(n);
                (reversed(column ^ row), reversed(row))
            })
            .collect();
        self
    }

    /// The same with details drawn by the threshold's share of their neighbourhood: an edge is a
    /// cluster of large details, noise is not.
    #[must_use]
    pub fn in_clusters(self) -> Self {
        Shrinkage { clusters: true, ..self }
    }

    /// Size of the planes it shrinks.
    pub fn size(&self) -> Size {
        self.transform.size()
    }

    /// The shift (columns, rows) of step `step_index`.
    pub fn shift(&self, step_index: usize) -> (usize, usize) {
        self.spin[step_index % self.spin.len()]
    }

    /// Draws all details of `plane`, turned by `shift`, towards zero by `threshold` grey levels.
    ///
    /// # Panics
    /// When the plane is of another size, which is a bug of the caller.
    pub fn shrink(
        &self,
        plane: &mut Plane,
        threshold: f32,
        shift: (usize, usize),
        scratch: &mut ShrinkageScratch,
    ) {
        self.shrink_levels(plane, &[threshold], None, shift, scratch);
    }

    /// [`Shrinkage::shrink`] with a threshold for each level, finest first; the last one holds for
    /// all coarser levels. Where details are judged in clusters, thresholds grow by `mask`.
    pub fn shrink_levels(
        &self,
        plane: &mut Plane,
        thresholds: &[f32],
        mask: Option<&DetailMask>,
        shift: (usize, usize),
        scratch: &mut ShrinkageScratch,
    ) {
        if thresholds.iter().all(|&threshold| threshold <= 0.0) {
            return;
        }
        let mut coefficients = self.coefficients(scratch);
        self.transform.analyse_shifted(plane, shift, &mut coefficients, &mut scratch.transform);
        let bands = coefficients.details.iter_mut().enumerate();
        let bands: Vec<_> =
            bands.flat_map(|(level, d)| d.bands_mut().map(|band| (level, band))).collect();
        bands.into_par_iter().with_max_len(1).for_each_init(Vec::new, |rows, (level, band)| {
            let threshold = thresholds[level.min(thresholds.len() - 1)].max(0.0);
            let factors = mask.and_then(|mask| mask.factors(level));
            draw(band, threshold, self.clusters, factors, rows);
        });
        self.transform.synthesise_shifted(&coefficients, shift, plane, &mut scratch.transform);
        scratch.coefficients = Some(coefficients);
    }

    /// Multiplies the levels of `plane`, turned by `shift`: the details by `factors`, finest first,
    /// the approximation by the last of them.
    ///
    /// # Panics
    /// When there is not one factor for each level and one more, which is a bug of the caller.
    pub fn scale_levels(
        &self,
        plane: &mut Plane,
        factors: &[f32],
        shift: (usize, usize),
        scratch: &mut ShrinkageScratch,
    ) {
        let mut coefficients = self.coefficients(scratch);
        self.transform.analyse_shifted(plane, shift, &mut coefficients, &mut scratch.transform);
        coefficients.scale_levels(factors);
        self.transform.synthesise_shifted(&coefficients, shift, plane, &mut scratch.transform);
        scratch.coefficients = Some(coefficients);
    }

    /// Coefficients to work in: those kept, if they fit.
    fn coefficients(&self, scratch: &mut ShrinkageScratch) -> Coefficients {
        let fits = scratch.coefficients.take().filter(|c| self.transform.owns(c));
        fits.unwrap_or_else(|| self.transform.zeros())
    }

    /// Replaces `plane` by the mean of its shrunk versions over all shifts of the finest levels
    /// and, of the coarser ones, those whose turn it is at step `step_index` ([`spinning`]).
    /// `thresholds` and `mask` as in [`Shrinkage::shrink_levels`].
    pub fn shrink_everywhere(
        &self,
        plane: &mut Plane,
        thresholds: &[f32],
        mask: Option<&DetailMask>,
        step_index: usize,
        scratch: &mut ShrinkageScratch,
    ) {
        if thresholds.iter().any(|&threshold| threshold > 0.0) {
            let drawing =
                Thresholding { thresholds, clusters: self.clusters, mask, turn: step_index };
            self.spinning.shrink(plane, drawing, &mut scratch.spinning);
        }
    }
}

/// Draws the details of `band` towards zero by `threshold`: in clusters, or one by one (Eq. 6).
fn draw(
    band: &mut Plane,
    threshold: f32,
    clusters: bool,
    factors: Option<&Plane>,
    rows: &mut Vec<f32>,
) {
    match clusters {
        true => clusters::draw(band, threshold, factors, rows),
        false => band.data_mut().iter_mut().for_each(|v| *v -= v.clamp(-threshold, threshold)),
    }
}

impl Prior for Shrinkage {
    fn apply(
        &self,
        plane: &mut Plane,
        strength: f32,
        step_index: usize,
        scratch: &mut ShrinkageScratch,
    ) {
        self.shrink(plane, strength, self.shift(step_index), scratch);
    }
}

/// The even and the odd bits of `n` as two numbers.
fn interleaved(n: usize) -> (usize, usize) {
    let every_second = |n: usize| (0..16).map(|b| (n >> (2 * b) & 1) << b).sum();
    (every_second(n), every_second(n >> 1))
}

#[cfg(test)]
mod tests;
