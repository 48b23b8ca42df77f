//! Wiener's filter with the measured lens: a baseline, and where the solver starts. No capture.

use rayon::prelude::*;

use super::richardson_lucy::finish;
use super::{IterationRecord, Method, MethodError, Problem, ResidualOf, Solution, Step, Watch};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};
use crate::restore::forward_convolution::ForwardConvolution;
use crate::restore::lens_model::{LensFunctions, LensModel};

/// Noise assumed at least: the rounding of an 8-bit photo, 1/√12 grey levels.
const NOISE_MIN: f32 = 0.29;

/// Wiener (1949), tile by tile with the function that holds in the tile's middle; the tiles are cut twice
/// their size under a cosine and added up, so that no seam shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wiener {
    /// Noise power over signal power at one grey level of noise; grows with the square of the noise.
    pub noise_to_signal: f32,
}

impl Method for Wiener {
    fn name(&self) -> &'static str {
        "wiener"
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        _optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let model = problem.needs_model("wiener")?;
        let begun = (problem.stopwatch)();
        let channels = problem.channels.list();
        let solved = channels
            .par_iter()
            .map(|&c| {
                let picture = self.filtered(problem, model, c);
                let mut predicted = Plane::zeros(problem.size());
                model.forward(c, &picture, &mut predicted);
                let residual = problem.residual_rms(c, &predicted);
                let seconds = (problem.stopwatch)() - begun;
                let mut record = IterationRecord::default();
                record.push(Step { iteration: 1, residual, of: ResidualOf::Model, captures: 0, seconds });
                (picture, record)
            })
            .collect();
        Ok(finish(problem, solved, watch))
    }
}

impl Wiener {
    /// One channel of the photo filtered.
    fn filtered(&self, problem: &Problem<'_>, model: &LensModel, channel: Channel) -> Plane {
        let noise = problem.photo_noise[channel.index()].max(NOISE_MIN);
        filter_tiles(model.functions(), channel, problem, self.noise_to_signal * noise * noise)
    }

    /// The photo filtered in the channels that are solved; black in others.
    pub(super) fn start(&self, problem: &Problem<'_>, model: &LensModel) -> Frame<Work> {
        let channels = problem.channels.list();
        let filtered: Vec<Plane> = channels.par_iter().map(|&c| self.filtered(problem, model, c)).collect();
        let mut start = Frame::zeros(problem.size());
        for (&c, plane) in channels.iter().zip(filtered) {
            *start.plane_mut(c) = plane;
        }
        start
    }
}

/// One channel filtered tile by tile.
fn filter_tiles(functions: &LensFunctions, channel: Channel, problem: &Problem<'_>, ratio: f32) -> Plane {
    let (photo, rect) = (problem.photo.plane(channel), problem.rect);
    let size = photo.size();
    let tile = Size::new(
        rect.size.width.div_ceil(functions.columns.max(1)),
        rect.size.height.div_ceil(functions.rows.max(1)),
    );
    // Twice the tile for the cosine, and the blur's reach on both sides so that nothing wraps around.
    let reach = functions.support_px / 2;
    let length = |tile: usize| smooth_length(2 * tile + 2 * reach);
    let transform = Transform2::new(Size::new(length(tile.width), length(tile.height)));
    let along = |tile: usize| (0..2 * tile).map(|at| cosine(at, tile)).collect::<Vec<f32>>();
    let (along_x, along_y) = (along(tile.width), along(tile.height));
    let corner = |place: isize, first: usize, tile: usize| {
        first as isize + place * tile as isize - (tile / 2) as isize
    };
    let clamped = |v: isize, end: usize| v.clamp(0, end as isize - 1) as usize;
    // One row of tiles, which overlaps the next by half.
    let filtered_row = |row: isize| {
        let mut strip = Plane::zeros(Size::new(size.width, 2 * tile.height));
        let y0 = corner(row, rect.y, tile.height);
        for column in -1..=functions.columns as isize {
            let x0 = corner(column, rect.x, tile.width);
            let cut = Plane::from_fn(transform.size, |x, y| {
                let (x, y) = (x0 + x as isize - reach as isize, y0 + y as isize - reach as isize);
                photo.at(clamped(x, size.width), clamped(y, size.height))
            });
            let taps =
                functions.function(channel, clamped(row, functions.rows), clamped(column, functions.columns));
            let filtered = transform.filtered(&cut, taps, functions.support_px, ratio);
            let inside = 0..size.width as isize;
            for (y, weight) in along_y.iter().enumerate() {
                let (from, to) = (&filtered.row(y + reach)[reach..], strip.row_mut(y));
                for (x, value) in from[..2 * tile.width].iter().enumerate() {
                    let to_x = x0 + x as isize;
                    if inside.contains(&to_x) {
                        to[to_x as usize] += weight * along_x[x] * value;
                    }
                }
            }
        }
        (y0, strip)
    };
    // A ring of tiles around the photo's completes the cosines to one everywhere.
    let rows: Vec<isize> = (-1..=functions.rows as isize).collect();
    let strips: Vec<(isize, Plane)> = rows.into_par_iter().map(filtered_row).collect();
    let mut picture: Plane = Plane::zeros(size);
    for (y0, strip) in &strips {
        for y in 0..strip.height() {
            let to_y = y0 + y as isize;
            if (0..size.height as isize).contains(&to_y) {
                let pairs = picture.row_mut(to_y as usize).iter_mut().zip(strip.row(y));
                pairs.for_each(|(sum, value)| *sum += value);
            }
        }
    }
    picture.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
    picture
}

/// The next product of 2, 3 and 5: other lengths transform several times slower.
fn smooth_length(least: usize) -> usize {
    let smooth = |n: usize| {
        let without = |mut n: usize, factor: usize| {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
            n
        };
        [2, 3, 5].into_iter().fold(n, without) == 1
    };
    (least.max(1)..).find(|&n| smooth(n)).unwrap_or(least)
}

/// Raised cosine over two tiles; neighbours a tile apart add up to one.
fn cosine(at: usize, tile: usize) -> f32 {
    0.5 - 0.5 * (std::f32::consts::PI * (at as f32 + 0.5) / tile as f32).cos()
}

/// Columns transformed together.
const COLUMNS_AT_A_TIME: usize = 8;

/// A planned two-dimensional transform of one size.
struct Transform2 {
    size: Size,
    rows: [std::sync::Arc<dyn rustfft::Fft<f32>>; 2],
    columns: [std::sync::Arc<dyn rustfft::Fft<f32>>; 2],
}

type Complex = rustfft::num_complex::Complex32;

impl Transform2 {
    fn new(size: Size) -> Self {
        let mut planner = rustfft::FftPlanner::new();
        let mut both = |n| [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)];
        Transform2 { size, rows: both(size.width), columns: both(size.height) }
    }

    fn run(&self, values: &mut [Complex], direction: usize) {
        self.rows[direction].process(values);
        let (width, height) = (self.size.width, self.size.height);
        // Eight neighbouring columns at a time, so that each line of memory is fetched once.
        let mut columns = vec![Complex::default(); COLUMNS_AT_A_TIME * height];
        for start in (0..width).step_by(COLUMNS_AT_A_TIME) {
            let count = COLUMNS_AT_A_TIME.min(width - start);
            for (y, row) in values.chunks_exact(width).enumerate() {
                (0..count).for_each(|x| columns[x * height + y] = row[start + x]);
            }
            self.columns[direction].process(&mut columns[..count * height]);
            for (y, row) in values.chunks_exact_mut(width).enumerate() {
                (0..count).for_each(|x| row[start + x] = columns[x * height + y]);
            }
        }
    }

    /// `cut` through H* / (|H|² + ratio), H the transform of the function with its middle at the origin.
    fn filtered(&self, cut: &Plane, taps: &[f32], support: usize, ratio: f32) -> Plane {
        let (width, height) = (self.size.width, self.size.height);
        let mut lens = vec![Complex::default(); width * height];
        for (k, &tap) in taps.iter().enumerate() {
            let x = (k % support + width - support / 2) % width;
            let y = (k / support + height - support / 2) % height;
            lens[y * width + x].re = tap;
        }
        let mut values: Vec<Complex> = cut.data().iter().map(|&v| Complex::new(v, 0.0)).collect();
        self.run(&mut lens, 0);
        self.run(&mut values, 0);
        let scale = 1.0 / (width * height) as f32;
        for (v, h) in values.iter_mut().zip(&lens) {
            *v = *v * h.conj() * (scale / (h.norm_sqr() + ratio));
        }
        self.run(&mut values, 1);
        let real: Vec<f32> = values.iter().map(|v| v.re).collect();
        Plane::from_vec(self.size, real).unwrap_or_else(|| Plane::zeros(self.size))
    }
}
