//! Bicubic resampling of a plane: at given positions ([`warp`]), displaced ([`translate`]), and to
//! another size (`resize`).
//!
//! The kernel is Keys' cubic convolution ("Cubic convolution interpolation for digital image
//! processing", 1981) with a = −½, the only value with an error of third order in the pixel pitch.
//! OpenCV's −¾ sharpens; a test below compares both on a smooth picture.

mod resize;

pub use resize::{resize, resize_rows};

use super::Plane;
use super::instructions::{Kernel, multiply_add, run_fastest};

/// Keys' free parameter.
const KEYS_A: f32 = -0.5;

/// Cubic polynomials in t of the four taps at −1, 0, 1, 2: coefficients of 1, t, t² and t³.
const CUBICS: [[f32; 4]; 4] = [
    [0.0, 1.0, 0.0, 0.0],
    [KEYS_A, 0.0, -KEYS_A, 0.0],
    [-2.0 * KEYS_A, -KEYS_A - 3.0, 2.0 * KEYS_A + 3.0, KEYS_A],
    [KEYS_A, KEYS_A + 2.0, -KEYS_A - 2.0, -KEYS_A],
];

/// Weights of the four taps at −1, 0, 1, 2 for a position `t` (0..=1) between taps 0 and 1.
#[inline(always)]
fn weights<const FUSED: bool>(t: f32) -> [f32; 4] {
    let mut weights = [0.0; 4];
    for (j, weight) in weights.iter_mut().enumerate() {
        let upper = multiply_add::<FUSED>(CUBICS[3][j], t, CUBICS[2][j]);
        *weight =
            multiply_add::<FUSED>(multiply_add::<FUSED>(upper, t, CUBICS[1][j]), t, CUBICS[0][j]);
    }
    weights
}

/// Interpolated value of `plane` at column `x`, row `y`; pixel centres are integers, and border
/// pixels repeat outside. Zero if a position is not finite or the plane is empty.
pub fn sample(plane: &Plane, x: f32, y: f32) -> f32 {
    let (width, height) = (plane.width() as isize, plane.height() as isize);
    if !(x.is_finite() && y.is_finite()) || width == 0 || height == 0 {
        return 0.0;
    }
    let (columns, wx) = border_taps(width, x);
    let (rows, wy) = border_taps(height, y);
    let mut total = 0.0;
    for (&row, &weight) in rows.iter().zip(&wy) {
        let row = plane.row(row);
        total += weight * columns.iter().zip(&wx).map(|(&column, w)| w * row[column]).sum::<f32>();
    }
    total
}

/// The four taps around `place` on a side of `length` pixels, and their weights.
#[inline(always)]
fn border_taps(length: isize, place: f32) -> ([usize; 4], [f32; 4]) {
    // Clamping keeps the arithmetic in range; all taps are outside there anyway.
    let place = place.clamp(-4.0, length as f32 + 3.0);
    // The offset of 5 makes truncation equal rounding down: `floor` is a library call on baseline
    // x86-64.
    let first = (place + 5.0) as isize - 6;
    let weights = weights::<false>(place - (first + 1) as f32);
    ([0, 1, 2, 3].map(|n| (first + n).clamp(0, length - 1) as usize), weights)
}

/// `plane` displaced by `x` pixels to the right and `y` down, its border repeated. Equals [`warp`]
/// with constant displacements, but computes the weights once.
pub fn translate(plane: &Plane, x: f32, y: f32) -> Plane {
    let mut out = Plane::zeros(plane.size());
    if plane.size().area() > 0 {
        run_fastest(Translate { plane, x, y, out: &mut out });
    }
    out
}

struct Translate<'a> {
    plane: &'a Plane,
    x: f32,
    y: f32,
    out: &'a mut Plane,
}

impl Kernel for Translate<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Translate { plane, x, y, out } = self;
        let (width, height) = (plane.width(), plane.height());
        // Taps around −x and −y relative to a pixel, the same for every pixel.
        let (left, wx) = shifted_taps(x);
        let (top, wy) = shifted_taps(y);
        let near = |at: isize, length: usize| at.clamp(0, length as isize - 1) as usize;
        // A row blended along y, and the same row with the three more columns that the taps reach.
        let (mut blended, mut padded) = (vec![0.0; width], vec![0.0; width + 3]);
        for row in 0..height {
            let [a, b, c, d] =
                [0, 1, 2, 3].map(|n| &plane.row(near(row as isize + top + n, height))[..width]);
            for i in 0..width {
                let upper = multiply_add::<FUSED>(wy[0], a[i], wy[1] * b[i]);
                let lower = multiply_add::<FUSED>(wy[2], c[i], wy[3] * d[i]);
                blended[i] = upper + lower;
            }
            for (i, value) in padded.iter_mut().enumerate() {
                *value = blended[near(i as isize + left, width)];
            }
            let taps = [0, 1, 2, 3].map(|n| &padded[n..][..width]);
            let to = &mut out.row_mut(row)[..width];
            for i in 0..width {
                to[i] = (wx[0] * taps[0][i] + wx[2] * taps[2][i])
                    + (wx[1] * taps[1][i] + wx[3] * taps[3][i]);
            }
        }
    }
}

/// The first of the four taps of a plane displaced by `shift`, relative to the pixel, and their
/// weights.
fn shifted_taps(shift: f32) -> (isize, [f32; 4]) {
    let whole = (-shift).floor();
    (whole as isize - 1, weights::<false>(-shift - whole))
}

/// Sets `out`(i, j) to the value of `source` at column `map_x`(i, j), row `map_y`(i, j); border
/// pixels of `source` repeat outside.
///
/// # Panics
/// When the maps and `out` differ in size.
pub fn warp(source: &Plane, map_x: &Plane, map_y: &Plane, out: &mut Plane) {
    assert!(
        map_x.size() == out.size() && map_y.size() == out.size(),
        "maps and output have one size"
    );
    run_fastest(Warp { source, map_x: map_x.data(), map_y: map_y.data(), out: out.data_mut() });
}

struct Warp<'a> {
    source: &'a Plane,
    map_x: &'a [f32],
    map_y: &'a [f32],
    out: &'a mut [f32],
}

/// Positions per vector of arithmetic.
const AT_A_TIME: usize = 8;

impl Kernel for Warp<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Warp { source, map_x, map_y, out } = self;
        let whole = out.len() - out.len() % AT_A_TIME;
        for start in (0..whole).step_by(AT_A_TIME) {
            let mut x = [0.0; AT_A_TIME];
            let mut y = [0.0; AT_A_TIME];
            x.copy_from_slice(&map_x[start..start + AT_A_TIME]);
            y.copy_from_slice(&map_y[start..start + AT_A_TIME]);
            let values = &mut out[start..start + AT_A_TIME];
            if all_inside(source.width(), &x) & all_inside(source.height(), &y) {
                values.copy_from_slice(&inner::<FUSED>(source.data(), source.width(), &x, &y));
            } else {
                for i in 0..AT_A_TIME {
                    values[i] = sample(source, x[i], y[i]);
                }
            }
        }
        for i in whole..out.len() {
            out[i] = sample(source, map_x[i], map_y[i]);
        }
    }
}

/// Whether the four taps of all `places` on a side of `length` pixels lie inside, with a pixel of
/// reserve at the far end against rounding; NaN is outside.
#[inline(always)]
fn all_inside(length: usize, places: &[f32; AT_A_TIME]) -> bool {
    let end = length as f32 - 3.0;
    let mut inside = true;
    for &place in places {
        inside &= (place > 1.0) & (place <= end);
    }
    inside
}

/// First tap of each position (above 1, below 2²²), and the position's distance from the second
/// tap.
///
/// Avoids `floor`, a library call on baseline x86-64. The integer part may be one too small with a
/// remainder of 1, which is equivalent.
#[inline(always)]
fn first_taps(places: &[f32; AT_A_TIME]) -> ([u32; AT_A_TIME], [f32; AT_A_TIME]) {
    const SHIFT: f32 = 8_388_608.0; // 2²³: from here on the spacing of f32 is 1
    let mut first = [0; AT_A_TIME];
    let mut rest = [0.0; AT_A_TIME];
    for i in 0..AT_A_TIME {
        let shifted = (places[i] - 0.5) + SHIFT;
        first[i] = (shifted.to_bits() & 0x007f_ffff) - 1;
        rest[i] = places[i] - (shifted - SHIFT);
    }
    (first, rest)
}

/// Values at positions that are all inside.
#[inline(always)]
fn inner<const FUSED: bool>(
    data: &[f32],
    width: usize,
    x: &[f32; AT_A_TIME],
    y: &[f32; AT_A_TIME],
) -> [f32; AT_A_TIME] {
    let ((columns, tx), (rows, ty)) = (first_taps(x), first_taps(y));
    // Row weights are computed for all positions at once, column weights per position. Loops
    // without closures: code outside the kernel would call a library for each fused product (8
    // times slower).
    let mut wy = [[0.0f32; AT_A_TIME]; 4];
    for (j, of_row) in wy.iter_mut().enumerate() {
        for (weight, t) in of_row.iter_mut().zip(&ty) {
            let upper = multiply_add::<FUSED>(CUBICS[3][j], *t, CUBICS[2][j]);
            let upper = multiply_add::<FUSED>(upper, *t, CUBICS[1][j]);
            *weight = multiply_add::<FUSED>(upper, *t, CUBICS[0][j]);
        }
    }
    // Four views of one length, one row apart: a single bounds check covers all four loads.
    let length = data.len().saturating_sub(3 * width);
    let (up, mid) = (&data[..length], &data[width..][..length]);
    let (low, down) = (&data[2 * width..][..length], &data[3 * width..][..length]);
    // Columns first: four sums of four pixels for one position, each row one load.
    let mut sums = [[0.0f32; 4]; AT_A_TIME];
    for i in 0..AT_A_TIME {
        let start = rows[i] as usize * width + columns[i] as usize;
        let wx = weights::<FUSED>(tx[i]);
        let taps: [&[f32]; 4] =
            [&up[start..][..4], &mid[start..][..4], &low[start..][..4], &down[start..][..4]];
        for c in 0..4 {
            let upper = multiply_add::<FUSED>(wy[0][i], taps[0][c], wy[1][i] * taps[1][c]);
            let lower = multiply_add::<FUSED>(wy[2][i], taps[2][c], wy[3][i] * taps[3][c]);
            sums[i][c] = (upper + lower) * wx[c];
        }
    }
    sums.map(|[a, b, c, d]| (a + c) + (b + d))
}

#[cfg(test)]
mod tests;
