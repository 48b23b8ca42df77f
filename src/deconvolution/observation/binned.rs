//! An observation on pixels binned by two.

use std::sync::Arc;

use super::Observation;
use crate::deconvolution::data_term::{MISSING, SATURATED, TRUSTED, canvas_of};
use crate::deconvolution::lens_model::SquarePlaces;
use crate::frame::{Channel, Frame, Plane, Size, Work};

/// Columns and rows within a square of two by two pixels.
const SQUARE: [(usize, usize); 4] = [(0, 0), (1, 0), (0, 1), (1, 1)];

impl Observation {
    /// Columns and rows, within each square of two by two pixels, of the data of `channel`.
    pub fn places(&self, channel: Channel) -> SquarePlaces {
        let is_datum = |&(x, y): &(usize, usize)| {
            self.sampling.mosaic().is_none_or(|mosaic| mosaic.colour_at(x, y) == channel)
        };
        SQUARE.into_iter().filter(is_datum).collect()
    }

    /// The means of the data of each channel over squares of two by two pixels, as full-colour
    /// light; `None` for data without such means, and a canvas or photo that does not divide by
    /// two.
    pub fn binned(&self) -> Option<Observation> {
        let (size, rect) = (self.size(), self.rect);
        if !size.width.is_multiple_of(2) || !size.height.is_multiple_of(2) {
            return None;
        }
        let sampling = self.sampling.binned()?;
        let places = Channel::ALL.map(|c| self.places(c));
        let half = Size::new(size.width / 2, size.height / 2);
        let margin = rect.x.div_ceil(2);
        let photo = Size::new(half.width - 2 * margin, half.height - 2 * margin);
        let light = |c: Channel| {
            let (plane, places) = (self.light.plane(c), &places[c.index()]);
            let sum =
                |x, y| places.iter().map(|(u, v)| plane.at(2 * x + u, 2 * y + v)).sum::<f32>();
            Plane::from_fn(half, |x, y| sum(x, y) / places.len() as f32)
        };
        let trust = |c: Channel| {
            let (plane, places) = (self.trust.plane(c), &places[c.index()]);
            Plane::from_fn(half, |x, y| {
                let has =
                    |class: u8| places.iter().any(|(u, v)| plane.at(2 * x + u, 2 * y + v) == class);
                [MISSING, SATURATED].into_iter().find(|&class| has(class)).unwrap_or(TRUSTED)
            })
        };
        // Noise that interpolation spread remains in part: between that of white noise and the
        // datum's own, the geometric mean gains most (`tests/tables/README.md`).
        let spread = |c: Channel| self.pixels_a_datum(c).powf(0.25);
        let noise =
            |c: Channel| spread(c) * self.data_noise(c) / (places[c.index()].len() as f32).sqrt();
        Some(Observation {
            light: Frame::from_fn(light),
            trust: Frame::<Work, u8>::from_fn(trust),
            rect: canvas_of(photo, margin).1,
            channels: self.channels,
            noise: Channel::ALL.map(noise),
            dark_light: self.dark_light,
            sampling: Arc::new(sampling),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::example_lens::{gaussians, lens, photo};
    use crate::deconvolution::observation::Raw;
    use crate::frame::{Channels, Mosaic};

    #[test]
    fn raw_sites_are_binned_by_their_colours() {
        let mut own = photo(&lens(&gaussians([1.0; 3])), 3, Channels::Colour);
        own.sampling = Arc::new(Raw { mosaic: Mosaic::Grbg });
        own.trust.plane_mut(Channel::Green).row_mut(21)[31] = SATURATED;
        own.trust.plane_mut(Channel::Red).row_mut(20)[31] = MISSING;
        let binned = own.binned().unwrap();
        let light = |c: Channel, x: usize, y: usize| own.light.plane(c).at(x, y);
        let mean = |c: Channel| binned.light.plane(c).at(15, 10);
        assert_eq!(mean(Channel::Red), light(Channel::Red, 31, 20));
        assert_eq!(mean(Channel::Blue), light(Channel::Blue, 30, 21));
        let both = light(Channel::Green, 30, 20) + light(Channel::Green, 31, 21);
        assert_eq!(mean(Channel::Green), both / 2.0);
        let trust = Channel::ALL.map(|c| binned.trust.plane(c).at(15, 10));
        assert_eq!(trust, [MISSING, SATURATED, TRUSTED]);
        let [red, green, _] = own.noise;
        assert_eq!(binned.noise, [red, green / 2.0f32.sqrt(), red]);
    }
}
