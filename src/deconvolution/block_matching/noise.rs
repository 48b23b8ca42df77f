//! Noise variance of each coefficient of a block, by its position.
//!
//! Deconvolution colours the noise: with a Gaussian prior of standard deviation τ and the
//! regularised inverse (KᵀK + r)⁻¹Kᵀ, r = ν²/τ², the posterior power at a frequency is ν²/(|H|² +
//! r), where H is the lens's transfer function and ν the photo's noise σ. The variance of a
//! coefficient is that power integrated over the spectrum of its basis function (Dabov et al. 2008,
//! "Image restoration by sparse 3D transform-domain collaborative filtering").

use rayon::prelude::*;

use super::transform::{AREA, Block, SIDE, basis};
use crate::deconvolution::detail_mask::DetailMask;
use crate::deconvolution::lens_model::LensFunctions;
use crate::frame::{Channel, Size};

/// Number of frequencies per axis at which a transfer function is sampled.
const FREQUENCIES: usize = 64;
/// Number of non-redundant frequencies of a real function.
const HALF: usize = FREQUENCIES / 2 + 1;
/// Level of the detail mask whose cells have a block's size.
const MASK_LEVEL: usize = 2;

/// Power transfer functions |H|² of the functions of a lens.
#[derive(Debug, Clone)]
pub struct Passed {
    columns: usize,
    powers: Vec<Vec<f32>>,
}

impl Passed {
    /// The power transfer functions of `channel`.
    pub fn of(functions: &LensFunctions, channel: Channel) -> Passed {
        let count = functions.rows * functions.columns;
        let power = |n: usize| {
            powers(
                functions.function(channel, n / functions.columns, n % functions.columns),
                functions.support_px,
            )
        };
        Passed {
            columns: functions.columns,
            powers: (0..count).into_par_iter().map(power).collect(),
        }
    }
}

/// |H|² of `taps` at [`FREQUENCIES`] × [`HALF`] frequencies.
fn powers(taps: &[f32], support: usize) -> Vec<f32> {
    let unit_circle: Vec<(f32, f32)> = (0..FREQUENCIES)
        .map(|n| (std::f64::consts::TAU * n as f64 / FREQUENCIES as f64).sin_cos())
        .map(|(sin, cos)| (cos as f32, sin as f32))
        .collect();
    let at = |frequency: usize, place: usize| unit_circle[frequency * place % FREQUENCIES];
    // Along the rows, then down the columns.
    let mut along = vec![(0.0f32, 0.0f32); support * HALF];
    for (v, row) in taps.chunks_exact(support).enumerate() {
        for (f, sum) in along[v * HALF..][..HALF].iter_mut().enumerate() {
            for (u, tap) in row.iter().enumerate() {
                let (cos, sin) = at(f, u);
                *sum = (sum.0 + tap * cos, sum.1 - tap * sin);
            }
        }
    }
    let mut powers = vec![0.0; FREQUENCIES * HALF];
    for (f, row) in powers.chunks_exact_mut(HALF).enumerate() {
        let mut sums = [(0.0f32, 0.0f32); HALF];
        for v in 0..support {
            let (cos, sin) = at(f, v);
            for (sum, (re, im)) in sums.iter_mut().zip(&along[v * HALF..][..HALF]) {
                *sum = (sum.0 + re * cos + im * sin, sum.1 + im * cos - re * sin);
            }
        }
        row.iter_mut().zip(sums).for_each(|(power, (re, im))| *power = re * re + im * im);
    }
    powers
}

/// The variance of each coefficient of a block, grey levels², by the block's position.
#[derive(Debug, Clone)]
pub struct BlockNoise<'a> {
    columns: usize,
    tables: Vec<Block>,
    margin_px: usize,
    mask: Option<&'a DetailMask>,
}

impl<'a> BlockNoise<'a> {
    /// White noise of `variance`.
    #[cfg(test)]
    pub(super) fn white(variance: f32) -> Self {
        BlockNoise { columns: 1, tables: vec![[variance; AREA]], margin_px: 0, mask: None }
    }

    /// Posterior variances of a deconvolved picture, for a lens of power transfer functions
    /// `passed`, noise of variance `photo` in the photo and a prior of variance `prior`.
    pub fn deconvolved(passed: &Passed, photo: f32, prior: f32) -> Self {
        let spectra = basis_powers();
        let table = |powers: &Vec<f32>| {
            let mut table = [0.0; AREA];
            let mut sums = [[0.0f32; HALF]; SIDE];
            for (f, row) in powers.chunks_exact(HALF).enumerate() {
                let mirrored = f.min(FREQUENCIES - f);
                let uncertain: [f32; HALF] = std::array::from_fn(|g| {
                    photo / (row[g] + photo / prior.max(f32::MIN_POSITIVE))
                });
                for (sum, spectrum) in sums.iter_mut().zip(&spectra) {
                    sum.iter_mut().zip(&uncertain).for_each(|(s, u)| *s += spectrum[mirrored] * u);
                }
            }
            for (v, sum) in sums.iter().enumerate() {
                for (u, spectrum) in spectra.iter().enumerate() {
                    let both_halves = |g: usize| if g == 0 || g == HALF - 1 { 1.0 } else { 2.0 };
                    // Transposed like the coefficients.
                    table[u * SIDE + v] =
                        (0..HALF).map(|g| both_halves(g) * spectrum[g] * sum[g]).sum();
                }
            }
            table
        };
        let tables = passed.powers.par_iter().map(table).collect();
        BlockNoise { columns: passed.columns, tables, margin_px: 0, mask: None }
    }

    /// The sum of independent noises with the given weights, at the positions of the first.
    ///
    /// # Panics
    /// When `of` is empty, or its members differ in their number of positions.
    #[must_use]
    pub fn mixed(of: &[(f32, &BlockNoise<'a>)]) -> BlockNoise<'a> {
        let mut mixed = of[0].1.clone();
        for (n, table) in mixed.tables.iter_mut().enumerate() {
            *table = std::array::from_fn(|k| {
                of.iter().map(|(w, noise)| w * w * noise.tables[n][k]).sum()
            });
        }
        mixed
    }

    /// The variances times `factor`.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> Self {
        self.tables.iter_mut().flatten().for_each(|variance| *variance *= factor);
        self
    }

    /// The same noise on a canvas with `margin_px` more pixels on every side.
    #[must_use]
    pub fn within(self, margin_px: usize) -> Self {
        BlockNoise { margin_px, ..self }
    }

    /// The same noise, assumed larger where the photo is flat by `mask`.
    #[must_use]
    pub fn masked(self, mask: &'a DetailMask) -> Self {
        BlockNoise { mask: Some(mask), ..self }
    }

    /// The variances of the block at (`x`, `y`) in a plane of size `plane`, and a factor on them.
    pub(super) fn at(&self, x: usize, y: usize, plane: Size) -> (&Block, f32) {
        let rows = self.tables.len() / self.columns;
        let along = |at: usize, length: usize, count: usize| {
            let photo = length.saturating_sub(2 * self.margin_px).max(1);
            ((at + SIDE / 2).saturating_sub(self.margin_px) * count / photo).min(count - 1)
        };
        let (column, row) = (along(x, plane.width, self.columns), along(y, plane.height, rows));
        let cells = self.mask.and_then(|mask| mask.factors(MASK_LEVEL));
        let factor = cells.map_or(1.0, |cells| {
            let cell = |at: usize, count: usize| ((at + SIDE / 2) / SIDE).min(count - 1);
            cells.at(cell(x, cells.width()), cell(y, cells.height()))
        });
        (&self.tables[row * self.columns + column], factor * factor)
    }
}

/// |DFT|² of each basis function at the non-redundant frequencies, divided by [`FREQUENCIES`].
fn basis_powers() -> [[f32; HALF]; SIDE] {
    std::array::from_fn(|i| {
        std::array::from_fn(|f| {
            let angle = std::f64::consts::TAU * f as f64 / FREQUENCIES as f64;
            let (mut re, mut im) = (0.0, 0.0);
            for k in 0..SIDE {
                re += basis(i, k) * (angle * k as f64).cos();
                im += basis(i, k) * (angle * k as f64).sin();
            }
            ((re * re + im * im) / FREQUENCIES as f64) as f32
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One Gaussian for the whole field, wider along x.
    fn bell() -> LensFunctions {
        let taps: Vec<f32> = (0..81)
            .map(|t| {
                let (x, y) = ((t % 9) as f32 - 4.0, (t / 9) as f32 - 4.0);
                (-x * x / (2.0 * 1.8 * 1.8) - y * y / (2.0 * 0.9 * 0.9)).exp()
            })
            .collect();
        let total: f32 = taps.iter().sum();
        let taps: Vec<f32> = taps.iter().map(|t| t / total).collect();
        LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 9,
            taps: [taps.clone(), taps.clone(), taps],
        }
    }

    #[test]
    fn noise_through_a_perfect_lens_is_white() {
        let mut functions = bell();
        functions.taps[1] = (0..81).map(|n| if n == 40 { 1.0 } else { 0.0 }).collect();
        let noise = BlockNoise::deconvolved(&Passed::of(&functions, Channel::Green), 4.0, 4.0);
        let (table, factor) = noise.at(3, 3, Size::new(40, 30));
        assert!(table.iter().all(|v| (v - 2.0).abs() < 1e-4), "{table:?}");
        assert_eq!(factor, 1.0);
    }

    #[test]
    fn variances_are_large_where_the_lens_passes_little() {
        let noise = BlockNoise::deconvolved(&Passed::of(&bell(), Channel::Green), 1.0, 25.0);
        let (table, _) = noise.at(0, 0, Size::new(40, 30));
        // Variances by an independent program: of the mean, of the finest detail along x, and of
        // the finest along y; the table is stored transposed.
        for (k, wanted) in [(0, 3.8041), (7 * SIDE, 24.9770), (7, 23.6815)] {
            assert!((table[k] - wanted).abs() < 0.01, "{k}: {}, {wanted}", table[k]);
        }
    }
}
