//! Bytes to samples, under limits and with the decoder's panics caught.
//!
//! [`decode`] is a pure function of the bytes; the daemon runs it in a [`worker`](super::worker).

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Seek};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use image::codecs::{
    bmp::BmpDecoder, gif::GifDecoder, jpeg::JpegDecoder, png::PngDecoder, pnm::PnmDecoder,
    tiff::TiffDecoder, webp::WebPDecoder,
};
use image::{ColorType, ImageDecoder};
use serde::{Deserialize, Serialize};

use crate::frame::{Coding, PhotoGrid, Size};

use super::dng::{self, RawFile};
use super::kind::{Content, Format, recognise};
use super::metadata::{Lost, Walked};
use super::tone::StatedColours;
use super::{Flaw, Orientation, exif, jpeg, others, png, shape, tiff};

/// The resources that one photo may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Longest file in bytes.
    pub bytes_max: u64,
    /// Largest picture in pixels.
    pub pixels_max: u64,
    /// Most memory the decoder may allocate, in bytes.
    pub decoder_bytes_max: u64,
    /// The rig's photo and sensor: a developed photo of another shape than both is not decoded.
    pub grid: Option<PhotoGrid>,
}

impl Limits {
    /// These limits for photos on `grid`, raised to what a photo of its whole sensor takes.
    #[must_use]
    pub fn on(self, grid: PhotoGrid) -> Limits {
        let pixels = grid.sensor.area() as u64;
        Limits {
            pixels_max: self.pixels_max.max(pixels),
            // Four samples of 16 bits a pixel.
            bytes_max: self.bytes_max.max(8 * pixels),
            grid: Some(grid),
            ..self
        }
    }
}

impl Default for Limits {
    /// A 24-megapixel photo in 16-bit TIFF, and a third more: on a 4 GiB board its planes take a
    /// fifth of the memory. Guess.
    fn default() -> Self {
        Limits {
            bytes_max: 256 << 20,
            pixels_max: 32_000_000,
            decoder_bytes_max: 512 << 20,
            grid: None,
        }
    }
}

/// Bits of each sample of `colour`.
pub(super) fn bits_of(colour: ColorType) -> u8 {
    colour.bits_per_pixel() as u8 / colour.channel_count()
}

/// A decoded file: its samples as stored, and its metadata.
#[derive(Debug)]
pub(super) struct Raster {
    pub(super) content: Content,
    pub(super) size: Size,
    /// Channels of a pixel, with 8 or 16 bits a sample.
    pub(super) colour: ColorType,
    /// Samples pixel by pixel; full scale is 255 or 65535.
    pub(super) samples: Vec<u16>,
    pub(super) orientation: Orientation,
    pub(super) icc: Option<Vec<u8>>,
    /// The raw EXIF block, from its TIFF header on.
    pub(super) exif: Option<Vec<u8>>,
    /// Parts of the file that its result lacks.
    pub(super) lost: BTreeSet<Lost>,
    pub(super) coding: Option<Coding>,
    /// Whether the file states sRGB's colours.
    pub(super) is_srgb: bool,
}

/// A file walked to its end, nothing decoded.
pub(super) struct Heading {
    pub(super) content: Content,
    walked: Walked,
    /// The raw photo in the file, if any.
    pub(super) raw: Option<RawFile>,
    /// Coefficients of a JPEG that was decoded because of its long runs of zeros; the inner `None`
    /// for a kind whose coefficients are not read.
    coding: Option<Option<Coding>>,
}

/// Walks a whole photo to its end without decoding anything.
pub(super) fn walk(bytes: &[u8], limits: &Limits) -> Result<Heading, Flaw> {
    if bytes.len() as u64 > limits.bytes_max {
        return Err(Flaw::TooLong { found: bytes.len() as u64, allowed: limits.bytes_max });
    }
    let content = recognise(bytes)?;
    let mut raw = None;
    let walked = match content {
        Content::Written(Format::Jpeg) => jpeg::walk(bytes)?,
        Content::Written(Format::Png) => png::walk(bytes)?,
        Content::Written(Format::Tiff) => {
            raw = dng::find(bytes)?;
            match &raw {
                Some(raw) => raw.walked(),
                None => {
                    let (walked, file) = (tiff::walk(bytes)?, tiff::File::new(bytes));
                    Walked { exif: exif::of_tiff(&file, &[file.u32(4)? as usize]), ..walked }
                }
            }
        }
        // Their size is checked in the header that the decoder reads, before anything is allocated.
        Content::Bmp | Content::Gif | Content::Pnm | Content::Webp => others::walk(bytes, content)?,
    };
    let mut heading = Heading { content, walked, raw, coding: None };
    let Some(found) = heading.walked.size else { return Ok(heading) };
    if found.width as u64 * found.height as u64 > limits.pixels_max {
        return Err(Flaw::Oversized { found, allowed: limits.pixels_max });
    }
    // Flat areas may be coded in zero bits, so that only decoding shows whether data are missing. A
    // photo of another shape is refused later, and not decoded here.
    let upright = Orientation::NoTransforms;
    let fits = |grid| shape::check(found, upright, grid).is_ok();
    if let Some(Range { start: from, end: to }) = heading.walked.zeros
        && limits.grid.is_none_or(fits)
    {
        let hole = || Flaw::ZeroFilled { from, to, length: bytes.len() };
        heading.coding = Some(jpeg::coefficients_with_zeros(bytes).ok_or_else(hole)?);
    }
    Ok(heading)
}

/// Decodes a whole developed photo.
///
/// # Errors
/// The [`Flaw`] of the file; nothing large is allocated before the size in its header has been
/// found to be within `limits`.
pub(super) fn decode(bytes: &[u8], limits: &Limits) -> Result<Raster, Flaw> {
    walk(bytes, limits)?.decode(bytes, limits)
}

impl Heading {
    /// Decodes the developed photo in `bytes`, from which [`walk`] made this heading.
    pub(super) fn decode(self, bytes: &[u8], limits: &Limits) -> Result<Raster, Flaw> {
        let Heading { content, walked, coding, .. } = self;
        let Walked { lost, colours, exif, is_multiplied, .. } = walked;
        // Decoders may panic on hostile files, as their documentation states.
        let decoded = catch_unwind(AssertUnwindSafe(|| {
            let mut raster =
                collect(decoder(Cursor::new(bytes), content, limits), content, limits)?;
            let step = raster.step();
            if content == Content::Written(Format::Jpeg) {
                let coding = coding.map_or_else(|| jpeg::coefficients(bytes), Ok)?;
                raster.coding = match coding.filter(|read| read.size == raster.size) {
                    Some(coding) => jpeg::agree(&coding, &raster.samples, step)?.then_some(coding),
                    None => None,
                };
            } else if bits_of(raster.colour) == 8 {
                raster.coding = jpeg::earlier_coding(raster.size, &raster.samples, step);
            }
            Ok(raster)
        }));
        let decoded = decoded.unwrap_or_else(|_| Err(Flaw::Undecodable { kind: content.name() }));
        let mut raster = decoded.map_err(|flaw| match flaw {
            Flaw::Unsupported { kind, found, allowed }
                if content == Content::Written(Format::Tiff) =>
            {
                let found = tiff::samples_of(bytes).unwrap_or(found);
                Flaw::Unsupported { kind, found, allowed }
            }
            flaw => flaw,
        })?;
        raster.lost.extend(lost);
        raster.exif = raster.exif.or(exif);
        raster.state(colours);
        if is_multiplied && raster.colour.has_alpha() {
            raster.divide_by_alpha();
        }
        Ok(raster)
    }
}

impl Raster {
    /// Samples per pixel.
    pub(super) fn step(&self) -> usize {
        self.colour.channel_count().into()
    }

    /// Sets the profile of `colours`, which the file states elsewhere than in a profile. Coded
    /// numbers (cICP) take precedence over a profile, and a profile over all else (PNG
    /// specification, third edition, §4.3).
    fn state(&mut self, colours: Option<StatedColours>) {
        let is_coded = matches!(colours, Some(StatedColours::Coded(_)));
        if self.icc.is_some() && !is_coded {
            return;
        }
        let is_adobe = || self.exif.as_deref().is_some_and(exif::is_adobe_rgb);
        let colours = colours.or_else(|| is_adobe().then_some(StatedColours::ADOBE));
        let Some(colours) = colours else { return };
        self.is_srgb = matches!(colours, StatedColours::Srgb);
        self.icc = colours.profile(!self.colour.has_color());
    }

    fn divide_by_alpha(&mut self) {
        let top = if bits_of(self.colour) == 8 { 255 } else { 65535 };
        let step = self.step();
        for pixel in self.samples.chunks_exact_mut(step) {
            let Some((&mut alpha, colours)) = pixel.split_last_mut() else { continue };
            let alpha = u32::from(alpha);
            for code in colours.iter_mut().filter(|_| alpha > 0) {
                *code = ((u32::from(*code) * top + alpha / 2) / alpha).min(top) as u16;
            }
        }
    }
}

fn decoder_limits(limits: &Limits) -> image::Limits {
    let mut inner = image::Limits::no_limits();
    inner.max_alloc = Some(limits.decoder_bytes_max);
    inner
}

/// Varieties that are read, and what to do with others, for messages.
const READ: &str = "grey and RGB of 8 or 16 bits; save it so in an image program and drop it again";

/// Creates the decoder of `input`, which reads the header.
fn decoder<'a, R: BufRead + Seek + 'a>(
    input: R,
    content: Content,
    limits: &Limits,
) -> image::ImageResult<Box<dyn ImageDecoder + 'a>> {
    Ok(match content {
        Content::Written(Format::Jpeg) => Box::new(JpegDecoder::new(input)?),
        Content::Written(Format::Png) => {
            Box::new(PngDecoder::with_limits(input, decoder_limits(limits))?)
        }
        Content::Written(Format::Tiff) => Box::new(TiffDecoder::new(input)?),
        Content::Bmp => Box::new(BmpDecoder::new(input)?),
        Content::Gif => Box::new(GifDecoder::new(input)?),
        Content::Pnm => Box::new(PnmDecoder::new(input)?),
        Content::Webp => Box::new(WebPDecoder::new(input)?),
    })
}

/// Refuses `file`, which begins with `head`, by its kind or by the shape in its header, as far as
/// these are known without reading the rest. JPEGs pass: their decoder would read the whole file.
pub(super) fn check_head(mut file: &File, head: &[u8], limits: &Limits) -> Result<(), Flaw> {
    let content = match recognise(head) {
        Err(flaw @ (Flaw::Unread { .. } | Flaw::NotAPhoto { .. })) => return Err(flaw),
        Ok(content) if content != Content::Written(Format::Jpeg) => content,
        _ => return Ok(()),
    };
    let Some(grid) = limits.grid else { return Ok(()) };
    let found = catch_unwind(AssertUnwindSafe(|| {
        file.rewind().ok()?;
        // Another directory may hold a raw photo.
        if content == Content::Written(Format::Tiff) && !tiff::is_single(file).ok()? {
            return None;
        }
        file.rewind().ok()?;
        let mut decoder = decoder(BufReader::new(file), content, limits).ok()?;
        let (width, height) = decoder.dimensions();
        let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
        Some((Size::new(width as usize, height as usize), orientation))
    }));
    match found {
        Ok(Some((size, orientation))) => shape::check(size, orientation, grid),
        _ => Ok(()),
    }
}

fn collect<D: ImageDecoder>(
    decoder: image::ImageResult<D>,
    content: Content,
    limits: &Limits,
) -> Result<Raster, Flaw> {
    let kind = content.name();
    let unsupported =
        |found: &str| Flaw::Unsupported { kind, found: found.to_owned(), allowed: READ };
    let undecodable = |error| match error {
        image::ImageError::Unsupported(_) => unsupported("one of its rarer forms"),
        _ => Flaw::Undecodable { kind },
    };
    let mut decoder = decoder.map_err(undecodable)?;
    let (width, height) = decoder.dimensions();
    let size = Size::new(width as usize, height as usize);
    if decoder.total_bytes() > limits.decoder_bytes_max
        || u64::from(width) * u64::from(height) > limits.pixels_max
    {
        return Err(Flaw::Oversized { found: size, allowed: limits.pixels_max });
    }
    let colour = decoder.color_type();
    if !matches!(bits_of(colour), 8 | 16) {
        return Err(unsupported("samples of another depth"));
    }
    let icc = decoder.icc_profile().unwrap_or(None).filter(|icc| !icc.is_empty());
    let exif = decoder.exif_metadata().unwrap_or(None).filter(|exif| !exif.is_empty());
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    if let Some(grid) = limits.grid {
        shape::check(size, orientation, grid)?;
    }
    let has_xmp = matches!(decoder.xmp_metadata(), Ok(Some(block)) if !block.is_empty());
    // Set only now, because the TIFF decoder would limit the profile by the picture's size. Up to
    // here its default limits hold.
    decoder.set_limits(decoder_limits(limits)).map_err(undecodable)?;
    let mut raw = vec![0u8; decoder.total_bytes() as usize];
    decoder.read_image(&mut raw).map_err(undecodable)?;
    let samples = match bits_of(colour) {
        8 => raw.into_iter().map(u16::from).collect(),
        _ => raw.chunks_exact(2).map(|b| u16::from_ne_bytes([b[0], b[1]])).collect(),
    };
    let lost = has_xmp.then_some(Lost::XMP).into_iter().collect();
    let (coding, is_srgb) = (None, false);
    Ok(Raster { content, size, colour, samples, orientation, icc, exif, lost, coding, is_srgb })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of 16×16 pixels by libwebp at quality 95.
    #[rustfmt::skip]
    const LOSSY_WEBP: [u8; 60] = [
        82, 73, 70, 70, 52, 0, 0, 0, 87, 69, 66, 80, 86, 80, 56, 32, 40, 0, 0, 0, 176, 1, 0,
        157, 1, 42, 16, 0, 16, 0, 0, 128, 8, 37, 148, 2, 116, 186, 0, 6, 61, 128, 0, 254,
        241, 149, 143, 226, 218, 71, 66, 167, 87, 90, 22, 131, 224, 0, 0, 0,
    ];

    #[test]
    fn a_lossy_webp_is_decoded() {
        let raster = decode(&LOSSY_WEBP, &Limits::default()).unwrap();
        assert_eq!((raster.size, raster.colour), (Size::new(16, 16), ColorType::Rgb8));
        assert!(raster.coding.is_none());
    }

    #[test]
    fn colours_multiplied_by_alpha_are_divided() {
        let mut bytes = Vec::new();
        let pixels = [100u8, 60, 0, 128, 9, 0, 0, 0].repeat(2);
        let mut file = ::tiff::encoder::TiffEncoder::new(Cursor::new(&mut bytes)).unwrap();
        let mut picture = file.new_image::<::tiff::encoder::colortype::RGB8>(2, 2).unwrap();
        picture.extra_samples(&[::tiff::tags::ExtraSamples::AssociatedAlpha]).unwrap();
        picture.write_data(&pixels).unwrap();
        let raster = decode(&bytes, &Limits::default()).unwrap();
        assert_eq!(raster.samples[..8], [199, 120, 0, 128, 9, 0, 0, 0]);
    }

    #[test]
    fn zeros_that_are_picture_are_decoded_once() {
        let (mut bytes, size) = (Vec::new(), Size::new(1024, 768));
        let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, 80);
        encoder.set_optimized_huffman_tables(true);
        encoder.encode(&vec![255; size.area()], 1024, 768, jpeg_encoder::ColorType::Luma).unwrap();
        let limits = Limits::default();
        let heading = walk(&bytes, &limits).unwrap();
        let read = heading.coding.clone().flatten();
        assert!(read.as_ref().is_some_and(|read| read.size == size), "for the check of its zeros");
        assert_eq!(heading.decode(&bytes, &limits).unwrap().coding, read);
    }

    #[test]
    fn an_oversized_header_is_refused_before_decoding() {
        // A JPEG of a few hundred bytes may claim 16000×11000 and would decode to half a gigabyte.
        let mut jpeg = include_bytes!("../../tests/scenes/rocket.jpg").to_vec();
        let sof =
            jpeg.windows(2).position(|w| w[0] == 0xff && (w[1] == 0xc0 || w[1] == 0xc2)).unwrap();
        jpeg[sof + 5..sof + 9].copy_from_slice(&[0x2a, 0xf8, 0x3e, 0x80]);
        let flaw = decode(&jpeg, &Limits::default()).unwrap_err();
        assert!(flaw.to_string().contains("16000×11000"), "{flaw}");
        // The limits include the rig's own photos, which are as large as its sensor.
        let own = Limits::default().on(Size::new(8192, 6144).into());
        assert_eq!((own.pixels_max, own.bytes_max), (8192 * 6144, 8 * 8192 * 6144));
    }

    #[test]
    fn hostile_bytes_give_an_error_and_no_panic() {
        let png = include_bytes!("../../tests/scenes/coffee.png");
        let jpeg = include_bytes!("../../tests/scenes/rocket.jpg");
        let limits = Limits { pixels_max: 4_000_000, ..Limits::default() };
        for (seed, whole) in [(1u64, &png[..]), (2, &jpeg[..])] {
            let mut state = seed;
            for _ in 0..60 {
                let mut bytes = whole.to_vec();
                for _ in 0..6 {
                    // Numerical Recipes' linear congruential generator; any will do.
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    let at = (state >> 33) as usize % 700;
                    bytes[at] = (state >> 20) as u8;
                }
                let _ = decode(&bytes, &limits);
            }
        }
    }
}
