//! Pictures for checking and measuring a rig, and a test chart.
//!
//! Pictures in panel pixels ([`Codes`]) can be shown before calibration; pictures in light
//! ([`Plane`], 0..255, Work) need the response curve and the geometry to be shown.

pub mod chart;
mod gradation;

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::frame::{Channel, Codes, Frame, Plane, Size};
pub use chart::chart;
pub use gradation::{Gradation, GradationBlock};

/// A picture of one bright spot per channel, at [`locator_spots`], for a panel of `size`.
pub fn locator(size: Size) -> Codes {
    // Wide against any workable blur.
    let (radius, spots) = (size.height as f64 / 24.0, locator_spots(size));
    Codes::from_fn(|c| {
        let (cx, cy) = spots[c.index()];
        Plane::from_fn(size, |x, y| {
            let (dx, dy) = (x as f64 - cx, y as f64 - cy);
            if dx * dx + dy * dy < radius * radius { 255 } else { 0 }
        })
    })
}

/// Positions of the locator's spots, panel pixels: red to the left of the centre, green to the
/// right, blue below. They are near the centre, so that even a badly aimed camera sees them, and
/// not collinear, so that they give position, rotation, magnification and reflection.
pub fn locator_spots(size: Size) -> [(f64, f64); 3] {
    let (w, h) = (size.width as f64, size.height as f64);
    let (cx, cy) = ((w - 1.0) / 2.0, (h - 1.0) / 2.0);
    [(cx - h / 5.0, cy - h / 8.0), (cx + h / 5.0, cy - h / 8.0), (cx, cy + h / 5.0)]
}

/// A uniform picture with one code per channel.
pub fn flat(size: Size, codes: [u8; 3]) -> Codes {
    Frame::from_fn(|c| Plane::filled(size, codes[c.index()]))
}

/// A uniform picture with `code` in one channel and 0 in the others.
pub fn flat_of(size: Size, channel: Channel, code: u8) -> Codes {
    let mut codes = [0; 3];
    codes[channel.index()] = code;
    flat(size, codes)
}

/// A checkerboard of squares of `square_px` panel pixels with codes 0 and 255 in one channel. Its
/// corners are at (a·`square_px` − ½, b·`square_px` − ½); squares right of and below a corner with
/// even a + b are bright.
pub fn checkerboard(size: Size, square_px: usize, channel: Channel) -> Codes {
    let square_px = square_px.max(1);
    Frame::from_fn(|c| {
        if c != channel {
            return Plane::zeros(size);
        }
        Plane::from_fn(size, |x, y| {
            if (x / square_px + y / square_px).is_multiple_of(2) { 255 } else { 0 }
        })
    })
}

/// Pseudo-random ±1, white and of zero mean (one 0 if the area is odd), reproducible by `seed`.
pub fn pseudo_random(size: Size, seed: u64) -> Plane {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let half = size.area() / 2;
    let mut data = vec![1.0f32; half];
    data.resize(2 * half, -1.0);
    data.resize(size.area(), 0.0);
    data.shuffle(&mut random);
    Plane::from_vec(size, data).unwrap_or_else(|| Plane::zeros(size))
}

/// Derives the seed of the `n`-th of several patterns.
pub fn nth_seed(seed: u64, n: u64) -> u64 {
    Xoshiro256PlusPlus::seed_from_u64(seed ^ n.wrapping_mul(0x9E37_79B9_7F4A_7C15)).random()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pseudo_random_is_balanced_white_and_repeatable() {
        let size = Size::new(64, 48);
        let p = pseudo_random(size, 7);
        assert_eq!(p, pseudo_random(size, 7));
        assert_ne!(p, pseudo_random(size, 8));
        assert_eq!(p.data().iter().sum::<f32>(), 0.0);
        let neighbours: f32 =
            (0..48).map(|y| p.row(y).windows(2).map(|w| w[0] * w[1]).sum::<f32>()).sum::<f32>()
                / 3024.0;
        // Five standard deviations of a mean of 3024 signs.
        assert!(neighbours.abs() < 5.0 / 3024f32.sqrt(), "{neighbours}");
    }

    #[test]
    fn checkerboard_corners_are_at_their_documented_positions() {
        let board = checkerboard(Size::new(20, 20), 5, Channel::Green);
        let green = board.plane(Channel::Green);
        assert_eq!(
            (green.at(4, 4), green.at(5, 4), green.at(4, 5), green.at(5, 5)),
            (255, 0, 0, 255)
        );
        assert!(board.plane(Channel::Red).data().iter().all(|&v| v == 0));
    }

    #[test]
    fn locator_spots_are_in_their_channels() {
        let size = Size::new(320, 180);
        let codes = locator(size);
        for c in Channel::ALL {
            let (x, y) = locator_spots(size)[c.index()];
            assert_eq!(codes.plane(c).at(x.round() as usize, y.round() as usize), 255);
            let lit = codes.plane(c).data().iter().filter(|&&v| v > 0).count() as f64;
            let wanted = std::f64::consts::PI * 7.5f64.powi(2);
            assert!((lit / wanted - 1.0).abs() < 0.1);
        }
    }
}
