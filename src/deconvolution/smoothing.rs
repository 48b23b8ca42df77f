//! Smoothing and decimation of planes.

use crate::frame::{Plane, Rect, Size};

/// The mean of every 2×2 pixels; an odd last row or column counts twice.
pub(super) fn halve(plane: &Plane) -> Plane {
    of_each_four(plane, |[a, b, c, d]| 0.25 * (a + b + c + d))
}

/// The result of `of` for every 2×2 pixels, given row by row; an odd last row or column counts
/// twice.
pub(super) fn of_each_four(plane: &Plane, of: impl Fn([f32; 4]) -> f32) -> Plane {
    let size = Size::new(plane.width().div_ceil(2), plane.height().div_ceil(2));
    let (right, bottom) = (plane.width().saturating_sub(1), plane.height().saturating_sub(1));
    Plane::from_fn(size, |x, y| {
        let (x, y, x1, y1) = (2 * x, 2 * y, (2 * x + 1).min(right), (2 * y + 1).min(bottom));
        of([plane.at(x, y), plane.at(x1, y), plane.at(x, y1), plane.at(x1, y1)])
    })
}

/// `plane` convolved with a Gaussian of `sigma` pixels, its edge pixels repeated outside.
pub(super) fn blur(plane: &Plane, sigma: f32) -> Plane {
    if sigma < 0.2 {
        return plane.clone();
    }
    let reach = (3.0 * sigma).ceil() as usize;
    let weights = (0..=2 * reach).map(|at| {
        let from = at as f32 - reach as f32;
        (-from * from / (2.0 * sigma * sigma)).exp()
    });
    let mut weights: Vec<f32> = weights.collect();
    let total: f32 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= total);
    along_both(plane, &weights, 1.0)
}

/// `plane` convolved along rows and then columns with `weights`, centred on their middle, each sum
/// divided by `divisor`; edge pixels are repeated outside.
fn along_both(plane: &Plane, weights: &[f32], divisor: f32) -> Plane {
    let (size, reach) = (plane.size(), weights.len() / 2);
    let near = |at: usize, tap: usize, end: usize| (at + tap).saturating_sub(reach).min(end - 1);
    let mut across = Plane::zeros(size);
    let mut padded = vec![0.0; size.width + 2 * reach];
    for y in 0..size.height {
        let row = plane.row(y);
        padded.iter_mut().enumerate().for_each(|(x, v)| *v = row[near(x, 0, size.width)]);
        weigh(across.row_mut(y), weights, divisor, |tap| &padded[tap..][..size.width]);
    }
    let mut both = Plane::zeros(size);
    for y in 0..size.height {
        let row_at = |tap: usize| across.row(near(y, tap, size.height));
        weigh(both.row_mut(y), weights, divisor, row_at);
    }
    both
}

/// Pixels summed at a time: their sums stay in registers.
const LANES: usize = 16;

/// Sets `out` to Σ `weights` · rows / `divisor`.
fn weigh<'a>(out: &mut [f32], weights: &[f32], divisor: f32, row: impl Fn(usize) -> &'a [f32]) {
    let rows: Vec<(f32, &[f32])> = weights.iter().copied().zip((0..).map(row)).collect();
    let (whole, rest) = out.as_chunks_mut::<LANES>();
    for (n, out) in whole.iter_mut().enumerate() {
        let mut sums = [0.0f32; LANES];
        for (weight, row) in &rows {
            let row = &row[n * LANES..][..LANES];
            sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += weight * v);
        }
        *out = sums.map(|sum| sum / divisor);
    }
    for (x, out) in (whole.len() * LANES..).zip(rest) {
        *out = rows.iter().fold(0.0, |sum, (weight, row)| sum + weight * row[x]) / divisor;
    }
}

/// Mean of the square that reaches `reach` pixels to each side of every pixel, edges repeated.
pub fn mean_around(plane: &Plane, reach: usize) -> Plane {
    let side = 2 * reach + 1;
    along_both(plane, &vec![1.0; side], side as f32)
}

/// Replaces the pixels of `plane` that are set in `mask`, which lies at `rect`, by a smooth
/// continuation of the others.
pub fn fill(plane: &mut Plane, mask: &Plane<bool>, rect: Rect) {
    let weights = mask.map(|masked: bool| f32::from(u8::from(!masked)));
    let filled = filled(&plane.crop(rect), &weights);
    for y in 0..rect.size.height {
        plane.row_mut(rect.y + y)[rect.x..][..rect.size.width].copy_from_slice(filled.row(y));
    }
}

/// `values`, with those of weight 0 replaced by interpolated means over the smallest surrounding
/// squares that have a weight.
fn filled(values: &Plane, weights: &Plane) -> Plane {
    let size = values.size();
    if size.area() == 1 || weights.data().iter().all(|&weight| weight > 0.0) {
        return values.clone();
    }
    let mut weighted = values.clone();
    weighted.multiply(weights);
    let (mut means, weights_of_four) = (halve(&weighted), halve(weights));
    means.update(&weights_of_four, |mean, w| *mean /= if w > 0.0 { w } else { 1.0 });
    let coarse = filled(&means, &weights_of_four);
    // Linear interpolation: three quarters of the square around a pixel, a quarter of the next one.
    let near = |at: usize, length: usize| {
        let beside = if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { at / 2 + 1 };
        [(at / 2, 0.75), (beside.min(length - 1), 0.25)]
    };
    Plane::from_fn(size, |x, y| {
        if weights.at(x, y) > 0.0 {
            return values.at(x, y);
        }
        let row = |y: usize| {
            near(x, coarse.width()).map(|(x, share)| share * coarse.at(x, y)).iter().sum::<f32>()
        };
        near(y, coarse.height()).map(|(y, share)| share * row(y)).iter().sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_is_filled_from_its_rim() {
        let size = Size::new(37, 26);
        let rect = Rect { x: 2, y: 1, size: Size::new(33, 23) };
        let slope = |x: usize, y: usize| 50.0 + 2.0 * x as f32 - y as f32;
        let hole = |x: usize, y: usize| (10..20).contains(&x) && (8..15).contains(&y);
        let mask = Plane::from_fn(rect.size, hole);
        let in_hole = |x: usize, y: usize| x >= 2 && y >= 1 && hole(x - 2, y - 1);
        let mut plane =
            Plane::from_fn(size, |x, y| if in_hole(x, y) { 255.0 } else { slope(x, y) });
        fill(&mut plane, &mask, rect);
        for (x, y) in (0..size.area()).map(|i| (i % size.width, i / size.width)) {
            let error = (plane.at(x, y) - slope(x, y)).abs();
            assert!(error <= if in_hole(x, y) { 12.0 } else { 0.0 }, "({x}, {y}): {error}");
        }
    }
}
