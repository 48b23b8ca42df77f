//! Sums, centroids and radii of lens functions.

use crate::calibration::geometric::{Map, Pair};
use crate::calibration::surface::{Domain, SurfaceError};
use crate::deconvolution::lens_model::LensFunctions;
use crate::frame::{Channel, Size};

/// Scales every function to sum 1, so that flats stay flat, as the dark corner requires; glare
/// beyond the support is thus attributed to the function.
pub fn normalise(functions: &mut LensFunctions) {
    let one = functions.support_px.pow(2);
    for function in functions.taps.iter_mut().flat_map(|taps| taps.chunks_mut(one)) {
        let sum: f32 = function.iter().sum();
        // A function without half its light is invalid, which a later check reports.
        if sum > 0.5 {
            function.iter_mut().for_each(|t| *t /= sum);
        }
    }
}

/// Centroid (x, y) relative to the middle, and RMS radius of one function, pixels.
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

/// Standard deviation of the Gaussian that smooths taps before taking their centroid, pixels.
const SMOOTHING_PX: f64 = 1.5;
/// Smallest significant smoothed tap, in noise σ.
const NOISE_FLOOR: f64 = 3.0;
/// Taps up to this far from significant ones are kept: the faint tail of coma is below the noise
/// and still moves a centroid.
const TAIL_PX: isize = 5;

/// Centroid (x, y) of one measured function, pixels from its middle. The noise of far taps has a
/// large lever arm: taps are smoothed, which keeps the centroid, and those far from significant
/// ones are omitted (noise: median of the outermost two rings).
pub fn centroid(taps: &[f32], support_px: usize) -> (f64, f64) {
    let k = support_px as isize;
    let reach = (3.0 * SMOOTHING_PX).ceil() as isize;
    let bell: Vec<f64> =
        (-reach..=reach).map(|t| (-0.5 * (t as f64 / SMOOTHING_PX).powi(2)).exp()).collect();
    let total: f64 = bell.iter().sum();
    let pass = |from: &[f64], across: isize, down: isize| -> Vec<f64> {
        (0..k * k)
            .map(|n| {
                let (x, y) = (n % k, n / k);
                (-reach..=reach)
                    .filter_map(|t| {
                        let (u, v) = (x + t * across, y + t * down);
                        let inside = (0..k).contains(&u) && (0..k).contains(&v);
                        inside.then(|| {
                            bell[(t + reach) as usize] * from[(v * k + u) as usize] / total
                        })
                    })
                    .sum()
            })
            .collect()
    };
    let plain: Vec<f64> = taps.iter().map(|&t| f64::from(t)).collect();
    let smooth = pass(&pass(&plain, 1, 0), 0, 1);
    let mut rim: Vec<f64> = (0..k * k)
        .filter(|n| [n % k, n / k].into_iter().any(|p| p < 2 || p >= k - 2))
        .map(|n| smooth[n as usize].abs())
        .collect();
    rim.sort_by(f64::total_cmp);
    // The median of |x| is 0.6745 σ for a normal x.
    let noise = rim.get(rim.len() / 2).copied().unwrap_or(0.0) / 0.6745;
    let mut near = vec![false; smooth.len()];
    for n in (0..k * k).filter(|&n| smooth[n as usize] > NOISE_FLOOR * noise) {
        for v in (n / k - TAIL_PX).max(0)..=(n / k + TAIL_PX).min(k - 1) {
            for u in (n % k - TAIL_PX).max(0)..=(n % k + TAIL_PX).min(k - 1) {
                let far = (u - n % k).pow(2) + (v - n / k).pow(2) > TAIL_PX.pow(2);
                near[(v * k + u) as usize] |= !far;
            }
        }
    }
    let kept: Vec<f32> =
        smooth.iter().zip(near).map(|(&v, near)| if near { v as f32 } else { 0.0 }).collect();
    moments(&kept, support_px).0
}

/// Displacement of the light at each Work position, in Work pixels: a smooth map over `canvas`,
/// fitted to the centroids of green's functions, whose pixels are `pixel_px` Work pixels wide.
///
/// # Errors
/// When there are too few functions for a smooth map.
pub fn displacement(
    functions: &LensFunctions,
    photo: Size,
    canvas: Domain,
    pixel_px: usize,
) -> Result<Map, SurfaceError> {
    let centre =
        |n: usize, count: usize, side: usize| (n as f64 + 0.5) * side as f64 / count as f64 - 0.5;
    let mut pairs = Vec::new();
    for row in 0..functions.rows {
        for column in 0..functions.columns {
            let taps = functions.function(Channel::Green, row, column);
            let from = (
                centre(column, functions.columns, photo.width),
                centre(row, functions.rows, photo.height),
            );
            let (x, y) = centroid(taps, functions.support_px);
            pairs.push(Pair { from, to: (x * pixel_px as f64, y * pixel_px as f64) });
        }
    }
    // One cubic over the field, like coma's displacement; few coefficients suppress the centroids'
    // noise of some hundredths of a pixel.
    Map::fit(canvas, (1, 1), &pairs, 1e-6)
}
