//! Grain: what of a picture alternates from pixel to pixel where another picture is flat.
//!
//! A lens lets next to nothing of the finest details through, so a result that alternates so meets
//! the photo as well as one that does not, by model and by light. Only a picture that is flat there
//! tells: the photo cheaply, the reference solution surely, for it is sharp and flat at once.

use crate::frame::Plane;

/// A pixel is flat where lightness changes by less than this from pixel to pixel, of 255 codes, as
/// a mean around it. Measured, as the two below, on the laboratory's group of limits
/// (`tests/tables/judging.md`).
const FLAT: f32 = 2.0;
/// Pixels around, to each side.
const AROUND: usize = 2;
/// With a smaller share of flat pixels nothing is said. Guess.
const SHARE_MIN: f64 = 0.03;
/// Grain that is seen, codes,
const SEEN: f32 = 3.0;
/// and how many times the photo's it must be.
const TIMES_THE_PHOTO_S: f32 = 2.0;
/// A photo's grain that is worth taking out, codes. On the same group ordinary photos have at most
/// 1.8, those with 8 grey levels of noise 2.6 and more.
const WORTH_TAKING_OUT: f32 = 2.0;

/// The grain of a result and of its photo in the same flat pixels, RMS in codes of 255.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Grain {
    /// The result's.
    pub result: f32,
    /// The photo's.
    pub photo: f32,
}

impl Grain {
    /// Of `result` and `photo` where `base` is flat: all are lightness, 0..255, of one size.
    pub(super) fn of(result: &Plane, photo: &Plane, base: &Plane) -> Grain {
        let flat = flat(base);
        Grain { result: grain(result, &flat), photo: grain(photo, &flat) }
    }

    /// Whether the result is rid of grain that the photo has.
    pub(super) fn is_cleared(&self) -> bool {
        self.photo > WORTH_TAKING_OUT && TIMES_THE_PHOTO_S * self.result < self.photo
    }

    /// Whether it harms, where limits are `share` of what they are.
    pub(super) fn harms(&self, share: f32) -> bool {
        let fine =
            self.result <= share * SEEN || self.result <= share * TIMES_THE_PHOTO_S * self.photo;
        !fine
    }
}

/// The pixels (1 or 0) around which `lightness` is flat.
fn flat(lightness: &Plane) -> Plane {
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

/// Means over `reach` pixels to each side, edges repeated.
fn mean_around(plane: &Plane, reach: usize) -> Plane {
    let (width, height) = (plane.width(), plane.height());
    let mean = |at: usize, length: usize, of: &dyn Fn(usize) -> f32| {
        let places = (0..=2 * reach).map(|n| (at + n).saturating_sub(reach).min(length - 1));
        places.map(of).sum::<f32>() / (2 * reach + 1) as f32
    };
    let rows = Plane::from_fn(plane.size(), |x, y| mean(x, width, &|x| plane.at(x, y)));
    Plane::from_fn(plane.size(), |x, y| mean(y, height, &|y| rows.at(x, y)))
}

/// RMS of second differences along both axes of `lightness` over `flat` pixels, at the scale where
/// a chessboard of ± 1 is 4; nothing where too few are flat.
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
    match count as f64 >= SHARE_MIN * lightness.size().area() as f64 && count > 0 {
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
    fn a_chessboard_on_what_is_flat_is_grain() {
        let base = board(0.0);
        let of = |half: f32| Grain::of(&board(half), &board(0.1), &base);
        assert!((of(0.5).result - 2.0).abs() < 1e-3, "{:?}", of(0.5));
        assert!(of(1.0).harms(1.0) && !of(0.4).harms(1.0));
        let noisy = Grain::of(&board(1.0), &board(0.9), &base);
        assert!(!noisy.harms(1.0), "the photo has it, too: {noisy:?}");
    }

    #[test]
    fn detail_is_no_grain() {
        let steep = Plane::from_fn(SIZE, |x, y| 20.0 * ((x * 7 + y * 3) % 11) as f32);
        assert_eq!(Grain::of(&steep, &board(0.0), &steep).result, 0.0);
    }
}
