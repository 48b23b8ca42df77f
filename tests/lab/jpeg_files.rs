//! Cost of JPEG coding by another coder: progressive files, chroma halved along one side or taken
//! from one pixel of four, and other tables. Also the cost for pictures coded before.

use std::io::Cursor;

use image::{ImageFormat, Rgb, RgbImage};
use jpeg_encoder::{
    ChromaSubsamplingMethod, ColorType, Encoder, QuantizationTableType, SamplingFactor,
};
use relens::config::{MethodName, RigFile};
use relens::frame::{Channel, Frame, Plane, Size, Work};
use relens::picture::Tone;

use crate::Failure;
use crate::colour::{INKED, with_kept};
use crate::jpeg::{FileCoding, costs};
use crate::jpeg_coder::{Quality, coded};
use crate::made::Made;
use crate::sized::sized;

/// Offset of the earlier coding's blocks from the file's, pixels.
const OFF: (u32, u32) = (3, 5);

/// The codings, on which no limit of `src/deconvolution/jpeg` was set.
fn codings() -> Vec<FileCoding> {
    let of = |name: &str, quality, pixels, file| {
        let quality = Quality { quality, pixels };
        FileCoding { name: name.to_owned(), quality, file }
    };
    vec![
        of("95, 4:4:4", 95, (1, 1), |of, codes| other(of, codes, |_| {})),
        of("90, 4:2:0, progressive", 90, (2, 2), |of, codes| {
            other(of, codes, |encoder| encoder.set_progressive(true))
        }),
        of("85, 4:2:2", 85, (2, 1), |of, codes| other(of, codes, |_| {})),
        of("85, 4:2:0, progressive, ImageMagick's table", 85, (2, 2), |of, codes| {
            other(of, codes, |encoder| {
                let table = QuantizationTableType::ImageMagick;
                encoder.set_quantization_tables(table.clone(), table);
                encoder.set_progressive(true);
            })
        }),
        of("85, 4:2:0, chroma of one pixel of four", 85, (2, 2), |of, codes| {
            other(of, codes, |encoder| {
                encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Nearest);
            })
        }),
        of("60, 4:2:0", 60, (2, 2), |of, codes| other(of, codes, |_| {})),
        of("85, 4:2:0, kept as a PNG", 85, (2, 2), kept_as_png),
        of("60, 4:2:0, kept as a PNG", 60, (2, 2), kept_as_png),
        of("90, 4:2:0, cut off its blocks, kept as a PNG", 90, (2, 2), |of, codes| {
            png(&cut_before(of, codes)?)
        }),
        of("90, 4:2:0, cut off its blocks, again at 90", 90, (2, 2), |of, codes| {
            Ok(coded(&codes_of(&cut_before(of, codes)?), of.quality))
        }),
        of("60, 4:2:0, again at 95", 60, (2, 2), |of, codes| {
            let before = image::load_from_memory(&coded(codes, of.quality))?.into_rgb8();
            let again = Quality { quality: 95, ..of.quality };
            Ok(coded(&codes_of(&before), again))
        }),
    ]
}

/// A file by the crate `jpeg-encoder`, with chroma averaged unless `more` options change that.
fn other(
    of: &FileCoding,
    codes: &Frame<Work, u8>,
    more: impl Fn(&mut Encoder<&mut Vec<u8>>),
) -> Result<Vec<u8>, Failure> {
    let mut file = Vec::new();
    let picture = picture(codes);
    let mut encoder = Encoder::new(&mut file, u8::try_from(of.quality.quality)?);
    encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Average);
    encoder.set_sampling_factor(match of.quality.pixels {
        (1, 1) => SamplingFactor::R_4_4_4,
        (2, 1) => SamplingFactor::R_4_2_2,
        _ => SamplingFactor::R_4_2_0,
    });
    more(&mut encoder);
    let (width, height) = (u16::try_from(picture.width())?, u16::try_from(picture.height())?);
    encoder.encode(&picture, width, height, ColorType::Rgb)?;
    Ok(file)
}

/// A JPEG of `codes`, decoded and written as a PNG.
fn kept_as_png(of: &FileCoding, codes: &Frame<Work, u8>) -> Result<Vec<u8>, Failure> {
    png(&image::load_from_memory(&other(of, codes, |_| {})?)?.into_rgb8())
}

fn png(picture: &RgbImage) -> Result<Vec<u8>, Failure> {
    let mut file = Vec::new();
    picture.write_to(&mut Cursor::new(&mut file), ImageFormat::Png)?;
    Ok(file)
}

/// `codes` after an earlier coding whose blocks are offset by [`OFF`] from the picture's.
fn cut_before(of: &FileCoding, codes: &Frame<Work, u8>) -> Result<RgbImage, Failure> {
    let picture = picture(codes);
    let (width, height) = (picture.width(), picture.height());
    let larger = RgbImage::from_fn(width + OFF.0, height + OFF.1, |x, y| {
        *picture.get_pixel(x.saturating_sub(OFF.0), y.saturating_sub(OFF.1))
    });
    let before = image::load_from_memory(&coded(&codes_of(&larger), of.quality))?.into_rgb8();
    Ok(image::imageops::crop_imm(&before, OFF.0, OFF.1, width, height).to_image())
}

fn picture(codes: &Frame<Work, u8>) -> RgbImage {
    let size = codes.size();
    RgbImage::from_fn(size.width as u32, size.height as u32, |x, y| {
        Rgb(Channel::ALL.map(|c| codes.plane(c).at(x as usize, y as usize)))
    })
}

fn codes_of(picture: &RgbImage) -> Frame<Work, u8> {
    let size = Size::new(picture.width() as usize, picture.height() as usize);
    Frame::from_fn(|c: Channel| {
        Plane::from_fn(size, |x, y| picture.get_pixel(x as u32, y as u32).0[c.index()])
    })
}

/// Tables on the simulated rig of `rig` at half its pixels; `quick` takes three scenes.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let rig = sized(rig, 0.5);
    let mut scenes = with_kept(rig.photo.size(), &Tone::of_curve(rig.photo.curve, 8))?;
    scenes.drain(..INKED);
    scenes.truncate(if quick { 3 } else { scenes.len() });
    costs(&rig, "jpeg-files", (&[MethodName::Digital], &codings()), &scenes)
}
