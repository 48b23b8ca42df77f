//! What is read off lens functions: their sums, centroids and radii.

use crate::calibration::geometric::{Map, Pair};
use crate::calibration::surface::{Domain, SurfaceError};
use crate::frame::{Channel, Size};
use crate::restore::lens_model::LensFunctions;

/// Scales every function to sum 1: what is flat is seen flat, by the definition of the dark corner. The
/// light that glare carries beyond the support is thereby counted as if it stayed. Returns the mean sum before, per channel.
pub fn normalise(functions: &mut LensFunctions) -> [f32; 3] {
    let one = functions.support_px.pow(2);
    let count = (functions.rows * functions.columns) as f32;
    let mut means = [0.0; 3];
    for (taps, mean) in functions.taps.iter_mut().zip(&mut means) {
        for function in taps.chunks_mut(one) {
            let sum: f32 = function.iter().sum();
            *mean += sum / count;
            // A function that lost more than half its light is no function; left as it is, it is judged later.
            if sum > 0.5 {
                function.iter_mut().for_each(|t| *t /= sum);
            }
        }
    }
    means
}

/// Centroid (x, y) and RMS radius of one function's taps, pixels from its middle.
pub fn moments(taps: &[f32], support_px: usize) -> ((f64, f64), f64) {
    let middle = (support_px / 2) as f64;
    let (mut sum, mut sx, mut sy, mut srr) = (0.0, 0.0, 0.0, 0.0);
    for (n, &tap) in taps.iter().enumerate() {
        let (x, y) = ((n % support_px) as f64 - middle, (n / support_px) as f64 - middle);
        let tap = f64::from(tap);
        sum += tap;
        sx += tap * x;
        sy += tap * y;
        srr += tap * (x * x + y * y);
    }
    let (x, y) = (sx / sum, sy / sum);
    ((x, y), (srr / sum - x * x - y * y).max(0.0).sqrt())
}

/// How far from its place the light of each Work place is seen, smooth over `canvas`, by the centroids of
/// one channel's functions.
///
/// # Errors
/// When there are too few functions for a smooth map; the caller then leaves the geometry as it is.
pub fn displacement(
    functions: &LensFunctions,
    channel: Channel,
    photo: Size,
    canvas: Domain,
) -> Result<Map, SurfaceError> {
    let centre = |n: usize, count: usize, side: usize| (n as f64 + 0.5) * side as f64 / count as f64 - 0.5;
    let mut pairs = Vec::new();
    for row in 0..functions.rows {
        for column in 0..functions.columns {
            let taps = functions.function(channel, row, column);
            let from =
                (centre(column, functions.columns, photo.width), centre(row, functions.rows, photo.height));
            pairs.push(Pair { from, to: moments(taps, functions.support_px).0 });
        }
    }
    // Two by two intervals: coma's displacement is a cubic over the field. A stiff spline, for a centroid
    // carries a few hundredths of a pixel of noise.
    Map::fit(canvas, (2, 2), &pairs, 1e-3)
}
