//! Wiener's filter with the measured lens: a baseline, and the start of a solve. No capture.

use std::ops::Range;

use rayon::prelude::*;
use rustfft::num_complex::Complex32;

use super::record::Course;
use super::{About, Method, MethodError, Problem, ResidualOf, Solution, Watch};
use crate::deconvolution::data_term::NOISE_MIN;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::lens_model::{LensFunctions, LensModel};
use crate::deconvolution::observation::Observation;
use crate::frame::{Channel, FULL_SCALE, Plane, Rect, Size};

/// Noise-to-signal power of the baseline at one grey level of noise: the study's best.
pub const NOISE_TO_SIGNAL: f32 = 0.01;

/// Wiener's filter (1949), applied tile by tile with the lens function at the tile's middle.
/// Neighbouring tiles overlap under a raised cosine and are summed, so that no seam shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wiener {
    /// Noise power over signal power at one grey level of noise; it grows with the noise squared.
    pub noise_to_signal: f32,
}

/// The method's properties.
pub const ABOUT: About = About { name: "wiener", starts_from_lens: false };

impl Method for Wiener {
    fn about(&self) -> &'static About {
        &ABOUT
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        _optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let solve = |c: Channel| {
            let mut course = Course::new(problem.stopwatch);
            let picture = self.filter_channel(problem, c);
            let mut prediction = Plane::zeros(problem.size());
            problem.model.forward(c, &picture, &mut prediction);
            let residual = problem.observation.residual_rms(c, &prediction);
            course.step(residual, ResidualOf::Model, 0);
            (picture, course.record)
        };
        Ok(problem.solve_by_channel(solve, watch))
    }
}

impl Wiener {
    /// Filters one channel of the photo.
    pub(super) fn filter_channel(&self, problem: &Problem<'_>, channel: Channel) -> Plane {
        let observation = problem.observation;
        let blurred = observation.light.plane(channel);
        let mut picture = self.filter(observation, problem.model, channel, blurred);
        picture.data_mut().iter_mut().for_each(|v| *v = v.clamp(0.0, FULL_SCALE));
        picture
    }

    /// Filters `blurred`, which may have either sign, given the noise of `channel`.
    pub(super) fn filter(
        &self,
        observation: &Observation,
        model: &LensModel,
        channel: Channel,
        blurred: &Plane,
    ) -> Plane {
        let noise = observation.pixel_noise(channel).max(NOISE_MIN);
        let ratio = self.noise_to_signal * noise * noise;
        TileFilter::new(model, channel, blurred, ratio).filter()
    }
}

/// One channel of a photo to be filtered tile by tile.
struct TileFilter<'a> {
    functions: &'a LensFunctions,
    channel: Channel,
    photo: &'a Plane,
    rect: Rect,
    ratio: f32,
    across: TileWindow,
    down: TileWindow,
    columns: Range<isize>,
    rows: Range<isize>,
    /// Pixels of padding around a window: the reach of the blur, so that nothing wraps around.
    reach: usize,
    transform: Transform2,
}

/// A filtered row of tiles, which overlaps the next row.
struct FilteredRow {
    top: isize,
    light: Plane,
}

fn clamp_index(v: isize, end: usize) -> usize {
    v.clamp(0, end as isize - 1) as usize
}

impl<'a> TileFilter<'a> {
    fn new(model: &'a LensModel, channel: Channel, photo: &'a Plane, ratio: f32) -> TileFilter<'a> {
        let (functions, rect) = (model.functions(), model.field());
        let (size, reach) = (photo.size(), functions.support_px / 2);
        let across = TileWindow::of(rect.size.width.div_ceil(functions.columns.max(1)));
        let down = TileWindow::of(rect.size.height.div_ceil(functions.rows.max(1)));
        let length = |window: &TileWindow| smooth_length(window.length() + 2 * reach);
        let transform = Transform2::new(Size::new(length(&across), length(&down)));
        let columns = across.places(rect.x, size.width);
        let rows = down.places(rect.y, size.height);
        TileFilter {
            functions,
            channel,
            photo,
            rect,
            ratio,
            across,
            down,
            columns,
            rows,
            reach,
            transform,
        }
    }

    /// Filters the whole channel.
    fn filter(&self) -> Plane {
        let rows = self.rows.clone().into_par_iter();
        let filtered: Vec<FilteredRow> = rows.map(|row| self.filter_row(row)).collect();
        let mut picture: Plane = Plane::zeros(self.photo.size());
        for FilteredRow { top, light } in &filtered {
            for y in 0..light.height() {
                let to_y = top + y as isize;
                if (0..picture.height() as isize).contains(&to_y) {
                    let pairs = picture.row_mut(to_y as usize).iter_mut().zip(light.row(y));
                    pairs.for_each(|(sum, value)| *sum += value);
                }
            }
        }
        picture
    }

    /// Filters one row of tiles, two tiles per transform: the imaginary part is the second tile, or
    /// the first again at the end of the row.
    fn filter_row(&self, row: isize) -> FilteredRow {
        let mut light = Plane::zeros(Size::new(self.photo.width(), self.down.length()));
        let top = self.down.corner(row, self.rect.y);
        let [mut values, mut lens] =
            [(); 2].map(|()| vec![Complex32::default(); self.transform.size.area()]);
        let all: Vec<isize> = self.columns.clone().collect();
        for pair in all.chunks(2) {
            let pair = [pair[0], pair[pair.len() - 1]];
            self.load(pair, top, &mut values);
            let taps = pair.map(|column| {
                let row = clamp_index(row, self.functions.rows);
                let column = clamp_index(column, self.functions.columns);
                self.functions.function(self.channel, row, column)
            });
            let support_px = self.functions.support_px;
            self.transform.filter(&mut values, taps, support_px, self.ratio, &mut lens);
            self.add(&values, |value| value.re, (row, pair[0]), &mut light);
            if pair[1] != pair[0] {
                self.add(&values, |value| value.im, (row, pair[1]), &mut light);
            }
        }
        FilteredRow { top, light }
    }

    /// Loads the photo under the tiles of the columns `pair`, whose row starts at `top`.
    fn load(&self, pair: [isize; 2], top: isize, values: &mut [Complex32]) {
        let (size, width) = (self.photo.size(), self.transform.size.width);
        let from = pair.map(|column| {
            let start = self.across.corner(column, self.rect.x) - self.reach as isize;
            let place = |x: usize| clamp_index(start + x as isize, size.width);
            (0..width).map(place).collect::<Vec<usize>>()
        });
        for (y, line) in values.chunks_exact_mut(width).enumerate() {
            let y = clamp_index(top + y as isize - self.reach as isize, size.height);
            let row = self.photo.row(y);
            for ((value, &first), &second) in line.iter_mut().zip(&from[0]).zip(&from[1]) {
                *value = Complex32 { re: row[first], im: row[second] };
            }
        }
    }

    /// Adds the tile at `(row, column)`, one `part` of the filtered `values`, to `light`, its row
    /// of tiles, weighted by its window.
    fn add(
        &self,
        values: &[Complex32],
        part: fn(&Complex32) -> f32,
        (row, column): (isize, isize),
        light: &mut Plane,
    ) {
        let along_y = self.down.weights(row, &self.rows);
        let along_x = self.across.weights(column, &self.columns);
        let x0 = self.across.corner(column, self.rect.x);
        let width = light.width() as isize;
        for (y, weight) in along_y.iter().enumerate() {
            let from = &values[(y + self.reach) * self.transform.size.width + self.reach..];
            let to = light.row_mut(y);
            for (x, value) in from[..self.across.length()].iter().enumerate() {
                let to_x = x0 + x as isize;
                if (0..width).contains(&to_x) {
                    to[to_x as usize] += weight * along_x[x] * part(value);
                }
            }
        }
    }
}

/// The smallest product of powers of 2, 3 and 5 that is at least `least`; other lengths transform
/// several times slower.
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

/// The window of a tile along one side.
struct TileWindow {
    tile: usize,
    /// Overlap with the next tile, pixels.
    overlap: usize,
}

/// Ratio of a tile's size to its overlap. An overlap of a whole tile takes twice as long and gains
/// at most 0.0005 SSIM after the solve.
const OVERLAP: usize = 3;

impl TileWindow {
    fn of(tile: usize) -> TileWindow {
        TileWindow { tile, overlap: (tile / OVERLAP).max(1) }
    }

    fn length(&self) -> usize {
        self.tile + self.overlap
    }

    /// Start of the window of the tile at `place`, where tile 0 starts at `first`.
    fn corner(&self, place: isize, first: usize) -> isize {
        first as isize + place * self.tile as isize - (self.overlap / 2) as isize
    }

    /// The tiles whose windows cover a side of `length` pixels.
    fn places(&self, first: usize, length: usize) -> Range<isize> {
        let end = |place: isize| self.corner(place, first) + self.length() as isize;
        let lowest = (0..).map(|n| -n).find(|&place| self.corner(place, first) <= 0);
        let highest = (0..).find(|&place| end(place) >= length as isize);
        lowest.unwrap_or_default()..highest.unwrap_or_default() + 1
    }

    /// Weights of the window at `place`: 1, with a raised cosine over the overlaps with other tiles
    /// of `places`, so that neighbours sum to 1.
    fn weights(&self, place: isize, places: &Range<isize>) -> Vec<f32> {
        let rising = |at: usize| {
            let share = (at as f32 + 0.5) / self.overlap as f32;
            0.5 - 0.5 * (std::f32::consts::PI * share.min(1.0)).cos()
        };
        let weight = |at: usize| {
            let from_end = self.length() - 1 - at;
            let alone = if at < from_end { place == places.start } else { place == places.end - 1 };
            if alone { 1.0 } else { rising(at.min(from_end)) }
        };
        (0..self.length()).map(weight).collect()
    }
}

/// Columns transformed together.
const COLUMNS_AT_A_TIME: usize = 8;

/// A planned two-dimensional transform of one size.
struct Transform2 {
    size: Size,
    rows: [std::sync::Arc<dyn rustfft::Fft<f32>>; 2],
    columns: [std::sync::Arc<dyn rustfft::Fft<f32>>; 2],
}

impl Transform2 {
    fn new(size: Size) -> Self {
        let mut planner = rustfft::FftPlanner::new();
        let mut both = |n| [planner.plan_fft_forward(n), planner.plan_fft_inverse(n)];
        Transform2 { size, rows: both(size.width), columns: both(size.height) }
    }

    fn run(&self, values: &mut [Complex32], direction: usize) {
        self.rows[direction].process(values);
        let (width, height) = (self.size.width, self.size.height);
        // Eight neighbouring columns at a time, so that each line of memory is fetched once.
        let mut columns = vec![Complex32::default(); COLUMNS_AT_A_TIME * height];
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

    /// Filters two real pictures, the real and the imaginary part of `values`, each by
    /// H*/(|H|² + `ratio`), where H is the transform of the picture's own `taps` with their middle
    /// at the origin. `lens` is scratch memory as large as `values`.
    fn filter(
        &self,
        values: &mut [Complex32],
        taps: [&[f32]; 2],
        support: usize,
        ratio: f32,
        lens: &mut [Complex32],
    ) {
        let (width, height) = (self.size.width, self.size.height);
        lens.fill(Complex32::default());
        for (k, (&re, &im)) in taps[0].iter().zip(taps[1]).enumerate() {
            let x = (k % support + width - support / 2) % width;
            let y = (k / support + height - support / 2) % height;
            lens[y * width + x] = Complex32 { re, im };
        }
        self.run(lens, 0);
        self.run(values, 0);
        let scale = 1.0 / (width * height) as f32;
        let i = Complex32::i();
        for y in 0..height {
            let mirrored_row = (height - y) % height * width;
            for x in 0..width {
                let (here, there) = (y * width + x, mirrored_row + (width - x) % width);
                if there < here {
                    continue;
                }
                // The transform of a real picture at −k is the conjugate of that at k, which
                // separates the two.
                let split = |z: &[Complex32]| {
                    let (z, mirrored) = (z[here], z[there].conj());
                    [(z + mirrored) * 0.5, (z - mirrored) * -0.5 * i]
                };
                let ([p, q], [h, g]) = (split(values), split(lens));
                let first = p * h.conj() * (scale / (h.norm_sqr() + ratio));
                let second = q * g.conj() * (scale / (g.norm_sqr() + ratio));
                values[here] = first + second * i;
                values[there] = first.conj() + second.conj() * i;
            }
        }
        self.run(values, 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pictures, and two different functions of 3×3.
    fn pair(size: Size) -> ([Vec<f32>; 2], [[f32; 9]; 2]) {
        let picture =
            |k: usize| (0..size.area()).map(|i| ((i * (7 + k) + i * i % 11) % 97) as f32).collect();
        let first = [0.0, 0.1, 0.0, 0.1, 0.65, 0.05, 0.0, 0.1, 0.0];
        let second = [0.1, 0.0, 0.0, 0.0, 0.6, 0.0, 0.1, 0.0, 0.2];
        ([picture(0), picture(4)], [first, second])
    }

    fn filtered(size: Size, pictures: [&[f32]; 2], taps: [&[f32]; 2], ratio: f32) -> [Vec<f32>; 2] {
        let mut values: Vec<Complex32> =
            pictures[0].iter().zip(pictures[1]).map(|(&re, &im)| Complex32 { re, im }).collect();
        let mut lens = values.clone();
        Transform2::new(size).filter(&mut values, taps, 3, ratio, &mut lens);
        [values.iter().map(|v| v.re).collect(), values.iter().map(|v| v.im).collect()]
    }

    #[test]
    fn windows_add_up_to_one_from_border_to_border() {
        for (tile, first, length) in
            [(1, 0, 1), (2, 3, 17), (3, 1, 20), (7, 5, 31), (64, 20, 424), (64, 40, 464), (9, 0, 4)]
        {
            let window = TileWindow::of(tile);
            let places = window.places(first, length);
            let mut sums = vec![0.0f32; length];
            for place in places.clone() {
                for (at, weight) in window.weights(place, &places).into_iter().enumerate() {
                    let to = window.corner(place, first) + at as isize;
                    if let Some(sum) = usize::try_from(to).ok().and_then(|to| sums.get_mut(to)) {
                        *sum += weight;
                    }
                }
            }
            let all = sums.iter().all(|sum| (sum - 1.0).abs() < 1e-6);
            assert!(all, "tiles of {tile} from {first} over {length}: {sums:?}");
        }
        // Six tiles of 64 suffice for their own length and a margin of 10 on both sides.
        assert_eq!(TileWindow::of(64).places(10, 6 * 64 + 20), 0..6);
    }

    #[test]
    fn two_tiles_in_one_transform_do_not_mix() {
        for size in [Size::new(12, 10), Size::new(9, 15)] {
            let (pictures, taps) = pair(size);
            let black = vec![0.0; size.area()];
            let [first, second] =
                filtered(size, [&pictures[0], &pictures[1]], [&taps[0], &taps[1]], 0.01);
            let [alone, nothing] =
                filtered(size, [&pictures[0], &black], [&taps[0], &taps[0]], 0.01);
            let [_, other_alone] =
                filtered(size, [&black, &pictures[1]], [&taps[0], &taps[1]], 0.01);
            let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 2e-3);
            assert!(
                close(&first, &alone) && close(&second, &other_alone) && close(&nothing, &black)
            );
        }
    }

    #[test]
    fn without_noise_the_filter_undoes_the_blur() {
        let size = Size::new(12, 10);
        let (pictures, taps) = pair(size);
        // Periodic convolution from its definition.
        let blurred = |picture: &[f32], taps: &[f32; 9]| -> Vec<f32> {
            let at = |x: usize, y: usize| picture[y % size.height * size.width + x % size.width];
            let one = |i: usize| {
                let (x, y) = (i % size.width + size.width, i / size.width + size.height);
                (0..9).map(|t| taps[t] * at(x + 1 - t % 3, y + 1 - t / 3)).sum()
            };
            (0..size.area()).map(one).collect()
        };
        let seen = [blurred(&pictures[0], &taps[0]), blurred(&pictures[1], &taps[1])];
        let found = filtered(size, [&seen[0], &seen[1]], [&taps[0], &taps[1]], 1e-7);
        for (found, picture) in found.iter().zip(&pictures) {
            let furthest =
                found.iter().zip(picture).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(furthest < 0.1, "{furthest}");
        }
    }
}
