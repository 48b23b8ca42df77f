//! The learned prior: a network that shrinks the coefficients of 2×2 Haar transforms of opponent
//! colours.
//!
//! For each coefficient it computes a gate between 0 and 1 and an addition, both from the
//! coefficients of the 17×17 cells around it, in units of the noise σ. `prior/README.md` describes
//! its training.

use rayon::prelude::*;
use relens::deconvolution::opponent::{from_opponent, to_opponent};
use relens::frame::{Plane, Rect, Size};

use super::network::{Cells, Network, REACH};

/// Cells of a tile along each side.
const TILE: usize = 64;
/// Margin of cells around a tile: the network's reach, and one for the local means.
const MARGIN: usize = REACH + 1;

/// Haar coefficients a, h, v, d of a cell, in each opponent colour.
type Coefficients = [[f32; 4]; 3];

/// Pixels, 0 or 1, by which the first cell begins before the picture's corner along x and y. Cells
/// that move from round to round leave no grid.
pub(super) type Shift = [usize; 2];

/// Denoises `picture` (R, G, B, linear light) of noise `sigma` in each channel; both in grey
/// levels.
pub(super) fn denoise(network: &Network, picture: &mut [Plane; 3], sigma: [f32; 3], shift: Shift) {
    let size = picture[0].size();
    to_opponent(picture);
    let source = Source { network, planes: picture, noise: opponent_noise(sigma), shift };
    let cells = |length: usize, shift: usize| (length + shift).div_ceil(2);
    let field = Size::new(cells(size.width, shift[0]), cells(size.height, shift[1]));
    let [columns, rows] = [field.width, field.height].map(|length| length.div_ceil(TILE));
    let tiles: Vec<Rect> = Rect { x: 0, y: 0, size: field }.parts(columns, rows).collect();
    let done: Vec<_> =
        tiles.par_iter().map(|&tile| source.denoise(tile.x, tile.y, tile.size)).collect();
    for (tile, cells) in tiles.iter().zip(&done) {
        for (n, cell) in cells.iter().enumerate() {
            let (x0, y0) = (2 * (tile.x + n % tile.size.width), 2 * (tile.y + n / tile.size.width));
            for k in 0..4 {
                let place =
                    (x0 + k % 2).checked_sub(shift[0]).zip((y0 + k / 2).checked_sub(shift[1]));
                let Some((x, y)) = place.filter(|&(x, y)| x < size.width && y < size.height) else {
                    continue;
                };
                for (plane, values) in picture.iter_mut().zip(cell) {
                    plane.set(x, y, values[k]);
                }
            }
        }
    }
    from_opponent(picture);
}

/// Noise of the opponent colours for noise `sigma` of R, G, B.
fn opponent_noise(sigma: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = sigma.map(|sigma| sigma * sigma);
    [(r + g + b) / 3.0, (r + b) / 2.0, (r + 4.0 * g + b) / 6.0].map(f32::sqrt)
}

/// A picture in opponent colours, and the network for it.
struct Source<'a> {
    network: &'a Network,
    planes: &'a [Plane; 3],
    noise: [f32; 3],
    shift: Shift,
}

impl Source<'_> {
    /// The denoised pixels of the cells at (`x0`, `y0`), cell by cell, in opponent colours.
    fn denoise(&self, x0: usize, y0: usize, size: Size) -> Vec<Coefficients> {
        let grown = |margin: usize| Size::new(size.width + 2 * margin, size.height + 2 * margin);
        let known = grown(MARGIN);
        let haar: Vec<Coefficients> = (0..known.area())
            .map(|n| self.analyse([x0 + n % known.width, y0 + n / known.width]))
            .collect();
        let inner = grown(REACH);
        let mut features = Cells::new(inner.width, inner.height);
        let mut means = vec![[0.0; 3]; inner.area()];
        for (n, (cell, means)) in features.cells.iter_mut().zip(&mut means).enumerate() {
            let (x, y) = (n % inner.width, n / inner.width);
            for (k, &noise) in self.noise.iter().enumerate() {
                let row = |y: usize| haar[y * known.width + x..][..3].iter().map(|c| c[k][0]);
                means[k] = (y..y + 3).flat_map(row).sum::<f32>() / 9.0;
                let [a, details @ ..] = haar[(y + 1) * known.width + x + 1][k];
                cell[4 * k] = ((a - means[k]) / noise).asinh();
                for (feature, detail) in cell[4 * k + 1..].iter_mut().zip(details) {
                    *feature = (detail / noise).asinh();
                }
                cell[12 + k] = 0.25 * (means[k] / noise).asinh();
                cell[15 + k] = 0.25 * noise.ln();
            }
        }
        let outputs = self.network.run(&features);
        let pixels = outputs.cells.iter().enumerate().map(|(n, output)| {
            let (x, y) = (n % size.width, n / size.width);
            let mut cell = haar[(y + MARGIN) * known.width + x + MARGIN];
            let means = means[(y + REACH) * inner.width + x + REACH];
            for (k, (coefficients, mean)) in cell.iter_mut().zip(means).enumerate() {
                for (j, value) in coefficients.iter_mut().enumerate() {
                    let mean = if j == 0 { mean } else { 0.0 };
                    let gate = 1.0 / (1.0 + (-output[4 * k + j]).exp());
                    let added = self.noise[k] * output[12 + 4 * k + j];
                    *value = mean + gate * (*value - mean) + added;
                }
                *coefficients = transformed(*coefficients);
            }
            cell
        });
        pixels.collect()
    }

    /// Haar coefficients of the cell at `place`, counted from [`MARGIN`] cells before the first;
    /// beyond its borders the picture is reflected.
    fn analyse(&self, place: [usize; 2]) -> Coefficients {
        let size = self.planes[0].size();
        let along = |axis: usize, length: usize| {
            let first = 2 * place[axis] as isize - (2 * MARGIN + self.shift[axis]) as isize;
            [reflected(first, length), reflected(first + 1, length)]
        };
        let (columns, rows) = (along(0, size.width), along(1, size.height));
        let of_plane =
            |plane: &Plane| std::array::from_fn(|n| plane.at(columns[n % 2], rows[n / 2]));
        self.planes.each_ref().map(of_plane).map(transformed)
    }
}

/// The orthonormal Haar transform of 2×2 values, which is its own inverse.
fn transformed([a, b, c, d]: [f32; 4]) -> [f32; 4] {
    [a + b + c + d, a - b + c - d, a + b - c - d, a - b - c + d].map(|sum| sum / 2.0)
}

/// `at` reflected into 0..`length` about the first and last pixel.
fn reflected(at: isize, length: usize) -> usize {
    let last = length as isize - 1;
    let at = at.rem_euclid((2 * last).max(1));
    at.min(2 * last - at).max(0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_agrees_with_the_program_that_trained_it() {
        let network = Network::parse(super::super::WEIGHTS).expect("the file has all weights");
        let size = Size::new(64, 48);
        let planes = |bytes: &[u8]| -> [Plane; 3] {
            let values: Vec<f32> =
                bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
            let plane = |k: usize| values[k * size.area()..][..size.area()].to_vec();
            std::array::from_fn(|k| Plane::from_vec(size, plane(k)).expect("a plane's length"))
        };
        let sigma = include_str!("../prior/golden/golden-sigma.txt").split_whitespace();
        let sigma: Vec<f32> = sigma.map(|n| n.parse().expect("a number")).collect();
        let mut picture = planes(include_bytes!("../prior/golden/golden-input.f32"));
        denoise(&network, &mut picture, [sigma[0], sigma[1], sigma[2]], [0, 0]);
        let golden = planes(include_bytes!("../prior/golden/golden-output.f32"));
        for (plane, golden) in picture.iter().zip(&golden) {
            let pairs = plane.data().iter().zip(golden.data());
            let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            // The two programs add in different orders.
            assert!(off < 2e-3, "{off}");
        }
    }

    #[test]
    fn tiles_leave_no_seams_at_any_shift() {
        let network = Network::parse(super::super::WEIGHTS).expect("the file has all weights");
        let picture = |width: usize| -> [Plane; 3] {
            let size = Size::new(width, 37);
            [3, 5, 7].map(|k| Plane::from_fn(size, |x, y| ((k * x * y + x) % 97) as f32))
        };
        for shift in [[0, 0], [1, 0], [1, 1]] {
            let (mut wide, mut narrow) = (picture(201), picture(151));
            denoise(&network, &mut wide, [4.0; 3], shift);
            denoise(&network, &mut narrow, [4.0; 3], shift);
            for (wide, narrow) in wide.iter().zip(&narrow) {
                for y in 0..37 {
                    let pairs = wide.row(y)[..130].iter().zip(&narrow.row(y)[..130]);
                    let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    assert!(off < 1e-3, "{shift:?}, row {y}: {off}");
                }
            }
        }
    }
}
