//! A photo whose channels are blurred alike, and how its colours lie place by place.

use rayon::prelude::*;

use crate::deconvolution::lens_model::{LensFunctions, LensModel};
use crate::frame::{Channel, Frame, Plane, Size, Work};

/// Pixels of a place: as many as a detail of the second level has.
const CELL_PX: usize = 4;
/// Smoothing before covariances are taken, and the reach of a place's surroundings, over the width
/// of the equal blur. The independent study's 1.5 and 5 pixels on its rig; between 3 and 8 the
/// second does not matter.
const SMOOTHED: f32 = 0.5;
const REACH: f32 = 1.7;

/// Means and covariances of the colours about every place of [`CELL_PX`].
pub(super) struct Statistics {
    pub(super) mean: [Plane; 3],
    /// Means of the products rr, rg, rb, gg, gb, bb.
    products: [Plane; 6],
}

/// Channels of the products.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

impl Statistics {
    /// Mean and covariance at a place.
    pub(super) fn at(&self, x: usize, y: usize) -> ([f32; 3], [f32; 6]) {
        let mean = self.mean.each_ref().map(|plane| plane.at(x, y));
        let mut covariance = self.products.each_ref().map(|plane| plane.at(x, y));
        covariance.iter_mut().zip(PAIRS).for_each(|(v, (a, b))| *v -= mean[a] * mean[b]);
        (mean, covariance)
    }
}

/// Each channel of `photo` through the lens of the two others: K_G K_B of red, and so on. Lenses
/// that vary over the field commute nearly.
pub(super) fn equally_blurred(model: &LensModel, photo: &Frame<Work>) -> [Plane; 3] {
    let blurred = Channel::ALL.map(|c| (c, photo.plane(c).clone())).into_par_iter();
    let blurred: Vec<Plane> = blurred
        .map(|(own, mut plane)| {
            let mut seen = Plane::zeros(plane.size());
            for other in Channel::ALL.into_iter().filter(|&c| c != own) {
                model.forward(other, &plane, &mut seen);
                std::mem::swap(&mut plane, &mut seen);
            }
            plane
        })
        .collect();
    <[Plane; 3]>::try_from(blurred).unwrap_or_else(|_| [(); 3].map(|()| Plane::zeros(photo.size())))
}

/// What is known of the places of equally blurred channels.
pub(super) fn statistics(alike: &[Plane; 3], functions: &LensFunctions) -> Statistics {
    let width_px = width_px(functions);
    // Halving takes the mean of two pixels each way, a blur of half a pixel.
    let left = |sigma_px: f32, cell_px: usize| {
        let halvings = (cell_px * cell_px - 1) as f32 / 12.0;
        (sigma_px * sigma_px - halvings).max(0.0).sqrt() / cell_px as f32
    };
    let smoothed: Vec<Plane> = (alike.par_iter())
        .map(|plane| blurred(&halved(plane), left(SMOOTHED * width_px, 2)))
        .collect();
    let about = |plane: &Plane| blurred(&halved(plane), left(REACH * width_px, CELL_PX));
    let product = |(a, b): (usize, usize)| {
        let values = smoothed[a].data().iter().zip(smoothed[b].data()).map(|(a, b)| a * b);
        let size = smoothed[a].size();
        about(&Plane::from_vec(size, values.collect()).unwrap_or_else(|| Plane::zeros(size)))
    };
    Statistics { mean: [0, 1, 2].map(|c| about(&smoothed[c])), products: PAIRS.map(product) }
}

/// The width of the equal blur, pixels: of each channel the standard deviation of the Gaussian that
/// is as concentrated, Σ taps² = 1/(4πσ²), and their squares' sum.
pub fn width_px(functions: &LensFunctions) -> f32 {
    let squares = functions.taps.each_ref().map(|taps| {
        let power: f64 = taps.iter().map(|&tap| f64::from(tap).powi(2)).sum();
        let count = (functions.rows * functions.columns).max(1) as f64;
        count / (4.0 * std::f64::consts::PI * power.max(f64::MIN_POSITIVE))
    });
    squares.iter().sum::<f64>().sqrt() as f32
}

/// The mean of every four pixels; of a side's last one alone it is that.
pub(in crate::deconvolution) fn halved(plane: &Plane) -> Plane {
    let size = Size::new(plane.width().div_ceil(2), plane.height().div_ceil(2));
    let (right, bottom) = (plane.width() - 1, plane.height() - 1);
    Plane::from_fn(size, |x, y| {
        let (x, y, x1, y1) = (2 * x, 2 * y, (2 * x + 1).min(right), (2 * y + 1).min(bottom));
        0.25 * (plane.at(x, y) + plane.at(x1, y) + plane.at(x, y1) + plane.at(x1, y1))
    })
}

/// `plane` under a Gaussian of `sigma` pixels, its edges repeated.
pub(in crate::deconvolution) fn blurred(plane: &Plane, sigma: f32) -> Plane {
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

/// `out` += Σ `weights` · rows over `total`.
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
