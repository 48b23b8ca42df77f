//! Delivery of results in bands of rows, for whole frames and for photos solved on a coarser grid.

use std::borrow::Cow;
use std::ops::Range;

use super::resample::resize_rows;
use super::{Channel, Channels, Frame, Rect, Size, Work};

/// Rows of a band. Guess: 128 rows of 50 megapixels take 12 MiB as light.
const BAND_ROWS: usize = 128;

/// Row ranges of the bands of a picture of `height` rows.
pub fn bands_of(height: usize) -> impl Iterator<Item = Range<usize>> {
    (0..height).step_by(BAND_ROWS).map(move |y| y..(y + BAND_ROWS).min(height))
}

/// Result on a coarser grid, with what is needed to deliver it in the photo's own pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct CoarseResult {
    /// Result and photo on the coarser grid, both corrected for the softening by their enlargement.
    pub means: [Frame<Work>; 2],
    /// Threshold of each channel, grey levels: smaller differences of the photo from its enlarged
    /// means are taken for noise.
    pub thresholds: [f32; 3],
    /// The channels that were solved.
    pub channels: Channels,
    /// Whether the photo was turned by half for solving.
    pub is_turned: bool,
}

/// A result at the size of its photo.
#[derive(Debug, Clone, Copy)]
pub struct DeliveredPicture<'a> {
    /// The result itself, or the photo if `coarse` is given.
    pub light: &'a Frame<Work>,
    /// The result of a photo that was solved on a coarser grid.
    pub coarse: Option<&'a CoarseResult>,
}

impl<'a> DeliveredPicture<'a> {
    /// The whole picture.
    pub fn whole(&self) -> Cow<'a, Frame<Work>> {
        let Some(coarse) = self.coarse else { return Cow::Borrowed(self.light) };
        let size = self.size();
        let mut whole = Frame::zeros(size);
        for rows in bands_of(size.height) {
            let band = coarse.band(self.light, rows.clone());
            for (whole, band) in whole.planes_mut().iter_mut().zip(band.planes()) {
                let data = &mut whole.data_mut()[rows.start * size.width..];
                data[..band.data().len()].copy_from_slice(band.data());
            }
        }
        Cow::Owned(whole)
    }

    /// Width and height.
    pub fn size(&self) -> Size {
        self.light.size()
    }

    /// The `rows` of the picture, which must lie inside it.
    pub fn band(&self, rows: Range<usize>) -> Frame<Work> {
        match self.coarse {
            Some(coarse) => coarse.band(self.light, rows),
            None => rows_of(self.light, rows),
        }
    }
}

impl<'a> From<&'a Frame<Work>> for DeliveredPicture<'a> {
    fn from(light: &'a Frame<Work>) -> Self {
        DeliveredPicture { light, coarse: None }
    }
}

fn rows_of(light: &Frame<Work>, rows: Range<usize>) -> Frame<Work> {
    let size = Size::new(light.size().width, rows.len());
    light.crop(Rect { x: 0, y: rows.start, size })
}

impl CoarseResult {
    /// The enlarged result, to which details of the `photo` are added that are finer than the means
    /// and exceed the noise, such as the edges of a date stamp.
    fn band(&self, photo: &Frame<Work>, rows: Range<usize>) -> Frame<Work> {
        let (size, mut own) = (photo.size(), rows_of(photo, rows.clone()));
        let mut solved = rows.clone();
        if self.is_turned {
            own.turn_by_half();
            solved = size.height - rows.end..size.height - rows.start;
        }
        let mut picture = Frame::from_planes(Channel::each(|c| {
            if !self.channels.list().contains(&c) {
                return own.plane(c).clone();
            }
            let [mut picture, coarse] = self
                .means
                .each_ref()
                .map(|means| resize_rows(means.plane(c), size, solved.clone()));
            let threshold = self.thresholds[c.index()];
            let each = picture.data_mut().iter_mut().zip(own.plane(c).data()).zip(coarse.data());
            each.for_each(|((picture, own), coarse)| {
                let fine = own - coarse;
                *picture += fine.signum() * (fine.abs() - threshold).max(0.0);
            });
            picture
        }));
        if self.is_turned {
            picture.turn_by_half();
        }
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::super::binning::enlarged;
    use super::*;
    use crate::frame::Plane;

    #[test]
    fn bands_are_those_of_the_enlarged_result_and_turn_with_it() {
        let size = Size::new(60, 300);
        let waves = |at: Size, step: f32| -> Frame<Work> {
            Frame::from_fn(|c| {
                let value = |x, y| 99.0 * (step * (x + 2 * y + c.index()) as f32).sin();
                Plane::from_fn(at, value)
            })
        };
        let solved = Size::new(30, 150);
        let (mut photo, means) = (waves(size, 0.7), [0.3, 0.2].map(|step| waves(solved, step)));
        let corrected = |c| super::super::binning::corrected(means[0].plane(c), size);
        let mut coarse = CoarseResult {
            means: [Frame::from_fn(corrected), means[1].clone()],
            thresholds: [f32::INFINITY; 3],
            channels: Channels::Colour,
            is_turned: false,
        };
        let whole = |light: &Frame<Work>, coarse: &CoarseResult| {
            DeliveredPicture { light, coarse: Some(coarse) }.whole().into_owned()
        };
        let smooth = Frame::from_fn(|c| enlarged(means[0].plane(c), size));
        assert_eq!(whole(&photo, &coarse), smooth);
        coarse.thresholds = [1.0; 3];
        let mut turned = whole(&photo, &coarse);
        assert_ne!(turned, smooth);
        turned.turn_by_half();
        photo.turn_by_half();
        coarse.is_turned = true;
        assert_eq!(whole(&photo, &coarse), turned);
    }
}
