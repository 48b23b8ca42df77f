//! Distance of a result from the reference solution ([`super::measures`]) over the untouched
//! photo's: 0 is the same picture, above 1 the photo is nearer.

use crate::deconvolution::quality::ssim;
use crate::frame::{Channel, Channels, FULL_SCALE, Frame, Plane, Work};
use crate::picture::Lab;

/// Weights of red, green and blue in luminance (Rec. 709).
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];
/// Approximate exponent of lightness as a power of light.
const LIGHTNESS: f32 = 1.0 / 2.2;

/// Pixels from one sampled colour to the next, across and down; odd, so that both states of a
/// pixel-to-pixel alternation are sampled.
pub(super) const SAMPLED_EVERY: usize = 3;

/// A result beside the two pictures that its distance is measured by.
#[derive(Clone, Copy)]
pub(super) struct Compared<'a> {
    pub(super) result: &'a Frame<Work>,
    pub(super) photo: &'a Frame<Work>,
    pub(super) reference: &'a Frame<Work>,
    pub(super) channels: Channels,
}

impl Compared<'_> {
    /// Distance by 1 − SSIM of lightness.
    pub(super) fn by_lightness(&self) -> f64 {
        let reference = lightness(self.reference, self.channels);
        let distance = |of| 1.0 - ssim(&lightness(of, self.channels), &reference);
        distance(self.result) / distance(self.photo).max(f64::MIN_POSITIVE)
    }

    /// Distance by the mean difference of colours (CIEDE2000, taking light as sRGB's); `None` for a
    /// grey photo.
    pub(super) fn by_colour(&self) -> Option<f64> {
        let reference = (self.channels == Channels::Colour).then(|| colours(self.reference))?;
        let distance = |of| {
            let differences = colours(of).zip(reference.clone()).map(|(a, b)| a.difference(b));
            differences.sum::<f64>()
        };
        Some(distance(self.result) / distance(self.photo).max(f64::MIN_POSITIVE))
    }
}

/// Sampled colours of `picture`.
fn colours(picture: &Frame<Work>) -> impl Iterator<Item = Lab> + Clone {
    let size = picture.size();
    let rows = (0..size.height).step_by(SAMPLED_EVERY);
    let places =
        rows.flat_map(move |y| (0..size.width).step_by(SAMPLED_EVERY).map(move |x| (x, y)));
    places.map(|(x, y)| Lab::of_light(Channel::ALL.map(|c| picture.plane(c).at(x, y))))
}

/// Lightness of `picture`, 0..255; for a grey photo, that of the green channel.
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

    fn compared<'a>(
        result: &'a Frame<Work>,
        photo: &'a Frame<Work>,
        reference: &'a Frame<Work>,
    ) -> Compared<'a> {
        Compared { result, photo, reference, channels: Channels::Colour }
    }

    #[test]
    fn the_distance_is_zero_for_the_reference_solution_and_one_for_the_photo() {
        let wave = |share: f32| {
            let plane =
                Plane::from_fn(Size::new(40, 30), |x, y| 90.0 + share * ((x * y) % 23) as f32);
            Frame::<Work>::from_fn(|_| plane.clone())
        };
        let (photo, reference) = (wave(1.0), wave(4.0));
        assert!(compared(&reference, &photo, &reference).by_lightness().abs() < 1e-6);
        assert!((compared(&photo, &photo, &reference).by_lightness() - 1.0).abs() < 1e-6);
        let near = wave(3.0);
        let grey = Compared { channels: Channels::Green, ..compared(&near, &photo, &reference) };
        assert!(grey.by_lightness() < 0.5);
    }

    #[test]
    fn a_tint_of_the_same_lightness_shows_in_colour_alone() {
        let waves = |share: f32, tint: f32| {
            Frame::<Work>::from_fn(|c| {
                let of = |x: usize, y: usize| 90.0 + share * ((x * y) % 23) as f32;
                let sign = [1.0, 0.0, -LUMINANCE[0] / LUMINANCE[2]][c.index()];
                let stripe = |x: usize| if x.is_multiple_of(2) { tint } else { -tint };
                Plane::from_fn(Size::new(60, 40), |x, y| of(x, y) + sign * stripe(x))
            })
        };
        let (photo, result, reference) = (waves(2.0, 0.0), waves(4.0, 20.0), waves(4.0, 0.0));
        let tinted = compared(&result, &photo, &reference);
        assert!(tinted.by_lightness() < 0.3);
        assert!(tinted.by_colour().unwrap() > 1.5, "{:?}", tinted.by_colour());
        assert_eq!(Compared { channels: Channels::Green, ..tinted }.by_colour(), None);
        let itself = compared(&photo, &photo, &reference).by_colour().unwrap();
        assert!((itself - 1.0).abs() < 1e-9, "{itself}");
    }
}
