//! An observation on pixels binned by two.

use std::sync::Arc;

use super::Observation;
use crate::deconvolution::data_term::{MISSING, SATURATED, TRUSTED};
use crate::frame::{Channel, Frame, Plane, Rect, Size, SquarePlace, Work};

impl Observation {
    /// Places of the data of `channel` in a square of two by two pixels.
    fn data_of_square(&self, channel: Channel) -> Vec<SquarePlace> {
        match self.sampling.mosaic() {
            Some(mosaic) => SquarePlace::sites(mosaic, channel),
            None => SquarePlace::pixels(),
        }
    }

    /// Places whose light the mean over a square's data contains. Interpolated pixels contain that
    /// of sites around them; their camera is assumed to have interpolated bilinearly.
    pub fn light_of_square(&self, channel: Channel) -> Vec<SquarePlace> {
        match self.sampling.interpolated() {
            Some(mosaic) => SquarePlace::interpolated(mosaic, channel),
            None => self.data_of_square(channel),
        }
    }

    /// Observation of the means over the data of each square of two by two pixels; `None` if the
    /// data have no such means or a side of the canvas is odd.
    pub fn binned(&self) -> Option<Observation> {
        let Size { width, height } = self.size();
        if !width.is_multiple_of(2) || !height.is_multiple_of(2) {
            return None;
        }
        let sampling = self.sampling.binned()?;
        let half = Size::new(width / 2, height / 2);
        let Rect { x: left, y: top, size } = self.rect;
        let (x, y) = (left.div_ceil(2), top.div_ceil(2));
        let size = Size::new((left + size.width) / 2 - x, (top + size.height) / 2 - y);
        let data = Channel::each(|c| self.data_of_square(c));
        let light = |c: Channel| {
            let (own, data) = (self.light.plane(c), &data[c.index()]);
            Plane::from_fn(half, |x, y| data.iter().map(|p| p.share * p.of(own, x, y)).sum())
        };
        let trust = |c: Channel| {
            let (own, data) = (self.trust.plane(c), &data[c.index()]);
            Plane::from_fn(half, |x, y| {
                let is_any = |class: &u8| data.iter().any(|p| p.of(own, x, y) == *class);
                [MISSING, SATURATED].into_iter().find(is_any).unwrap_or(TRUSTED)
            })
        };
        // Averaging removes only part of noise that interpolation spread: between σ of white noise
        // and the datum's own, the geometric mean gains most (`tests/tables/constants.md`).
        let noise = |c: Channel| {
            let data = data[c.index()].len() as f32;
            self.pixels_a_datum(c).powf(0.25) * self.data_noise(c) / data.sqrt()
        };
        Some(Observation {
            light: Frame::from_fn(light),
            trust: Frame::<Work, u8>::from_fn(trust),
            rect: Rect { x, y, size },
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
    fn a_square_is_as_valid_as_its_least_valid_pixel() {
        let mut own = photo(&lens(&gaussians([1.0; 3])), 3, Channels::Colour);
        own.trust.plane_mut(Channel::Green).row_mut(21)[31] = SATURATED;
        own.trust.plane_mut(Channel::Red).row_mut(20)[31] = MISSING;
        own.trust.plane_mut(Channel::Red).row_mut(20)[30] = SATURATED;
        let binned = own.binned().unwrap();
        let trust = Channel::ALL.map(|c| binned.trust.plane(c).at(15, 10));
        assert_eq!(trust, [MISSING, SATURATED, TRUSTED]);
        assert_eq!(binned.noise, own.noise.map(|sigma| sigma / 2.0));
        own.sampling = Arc::new(Raw { mosaic: Mosaic::Grbg });
        let sites = own.binned().unwrap();
        let light = |c: Channel, x, y| own.light.plane(c).at(x, y);
        assert_eq!(sites.light.plane(Channel::Red).at(15, 10), light(Channel::Red, 31, 20));
        let green = 0.5 * (light(Channel::Green, 30, 20) + light(Channel::Green, 31, 21));
        assert_eq!(sites.light.plane(Channel::Green).at(15, 10), green);
        let trust = Channel::ALL.map(|c| sites.trust.plane(c).at(15, 10));
        assert_eq!(trust, [MISSING, SATURATED, TRUSTED]);
        assert_eq!(sites.noise[0], own.noise[0]);
    }
}
