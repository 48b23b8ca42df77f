//! The wavelet prior (paper Eqs. 3 and 6): sparse details, by soft thresholding of single
//! coefficients or of clusters, with or without cycle spinning.
//!
//! With a `shift` the plane is shifted cyclically, transformed, shrunk and shifted back. The mean
//! over a set of shifts is cycle spinning (Coifman and Donoho, "Translation-invariant de-noising",
//! 1995); using a different shift at each step spreads that mean over the iteration.

mod clusters;
mod spinning;

use rayon::prelude::*;

use super::detail_mask::DetailMask;
use super::wavelet::{Coefficients, Put, Scratch, Sym8};
use crate::frame::{Plane, Size};
pub(super) use spinning::{EVERYWHERE, SHIFTS};
use spinning::{Spinning, SpinningScratch, Thresholding};

/// Soft thresholding of Symlets 8 details, one by one (as in the paper) or in clusters; the
/// approximation is unchanged.
#[derive(Debug, Clone)]
pub struct Shrinkage {
    transform: Sym8,
    spinning: Spinning,
    clusters: bool,
}

/// Buffers of [`Shrinkage`].
#[derive(Debug, Clone, Default)]
pub struct ShrinkageScratch {
    coefficients: Option<Coefficients>,
    transform: Scratch,
    spinning: SpinningScratch,
}

impl Shrinkage {
    /// Shrinkage of planes of `size` in `levels` levels.
    pub fn new(size: Size, levels: usize) -> Self {
        Shrinkage {
            transform: Sym8::new(size, levels).parallel(),
            spinning: Spinning::new(size, levels),
            clusters: false,
        }
    }

    /// The same shrinkage, but details shrink by the power of their neighbourhood: edges are
    /// clusters of large details, noise is not.
    #[must_use]
    pub fn in_clusters(self) -> Self {
        Shrinkage { clusters: true, ..self }
    }

    /// The shift (columns, rows) of step `step_index`, in a fixed order in which any few
    /// consecutive shifts are spread evenly over the period of the coarsest level.
    pub fn shift(&self, step_index: usize) -> (usize, usize) {
        let bits = self.transform.levels();
        // The even and the odd bits of the index form two bit-reversed counters, so that the first
        // 2ᵏ shifts are evenly spread.
        let reversed = |every_second: usize| {
            let bit = |b: usize| (every_second >> (2 * b) & 1) << (bits - 1 - b);
            (0..bits).map(bit).sum::<usize>()
        };
        let (row, column) = (reversed(step_index), reversed(step_index >> 1));
        (column ^ row, row)
    }

    /// Shrinks all details of `plane`, shifted by `shift`, by `threshold` grey levels.
    ///
    /// # Panics
    /// When the plane has another size.
    pub fn shrink(
        &self,
        plane: &mut Plane,
        threshold: f32,
        shift: (usize, usize),
        scratch: &mut ShrinkageScratch,
    ) {
        self.shrink_levels(plane, &[threshold], None, shift, scratch);
    }

    /// Shrinks with a threshold for each level, finest first, the last one for all coarser levels.
    /// Thresholds of clusters are multiplied by the factors of `mask`. Else as
    /// [`Shrinkage::shrink`].
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
            shrink_band(band, threshold, self.clusters, factors, rows);
        });
        self.transform.synthesise_shifted(
            &coefficients,
            shift,
            (plane, Put::Set),
            &mut scratch.transform,
        );
        scratch.coefficients = Some(coefficients);
    }

    /// Multiplies the details of `plane`, shifted by `shift`, by one of `factors` for each level,
    /// finest first, and its approximation by the last one.
    ///
    /// # Panics
    /// Unless there is one factor for each level and one for the approximation.
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
        self.transform.synthesise_shifted(
            &coefficients,
            shift,
            (plane, Put::Set),
            &mut scratch.transform,
        );
        scratch.coefficients = Some(coefficients);
    }

    /// Coefficients of the transform's size, reused from `scratch` if they fit.
    fn coefficients(&self, scratch: &mut ShrinkageScratch) -> Coefficients {
        let fits = scratch.coefficients.take().filter(|c| self.transform.fits(c));
        fits.unwrap_or_else(|| self.transform.zeros())
    }

    /// Replaces `plane` by the mean of its shrunk versions over all shifts of the finest levels,
    /// with one shift of each coarser level, chosen by `step_index` ([`spinning`]). `thresholds`
    /// and `mask` as in [`Shrinkage::shrink_levels`].
    pub fn shrink_everywhere(
        &self,
        plane: &mut Plane,
        thresholds: &[f32],
        mask: Option<&DetailMask>,
        step_index: usize,
        scratch: &mut ShrinkageScratch,
    ) {
        if thresholds.iter().any(|&threshold| threshold > 0.0) {
            let thresholding =
                Thresholding { thresholds, clusters: self.clusters, mask, step_index };
            self.spinning.shrink(plane, thresholding, &mut scratch.spinning);
        }
    }
}

/// Shrinks the details of `band` by `threshold`, in clusters or singly (Eq. 6).
fn shrink_band(
    band: &mut Plane,
    threshold: f32,
    clusters: bool,
    factors: Option<&Plane>,
    rows: &mut Vec<f32>,
) {
    match clusters {
        true => clusters::shrink(band, threshold, factors, rows),
        false => band.data_mut().iter_mut().for_each(|v| *v -= v.clamp(-threshold, threshold)),
    }
}

#[cfg(test)]
mod tests;
