//! What a capture says about a change of the lens, square by square: sums of products of the
//! regressors.
//!
//! Everything that a least-squares fit wants to know of a capture is in these sums, for any
//! interpolation over the field and for any choice of squares to hold out. So the capture is gone
//! through once, however many fits are tried.

use rayon::prelude::*;

use super::bands::Bands;
use crate::frame::instructions::{Kernel, multiply_add, run_fastest};
use crate::frame::{Plane, Rect};

/// Numbers in a row of the sums: the regressors and what they are to explain, padded to whole
/// lanes.
const PITCH: usize = 32;
/// Squares across the photo, about: the places between the centres of a coarse grid are told apart
/// well enough.
const ACROSS: usize = 32;

/// The sums over one square of the photo.
#[derive(Debug, Clone)]
pub(super) struct Square {
    /// Centre, as shares of the photo's width and height.
    pub(super) centre: (f64, f64),
    /// Column and row of the square.
    pub(super) place: (usize, usize),
    /// Trusted pixels.
    pub(super) pixels: usize,
    sums: Vec<f32>,
}

impl Square {
    /// Sum of the products of regressors `a` ≤ `b`.
    pub(super) fn product(&self, a: usize, b: usize) -> f64 {
        f64::from(self.sums[a * PITCH + b])
    }
}

/// All squares of a photo.
#[derive(Debug, Clone)]
pub(super) struct Squares {
    pub(super) squares: Vec<Square>,
    /// Number of regressors that are taps; they come first.
    pub(super) narrow: usize,
    /// Number of regressors; what they are to explain comes after them.
    pub(super) count: usize,
}

impl Squares {
    /// The sums over the pixels of `photo` with `trusted` not 0, of the `bands` of `shown` and of
    /// the `unexplained` light.
    pub(super) fn of(
        bands: Bands,
        photo: Rect,
        shown: &Plane,
        unexplained: &Plane,
        trusted: &Plane<u8>,
    ) -> Squares {
        let side = (photo.size.width / ACROSS).max(8);
        let (columns, rows) = (photo.size.width.div_ceil(side), photo.size.height.div_ceil(side));
        let smoothed = bands.smoothed(shown);
        let (count, width) = (bands.count(), shown.width());
        let of_row = |row: usize| {
            let mut products = vec![0.0f32; columns * (count + 1) * PITCH];
            let mut regressors = vec![0.0; (count + 1) * width];
            let mut pixels = vec![0; columns];
            for y in row * side..((row + 1) * side).min(photo.size.height) {
                let canvas_y = photo.y + y;
                bands.row(&smoothed, canvas_y, &mut regressors[..count * width]);
                regressors[count * width..].copy_from_slice(unexplained.row(canvas_y));
                let trusted = &trusted.row(canvas_y)[photo.x..][..photo.size.width];
                for (x, _) in trusted.iter().enumerate().filter(|(_, t)| **t != 0) {
                    pixels[x / side] += 1;
                }
                let (rows, sums) = (&regressors[..], &mut products[..]);
                run_fastest(Sum {
                    rows,
                    width,
                    from: photo.x,
                    side,
                    count: count + 1,
                    trusted,
                    sums,
                });
            }
            let one = (count + 1) * PITCH;
            (0..columns)
                .map(|column| Square {
                    centre: (
                        ((column as f64 + 0.5) * side as f64 / photo.size.width as f64).min(1.0),
                        ((row as f64 + 0.5) * side as f64 / photo.size.height as f64).min(1.0),
                    ),
                    place: (column, row),
                    pixels: pixels[column],
                    sums: products[column * one..][..one].to_vec(),
                })
                .collect::<Vec<_>>()
        };
        Squares {
            squares: (0..rows).into_par_iter().flat_map_iter(of_row).collect(),
            narrow: bands.narrow(),
            count,
        }
    }
}

/// Adds the products along one row of the photo to the sums of its squares.
struct Sum<'a> {
    /// The regressors along the canvas's row, one after the other.
    rows: &'a [f32],
    width: usize,
    /// First column of the photo.
    from: usize,
    side: usize,
    count: usize,
    trusted: &'a [u8],
    sums: &'a mut [f32],
}

impl Kernel for Sum<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let mut values = [0.0f32; PITCH];
        let one = self.count * PITCH;
        for (x, _) in self.trusted.iter().enumerate().filter(|(_, t)| **t != 0) {
            for (n, value) in values[..self.count].iter_mut().enumerate() {
                *value = self.rows[n * self.width + self.from + x];
            }
            let sums = &mut self.sums[x / self.side * one..][..one];
            for (n, sums) in sums.chunks_exact_mut(PITCH).enumerate() {
                // From the lanes that hold the diagonal on.
                let (first, value) = (n & !7, values[n]);
                for (sum, &other) in sums[first..].iter_mut().zip(&values[first..]) {
                    *sum = multiply_add::<FUSED>(value, other, *sum);
                }
            }
        }
    }
}
