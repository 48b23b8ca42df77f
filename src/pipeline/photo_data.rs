//! Input of the pipeline: a photo's light, and how it was recorded.

use crate::frame::{Channels, Coding, Frame, RawSites, Work};
use crate::picture::{Photo, Tone};

/// A photo's light with the kind of its data, from a file or from the laboratory.
#[derive(Debug, Clone, Copy)]
pub struct PhotoData<'a> {
    /// Linear light 0..255, photo-sized; interpolated between the sites of a raw photo.
    pub light: &'a Frame<Work>,
    /// The photo's channels.
    pub channels: Channels,
    /// The kind of data.
    pub recorded: Recorded<'a>,
}

/// How light was recorded.
#[derive(Debug, Clone, Copy)]
pub enum Recorded<'a> {
    /// As full-colour pixels.
    Developed,
    /// At the sites of the rig's sensor.
    Raw(RawSites),
    /// As means of squares of pixels.
    Binned {
        /// Whether any pixel of a mean is saturated.
        saturated: &'a Frame<Work, bool>,
        /// The sites of a raw photo, from which the pixels were interpolated.
        raw: Option<RawSites>,
    },
    /// As quantised coefficients, whose codes `tone` maps to light.
    Jpeg {
        /// The file's coefficients.
        coding: &'a Coding,
        /// The file's tone curve.
        tone: &'a Tone,
    },
}

impl<'a> Recorded<'a> {
    /// The kind of data of a photo with the sites `raw`, or `coded` as a JPEG in a tone curve.
    pub(crate) fn of(raw: Option<RawSites>, coded: Option<(&'a Coding, &'a Tone)>) -> Self {
        match (raw, coded) {
            (Some(raw), _) => Recorded::Raw(raw),
            (None, Some((coding, tone))) => Recorded::Jpeg { coding, tone },
            (None, None) => Recorded::Developed,
        }
    }
}

impl<'a> PhotoData<'a> {
    /// A photo with full-colour pixels: `light` in `channels`.
    pub fn developed(light: &'a Frame<Work>, channels: Channels) -> PhotoData<'a> {
        PhotoData { light, channels, recorded: Recorded::Developed }
    }

    /// A raw photo with the sites `raw` of the rig's sensor and the `light` interpolated from them.
    pub fn raw(light: &'a Frame<Work>, raw: RawSites) -> PhotoData<'a> {
        PhotoData { light, channels: Channels::Colour, recorded: Recorded::Raw(raw) }
    }
}

impl<'a> From<&'a Photo> for PhotoData<'a> {
    fn from(photo: &'a Photo) -> PhotoData<'a> {
        let coded = photo.coding.as_ref().map(|coding| (coding, &photo.manner.tone));
        let recorded = Recorded::of(photo.raw, coded);
        PhotoData { light: &photo.light, channels: photo.channels, recorded }
    }
}
