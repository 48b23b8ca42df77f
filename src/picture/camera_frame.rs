//! Decoding of camera frames that are coded as JPEG (`MJPG`) into counts.
//!
//! Such frames often omit the code tables, which are then the standard ones (ITU-T T.81, annex K).
//! A frame that is cut, or lacks codes for some blocks, is refused, because the decoder would fill
//! the rest with grey.

use super::decode::{Limits, decode};
use super::{Flaw, jpeg};
use crate::frame::{Counts, Size};

/// Longest frame, bytes a pixel: more than uncoded samples take.
const BYTES_A_PIXEL_MAX: usize = 4;

/// The counts in `bytes`, a camera's frame of `size`; a grey frame fills all three planes.
///
/// # Errors
/// The [`Flaw`] of a frame that is damaged or of another size.
pub fn camera_frame(bytes: &[u8], size: Size) -> Result<Counts, Flaw> {
    let limits = Limits {
        bytes_max: (BYTES_A_PIXEL_MAX * size.area() + (64 << 10)) as u64,
        pixels_max: size.area() as u64,
        decoder_bytes_max: 1 << 20 | (8 * size.area()) as u64,
        grid: None,
    };
    if !bytes.starts_with(&[0xff, 0xd8]) {
        let (found, allowed) = (format!("{} bytes that begin otherwise", bytes.len()), "ff d8");
        return Err(Flaw::Damaged { kind: "JPEG", found, allowed: allowed.to_owned() });
    }
    let with_codes = jpeg::with_usual_codes(bytes);
    let bytes = with_codes.as_deref().unwrap_or(bytes);
    let raster = decode(bytes, &limits)?;
    // `raster.coding` will not do: samples of strong colours are clipped and do not agree with it.
    let has_all = || jpeg::coefficients(bytes).is_ok_and(|of| of.is_some_and(|of| of.size == size));
    if raster.size != size || !has_all() {
        return Err(Flaw::Damaged {
            kind: "JPEG",
            found: format!("a frame of {}, or one with blocks missing", raster.size),
            allowed: format!("a whole frame of {size}"),
        });
    }
    let step = raster.step();
    let mut counts = Counts::zeros(size);
    for (n, plane) in counts.planes_mut().iter_mut().enumerate() {
        let own = raster.samples.iter().skip(n.min(step - 1)).step_by(step);
        plane.data_mut().iter_mut().zip(own).for_each(|(to, &from)| *to = from);
    }
    Ok(counts)
}
