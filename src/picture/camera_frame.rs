//! A frame of a camera that codes its frames as JPEG (`MJPG`), decoded into counts.
//!
//! Such frames often leave out the code tables, which are then ITU-T T.81's own (annex K). A frame
//! that is cut, or whose codes do not add up to its blocks, is refused: a decoder would fill up the
//! rest with grey.

use super::decode::{Limits, decode};
use super::{Flaw, jpeg};
use crate::frame::{Counts, Size};

/// Longest frame in bytes a pixel: more than samples that are not coded.
const BYTES_A_PIXEL_MAX: usize = 4;

/// The counts in `bytes`, a frame of a camera of `size`. A grey one fills all three planes.
///
/// # Errors
/// The [`Flaw`] that keeps it from being this camera's frame, whole.
pub fn camera_frame(bytes: &[u8], size: Size) -> Result<Counts, Flaw> {
    let limits = Limits {
        bytes_max: (BYTES_A_PIXEL_MAX * size.area() + (64 << 10)) as u64,
        pixels_max: size.area() as u64,
        decoder_bytes_max: 1 << 20 | (8 * size.area()) as u64,
    };
    if !bytes.starts_with(&[0xff, 0xd8]) {
        let (found, allowed) = (format!("{} bytes that begin otherwise", bytes.len()), "ff d8");
        return Err(Flaw::Damaged { kind: "JPEG", found, allowed: allowed.to_owned() });
    }
    let with_codes = jpeg::with_usual_codes(bytes);
    let bytes = with_codes.as_deref().unwrap_or(bytes);
    let raster = decode(bytes, &limits)?;
    // Whether the samples agree with the codes is not asked: strong colours are clipped.
    let has_all = || jpeg::coefficients(bytes).is_some_and(|coding| coding.size == size);
    if raster.size != size || !has_all() {
        return Err(Flaw::Damaged {
            kind: "JPEG",
            found: format!("a frame of {}, or codes that give less than it", raster.size),
            allowed: format!("a whole frame of {size}"),
        });
    }
    let step = raster.layout.samples();
    let mut counts = Counts::zeros(size);
    for (n, plane) in counts.planes_mut().iter_mut().enumerate() {
        let own = raster.samples.iter().skip(n.min(step - 1)).step_by(step);
        plane.data_mut().iter_mut().zip(own).for_each(|(to, &from)| *to = from);
    }
    Ok(counts)
}
