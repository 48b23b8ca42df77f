//! The lens functions, from captures of pseudo-random patterns.
//!
//! All functions of a channel are fitted at once: the taps whose interpolated model K(taps)·x comes
//! nearest to what was seen of the patterns x, by conjugate gradients on the normal equations.
//! Zero-mean white patterns make these nearly diagonal: in expectation they are the overlaps of the
//! functions' weights, and with that as preconditioner a handful of rounds is enough. Negative taps
//! stay: cutting them biases the model (study: it hurts).

mod broad;
mod overlaps;
mod plausibility;
mod shape;

pub use broad::{halos, within_a_square, without_halos};
pub use plausibility::{dominant, misfit};
pub use shape::{centroid, displacement, moments, normalise};

use nalgebra::{Cholesky, DMatrix, Dyn};
use rayon::prelude::*;

use crate::deconvolution::lens_model::{LensFunctions, LensModel, LensModelError};
use crate::frame::{Channel, Plane, Size};

/// Why no lens functions were found.
#[derive(Debug, thiserror::Error)]
pub enum LensBlurError {
    /// Grid and support do not make a model.
    #[error("the lens model cannot be set up")]
    Model(#[source] LensModelError),
    /// Too little was seen of some function.
    #[error(
        "some lens function is seen by too few trusted pixels: {trusted} of {all} pixels are \
         trusted"
    )]
    NotSeen {
        /// Trusted pixels.
        trusted: usize,
        /// All pixels of the canvas.
        all: usize,
    },
}

/// The grid of functions to be found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FunctionGrid {
    /// The photo's size.
    pub photo: Size,
    /// Canvas around it.
    pub margin_px: usize,
    /// Functions from left to right.
    pub columns: usize,
    /// Functions from top to bottom.
    pub rows: usize,
    /// Side of each function's support, odd.
    pub support_px: usize,
}

/// One pattern: what was shown and what was seen, both as differences from grey, canvas-sized.
#[derive(Debug, Clone)]
pub struct Shot {
    /// Shown light minus grey.
    pub shown: Plane,
    /// Seen light minus what is seen of grey.
    pub seen: Plane,
}

/// Weight of the penalty on the taps' squares, as a share of what the data say of one tap: noise
/// over signal of a tap as the study has them (noise 1 grey level, patterns of 80, 65 000 pixels a
/// function).
const RIDGE: f64 = 1e-3;

impl FunctionGrid {
    /// The canvas.
    fn canvas(&self) -> Size {
        Size::new(self.photo.width + 2 * self.margin_px, self.photo.height + 2 * self.margin_px)
    }

    /// Functions that only pass light on, as a start.
    fn unblurred(&self) -> LensFunctions {
        let (k, count) = (self.support_px, self.rows * self.columns);
        let mut taps = vec![0.0; count * k * k];
        for function in taps.chunks_mut((k * k).max(1)) {
            function[k * k / 2] = 1.0;
        }
        LensFunctions {
            rows: self.rows,
            columns: self.columns,
            support_px: k,
            taps: [taps.clone(), taps.clone(), taps],
        }
    }

    /// Weight of each of `count` functions along a side, per canvas pixel: the model's bilinear
    /// hats.
    fn hats(&self, photo_px: usize, count: usize) -> Vec<Vec<f64>> {
        let place = |pixel: usize| {
            let along =
                (pixel as f64 - self.margin_px as f64 + 0.5) * count as f64 / photo_px as f64 - 0.5;
            along.clamp(0.0, count as f64 - 1.0)
        };
        let hats =
            |pixel| (0..count).map(|n| (1.0 - (place(pixel) - n as f64).abs()).max(0.0)).collect();
        (0..photo_px + 2 * self.margin_px).map(hats).collect()
    }
}

/// Finds the functions of one channel after another on one grid.
pub struct FunctionFit {
    grid: FunctionGrid,
    model: LensModel,
    trusted: Plane<u8>,
    /// Factor of the expected normal matrix for patterns of unit variance: overlaps of the weights.
    overlaps: Cholesky<f64, Dyn>,
    /// Mean of its diagonal.
    diagonal: f64,
}

impl FunctionFit {
    /// For `grid`, using pixels with `trusted` = 1 (canvas-sized). Patterns must be grey at the
    /// canvas's border, so that what is shown beyond it, which the model knows nothing of, is no
    /// different from grey.
    ///
    /// # Errors
    /// When the grid makes no model or some function is hardly seen.
    pub fn new(grid: FunctionGrid, trusted: &Plane<u8>) -> Result<FunctionFit, LensBlurError> {
        let model = LensModel::new(grid.photo, grid.margin_px, &grid.unblurred())
            .map_err(LensBlurError::Model)?;
        let (canvas, trusted) = (grid.canvas(), trusted.clone());
        let normal = overlaps::overlaps(&grid, &trusted);
        let diagonal = normal.trace() / normal.nrows() as f64;
        let not_seen = || LensBlurError::NotSeen {
            trusted: trusted.data().iter().filter(|&&t| t > 0).count(),
            all: canvas.area(),
        };
        // A function seen by less than a hundredth of what the others are seen by is not seen.
        if normal.diagonal().iter().any(|&d| d < 0.01 * diagonal) {
            return Err(not_seen());
        }
        let ridge = DMatrix::identity(normal.nrows(), normal.ncols()) * (RIDGE * diagonal);
        let overlaps = Cholesky::new(normal + ridge).ok_or_else(not_seen)?;
        Ok(FunctionFit { grid, model, trusted, overlaps, diagonal })
    }

    /// The taps of one channel, `[rows][columns][k][k]`, after `rounds` of conjugate gradients.
    ///
    /// # Errors
    /// When the taps found are not finite, which takes captures that are not.
    pub fn taps(
        &mut self,
        channel: Channel,
        shots: &[Shot],
        rounds: usize,
    ) -> Result<Vec<f32>, LensBlurError> {
        // Mean squared light of the patterns; makes the expected normal matrix `power` × overlaps.
        let power: f64 = shots
            .iter()
            .map(|s| s.shown.dot(&s.shown) / s.shown.size().area() as f64)
            .sum::<f64>()
            .max(1e-12);
        let ridge = (RIDGE * power * self.diagonal) as f32;
        let count = self.grid.rows * self.grid.columns * self.grid.support_px.pow(2);
        let mut taps = vec![0.0f32; count];
        let mut rest = self.gathered(channel, shots, |s| s.seen.clone());
        let mut better = self.preconditioned(&rest, power);
        let mut direction = better.clone();
        let mut length = dot(&rest, &better);
        for _ in 0..rounds {
            if length <= 0.0 {
                break;
            }
            self.model.set_taps(channel, &direction).map_err(LensBlurError::Model)?;
            let mut bent = self.gathered(channel, shots, |s| {
                let mut seen = Plane::zeros(s.shown.size());
                self.model.forward(channel, &s.shown, &mut seen);
                seen
            });
            add(&mut bent, ridge, &direction);
            let step = (length / dot(&direction, &bent)) as f32;
            add(&mut taps, step, &direction);
            add(&mut rest, -step, &bent);
            better = self.preconditioned(&rest, power);
            let next = dot(&rest, &better);
            let keep = (next / length) as f32;
            length = next;
            direction.iter_mut().zip(&better).for_each(|(d, b)| *d = *b + keep * *d);
        }
        // Leaves the channel with what was found, and checks that it is finite.
        self.model.set_taps(channel, &taps).map_err(LensBlurError::Model)?;
        Ok(taps)
    }

    /// Σ over the shots of the adjoint of taps ↦ K(taps)·shown, of trusted pixels of `picture`.
    fn gathered(
        &self,
        channel: Channel,
        shots: &[Shot],
        picture: impl Fn(&Shot) -> Plane + Sync,
    ) -> Vec<f32> {
        let parts: Vec<Vec<f32>> = shots
            .par_iter()
            .map(|shot| {
                let mut picture = picture(shot);
                for (v, &t) in picture.data_mut().iter_mut().zip(self.trusted.data()) {
                    *v *= f32::from(t);
                }
                self.model.correlate(channel, &shot.shown, &picture)
            })
            .collect();
        let mut total = vec![0.0; self.grid.rows * self.grid.columns * self.grid.support_px.pow(2)];
        for part in &parts {
            add(&mut total, 1.0, part);
        }
        total
    }

    /// The expected normal matrix's inverse applied: every tap over all functions.
    fn preconditioned(&self, rest: &[f32], power: f64) -> Vec<f32> {
        let one = self.grid.support_px.pow(2);
        let functions = self.grid.rows * self.grid.columns;
        let mut sides =
            DMatrix::from_fn(functions, one, |n, tap| f64::from(rest[n * one + tap]) / power);
        self.overlaps.solve_mut(&mut sides);
        let mut out = vec![0.0; rest.len()];
        for n in 0..functions {
            for tap in 0..one {
                out[n * one + tap] = sides[(n, tap)] as f32;
            }
        }
        out
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}

fn add(to: &mut [f32], weight: f32, what: &[f32]) {
    to.iter_mut().zip(what).for_each(|(t, w)| *t += weight * w);
}

#[cfg(test)]
mod tests;
