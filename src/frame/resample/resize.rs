//! Resizing of a plane: bicubic enlargement, antialiased reduction.

use std::ops::Range;

use super::KEYS_A;
use crate::frame::{Plane, Size};

/// Resamples `plane` to `size`. Both cover the same rectangle: pixel i of n is at (i+½)/n of its
/// side. Each new pixel is a mean of old ones weighted by Keys' kernel, which is stretched for
/// reduction to avoid aliasing; at the border only pixels inside are used. An empty plane gives
/// black.
pub fn resize(plane: &Plane, size: Size) -> Plane {
    resize_rows(plane, size, 0..size.height)
}

/// The `rows` of `plane` resampled to `size`.
pub fn resize_rows(plane: &Plane, size: Size, rows: Range<usize>) -> Plane {
    let mut out = Plane::zeros(Size::new(size.width, rows.len()));
    if plane.size().area() == 0 || out.size().area() == 0 {
        return out;
    }
    let along_x = taps(plane.width(), size.width, 0..size.width);
    let along_y = taps(plane.height(), size.height, rows);
    let (top, last) = (along_y[0].first, &along_y[along_y.len() - 1]);
    let end = last.first + last.weights.len();
    let mut narrow = Plane::<f32>::zeros(Size::new(size.width, end - top));
    for y in top..end {
        let from = plane.row(y);
        for (value, taps) in narrow.row_mut(y - top).iter_mut().zip(&along_x) {
            *value = from[taps.first..].iter().zip(&taps.weights).map(|(v, w)| v * w).sum();
        }
    }
    for (y, taps) in along_y.iter().enumerate() {
        let row = out.row_mut(y);
        for (v, &weight) in taps.weights.iter().enumerate() {
            for (value, from) in row.iter_mut().zip(narrow.row(taps.first - top + v)) {
                *value += weight * from;
            }
        }
    }
    out
}

/// Old pixels and weights of one new pixel.
struct Taps {
    first: usize,
    weights: Vec<f32>,
}

/// Taps of the range `part` of `to` new pixels among `from` old ones.
fn taps(from: usize, to: usize, part: Range<usize>) -> Vec<Taps> {
    let scale = from as f64 / to as f64;
    let stretch = scale.max(1.0);
    part.map(|i| {
        let middle = (i as f64 + 0.5) * scale - 0.5;
        let first = (middle - 2.0 * stretch).ceil().max(0.0) as usize;
        let last = ((middle + 2.0 * stretch).floor() as usize).min(from - 1);
        let raw: Vec<f64> = (first..=last).map(|n| kernel((n as f64 - middle) / stretch)).collect();
        let total: f64 = raw.iter().sum();
        Taps { first, weights: raw.iter().map(|w| (w / total) as f32).collect() }
    })
    .collect()
}

/// Keys' kernel at `distance` pixels.
fn kernel(distance: f64) -> f64 {
    let (a, d) = (f64::from(KEYS_A), distance.abs());
    if d <= 1.0 {
        ((a + 2.0) * d - (a + 3.0)) * d * d + 1.0
    } else if d < 2.0 {
        ((a * d - 5.0 * a) * d + 8.0 * a) * d - 4.0 * a
    } else {
        0.0
    }
}
