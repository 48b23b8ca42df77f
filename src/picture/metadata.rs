//! Metadata of photo files, and what a result carries of it.
//!
//! | metadata | in the result |
//! |---|---|
//! | ICC profile | carried, byte by byte |
//! | colours stated otherwise ([`StatedColours`]) | carried as an ICC profile |
//! | EXIF, GPS | carried with the result's sizes and no thumbnail |
//! | description, camera, program, date, artist, copyright of a TIFF or raw photo | as EXIF |
//! | orientation | applied, and the tag cleared |
//! | all else (XMP, IPTC, maker's notes, texts, density) | not carried; the original stays |

use std::ops::Range;

use super::tone::StatedColours;
use crate::frame::Size;

/// Shortest run of zero bytes that counts as a hole. Guess: coded photographs hold runs of a few
/// bytes, file systems leave holes of whole blocks, 512 bytes and up.
pub(super) const HOLE_BYTES: usize = 512;

/// The longest run of zero bytes in `data`.
pub(super) fn longest_zero_run(data: &[u8]) -> Range<usize> {
    let (mut longest, mut start) = (0..0, 0);
    for (i, &b) in data.iter().enumerate() {
        if b != 0 {
            start = i + 1;
        } else if i + 1 - start > longest.len() {
            longest = start..i + 1;
        }
    }
    longest
}

/// A photo file walked to its end, nothing decoded.
#[derive(Debug, Default)]
pub(super) struct Walked {
    /// Width and height by the header; `None` where only the decoder reads them.
    pub(super) size: Option<Size>,
    /// Colours stated elsewhere than in an ICC profile.
    pub(super) colours: Option<StatedColours>,
    /// Metadata as an EXIF block, from its TIFF header on, where the decoder finds none.
    pub(super) exif: Option<Vec<u8>>,
}
