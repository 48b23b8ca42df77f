//! How far a result is from the reference solution ([`super::evidence`]), measured against how far
//! the untouched photo is from it: 0 is the same picture, above 1 the photo is nearer.

use crate::deconvolution::quality::ssim;
use crate::frame::{Channel, Channels, FULL_SCALE, Frame, Plane, Work};
use crate::picture::Lab;

/// Weights of red, green and blue in luminance (Rec. 709).
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];
/// Lightness is light to this power, about.
const LIGHTNESS: f32 = 1.0 / 2.2;

/// Colours are compared at every third pixel of every third row: what alternates from pixel to
/// pixel is met in both its states.
const EVERY: usize = 3;

/// The distance of a result from its reference solution by 1 − SSIM of lightness.
pub(super) fn distance([photo, result, reference]: [&Frame<Work>; 3], channels: Channels) -> f64 {
    let (reference, result) = (lightness(reference, channels), lightness(result, channels));
    let unlike = |plane: &Plane| 1.0 - ssim(plane, &reference);
    unlike(&result) / unlike(&lightness(photo, channels)).max(f64::MIN_POSITIVE)
}

/// The same by the mean difference of their colours (CIEDE2000, light taken for sRGB's); nothing of
/// a grey photo.
pub(super) fn colour_distance(
    [photo, result, reference]: [&Frame<Work>; 3],
    channels: Channels,
) -> Option<f64> {
    let reference = (channels == Channels::Colour).then(|| colours(reference))?;
    let unlike = |picture: &Frame<Work>| {
        let differences = colours(picture).zip(reference.clone()).map(|(a, b)| a.difference(b));
        differences.sum::<f64>()
    };
    Some(unlike(result) / unlike(photo).max(f64::MIN_POSITIVE))
}

/// Some of the colours of `picture`.
fn colours(picture: &Frame<Work>) -> impl Iterator<Item = Lab> + Clone {
    let size = picture.size();
    let rows = (0..size.height).step_by(EVERY);
    let places = rows.flat_map(move |y| (0..size.width).step_by(EVERY).map(move |x| (x, y)));
    places.map(|(x, y)| Lab::of_light(Channel::ALL.map(|c| picture.plane(c).at(x, y))))
}

/// How light `picture` looks, 0..255; of a grey photo its green channel.
pub(super) fn lightness(picture: &Frame<Work>, channels: Channels) -> Plane {
    let mut sum = Plane::zeros(picture.size());
    for &c in channels.list() {
        let weight = if channels == Channels::Green { 1.0 } else { LUMINANCE[c.index()] };
        sum.add_scaled(weight, &picture.plane(c).map(|v: f32| v.clamp(0.0, FULL_SCALE)));
    }
    sum.map(|v: f32| FULL_SCALE * (v / FULL_SCALE).powf(LIGHTNESS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    #[test]
    fn the_distance_is_nought_for_the_reference_solution_and_one_for_the_photo() {
        let wave = |share: f32| {
            let plane =
                Plane::from_fn(Size::new(40, 30), |x, y| 90.0 + share * ((x * y) % 23) as f32);
            Frame::<Work>::from_fn(|_| plane.clone())
        };
        let (photo, reference) = (wave(1.0), wave(4.0));
        assert!(distance([&photo, &reference, &reference], Channels::Colour).abs() < 1e-6);
        assert!((distance([&photo, &photo, &reference], Channels::Colour) - 1.0).abs() < 1e-6);
        assert!(distance([&photo, &wave(3.0), &reference], Channels::Green) < 0.5);
    }

    #[test]
    fn a_tint_of_the_same_lightness_is_told_by_colour_alone() {
        let waves = |share: f32, tint: f32| {
            Frame::<Work>::from_fn(|c| {
                let of = |x: usize, y: usize| 90.0 + share * ((x * y) % 23) as f32;
                let sign = [1.0, 0.0, -LUMINANCE[0] / LUMINANCE[2]][c.index()];
                let stripe = |x: usize| if x.is_multiple_of(2) { tint } else { -tint };
                Plane::from_fn(Size::new(60, 40), |x, y| of(x, y) + sign * stripe(x))
            })
        };
        let (photo, result, reference) = (waves(2.0, 0.0), waves(4.0, 20.0), waves(4.0, 0.0));
        assert!(distance([&photo, &result, &reference], Channels::Colour) < 0.3);
        let far = colour_distance([&photo, &result, &reference], Channels::Colour).unwrap();
        assert!(far > 1.5, "{far}");
        assert_eq!(colour_distance([&photo, &result, &reference], Channels::Green), None);
        let itself = colour_distance([&photo, &photo, &reference], Channels::Colour).unwrap();
        assert!((itself - 1.0).abs() < 1e-9, "{itself}");
    }
}
