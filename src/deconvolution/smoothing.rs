//! Smoothing and decimation of planes.

use crate::frame::{Plane, Size};

/// The mean of every 2×2 pixels; an odd last row or column counts twice.
pub(super) fn halve(plane: &Plane) -> Plane {
    let size = Size::new(plane.width().div_ceil(2), plane.height().div_ceil(2));
    let (right, bottom) = (plane.width().saturating_sub(1), plane.height().saturating_sub(1));
    Plane::from_fn(size, |x, y| {
        let (x, y, x1, y1) = (2 * x, 2 * y, (2 * x + 1).min(right), (2 * y + 1).min(bottom));
        0.25 * (plane.at(x, y) + plane.at(x1, y) + plane.at(x, y1) + plane.at(x1, y1))
    })
}

/// `plane` convolved with a Gaussian of `sigma` pixels, its edge pixels repeated outside.
pub(super) fn blur(plane: &Plane, sigma: f32) -> Plane {
    if sigma < 0.2 {
        return plane.clone();
    }
    let size = plane.size();
    let reach = (3.0 * sigma).ceil() as usize;
    let weights = (0..=2 * reach).map(|at| {
        let from = at as f32 - reach as f32;
        (-from * from / (2.0 * sigma * sigma)).exp()
    });
    let weights: Vec<f32> = weights.collect();
    let total: f32 = weights.iter().sum();
    let near = |at: usize, tap: usize, end: usize| (at + tap).saturating_sub(reach).min(end - 1);
    let mut across = Plane::zeros(size);
    let mut padded = vec![0.0; size.width + 2 * reach];
    for y in 0..size.height {
        let row = plane.row(y);
        padded.iter_mut().enumerate().for_each(|(x, v)| *v = row[near(x, 0, size.width)]);
        add_weighted(across.row_mut(y), &weights, total, |tap| &padded[tap..][..size.width]);
    }
    let mut both = Plane::zeros(Size::new(size.width, size.height));
    for y in 0..size.height {
        let row_at = |tap: usize| across.row(near(y, tap, size.height));
        add_weighted(both.row_mut(y), &weights, total, row_at);
    }
    both
}

/// `out` += Σ `weights` · rows / `total`.
fn add_weighted<'a>(
    out: &mut [f32],
    weights: &[f32],
    total: f32,
    row: impl Fn(usize) -> &'a [f32],
) {
    for (tap, weight) in weights.iter().enumerate() {
        let weight = weight / total;
        out.iter_mut().zip(row(tap)).for_each(|(sum, v)| *sum += weight * v);
    }
}
