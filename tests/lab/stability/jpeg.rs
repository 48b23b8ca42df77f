//! A photo as it comes back from a JPEG.

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageFormat};

use crate::frame::{Channel, Frame, Plane, Work};

/// `codes` saved at `quality` (1 to 100) and read again.
///
/// # Errors
/// When the coder refuses.
pub(super) fn through(
    codes: &Frame<Work, u8>,
    quality: u8,
) -> Result<Frame<Work, u8>, image::ImageError> {
    let size = codes.size();
    let [red, green, blue] = codes.planes().each_ref().map(|plane| plane.data());
    let pixels: Vec<u8> =
        red.iter().zip(green).zip(blue).flat_map(|((&r, &g), &b)| [r, g, b]).collect();
    let mut file = Vec::new();
    JpegEncoder::new_with_quality(&mut file, quality).write_image(
        &pixels,
        size.width as u32,
        size.height as u32,
        ExtendedColorType::Rgb8,
    )?;
    let read = image::load_from_memory_with_format(&file, ImageFormat::Jpeg)?.into_rgb8();
    Ok(Frame::from_fn(|c: Channel| {
        Plane::from_fn(size, |x, y| read.get_pixel(x as u32, y as u32).0[c.index()])
    }))
}
