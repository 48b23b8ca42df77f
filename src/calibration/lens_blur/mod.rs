//! Estimation of the lens functions from captures of pseudo-random patterns.
//!
//! All functions of a channel are fitted at once: the taps whose interpolated model K(taps)·x is
//! closest to the captures of the patterns x, by conjugate gradients on the normal equations. For
//! zero-mean white patterns the expected normal matrix consists of the overlaps of the functions'
//! weights; with it as preconditioner a handful of rounds suffices. Negative taps are kept, as
//! clipping them biases the model (study).

mod broad;
mod plausibility;
mod shape;

pub use broad::{halos, remove_halos, within_a_square};
pub use plausibility::{dominant, misfit};
pub use shape::{centroid, displacement, moments, normalise};

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use crate::deconvolution::lens_model::{LensFunctions, LensModel, LensModelError};
use crate::frame::{Channel, Plane, Size};

/// Why lens functions could not be fitted.
#[derive(Debug, thiserror::Error)]
pub enum LensBlurError {
    /// Grid and support are invalid.
    #[error("the lens model cannot be set up")]
    Model(#[source] LensModelError),
    /// Too few trusted pixels for some function; holds their number and that of all pixels.
    #[error("too few trusted pixels for some lens function: {0} of {1} pixels are trusted")]
    NotSeen(usize, usize),
}

/// The grid of functions to fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FunctionGrid {
    /// The photo's size.
    pub photo: Size,
    /// Width of the canvas's margin around the photo, on every side.
    pub margin_px: usize,
    /// Functions from left to right.
    pub columns: usize,
    /// Functions from top to bottom.
    pub rows: usize,
    /// Side of each function's support, odd.
    pub support_px: usize,
}

/// One pattern and its capture, as differences from grey, canvas-sized.
#[derive(Debug, Clone)]
pub struct Shot {
    /// Shown light minus grey.
    pub shown: Plane,
    /// Captured light minus the capture of grey.
    pub seen: Plane,
}

/// Weight of the penalty on squared taps relative to the data of one tap: the ratio of a tap's
/// noise to its signal in the study (noise of 1 grey level, patterns of 80, 65 000 pixels per
/// function).
const RIDGE: f64 = 1e-3;

impl FunctionGrid {
    fn canvas(&self) -> Size {
        Size::new(self.photo.width + 2 * self.margin_px, self.photo.height + 2 * self.margin_px)
    }

    /// Identity functions, as a start.
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

    /// Bilinear weights of `count` functions along a side, per canvas pixel.
    fn hats(&self, photo_px: usize, count: usize) -> Vec<DVector<f64>> {
        let hats = |pixel: usize| {
            let along =
                (pixel as f64 - self.margin_px as f64 + 0.5) * count as f64 / photo_px as f64 - 0.5;
            let place = along.clamp(0.0, count as f64 - 1.0);
            DVector::from_fn(count, |n, _| (1.0 - (place - n as f64).abs()).max(0.0))
        };
        (0..photo_px + 2 * self.margin_px).map(hats).collect()
    }

    /// Σ over trusted pixels of the products of the functions' weights.
    fn overlaps(&self, trusted: &Plane<u8>) -> DMatrix<f64> {
        let (columns, functions) = (self.columns, self.rows * self.columns);
        let across = self.hats(self.photo.width, columns);
        let mut normal = DMatrix::zeros(functions, functions);
        for (y, down) in self.hats(self.photo.height, self.rows).iter().enumerate() {
            let mut of_row = DMatrix::zeros(columns, columns);
            let seen = across.iter().zip(trusted.row(y)).filter(|(_, t)| **t > 0);
            seen.for_each(|(across, _)| of_row.ger(1.0, across, across, 1.0));
            normal += (down * down.transpose()).kronecker(&of_row);
        }
        normal
    }
}

/// Fits the functions of one channel after another on one grid.
pub struct FunctionFit {
    grid: FunctionGrid,
    model: LensModel,
    trusted: Plane<u8>,
    /// Cholesky factor of the expected normal matrix for patterns of unit variance.
    overlaps: Cholesky<f64, Dyn>,
    /// Mean of that matrix's diagonal.
    diagonal: f64,
}

impl FunctionFit {
    /// Prepares a fit on `grid` to pixels with `trusted` = 1 (canvas-sized). Patterns must be grey
    /// at the canvas's border, so that everything beyond it equals grey.
    ///
    /// # Errors
    /// When the grid is invalid, or some function has too few trusted pixels.
    pub fn new(grid: FunctionGrid, trusted: &Plane<u8>) -> Result<FunctionFit, LensBlurError> {
        let model = LensModel::new(grid.photo, grid.margin_px, &grid.unblurred())
            .map_err(LensBlurError::Model)?;
        let (canvas, trusted) = (grid.canvas(), trusted.clone());
        let normal = grid.overlaps(&trusted);
        let diagonal = normal.trace() / normal.nrows() as f64;
        let not_seen = || {
            let count = trusted.data().iter().filter(|&&t| t > 0).count();
            LensBlurError::NotSeen(count, canvas.area())
        };
        // Less than a hundredth of the average weight is too little.
        if normal.diagonal().iter().any(|&d| d < 0.01 * diagonal) {
            return Err(not_seen());
        }
        let ridge = DMatrix::identity(normal.nrows(), normal.ncols()) * (RIDGE * diagonal);
        let overlaps = Cholesky::new(normal + ridge).ok_or_else(not_seen)?;
        Ok(FunctionFit { grid, model, trusted, overlaps, diagonal })
    }

    /// Fits the taps of one channel, `[rows][columns][k][k]`, by `rounds` of conjugate gradients.
    ///
    /// # Errors
    /// When the taps are not finite.
    pub fn taps(
        &mut self,
        channel: Channel,
        shots: &[Shot],
        rounds: usize,
    ) -> Result<Vec<f32>, LensBlurError> {
        // Mean squared light of the patterns; the expected normal matrix is `power` × overlaps.
        let power: f64 = shots
            .iter()
            .map(|s| s.shown.dot(&s.shown) / s.shown.size().area() as f64)
            .sum::<f64>()
            .max(1e-12);
        let ridge = (RIDGE * power * self.diagonal) as f32;
        let count = self.grid.rows * self.grid.columns * self.grid.support_px.pow(2);
        let mut taps = vec![0.0f32; count];
        let mut residual = self.gathered(shots, |s| s.seen.clone());
        let mut better = self.preconditioned(&residual, power);
        let mut direction = better.clone();
        let mut length = dot(&residual, &better);
        for _ in 0..rounds {
            if length <= 0.0 {
                break;
            }
            self.model.set_taps(channel, &direction).map_err(LensBlurError::Model)?;
            let mut image = self.gathered(shots, |s| {
                let mut seen = Plane::zeros(s.shown.size());
                self.model.forward(channel, &s.shown, &mut seen);
                seen
            });
            add(&mut image, ridge, &direction);
            let step = (length / dot(&direction, &image)) as f32;
            add(&mut taps, step, &direction);
            add(&mut residual, -step, &image);
            better = self.preconditioned(&residual, power);
            let next = dot(&residual, &better);
            let keep = (next / length) as f32;
            length = next;
            direction.iter_mut().zip(&better).for_each(|(d, b)| *d = *b + keep * *d);
        }
        // Also checks that the taps are finite.
        self.model.set_taps(channel, &taps).map_err(LensBlurError::Model)?;
        Ok(taps)
    }

    /// Σ over the shots of the adjoint of taps ↦ K(taps)·shown, applied to trusted pixels of
    /// `picture`.
    fn gathered(&self, shots: &[Shot], picture: impl Fn(&Shot) -> Plane + Sync) -> Vec<f32> {
        let parts: Vec<Vec<f32>> = shots
            .par_iter()
            .map(|shot| {
                let mut picture = picture(shot);
                for (v, &t) in picture.data_mut().iter_mut().zip(self.trusted.data()) {
                    *v *= f32::from(t);
                }
                self.model.correlate(&shot.shown, &picture)
            })
            .collect();
        let mut total = vec![0.0; self.grid.rows * self.grid.columns * self.grid.support_px.pow(2)];
        for part in &parts {
            add(&mut total, 1.0, part);
        }
        total
    }

    /// Applies the inverse of the expected normal matrix, which couples equal taps of all
    /// functions.
    fn preconditioned(&self, residual: &[f32], power: f64) -> Vec<f32> {
        let one = self.grid.support_px.pow(2);
        let functions = self.grid.rows * self.grid.columns;
        let sides = residual.iter().map(|&v| f64::from(v) / power);
        let mut sides = DMatrix::from_iterator(one, functions, sides).transpose();
        self.overlaps.solve_mut(&mut sides);
        sides.transpose().iter().map(|&v| v as f32).collect()
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
}

fn add(to: &mut [f32], weight: f32, other: &[f32]) {
    to.iter_mut().zip(other).for_each(|(t, w)| *t += weight * w);
}

#[cfg(test)]
mod tests;
