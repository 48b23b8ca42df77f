//! Decomposition of the canvas into cells. Within a cell the same four functions are interpolated.
//!
//! Between the centres of four neighbouring functions the bilinear weights are separable. Beyond
//! the outermost centres cells extend to the canvas's edge, with fewer functions. Each cell is
//! convolved by Fourier transforms padded by the support.

use super::LensFunctions;
use super::fourier::{Fourier, fast_length};
use super::interpolation::Interpolation;
use super::lanes::ComplexLanes;

/// Maximum side of a cell, pixels: its working set fits a core's L2 cache. Guess.
const CELL_PX_MAX: usize = 256;

/// The extent of a cell along one axis.
#[derive(Debug, Clone)]
pub(super) struct Stretch {
    pub(super) start: usize,
    pub(super) length: usize,
    /// Indices of the one or two functions interpolated along this axis.
    pub(super) functions: Vec<usize>,
    /// Index into the axis's transforms.
    pub(super) transform: usize,
}

/// The cells along one axis of the canvas.
#[derive(Debug, Clone)]
pub(super) struct Side {
    pub(super) stretches: Vec<Stretch>,
    pub(super) transforms: Vec<Fourier>,
    /// Weight of the second function at each pixel of the canvas.
    pub(super) weight: Vec<f32>,
}

impl Side {
    fn new(along: &Interpolation, support_px: usize) -> Self {
        let mut side =
            Side { stretches: Vec::new(), transforms: Vec::new(), weight: along.weight.clone() };
        let mut start = 0;
        for run in along.functions.chunk_by(|a, b| a == b) {
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
        let planned = self.transforms.iter().position(|t| t.length() == wanted);
        let transform = planned.unwrap_or_else(|| {
            self.transforms.push(Fourier::new(wanted));
            self.transforms.len() - 1
        });
        let mut functions = along.functions[start].to_vec();
        functions.dedup();
        self.stretches.push(Stretch { start, length, functions, transform });
    }
}

/// The cells of a canvas and the list of spectra that they use.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    pub(super) along_x: Side,
    pub(super) along_y: Side,
    pub(super) support_px: usize,
    /// Columns of the grid of functions.
    pub(super) columns: usize,
    /// For each cell, row by row, indices of the spectra of its upper left, upper right, lower left
    /// and lower right function; `usize::MAX` where there is none.
    pub(super) spectra_of: Vec<[usize; 4]>,
    /// Function and transforms of each spectrum.
    pub(super) spectra: Vec<SpectrumOf>,
}

/// A cell of the canvas.
pub(super) struct ModelCell<'a> {
    pub(super) along_y: &'a Stretch,
    pub(super) along_x: &'a Stretch,
    /// Indices of the spectra of its four functions.
    pub(super) spectra: &'a [usize; 4],
}

/// A function in the grid, and the transforms of its spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SpectrumOf {
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) transform_x: usize,
    pub(super) transform_y: usize,
}

/// Half spectrum of one function: rows of `nx` vectors, each with eight adjacent vertical
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
                        let listed = cells.spectra.iter().position(|s| *s == wanted);
                        of[2 * a + b] = listed.unwrap_or(cells.spectra.len());
                        if listed.is_none() {
                            cells.spectra.push(wanted);
                        }
                    }
                }
                cells.spectra_of.push(of);
            }
        }
        cells
    }

    /// All cells, row by row.
    pub(super) fn iter(&self) -> impl Iterator<Item = ModelCell<'_>> {
        (0..self.along_y.stretches.len()).flat_map(|row| self.row(row))
    }

    /// The cells of one row.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = ModelCell<'_>> {
        let (along_y, columns) = (&self.along_y.stretches[row], self.along_x.stretches.len());
        let spectra = &self.spectra_of[row * columns..][..columns];
        let stretches = self.along_x.stretches.iter().zip(spectra);
        stretches.map(move |(along_x, spectra)| ModelCell { along_y, along_x, spectra })
    }
}
