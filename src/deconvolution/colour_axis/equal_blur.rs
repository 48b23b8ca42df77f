//! A photo with its channels blurred equally, and the local statistics of its colours.

use rayon::prelude::*;

use crate::deconvolution::lens_model::{LensFunctions, LensModel};
use crate::deconvolution::smoothing::{blur, halve};
use crate::frame::{Channel, Frame, Plane, Work};

/// Side of a cell, pixels: that of a detail of the second level.
const CELL_PX: usize = 4;
/// σ of the smoothing before products are taken, in widths of the equal blur: 1.5 pixels on the rig
/// of the study.
const SMOOTHED: f32 = 0.5;
/// σ of the window of the local statistics, in widths of the equal blur: 5 pixels in the study,
/// where any value between 3 and 8 did as well.
const REACH: f32 = 1.7;

/// Local means and covariances of the colours, in cells of [`CELL_PX`].
pub(super) struct Statistics {
    pub(super) mean: [Plane; 3],
    /// Local means of the products rr, rg, rb, gg, gb, bb.
    products: [Plane; 6],
}

/// Channel indices of the products.
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

impl Statistics {
    /// Mean and covariance of a cell.
    pub(super) fn at(&self, x: usize, y: usize) -> ([f32; 3], [f32; 6]) {
        let mean = self.mean.each_ref().map(|plane| plane.at(x, y));
        let mut covariance = self.products.each_ref().map(|plane| plane.at(x, y));
        covariance.iter_mut().zip(PAIRS).for_each(|(v, (a, b))| *v -= mean[a] * mean[b]);
        (mean, covariance)
    }
}

/// Each channel of `photo` convolved with the lens of the other two: K_G K_B for red, and so on.
/// Spatially varying lenses nearly commute.
pub(super) fn equalise_blur(model: &LensModel, photo: &Frame<Work>) -> [Plane; 3] {
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

/// Local statistics of equally blurred channels.
pub(super) fn statistics(equal: &[Plane; 3], functions: &LensFunctions) -> Statistics {
    let width_px = width_px(functions);
    // σ in cells after subtracting the variance of averaging over a cell.
    let remaining = |sigma_px: f32, cell_px: usize| {
        let halvings = (cell_px * cell_px - 1) as f32 / 12.0;
        (sigma_px * sigma_px - halvings).max(0.0).sqrt() / cell_px as f32
    };
    let smoothed: Vec<Plane> = (equal.par_iter())
        .map(|plane| blur(&halve(plane), remaining(SMOOTHED * width_px, 2)))
        .collect();
    let local_mean = |plane: &Plane| blur(&halve(plane), remaining(REACH * width_px, CELL_PX));
    let product = |(a, b): (usize, usize)| {
        let values = smoothed[a].data().iter().zip(smoothed[b].data()).map(|(a, b)| a * b);
        let size = smoothed[a].size();
        local_mean(&Plane::from_vec(size, values.collect()).unwrap_or_else(|| Plane::zeros(size)))
    };
    Statistics { mean: [0, 1, 2].map(|c| local_mean(&smoothed[c])), products: PAIRS.map(product) }
}

/// The width of the equal blur, pixels: √Σ σ², where σ of a channel is that of the Gaussian with
/// the same Σ taps² = 1/(4πσ²).
pub fn width_px(functions: &LensFunctions) -> f32 {
    let squares = functions.taps.each_ref().map(|taps| {
        let power: f64 = taps.iter().map(|&tap| f64::from(tap).powi(2)).sum();
        let count = (functions.rows * functions.columns).max(1) as f64;
        count / (4.0 * std::f64::consts::PI * power.max(f64::MIN_POSITIVE))
    });
    squares.iter().sum::<f64>().sqrt() as f32
}
