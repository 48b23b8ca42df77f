//! Encoding of restored frames in the photo's format, depth and curve, turned upright.

use std::io::Cursor;

use image::codecs::{jpeg::JpegEncoder, png::PngEncoder, tiff::TiffEncoder};
use image::{ColorType, ImageEncoder};

use crate::frame::resample::resize;
use crate::frame::{Channel, Channels, DeliveredPicture, Frame, Plane, Size, Work, bands_of};

use super::decode::bits_of;
use super::exif;
use super::turn::{turn, turned_size, upright_place};
use super::{Format, Manner, Photo, PictureError};

/// JPEG quality of results, chosen so that the loss stays below a capture's noise. Guess.
const QUALITY: u8 = 95;
/// JPEG quality of the gallery's previews. Guess.
const PREVIEW_QUALITY: u8 = 88;

/// The file for `picture` (linear light 0..255, stored orientation), named `name` in errors.
///
/// Grey layouts get the green plane alone; with `grey`, colour layouts get it in all channels.
pub fn encode<'a>(
    name: &str,
    picture: impl Into<DeliveredPicture<'a>>,
    manner: &Manner,
    grey: bool,
) -> Result<Vec<u8>, PictureError> {
    encoded(picture.into(), manner, grey, QUALITY)
        .map_err(|source| PictureError::Encode { name: name.to_owned(), source })
}

impl Photo {
    /// The file of `picture` (linear light 0..255, the photo's stored orientation) in `format`,
    /// with the photo's metadata.
    pub fn with_picture<'a>(
        &self,
        picture: impl Into<DeliveredPicture<'a>>,
        format: Format,
    ) -> Result<Vec<u8>, PictureError> {
        let manner = Manner { format, ..self.manner.clone() };
        encode(&self.name, picture, &manner, self.channels == Channels::Green)
    }

    /// `plane`, in the photo's stored orientation, turned upright.
    pub fn upright(&self, plane: &Plane) -> Plane {
        turn(plane, self.manner.orientation)
    }

    /// `picture` (linear light, the photo's stored orientation) for display: upright, in sRGB's
    /// primaries, grey photos grey.
    pub fn for_display(&self, picture: &Frame<Work>) -> Frame<Work> {
        let developed = self.manner.colours.as_ref().map(|colours| colours.developed(picture));
        let picture = developed.as_ref().unwrap_or(picture);
        let grey = self.channels == Channels::Green || !self.manner.colour.has_color();
        let source = |c: Channel| picture.plane(if grey { Channel::Green } else { c });
        Frame::from_fn(|c| self.upright(source(c)))
    }
}

/// A small JPEG of `picture`, upright, at most `longest_px` on its longer side.
pub fn preview(
    name: &str,
    picture: &Frame<Work>,
    manner: &Manner,
    grey: bool,
    longest_px: usize,
) -> Result<Vec<u8>, PictureError> {
    let size = picture.size();
    let longest = size.width.max(size.height);
    let scaled = |n: usize| ((n * longest_px + longest / 2) / longest).max(1);
    let manner = Manner { format: Format::Jpeg, exif: None, alpha: None, ..manner.clone() };
    let small = (longest > longest_px).then(|| {
        let small = Size::new(scaled(size.width), scaled(size.height));
        Frame::from_fn(|channel| resize(picture.plane(channel), small))
    });
    encoded(small.as_ref().unwrap_or(picture).into(), &manner, grey, PREVIEW_QUALITY)
        .map_err(|source| PictureError::Encode { name: name.to_owned(), source })
}

fn encoded(
    picture: DeliveredPicture<'_>,
    manner: &Manner,
    grey: bool,
    quality: u8,
) -> image::ImageResult<Vec<u8>> {
    // The TIFF encoder has no grey with alpha, and JPEG neither alpha nor 16 bits.
    let colour = match (manner.format, manner.colour) {
        (Format::Tiff, ColorType::La8) => ColorType::Rgba8,
        (Format::Tiff, ColorType::La16) => ColorType::Rgba16,
        (Format::Jpeg, colour) if colour.has_color() => ColorType::Rgb8,
        (Format::Jpeg, _) => ColorType::L8,
        (_, colour) => colour,
    };
    let size = turned_size(picture.size(), manner.orientation);
    let raw = samples(&picture, manner, grey, colour);
    let mut bytes = Vec::with_capacity(raw.len());
    let out = Cursor::new(&mut bytes);
    match manner.format {
        Format::Jpeg => {
            write(JpegEncoder::new_with_quality(out, quality), manner, &raw, size, colour)?;
        }
        Format::Png => write(PngEncoder::new(out), manner, &raw, size, colour)?,
        Format::Tiff => {
            write(TiffEncoder::new(out), manner, &raw, size, colour)?;
            if let Some(exif) = &manner.exif {
                bytes = exif::into_tiff(bytes, &exif::of_result(exif, size));
            }
        }
    }
    Ok(bytes)
}

/// The samples of `picture` in `colour`, turned upright.
fn samples(
    picture: &DeliveredPicture<'_>,
    manner: &Manner,
    grey: bool,
    colour: ColorType,
) -> Vec<u8> {
    let grey = grey || !manner.colour.has_color();
    let (deep, narrow) = (bits_of(manner.colour) > 8, bits_of(colour) == 8);
    let stored = picture.size();
    let width = turned_size(stored, manner.orientation).width;
    let upright = upright_place(stored, manner.orientation);
    let (pixel, sample) = (usize::from(colour.bytes_per_pixel()), if narrow { 1 } else { 2 });
    let mut raw = vec![0; stored.area() * pixel];
    let colours: &[Channel] = if colour.has_color() { &Channel::ALL } else { &[Channel::Green] };
    // By bands: the planes of a large photo need much memory.
    for rows in bands_of(stored.height) {
        let mut put = |n: usize, codes: Vec<u16>| {
            for (y, row) in rows.clone().zip(codes.chunks(stored.width.max(1))) {
                for (x, &code) in row.iter().enumerate() {
                    let (x, y) = upright(x, y);
                    let place = &mut raw[(y * width + x) * pixel + n * sample..][..sample];
                    match (deep, narrow) {
                        (true, true) => place[0] = ((u32::from(code) + 128) / 257) as u8,
                        (false, _) => place[0] = code as u8,
                        (true, false) => place.copy_from_slice(&code.to_ne_bytes()),
                    }
                }
            }
        };
        let band = picture.band(rows.clone());
        for (n, &channel) in colours.iter().enumerate() {
            let source = if grey { Channel::Green } else { channel };
            let developed = manner.colours.as_ref().map(|of| of.developed_plane(&band, source));
            let plane = developed.as_ref().unwrap_or(band.plane(source));
            put(n, manner.tone.codes(channel.index(), plane));
        }
        if colour.has_alpha() {
            let top = if deep { 65535.0 } else { 255.0 };
            let code = |alpha: f32| (alpha.clamp(0.0, 1.0) * top + 0.5) as u16;
            let codes = match &manner.alpha {
                Some(alpha) => rows.clone().flat_map(|y| alpha.row(y)).map(|&a| code(a)).collect(),
                None => vec![code(1.0); rows.len() * stored.width],
            };
            put(colours.len(), codes);
        }
    }
    raw
}

fn write<E: ImageEncoder>(
    mut encoder: E,
    manner: &Manner,
    raw: &[u8],
    size: Size,
    colour: ColorType,
) -> image::ImageResult<()> {
    if let Some(icc) = &manner.icc {
        // All three formats take a profile.
        encoder.set_icc_profile(icc.clone()).map_err(image::ImageError::Unsupported)?;
    }
    if let Some(exif) = &manner.exif {
        // The TIFF encoder takes none; `exif::into_tiff` adds it later.
        let _ = encoder.set_exif_metadata(exif::of_result(exif, size));
    }
    encoder.write_image(raw, size.width as u32, size.height as u32, colour.into())
}

#[cfg(test)]
mod tests {
    use image::metadata::Orientation;

    use super::super::{Limits, Photo};
    use super::*;
    use crate::config::Curve;

    fn scene(size: Size) -> Frame<Work> {
        Frame::from_fn(|c| {
            Plane::from_fn(size, |x, y| ((x * 5 + y * 3 + 40 * c.index()) % 256) as f32)
        })
    }

    fn back(bytes: &[u8]) -> Photo {
        Photo::from_bytes("p", bytes, Curve::Srgb, &Limits::default()).unwrap()
    }

    /// Exif header, one directory with one entry: orientation 6.
    fn exif_turned() -> Vec<u8> {
        let mut exif = b"II*\0\x08\0\0\0\x01\0".to_vec();
        exif.extend_from_slice(&[0x12, 0x01, 3, 0, 1, 0, 0, 0, 6, 0, 0, 0, 0, 0, 0, 0]);
        exif
    }

    #[test]
    fn a_photo_is_displayed_upright_and_a_grey_one_grey() {
        let size = Size::new(20, 14);
        let mut manner = Manner::plain(Format::Png, 8, Curve::Srgb);
        let mut photo = back(&encode("p", &scene(size), &manner, false).unwrap());
        photo.manner.orientation = Orientation::Rotate90;
        let seen = photo.for_display(&photo.light);
        assert_eq!(seen.size(), Size::new(14, 20));
        assert_eq!(seen.plane(Channel::Red).at(13, 0), photo.light.plane(Channel::Red).at(0, 0));

        manner.colour = ColorType::L8;
        let photo = back(&encode("p", &scene(size), &manner, true).unwrap());
        // For grey photos, the solver fills the green plane only.
        let mut picture = Frame::zeros(size);
        *picture.plane_mut(Channel::Green) = Plane::filled(size, 90.0);
        let seen = photo.for_display(&picture);
        assert_eq!(seen.plane(Channel::Red), seen.plane(Channel::Green));
    }

    #[test]
    fn lossless_formats_keep_every_sample_at_either_depth() {
        for format in [Format::Png, Format::Tiff] {
            use ColorType::{L8, L16, La8, La16, Rgb8, Rgb16, Rgba8, Rgba16};
            for colour in [L8, Rgb8, Rgba8, La8, L16, Rgb16, Rgba16, La16] {
                let bits = bits_of(colour);
                let mut manner = Manner::plain(format, bits, Curve::Srgb);
                manner.colour = colour;
                let size = Size::new(20, 14);
                manner.alpha =
                    colour.has_alpha().then(|| Plane::from_fn(size, |x, _| x as f32 / 255.0));
                let first = back(&encode("p", &scene(size), &manner, false).unwrap());
                assert_eq!(bits_of(first.manner.colour), bits);
                let grey = !colour.has_color();
                let second = back(&encode("p", &first.light, &first.manner, grey).unwrap());
                assert_eq!(first.light, second.light, "{format:?} {colour:?}");
                assert_eq!(first.manner, second.manner, "{format:?} {colour:?}");
            }
        }
    }

    #[test]
    fn orientation_is_applied_once_and_the_tag_cleared() {
        for format in [Format::Jpeg, Format::Png] {
            let mut manner = Manner::plain(format, 8, Curve::Srgb);
            manner.exif = Some(exif_turned());
            let photo = back(&encode("p", &scene(Size::new(24, 16)), &manner, false).unwrap());
            assert_eq!(photo.manner.orientation, Orientation::Rotate90);
            assert_eq!(photo.light.size(), Size::new(24, 16), "restored as the sensor saw it");
            let result = back(&encode("p", &photo.light, &photo.manner, false).unwrap());
            assert_eq!(result.manner.orientation, Orientation::NoTransforms, "{format:?}");
            assert!(result.manner.exif.is_some() && result.light.size() == Size::new(16, 24));
        }
    }

    #[test]
    fn a_profile_is_carried_byte_by_byte() {
        let icc = moxcms::ColorProfile::new_display_p3().encode().unwrap();
        for format in [Format::Jpeg, Format::Png, Format::Tiff] {
            let mut manner = Manner::plain(format, 8, Curve::Srgb);
            manner.icc = Some(icc.clone());
            let photo = back(&encode("p", &scene(Size::new(24, 16)), &manner, false).unwrap());
            assert_eq!(photo.manner.icc.as_ref(), Some(&icc), "{format:?}");
            assert_eq!(photo.manner.tone.origin(), "ICC profile");
        }
    }

    #[test]
    fn a_tiff_cut_anywhere_or_never_filled_is_refused() {
        let manner = Manner::plain(Format::Tiff, 16, Curve::Srgb);
        let whole = encode("p", &scene(Size::new(64, 48)), &manner, false).unwrap();
        let read = |b: &[u8]| Photo::from_bytes("p.tif", b, Curve::Srgb, &Limits::default());
        assert!(read(&whole).is_ok());
        for percent in 0..100 {
            let cut = &whole[..whole.len() * percent / 100];
            assert!(read(cut).is_err(), "cut to {percent} %");
        }
        let mut hole = whole.clone();
        let half = whole.len() / 2;
        hole[half..].fill(0);
        assert!(read(&hole).unwrap_err().to_string().contains("never filled"));
    }

    #[test]
    fn a_preview_is_small_and_upright() {
        let mut manner = Manner::plain(Format::Png, 16, Curve::Srgb);
        manner.orientation = Orientation::Rotate270;
        let small = back(&preview("p", &scene(Size::new(200, 100)), &manner, false, 50).unwrap());
        assert_eq!((small.light.size(), small.manner.format), (Size::new(25, 50), Format::Jpeg));
    }
}
