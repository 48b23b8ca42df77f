//! Bicubic resampling of a plane: at given places ([`warp`], [`sample`]), and to another size ([`resize`]).
//!
//! The kernel is Keys' cubic convolution ("Cubic convolution interpolation for digital image processing",
//! 1981) with a = −½, the one value whose error falls with the third power of the pixel pitch. OpenCV's −¾
//! sharpens: a test below measures both on a smooth picture.

mod resize;

pub use resize::resize;

use super::Plane;

/// What is taken for pixels outside the plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outside {
    /// The nearest pixel of the border.
    Edge,
    /// Black.
    Zero,
}

/// Keys' free parameter.
const KEYS_A: f32 = -0.5;

/// The cubics in t of the four taps at −1, 0, 1, 2: constants, then factors of t, t² and t³.
const CUBICS: [[f32; 4]; 4] = cubics(KEYS_A);

const fn cubics(a: f32) -> [[f32; 4]; 4] {
    [
        [0.0, 1.0, 0.0, 0.0],
        [a, 0.0, -a, 0.0],
        [-2.0 * a, -a - 3.0, 2.0 * a + 3.0, a],
        [a, a + 2.0, -a - 2.0, -a],
    ]
}

/// Weights of the four taps at −1, 0, 1, 2 for a place `t` (0..=1) between taps 0 and 1.
#[inline(always)]
fn weights(cubics: &[[f32; 4]; 4], t: f32) -> [f32; 4] {
    std::array::from_fn(|j| ((cubics[3][j] * t + cubics[2][j]) * t + cubics[1][j]) * t + cubics[0][j])
}

/// The value of `plane` at column `x`, row `y` (pixel centres are whole numbers). Zero where a place is not a
/// finite number or the plane is empty.
pub fn sample(plane: &Plane, x: f32, y: f32, outside: Outside) -> f32 {
    sample_by(&CUBICS, plane, x, y, outside)
}

fn sample_by(cubics: &[[f32; 4]; 4], plane: &Plane, x: f32, y: f32, outside: Outside) -> f32 {
    let (width, height) = (plane.width() as isize, plane.height() as isize);
    if !(x.is_finite() && y.is_finite()) || width == 0 || height == 0 {
        return 0.0;
    }
    // Far outside all taps are outside; clamping keeps the arithmetic small.
    let (x, y) = (x.clamp(-4.0, width as f32 + 3.0), y.clamp(-4.0, height as f32 + 3.0));
    let (left, top) = (x.floor(), y.floor());
    let (wx, wy) = (weights(cubics, x - left), weights(cubics, y - top));
    let mut total = 0.0;
    for (j, &weight_y) in wy.iter().enumerate() {
        let row = top as isize - 1 + j as isize;
        for (i, &weight_x) in wx.iter().enumerate() {
            let column = left as isize - 1 + i as isize;
            let inside = (0..width).contains(&column) && (0..height).contains(&row);
            if inside || outside == Outside::Edge {
                let (column, row) = (column.clamp(0, width - 1), row.clamp(0, height - 1));
                total += weight_y * weight_x * plane.at(column as usize, row as usize);
            }
        }
    }
    total
}

/// `out`(i, j) = `source` at column `map_x`(i, j), row `map_y`(i, j), as [`sample`] gives it.
///
/// # Panics
/// When the maps and `out` differ in size, which is a bug of the caller.
pub fn warp(source: &Plane, map_x: &Plane, map_y: &Plane, outside: Outside, out: &mut Plane) {
    assert!(
        map_x.size() == out.size() && map_y.size() == out.size(),
        "the maps have the size of the plane they make"
    );
    let width = source.width();
    let data = source.data();
    // Places whose sixteen taps all lie inside take the short way. One more pixel is left off at the far
    // side, so that rounding cannot bring a tap outside.
    let (right, bottom) = (width as f32 - 3.0, source.height() as f32 - 3.0);
    let places = map_x.data().iter().zip(map_y.data());
    for (value, (&x, &y)) in out.data_mut().iter_mut().zip(places) {
        *value = if x > 1.0 && x <= right && y > 1.0 && y <= bottom {
            let ((column, tx), (row, ty)) = (whole_and_rest(x), whole_and_rest(y));
            let start = (row - 1) * width + column - 1;
            inner(data, start, width, weights(&CUBICS, tx), weights(&CUBICS, ty))
        } else {
            sample(source, x, y, outside)
        };
    }
}

/// A whole number next to `place` (above 1, below 2²²), at least 1, and the rest, 0..=1: `floor` without the library call that it is on
/// baseline x86-64. A rest of 1 instead of 0 with the next number is the same place.
#[inline(always)]
fn whole_and_rest(place: f32) -> (usize, f32) {
    const SHIFT: f32 = 8_388_608.0; // 2²³: from here on the spacing of f32 is 1
    let shifted = (place - 0.5) + SHIFT;
    ((shifted.to_bits() & 0x007f_ffff) as usize, place - (shifted - SHIFT))
}

/// Sum over the sixteen taps whose first is `data[start]`.
#[inline(always)]
fn inner(data: &[f32], start: usize, width: usize, wx: [f32; 4], wy: [f32; 4]) -> f32 {
    let mut columns = [0.0f32; 4];
    for (j, &weight) in wy.iter().enumerate() {
        let taps = &data[start + j * width..][..4];
        for i in 0..4 {
            columns[i] += weight * taps[i];
        }
    }
    (columns[0] * wx[0] + columns[1] * wx[1]) + (columns[2] * wx[2] + columns[3] * wx[3])
}

#[cfg(test)]
mod tests;
