//! How the fast form cuts the canvas: cells in which the same four functions hold.
//!
//! Between the centres of four neighbouring functions their bilinear weights are products of one
//! weight along each side, and no other function has a say. What lies outside the outermost centres
//! belongs to the cells there. Each cell is convolved by Fourier transforms long enough to hold its
//! light spread by the support.

use super::LensFunctions;
use super::fourier::{Fourier, fast_length};
use super::interpolation::Interpolation;
use super::lanes::ComplexLanes;

/// Cells longer than this are cut evenly, so that the working set of a cell stays in a core's
/// second cache. A guess, not yet measured against others.
const CELL_PX_MAX: usize = 256;

/// A stretch of one side of the canvas.
#[derive(Debug, Clone)]
pub(super) struct Stretch {
    pub(super) start: usize,
    pub(super) length: usize,
    /// The functions that hold, by their place along this side: two, or one where there is no
    /// other.
    pub(super) functions: Vec<usize>,
    /// Which of the side's transforms fits.
    pub(super) transform: usize,
}

/// One side of the canvas, cut.
#[derive(Debug, Clone)]
pub(super) struct Side {
    pub(super) stretches: Vec<Stretch>,
    pub(super) transforms: Vec<Fourier>,
    /// Weight of a stretch's second function at each pixel of the canvas.
    pub(super) weight: Vec<f32>,
}

impl Side {
    fn new(along: &Interpolation, support_px: usize) -> Self {
        let mut side =
            Side { stretches: Vec::new(), transforms: Vec::new(), weight: along.weight.clone() };
        let mut start = 0;
        for run in along.lower.chunk_by(|a, b| a == b) {
            let pieces = run.len().div_ceil(CELL_PX_MAX);
            for piece in 0..pieces {
                let (from, to) = (run.len() * piece / pieces, run.len() * (piece + 1) / pieces);
                side.push(along, start + from, to - from, support_px);
            }
            start += run.len();
        }
        side
    }

    fn push(&mut self, along: &Interpolation, start: usize, length: usize, support_px: usize) {
        let wanted = fast_length(length + support_px - 1);
        let known = self.transforms.iter().position(|t| t.length() == wanted);
        let transform = known.unwrap_or_else(|| {
            self.transforms.push(Fourier::new(wanted));
            self.transforms.len() - 1
        });
        let mut functions = vec![along.lower[start]];
        if along.weight[start..start + length].iter().any(|&w| w != 0.0) {
            functions.push(along.upper[start]);
        }
        self.stretches.push(Stretch { start, length, functions, transform });
    }
}

/// All that the fast form needs to know beside the spectra.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    pub(super) along_x: Side,
    pub(super) along_y: Side,
    pub(super) support_px: usize,
    /// Functions in a row of the grid.
    pub(super) columns: usize,
    /// For each cell, row by row, the spectra of its functions: upper left, upper right, lower
    /// left, lower right.
    pub(super) spectra_of: Vec<[usize; 4]>,
    /// Of which function, with which transforms, each spectrum is.
    pub(super) spectra: Vec<SpectrumOf>,
}

/// What a spectrum is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SpectrumOf {
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) transform_x: usize,
    pub(super) transform_y: usize,
}

/// The spectrum of one function: rows of `nx` numbers, each for eight neighbouring vertical
/// frequencies of 0..=ny/2.
pub(super) type Spectrum = Vec<ComplexLanes>;

impl Cells {
    pub(super) fn new(
        along_x: &Interpolation,
        along_y: &Interpolation,
        functions: &LensFunctions,
    ) -> Self {
        let mut cells = Cells {
            along_x: Side::new(along_x, functions.support_px),
            along_y: Side::new(along_y, functions.support_px),
            support_px: functions.support_px,
            columns: functions.columns,
            spectra_of: Vec::new(),
            spectra: Vec::new(),
        };
        for y in &cells.along_y.stretches {
            for x in &cells.along_x.stretches {
                let mut of = [usize::MAX; 4];
                for (a, &row) in y.functions.iter().enumerate() {
                    for (b, &column) in x.functions.iter().enumerate() {
                        let wanted = SpectrumOf {
                            row,
                            column,
                            transform_x: x.transform,
                            transform_y: y.transform,
                        };
                        let known = cells.spectra.iter().position(|s| *s == wanted);
                        of[2 * a + b] = known.unwrap_or(cells.spectra.len());
                        if known.is_none() {
                            cells.spectra.push(wanted);
                        }
                    }
                }
                cells.spectra_of.push(of);
            }
        }
        cells
    }

    /// The cells, row by row: stretches along y and x, and their spectra.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&Stretch, &Stretch, &[usize; 4])> {
        (0..self.along_y.stretches.len()).flat_map(|row| self.row(row))
    }

    /// The cells of one row.
    pub(super) fn row(
        &self,
        row: usize,
    ) -> impl Iterator<Item = (&Stretch, &Stretch, &[usize; 4])> {
        let (y, columns) = (&self.along_y.stretches[row], self.along_x.stretches.len());
        let spectra = &self.spectra_of[row * columns..][..columns];
        self.along_x.stretches.iter().zip(spectra).map(move |(x, of)| (y, x, of))
    }
}
