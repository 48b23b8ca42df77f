//! An observation on pixels binned by two.

use std::sync::Arc;

use super::Observation;
use crate::deconvolution::data_term::{MISSING, SATURATED, TRUSTED};
use crate::frame::binning::bin;
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};

impl Observation {
    /// The means over squares of two by two pixels; `None` for data without such means, and a
    /// canvas that does not divide by two.
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
        let trust = |c: Channel| {
            let own = self.trust.plane(c);
            Plane::from_fn(half, |x, y| {
                let (left, top) = (2 * x, 2 * y);
                let classes =
                    [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| own.at(left + x, top + y));
                let found = [MISSING, SATURATED].into_iter().find(|class| classes.contains(class));
                found.unwrap_or(TRUSTED)
            })
        };
        // Noise that interpolation spread remains in part: between σ of white noise and the
        // datum's own, the geometric mean gains most (`tests/tables/README.md`).
        let noise = |c: Channel| self.pixels_a_datum(c).powf(0.25) * self.data_noise(c) / 2.0;
        Some(Observation {
            light: Frame::from_fn(|c| bin(self.light.plane(c), 2)),
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
        assert!(own.binned().is_none(), "raw sites");
    }
}
