//! The standard code tables, which camera frames omit: ITU-T T.81, tables K.3 to K.6.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use super::{SCAN, Segment, Segments};

/// The marker of a segment of code tables.
const TABLES: u8 = 0xc4;

/// The JPEG `bytes` with the standard tables inserted before its first scan; `None` if it has
/// tables of its own there, or no scan.
pub(crate) fn with_usual_codes(bytes: &[u8]) -> Option<Vec<u8>> {
    let first = Segments::new(bytes)
        .take_while(|segment| !matches!(segment, Ok(Segment { marker: TABLES, .. })))
        .find(|segment| !matches!(segment, Ok(segment) if segment.marker != SCAN))?
        .ok()?;
    // The scan's marker and length come before its body.
    let scan = first.coded.start - first.body.len() - 4;
    // The encoder writes the standard tables, and no others.
    let mut usual = Vec::new();
    JpegEncoder::new(&mut usual).encode(&[0; 3], 1, 1, ExtendedColorType::Rgb8).ok()?;
    let segments = Segments::new(&usual).filter_map(Result::ok);
    let tables = segments.filter(|segment| segment.marker == TABLES);
    let tables: Vec<u8> = tables.flat_map(|segment| segment.body).copied().collect();
    let (before, after) = bytes.split_at(scan);
    let length = (tables.len() as u16 + 2).to_be_bytes();
    Some([before, &[0xff, 0xc4], &length, &tables, after].concat())
}
