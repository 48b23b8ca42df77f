//! Spectra of the functions, and the gradient with respect to their taps.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use super::LensFunctions;
use super::cells::{Cells, ModelCell, Spectrum, SpectrumOf};
use super::fast::{Cell, Workspace, lanes_at, pitch};
use super::fourier::Fourier;
use super::halves::{Part, frequency_groups, inverse, store};
use super::lanes::{ComplexLanes, LANES};
use crate::frame::instructions::{Kernel, run_fastest};
use crate::frame::{Channel, Plane};

/// The spectra of one channel, computed when first needed: they are as large as three planes.
#[derive(Debug, Default)]
pub(super) struct KeptSpectra(Mutex<Option<Arc<Vec<Spectrum>>>>);

impl KeptSpectra {
    /// Returns the kept spectra, or computes them by `make` and keeps them.
    pub(super) fn get(&self, make: impl FnOnce() -> Vec<Spectrum>) -> Arc<Vec<Spectrum>> {
        if let Some(spectra) = &*self.lock() {
            return Arc::clone(spectra);
        }
        // Not under the lock, which could deadlock: see `once`.
        let made = Arc::new(make());
        Arc::clone(self.lock().get_or_insert(made))
    }

    /// Frees the spectra.
    pub(super) fn release(&self) {
        *self.lock() = None;
    }

    fn lock(&self) -> MutexGuard<'_, Option<Arc<Vec<Spectrum>>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Clone for KeptSpectra {
    fn clone(&self) -> Self {
        KeptSpectra(Mutex::new(self.lock().clone()))
    }
}

/// The spectra of one channel's functions, in the order of [`Cells::spectra`].
pub(super) fn spectra(cells: &Cells, functions: &LensFunctions, channel: Channel) -> Vec<Spectrum> {
    let one = |of: &SpectrumOf| {
        let taps = functions.function(channel, of.row, of.column);
        let fx = &cells.along_x.transforms[of.transform_x];
        let fy = &cells.along_y.transforms[of.transform_y];
        spectrum(taps, functions.support_px, fx, fy)
    };
    cells.spectra.par_iter().map(one).collect()
}

/// The half spectrum of `taps` `[k][k]`, scaled for the doubling by [`store`] and the unscaled
/// inverse.
fn spectrum(taps: &[f32], k: usize, fx: &Fourier, fy: &Fourier) -> Spectrum {
    let mut spectrum = vec![ComplexLanes::default(); frequency_groups(fy.length()) * fx.length()];
    run_fastest(Transform { taps, k, fx, fy, spectrum: &mut spectrum });
    spectrum
}

struct Transform<'a> {
    taps: &'a [f32],
    k: usize,
    fx: &'a Fourier,
    fy: &'a Fourier,
    spectrum: &'a mut [ComplexLanes],
}

impl Kernel for Transform<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Transform { taps, k, fx, fy, spectrum } = self;
        let (nx, ny) = (fx.length(), fy.length());
        // ½ each for the doubled spectra of the function and of the picture.
        let scale = 0.25 / (nx * ny) as f32;
        let mut work = Workspace::default();
        work.fit(nx, ny, false);
        let pitch = pitch(nx);
        let half = &mut work.halves[0];
        for column in (0..k).step_by(2 * LANES) {
            work.data[..ny].fill(ComplexLanes::default());
            for (value, row) in work.data.iter_mut().zip(taps.chunks_exact(k)) {
                value.re = lanes_at(row, column as isize) * scale;
                value.im = lanes_at(row, (column + LANES) as isize) * scale;
            }
            let (found, _) = fy.run::<false>(&mut work.data, &mut work.scratch);
            store::<FUSED>(found, ny, Part::Real, half, pitch, column);
            store::<FUSED>(found, ny, Part::Imaginary, half, pitch, column + LANES);
        }
        for (group, out) in spectrum.chunks_exact_mut(nx).enumerate() {
            work.data[..nx].fill(ComplexLanes::default());
            work.data[..k].copy_from_slice(&half[group * pitch..][..k]);
            let (found, _) = fx.run::<false>(&mut work.data, &mut work.scratch);
            out.copy_from_slice(found);
        }
    }
}

/// The adjoint of taps ↦ K(taps) x, applied to `residual`, added to `taps` `[rows][columns][k][k]`.
pub(super) struct Correlate<'a> {
    pub(super) cells: &'a Cells,
    pub(super) x: &'a Plane,
    pub(super) residual: &'a Plane,
    pub(super) taps: &'a mut [f32],
    pub(super) work: &'a mut Workspace,
}

impl Kernel for Correlate<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Correlate { cells, x, residual, taps, work } = self;
        let k = cells.support_px;
        for place in cells.iter() {
            let cell = Cell::of(cells, &place);
            let ModelCell { along_y, along_x, spectra: of } = place;
            let (nx, ny) = (cell.fx.length(), cell.fy.length());
            let pitch = pitch(nx);
            work.fit(nx, ny, true);
            cell.weighted_halves::<FUSED>(x, work);
            cell.reached_half::<FUSED>(residual, work);
            let Workspace { data, scratch, sum, halves: [upper, lower, seen], corners } =
                &mut *work;
            for group in 0..frequency_groups(ny) {
                data[..nx].copy_from_slice(&seen[group * pitch..][..nx]);
                data[cell.reach().width..nx].fill(ComplexLanes::default());
                sum[..nx].copy_from_slice(cell.fx.run::<false>(data, scratch).0);
                for a in 0..along_y.functions.len() {
                    let half = if a == 0 { &*upper } else { &*lower };
                    for b in 0..along_x.functions.len() {
                        let (shown, free) = cell.along(half, group, b, data, scratch);
                        for (value, seen) in shown.iter_mut().zip(sum.iter()) {
                            *value = seen.product_conjugate::<FUSED>(*value);
                        }
                        let (found, _) = cell.fx.run::<true>(shown, free);
                        let row = &mut corners[2 * a + b][group * pitch..][..pitch];
                        row[..nx].copy_from_slice(found);
                        row[nx..].fill(ComplexLanes::default());
                    }
                }
            }
            let scale = 0.25 / (nx * ny) as f32;
            for (corner, &spectrum) in of.iter().enumerate().filter(|(_, s)| **s != usize::MAX) {
                let function = &cells.spectra[spectrum];
                let place = (function.row * cells.columns + function.column) * k * k;
                let half = &corners[corner];
                for column in (0..k).step_by(2 * LANES) {
                    let columns = [(&half[..], column), (&half[..], column + LANES)];
                    let both =
                        inverse::<FUSED>(cell.fy, columns[0], columns[1], pitch, data, scratch);
                    for (found, row) in
                        both.iter().zip(taps[place..place + k * k].chunks_exact_mut(k))
                    {
                        let lanes = found.re.0.iter().chain(&found.im.0);
                        for (tap, value) in row[column..].iter_mut().zip(lanes) {
                            *tap += value * scale;
                        }
                    }
                }
            }
        }
    }
}
