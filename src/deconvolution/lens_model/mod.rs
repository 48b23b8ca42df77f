//! The measured lens: a spatially varying convolution K and its exact adjoint.
//!
//! K X = Σₙ Pₙ * (wₙ X): the light of each object point is spread by the point spread function at
//! that point, interpolated bilinearly between the Pₙ with weights wₙ (paper Eq. 1;
//! [`LensFunctions`]). Light from outside the canvas is zero. The convolution is exact: transforms
//! are padded by the functions' support. Rows of cells ([`cells`]) run in parallel, so a single
//! channel uses all cores. Light scattered beyond the functions' support is in [`broad`].

mod binned;
pub(crate) mod broad;
mod cells;
mod fast;
mod fourier;
mod functions;
mod halves;
mod interpolation;
mod inverse;
mod lanes;
mod taps;

pub use broad::{Beyond, Halo};
pub use functions::{LensFunctions, LensModelError};
pub use inverse::{Density, LocalInverse};

use crate::frame::instructions::run_fastest;
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};
use broad::Broad;
use cells::{Cells, Spectrum};
use fast::{Adjoint, Forward, Workspace};
use interpolation::Interpolation;
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use taps::{Correlate, KeptSpectra};

/// The operator K of one rig on its canvas, and Kᵀ.
#[derive(Debug, Clone)]
pub struct LensModel {
    canvas: Size,
    field: Rect,
    functions: LensFunctions,
    cells: Cells,
    spectra: [KeptSpectra; 3],
    broad: [Option<Broad>; 3],
    workspaces: Workspaces,
}

/// A pool of workspaces, one per concurrent task.
#[derive(Debug, Default)]
struct Workspaces(Mutex<Vec<Workspace>>);

impl Workspaces {
    /// Runs `work` with a workspace.
    fn with<R>(&self, work: impl FnOnce(&mut Workspace) -> R) -> R {
        // The pool is consistent even when poisoned.
        let free = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut workspace = free().pop().unwrap_or_default();
        let result = work(&mut workspace);
        free().push(workspace);
        result
    }
}

impl Clone for Workspaces {
    fn clone(&self) -> Self {
        Workspaces::default()
    }
}

impl LensModel {
    /// The model of `functions` spread over a photo of size `photo`, on a canvas with `margin_px`
    /// more pixels on every side.
    ///
    /// # Errors
    /// When the functions do not make a grid ([`LensFunctions::check`]) or the photo is empty.
    pub fn new(
        photo: Size,
        margin_px: usize,
        functions: &LensFunctions,
    ) -> Result<Self, LensModelError> {
        functions.check()?;
        if photo.area() == 0 {
            let found = format!("is for a photo of {photo} pixels; at least 1×1 is allowed");
            return Err(LensModelError(found));
        }
        let along_x = Interpolation::new(photo.width, margin_px, functions.columns);
        let along_y = Interpolation::new(photo.height, margin_px, functions.rows);
        let cells = Cells::new(&along_x, &along_y, functions);
        Ok(LensModel {
            canvas: Size::new(photo.width + 2 * margin_px, photo.height + 2 * margin_px),
            field: Rect { x: margin_px, y: margin_px, size: photo },
            spectra: Default::default(),
            cells,
            functions: functions.clone(),
            broad: [None, None, None],
            workspaces: Workspaces::default(),
        })
    }

    /// The same lens with `halos` for each channel; their shares of the light are deducted from
    /// that of the functions.
    ///
    /// # Errors
    /// When a radius or share is out of range.
    pub fn with_broad_light(
        mut self,
        halos: &[Vec<Halo>; 3],
        beyond: Beyond,
    ) -> Result<Self, LensModelError> {
        for (broad, halos) in self.broad.iter_mut().zip(halos) {
            broad::check_halos(halos).map_err(|found| LensModelError(format!("has {found}")))?;
            *broad = Broad::new(self.canvas, halos, beyond);
        }
        Ok(self)
    }

    /// Size of the canvas: the photo and its margins.
    pub fn canvas(&self) -> Size {
        self.canvas
    }

    /// Part of the canvas over which the functions are spread: the whole photo without its margins.
    pub fn field(&self) -> Rect {
        self.field
    }

    /// The point spread functions.
    pub fn functions(&self) -> &LensFunctions {
        &self.functions
    }

    /// Replaces the taps of one channel, `[rows][columns][k][k]`; the planned transforms are kept.
    ///
    /// # Errors
    /// When their number does not match or one is not finite; the model is then unchanged.
    pub fn set_taps(&mut self, channel: Channel, taps: &[f32]) -> Result<(), LensModelError> {
        let old = std::mem::replace(&mut self.functions.taps[channel.index()], taps.to_vec());
        if let Err(wrong) = self.functions.check() {
            self.functions.taps[channel.index()] = old;
            return Err(wrong);
        }
        self.spectra[channel.index()].release();
        Ok(())
    }

    /// The same model with other `functions` on the same canvas, broad light kept.
    ///
    /// # Errors
    /// When the functions do not make a grid ([`LensFunctions::check`]).
    pub fn with_functions(&self, functions: &LensFunctions) -> Result<Self, LensModelError> {
        let broad = self.broad.clone();
        Ok(LensModel { broad, ..LensModel::new(self.field.size, self.field.x, functions)? })
    }

    /// `out` = K x.
    ///
    /// # Panics
    /// This and the other operations panic when a plane does not have the canvas's size, which is a
    /// bug of the caller.
    pub fn forward(&self, channel: Channel, x: &Plane, out: &mut Plane) {
        assert!(
            x.size() == self.canvas && out.size() == self.canvas,
            "planes have the canvas's size"
        );
        let (rows, spectra) = (&self.cells.along_y.stretches, &*self.spectra(channel));
        let spill_length = (self.cells.support_px - 1) * self.canvas.width;
        let mut bands = self.bands(out);
        let spills: Vec<Vec<f32>> = bands
            .par_iter_mut()
            .enumerate()
            .map(|(row, band)| {
                self.workspaces.with(|work| {
                    let mut spill = vec![0.0; spill_length];
                    let (cells, spill_rows) = (&self.cells, &mut spill[..]);
                    run_fastest(Forward { cells, spectra, x, row, band, spill: spill_rows, work });
                    spill
                })
            })
            .collect();
        // Added in the order of the rows, so that sums are the same on any number of threads.
        let r = self.cells.support_px / 2;
        for (stretch, spill) in rows.iter().zip(&spills) {
            for (n, light) in spill.chunks_exact(self.canvas.width).enumerate() {
                let below = if n < r { 0 } else { stretch.length };
                let y = (stretch.start + n + below).wrapping_sub(r);
                if y < self.canvas.height {
                    out.row_mut(y).iter_mut().zip(light).for_each(|(value, l)| *value += l);
                }
            }
        }
        if let Some(broad) = &self.broad[channel.index()] {
            broad.add(x, out);
        }
    }

    /// K X in each of `channels`, zero in the other channels.
    pub fn seen(&self, channels: &[Channel], x: &Frame<Work>) -> Frame<Work> {
        let of = |&c: &Channel| {
            let mut plane = Plane::zeros(self.canvas);
            self.forward(c, x.plane(c), &mut plane);
            plane
        };
        let planes: Vec<Plane> = channels.par_iter().map(of).collect();
        let mut seen = Frame::zeros(self.canvas);
        channels.iter().zip(planes).for_each(|(&c, plane)| *seen.plane_mut(c) = plane);
        seen
    }

    /// `out` = Kᵀ y.
    pub fn adjoint(&self, channel: Channel, y: &Plane, out: &mut Plane) {
        assert!(
            y.size() == self.canvas && out.size() == self.canvas,
            "planes have the canvas's size"
        );
        let (cells, spectra) = (&self.cells, &*self.spectra(channel));
        let broad = self.broad[channel.index()].as_ref();
        let scaled = broad.and_then(|broad| broad.before_adjoint(y));
        let y = scaled.as_ref().unwrap_or(y);
        self.bands(out).par_iter_mut().enumerate().for_each(|(row, band)| {
            self.workspaces.with(|work| {
                run_fastest(Adjoint { cells, spectra, factors: None, y, row, band, work });
            });
        });
        if let Some(broad) = broad {
            broad.add_adjoint(y, out);
        }
    }

    /// The local inverse of one channel, regularised by `epsilon` > 0, for data of `density`.
    pub fn local_inverse(&self, channel: Channel, epsilon: f32, density: Density) -> LocalInverse {
        LocalInverse::new(&self.cells, &self.spectra(channel), channel, epsilon, density)
    }

    /// `out` = (KᵀMK + ε)⁻¹Kᵀ y, computed cell by cell without broad light. `y` is zero where data
    /// are missing, and each datum is multiplied by the number of pixels that it stands for. Meant
    /// for residuals: cells are cut without a taper.
    pub fn invert(&self, inverse: &LocalInverse, y: &Plane, out: &mut Plane) {
        assert!(
            y.size() == self.canvas && out.size() == self.canvas,
            "planes have the canvas's size"
        );
        let (cells, spectra) = (&self.cells, &*self.spectra(inverse.channel));
        let factors = Some(&inverse.reciprocals[..]);
        self.bands(out).par_iter_mut().enumerate().for_each(|(row, band)| {
            self.workspaces
                .with(|work| run_fastest(Adjoint { cells, spectra, factors, y, row, band, work }));
        });
    }

    /// Frees the spectra of `channel`; the next operation that needs them computes them again.
    pub fn release_spectra(&self, channel: Channel) {
        self.spectra[channel.index()].release();
    }

    fn spectra(&self, channel: Channel) -> Arc<Vec<Spectrum>> {
        let make = || taps::spectra(&self.cells, &self.functions, channel);
        self.spectra[channel.index()].get(make)
    }

    /// The rows of `out`, split by rows of cells.
    fn bands<'a>(&self, out: &'a mut Plane) -> Vec<&'a mut [f32]> {
        let mut rest = out.data_mut();
        let lengths = self.cells.along_y.stretches.iter().map(|stretch| stretch.length);
        lengths
            .map(|length| rest.split_off_mut(..length * self.canvas.width).unwrap_or_default())
            .collect()
    }

    /// Gradient of ½‖K x − y‖² with respect to one channel's taps, where `residual` is K x − y: the
    /// adjoint of taps ↦ K(taps) x, without broad light. Laid out as [`LensFunctions::taps`].
    pub fn correlate(&self, x: &Plane, residual: &Plane) -> Vec<f32> {
        assert!(
            x.size() == self.canvas && residual.size() == self.canvas,
            "planes have the canvas's size"
        );
        let mut taps = vec![0.0; self.functions.taps[0].len()];
        self.workspaces.with(|work| {
            run_fastest(Correlate { cells: &self.cells, x, residual, taps: &mut taps, work });
        });
        taps
    }
}

#[cfg(test)]
mod tests;
