//! Veiling glare: a share of the light scattered into a wide Gaussian.

use crate::config::Glare;
use crate::frame::{Plane, Size};

/// Cells of the coarse grid per standard deviation; more would change the result by under 0.1 %.
const CELLS_PER_SIGMA: f32 = 6.0;
/// Extent of the Gaussian in standard deviations: 6e-5 of the light is beyond.
const CUT: f32 = 4.0;

/// Scatters the share of light given by `glare`; light scattered out of the frame is lost.
pub(super) fn scatter(light: Plane, glare: Glare) -> Plane {
    if glare.share <= 0.0 {
        return light;
    }
    let cell = ((glare.radius_px / CELLS_PER_SIGMA) as usize).max(1);
    let coarse = cell_means(&light, cell);
    // Cell means and linear interpolation add cell²/4 to the variance.
    let spread = if cell == 1 { 0.0 } else { 0.25 };
    let sigma = ((glare.radius_px / cell as f32).powi(2) - spread).max(0.01).sqrt();
    let taps = gaussian(sigma);
    let veil = transposed_blur(&transposed_blur(&coarse, &taps), &taps);
    let mut out = light;
    let size = out.size();
    for y in 0..size.height {
        let rows = between(y, cell, veil.height());
        let row = out.row_mut(y);
        for (x, value) in row.iter_mut().enumerate() {
            let columns = between(x, cell, veil.width());
            let along = |y: usize| {
                let (left, right) = (veil.at(columns.low, y), veil.at(columns.high, y));
                left + columns.share * (right - left)
            };
            let (upper, lower) = (along(rows.low), along(rows.high));
            *value += glare.share * (upper + rows.share * (lower - upper) - *value);
        }
    }
    out
}

/// Means over cells of `cell`² pixels, with a border of one cell; pixels outside the frame are
/// dark.
fn cell_means(light: &Plane, cell: usize) -> Plane {
    let size = light.size();
    let coarse = Size::new(size.width.div_ceil(cell) + 2, size.height.div_ceil(cell) + 2);
    let mut sums: Plane = Plane::zeros(coarse);
    let scale = 1.0 / (cell * cell) as f32;
    for y in 0..size.height {
        let to = sums.row_mut(y / cell + 1);
        for (n, part) in light.row(y).chunks(cell).enumerate() {
            to[n + 1] += part.iter().sum::<f32>() * scale;
        }
    }
    sums
}

/// Coarse places around a fine one, and the position between them, 0..1.
struct Neighbours {
    low: usize,
    high: usize,
    share: f32,
}

/// Coarse places around fine place `x`.
fn between(x: usize, cell: usize, length: usize) -> Neighbours {
    let place = (x as f32 + 0.5) / cell as f32 + 0.5;
    let low = (place as usize).min(length - 1);
    Neighbours { low, high: (low + 1).min(length - 1), share: place - low as f32 }
}

/// Sampled Gaussian from −n to n, with sum 1.
fn gaussian(sigma: f32) -> Vec<f32> {
    let reach = (CUT * sigma).ceil() as i32;
    let taps: Vec<f32> =
        (-reach..=reach).map(|i| (-0.5 * (i as f32 / sigma).powi(2)).exp()).collect();
    let sum: f32 = taps.iter().sum();
    taps.into_iter().map(|v| v / sum).collect()
}

/// Blurs along rows, dark outside, and transposes; applied twice, it blurs the plane.
fn transposed_blur(plane: &Plane, taps: &[f32]) -> Plane {
    let (width, half) = (plane.width(), taps.len() / 2);
    Plane::from_fn(Size::new(plane.height(), width), |y, x| {
        let row = plane.row(y);
        let low = x.saturating_sub(half);
        let high = (x + half + 1).min(width);
        row[low..high].iter().zip(&taps[low + half - x..]).map(|(a, b)| a * b).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coarse_grid_agrees_with_the_direct_sum() {
        let size = Size::new(90, 70);
        let light =
            Plane::from_fn(size, |x, y| if (x / 9 + y / 7) % 2 == 0 { 255.0 } else { 20.0 });
        let glare = Glare { share: 0.5, radius_px: 20.0 };
        let taps = gaussian(20.0);
        let veil = transposed_blur(&transposed_blur(&light, &taps), &taps);
        let fast = scatter(light.clone(), glare);
        for (n, value) in fast.data().iter().enumerate() {
            let plain = 0.5 * light.data()[n] + 0.5 * veil.data()[n];
            assert!((value - plain).abs() < 0.5, "{n}: {value} {plain}");
        }
    }

    #[test]
    fn light_is_conserved() {
        let mut light = Plane::zeros(Size::new(301, 301));
        light.set(150, 150, 1.0e6);
        let out = scatter(light, Glare { share: 0.1, radius_px: 20.0 });
        let sum: f64 = out.data().iter().map(|&v| f64::from(v)).sum();
        assert!((sum / 1.0e6 - 1.0).abs() < 2e-3, "{sum}");
    }
}
