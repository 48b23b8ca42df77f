//! Grain: alternation from pixel to pixel where a result is flat.
//!
//! A lens passes next to nothing of the finest details, so grain hardly changes the residuals of
//! model and capture. Where the photo or the reference solution is flat, but not the result, there
//! are strokes that only the result restores.

use super::limits::{DATA_SHARE_MIN, FLAT, GRAIN_SEEN, GRAIN_TIMES};
use crate::deconvolution::smoothing::mean_around;
use crate::frame::Plane;

/// Pixels to each side over which slopes are averaged.
const AROUND: usize = 2;

/// The grain of a result and of its photo in the same flat pixels, RMS in codes of 255.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Grain {
    /// Grain of the result.
    pub result: f32,
    /// Grain of the photo.
    pub photo: f32,
}

impl Grain {
    /// Grain of `result` and `photo` where `result` is flat: lightness, 0..255, of one size.
    pub(super) fn of(result: &Plane, photo: &Plane) -> Grain {
        let flat = flat_parts(result);
        Grain { result: grain(result, &flat), photo: grain(photo, &flat) }
    }

    /// Whether the result lacks grain that the photo has.
    pub(super) fn is_cleared(&self) -> bool {
        self.photo > GRAIN_SEEN && GRAIN_TIMES * self.result < self.photo
    }

    /// The result's grain over the larger of the visible grain and [`GRAIN_TIMES`] the photo's.
    pub(super) fn over_allowed(&self) -> f32 {
        (self.result / GRAIN_SEEN).min(self.result / (GRAIN_TIMES * self.photo))
    }
}

/// The pixels (1 or 0) around which `lightness` is flat.
fn flat_parts(lightness: &Plane) -> Plane {
    let smooth = mean_around(lightness, 1);
    let (width, height) = (lightness.width(), lightness.height());
    let slope = Plane::from_fn(lightness.size(), |x, y| {
        let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        let across = smooth.at(right, y) - smooth.at(left, y);
        (across / 2.0).hypot((smooth.at(x, below) - smooth.at(x, above)) / 2.0)
    });
    mean_around(&slope, AROUND).map(|v: f32| f32::from(u8::from(v <= FLAT)))
}

/// RMS of second differences along both axes of `lightness` over `flat` pixels, scaled so that a
/// chessboard of ± 1 gives 4; 0 if too few pixels are flat.
fn grain(lightness: &Plane, flat: &Plane) -> f32 {
    let (width, height) = (lightness.width(), lightness.height());
    let (mut squares, mut count) = (0.0f64, 0usize);
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            if flat.at(x, y) > 0.0 {
                let across = |y: usize| {
                    lightness.at(x - 1, y) - 2.0 * lightness.at(x, y) + lightness.at(x + 1, y)
                };
                let both = (2.0 * across(y) - across(y - 1) - across(y + 1)) / 4.0;
                squares += f64::from(both).powi(2);
                count += 1;
            }
        }
    }
    match count as f64 >= DATA_SHARE_MIN * lightness.size().area() as f64 && count > 0 {
        true => (squares / count as f64).sqrt() as f32,
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    const SIZE: Size = Size { width: 60, height: 40 };

    /// Flat on the left, a ramp on the right, with a chessboard of ± `half` all over.
    fn board(half: f32) -> Plane {
        Plane::from_fn(SIZE, |x, y| {
            let sign = if (x + y) % 2 == 0 { 1.0 } else { -1.0 };
            100.0 + 5.0 * x.saturating_sub(30) as f32 + sign * half
        })
    }

    #[test]
    fn a_chessboard_on_a_flat_part_is_grain() {
        let of = |half: f32| Grain::of(&board(half), &board(0.1));
        assert!((of(0.5).result - 2.0).abs() < 1e-3, "{:?}", of(0.5));
        assert!(of(1.0).over_allowed() > 1.5 && of(0.4).over_allowed() <= 1.0);
        let noisy = Grain::of(&board(1.0), &board(0.9));
        assert!(noisy.over_allowed() <= 1.0, "the photo has it, too: {noisy:?}");
    }

    #[test]
    fn strokes_are_no_grain() {
        let stroke = |x: usize| if (20..30).contains(&x) { 40.0 * (x / 2 % 2) as f32 } else { 0.0 };
        let result = Plane::from_fn(SIZE, |x, y| board(0.5).at(x, y) + stroke(x));
        let grain = Grain::of(&result, &board(0.1));
        assert!((grain.result - 2.0).abs() < 1e-3, "{grain:?}");
    }

    #[test]
    fn detail_is_no_grain() {
        let steep = Plane::from_fn(SIZE, |x, y| 20.0 * ((x * 7 + y * 3) % 11) as f32);
        assert_eq!(Grain::of(&steep, &board(0.0)).result, 0.0);
    }
}
