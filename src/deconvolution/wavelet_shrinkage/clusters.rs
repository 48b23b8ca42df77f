//! Shrinkage of details by the power of their neighbourhood.
//!
//! v ← v · max(0, 1 − t/√P), where P is the mean power of the 3×3 details about v, weighted (1 2
//! 1)/4 along both axes and periodic like the transform. Among details of its own size v shrinks by
//! t, as in soft thresholding; an isolated detail shrinks by 2t ("windowed group lasso": Kowalski &
//! Torrésani 2009, "Sparsity and persistence").

use crate::frame::Plane;
use crate::frame::instructions::{Kernel, run_fastest};

/// Shrinks `band` by `threshold`, times `factors` pixel by pixel if given; `rows` is scratch.
pub(super) fn shrink(
    band: &mut Plane,
    threshold: f32,
    factors: Option<&Plane>,
    rows: &mut Vec<f32>,
) {
    if threshold <= 0.0 || band.size().area() == 0 {
        return;
    }
    rows.resize(5 * band.width() + (band.width() + 2), 0.0);
    rows[..band.width()].fill(1.0);
    let factors = factors.filter(|factors| factors.size() == band.size());
    run_fastest(Shrink { band, threshold, factors, rows });
}

struct Shrink<'a> {
    band: &'a mut Plane,
    threshold: f32,
    factors: Option<&'a Plane>,
    rows: &'a mut [f32],
}

impl Kernel for Shrink<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Shrink { band, threshold, factors, rows } = self;
        let (width, height) = (band.width(), band.height());
        // Powers of the original details in the first row, the row above, this row and the row
        // below, followed by their weighted sums.
        let (ones, rows) = rows.split_at_mut(width);
        let (first, rows) = rows.split_at_mut(width);
        let (mut above, rest) = rows.split_at_mut(width);
        let (mut here, rest) = rest.split_at_mut(width);
        let (mut below, sums) = rest.split_at_mut(width);
        square(band.row(0), first);
        here.copy_from_slice(first);
        square(band.row(height - 1), above);
        for y in 0..height {
            match y + 1 < height {
                true => square(band.row(y + 1), below),
                false => below.copy_from_slice(first),
            }
            for (((sum, a), h), b) in
                sums[1..=width].iter_mut().zip(&*above).zip(&*here).zip(&*below)
            {
                *sum = a + 2.0 * h + b;
            }
            (sums[0], sums[width + 1]) = (sums[width], sums[1]);
            let row = band.row_mut(y);
            let (left, middle, right) = (&sums[..width], &sums[1..=width], &sums[2..width + 2]);
            let factors = factors.map_or(&*ones, |factors| factors.row(y));
            for ((((value, l), m), r), factor) in
                row.iter_mut().zip(left).zip(middle).zip(right).zip(factors)
            {
                let power = (l + 2.0 * m + r) * (1.0 / 16.0);
                // Where the power is 0 the detail is 0, too.
                *value *= (1.0 - threshold * factor / power.max(f32::MIN_POSITIVE).sqrt()).max(0.0);
            }
            (above, here, below) = (here, below, above);
        }
    }
}

#[inline(always)]
fn square(row: &[f32], powers: &mut [f32]) {
    powers.iter_mut().zip(row).for_each(|(power, value)| *power = value * value);
}
