//! Spatially varying convolution of the simulated lens: out = Σ_n P_n * (w_n·in), by tiles in the
//! frequency domain.
//!
//! The weights w_n are hat functions around evenly spaced nodes and sum to 1 everywhere
//! (object-side bilinear interpolation between the functions P_n). It is dark outside the frame.

use std::sync::Arc;

use rayon::prelude::*;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use crate::frame::{Channel, Plane, Size};

/// Evenly spaced nodes along one axis; beyond the outermost nodes the functions are constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    /// Place of the first node.
    pub(super) first: f64,
    /// Distance between nodes.
    pub(super) step: f64,
    /// Number of nodes.
    pub(super) count: usize,
}

impl Axis {
    /// Place of node `n`.
    pub(super) fn place(&self, n: usize) -> f64 {
        self.first + n as f64 * self.step
    }

    /// Weight of node `n` at `x`.
    fn weight(&self, n: usize, x: f64) -> f64 {
        let t = (x - self.first) / self.step;
        let t = t.clamp(0.0, (self.count - 1) as f64);
        (1.0 - (t - n as f64).abs()).max(0.0)
    }

    /// The part of a frame of `length` pixels in which node `n` has weight.
    fn span(&self, n: usize, length: usize) -> Span {
        let weights: Vec<f32> = (0..length).map(|x| self.weight(n, x as f64) as f32).collect();
        let start = weights.iter().position(|&w| w > 0.0).unwrap_or(0);
        let end = weights.iter().rposition(|&w| w > 0.0).map_or(start, |last| last + 1);
        Span { start, weights: weights[start..end].to_vec() }
    }
}

/// A node's part of the frame, and its weights there.
#[derive(Debug, Clone)]
struct Span {
    start: usize,
    weights: Vec<f32>,
}

/// Two-dimensional real transforms of a tile; spectra are stored by columns.
struct TileTransform {
    width: usize,
    height: usize,
    forward_rows: Arc<dyn RealToComplex<f32>>,
    inverse_rows: Arc<dyn ComplexToReal<f32>>,
    forward_columns: Arc<dyn Fft<f32>>,
    inverse_columns: Arc<dyn Fft<f32>>,
}

/// Buffers of a worker thread.
struct TileScratch {
    row: Vec<f32>,
    line: Vec<Complex<f32>>,
    spectrum: Vec<Complex<f32>>,
}

impl TileTransform {
    fn new(width: usize, height: usize) -> Self {
        let (mut real, mut complex) = (RealFftPlanner::new(), FftPlanner::new());
        TileTransform {
            width,
            height,
            forward_rows: real.plan_fft_forward(width),
            inverse_rows: real.plan_fft_inverse(width),
            forward_columns: complex.plan_fft_forward(height),
            inverse_columns: complex.plan_fft_inverse(height),
        }
    }

    fn bins(&self) -> usize {
        self.width / 2 + 1
    }

    fn scratch(&self) -> TileScratch {
        let zero = Complex::default();
        TileScratch {
            row: vec![0.0; self.width],
            line: vec![zero; self.bins()],
            spectrum: vec![zero; self.bins() * self.height],
        }
    }

    /// Transforms `rows` rows, written by `fill` over zeros, into `scratch.spectrum`.
    fn forward(
        &self,
        scratch: &mut TileScratch,
        rows: usize,
        mut fill: impl FnMut(usize, &mut [f32]),
    ) {
        scratch.spectrum.fill(Complex::default());
        for y in 0..rows {
            scratch.row.fill(0.0);
            fill(y, &mut scratch.row);
            // Cannot fail, since the lengths are those of the plan.
            let _ = self.forward_rows.process(&mut scratch.row, &mut scratch.line);
            for (bin, &value) in scratch.line.iter().enumerate() {
                scratch.spectrum[bin * self.height + y] = value;
            }
        }
        self.forward_columns.process(&mut scratch.spectrum);
    }

    /// Transforms `scratch.spectrum` back and passes the first `rows` rows to `take`.
    fn inverse(&self, scratch: &mut TileScratch, rows: usize, mut take: impl FnMut(usize, &[f32])) {
        self.inverse_columns.process(&mut scratch.spectrum);
        for y in 0..rows {
            for (bin, value) in scratch.line.iter_mut().enumerate() {
                *value = scratch.spectrum[bin * self.height + y];
            }
            // Both ends of a real row's spectrum are real up to rounding.
            scratch.line[0].im = 0.0;
            if self.width.is_multiple_of(2) {
                scratch.line[self.width / 2].im = 0.0;
            }
            let _ = self.inverse_rows.process(&mut scratch.line, &mut scratch.row);
            take(y, &scratch.row);
        }
    }
}

/// The lens as an operator on one grid.
pub(super) struct Convolution {
    size: Size,
    support_px: usize,
    columns: Vec<Span>,
    rows: Vec<Span>,
    transform: TileTransform,
    /// Spectra of the functions, per channel, row-major over the nodes.
    spectra: [Vec<Vec<Complex<f32>>>; 3],
}

impl Convolution {
    /// Plans the convolution on a grid of `size` with nodes along `axes` (x, y). `function` returns
    /// the function of a channel at node (column, row): `support_px`² values, row-major.
    pub(super) fn new(
        size: Size,
        axes: [Axis; 2],
        support_px: usize,
        function: impl Fn(Channel, usize, usize) -> Vec<f32> + Sync,
    ) -> Convolution {
        let spans = |axis: &Axis, length: usize| -> Vec<Span> {
            (0..axis.count).map(|n| axis.span(n, length)).collect()
        };
        let (columns, rows) = (spans(&axes[0], size.width), spans(&axes[1], size.height));
        let longest = |spans: &[Span]| spans.iter().map(|s| s.weights.len()).max().unwrap_or(1);
        let transform = TileTransform::new(
            good_length(longest(&columns) + support_px - 1, 2),
            good_length(longest(&rows) + support_px - 1, 1),
        );
        let scale = 1.0 / (transform.width * transform.height) as f32;
        let spectra = Channel::ALL.map(|channel| {
            let nodes = (0..rows.len() * columns.len()).into_par_iter();
            nodes
                .map_init(
                    || transform.scratch(),
                    |scratch, n| {
                        let taps = function(channel, n % columns.len(), n / columns.len());
                        transform.forward(scratch, support_px, |y, row| {
                            for (to, from) in
                                row.iter_mut().zip(&taps[y * support_px..][..support_px])
                            {
                                *to = from * scale;
                            }
                        });
                        scratch.spectrum.clone()
                    },
                )
                .collect()
        });
        Convolution { size, support_px, columns, rows, transform, spectra }
    }

    /// Light of one channel through the lens, on the same grid.
    pub(super) fn apply(&self, channel: Channel, light: &Plane) -> Plane {
        debug_assert_eq!(light.size(), self.size);
        let half = self.support_px / 2;
        let stride = self.size.width + self.support_px - 1;
        // One strip per row of nodes, each from one worker, so that the sum does not depend on
        // their number.
        let strips: Vec<(usize, Vec<f32>)> = (0..self.rows.len())
            .into_par_iter()
            .map_init(
                || self.transform.scratch(),
                |scratch, n| self.strip(channel, light, n, stride, scratch),
            )
            .collect();
        let mut out = Plane::zeros(self.size);
        let width = self.size.width;
        out.data_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (start, strip) in &strips {
                // Row y of the frame is row y + half of the padded frame the strips lie in.
                let Some(inside) = (y + half).checked_sub(*start) else { continue };
                if let Some(from) = strip.get(inside * stride..(inside + 1) * stride) {
                    for (to, from) in row.iter_mut().zip(&from[half..]) {
                        *to += from;
                    }
                }
            }
        });
        out
    }

    /// Output of the nodes of row `n`: its first row in the padded frame, and its rows of `stride`.
    fn strip(
        &self,
        channel: Channel,
        light: &Plane,
        n: usize,
        stride: usize,
        scratch: &mut TileScratch,
    ) -> (usize, Vec<f32>) {
        let rows = &self.rows[n];
        let height = rows.weights.len() + self.support_px - 1;
        let mut strip = vec![0.0f32; height * stride];
        if rows.weights.is_empty() {
            return (rows.start, Vec::new());
        }
        for (m, columns) in self.columns.iter().enumerate() {
            if columns.weights.is_empty() {
                continue;
            }
            let lit =
                |y: usize| &light.row(rows.start + y)[columns.start..][..columns.weights.len()];
            if (0..rows.weights.len()).all(|y| lit(y).iter().all(|&v| v == 0.0)) {
                continue;
            }
            self.transform.forward(scratch, rows.weights.len(), |y, row| {
                let weight = rows.weights[y];
                for ((to, from), across) in row.iter_mut().zip(lit(y)).zip(&columns.weights) {
                    *to = from * across * weight;
                }
            });
            let spectrum = &self.spectra[channel.index()][n * self.columns.len() + m];
            for (value, factor) in scratch.spectrum.iter_mut().zip(spectrum) {
                *value *= factor;
            }
            let width = columns.weights.len() + self.support_px - 1;
            self.transform.inverse(scratch, height, |y, row| {
                for (to, from) in strip[y * stride + columns.start..][..width].iter_mut().zip(row) {
                    *to += from;
                }
            });
        }
        (rows.start, strip)
    }
}

/// Smallest multiple of `step`, at least `least`, with no prime factor above 5.
fn good_length(least: usize, step: usize) -> usize {
    let smooth = |mut n: usize| {
        for p in [2, 3, 5] {
            while n.is_multiple_of(p) {
                n /= p;
            }
        }
        n == 1
    };
    (least..).find(|&n| n.is_multiple_of(step) && smooth(n)).unwrap_or(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the sum pixel by pixel.
    fn plain(
        light: &Plane,
        axes: [Axis; 2],
        k: usize,
        function: impl Fn(usize, usize) -> Vec<f32>,
    ) -> Plane {
        let (size, half) = (light.size(), (k / 2) as isize);
        let mut out = Plane::zeros(size);
        for row in 0..axes[1].count {
            for column in 0..axes[0].count {
                let taps = function(column, row);
                for y in 0..size.height {
                    for x in 0..size.width {
                        let weight =
                            axes[0].weight(column, x as f64) * axes[1].weight(row, y as f64);
                        let value = light.at(x, y) * weight as f32;
                        for (n, tap) in taps.iter().enumerate() {
                            let (i, j) = (
                                x as isize + (n % k) as isize - half,
                                y as isize + (n / k) as isize - half,
                            );
                            if i >= 0
                                && j >= 0
                                && (i as usize) < size.width
                                && (j as usize) < size.height
                            {
                                let (i, j) = (i as usize, j as usize);
                                out.set(i, j, out.at(i, j) + value * tap);
                            }
                        }
                    }
                }
            }
        }
        out
    }

    #[test]
    fn tiles_agree_with_the_direct_sum() {
        let size = Size::new(53, 41);
        let light = Plane::from_fn(size, |x, y| ((x * 31 + y * 17) % 23) as f32 * 11.0);
        let axes =
            [Axis { first: -4.2, step: 12.3, count: 6 }, Axis { first: 7.5, step: 13.0, count: 3 }];
        let function = |column: usize, row: usize| -> Vec<f32> {
            (0..49).map(|n| ((n * (column + 2) + row * 5) % 13) as f32 / 300.0).collect()
        };
        let plan = Convolution::new(size, axes, 7, |_, column, row| function(column, row));
        let (fast, slow) = (plan.apply(Channel::Red, &light), plain(&light, axes, 7, function));
        let worst =
            fast.data().iter().zip(slow.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-3, "{worst}");
        assert!(slow.rms() > 10.0);
    }

    #[test]
    fn weights_sum_to_one_everywhere() {
        let axis = Axis { first: 5.5, step: 11.0, count: 4 };
        for x in 0..60 {
            let sum: f64 = (0..4).map(|n| axis.weight(n, f64::from(x))).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
    }
}
