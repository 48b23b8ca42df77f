//! Metadata of photo files: what a result carries, and notes about the rest.
//!
//! | metadata | in the result |
//! |---|---|
//! | ICC profile | carried, byte by byte |
//! | EXIF | carried into JPEG and PNG with the result's sizes and no thumbnail; not into TIFF |
//! | orientation | applied, and the tag cleared |
//! | all of [`Lost`] | not carried, with a note |

use std::collections::BTreeSet;
use std::ops::Range;

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

/// A part of a photo file that its result lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Lost {
    /// Pictures after the first.
    Pictures,
    Texts,
    Iptc,
    Xmp,
    Exif,
    /// Dots per inch or centimetre.
    Density,
}

impl Lost {
    /// The sentence for the report.
    pub(super) fn note(self) -> String {
        let what = match self {
            Lost::Pictures => "the pictures after the first",
            Lost::Texts => "texts outside EXIF (such as comment, artist, date, camera)",
            Lost::Iptc => "IPTC data",
            Lost::Xmp => "XMP data",
            Lost::Exif => "EXIF data",
            Lost::Density => "dots per inch",
        };
        format!("not in the result: {what}")
    }
}

/// A photo file walked to its end, nothing decoded.
#[derive(Debug, Default)]
pub(super) struct Walked {
    /// Width and height by the header; `None` where only the decoder reads them.
    pub(super) size: Option<Size>,
    pub(super) lost: BTreeSet<Lost>,
}

impl Walked {
    /// Notes that the result lacks `lost`, if `is_there`.
    pub(super) fn lose(&mut self, lost: Lost, is_there: bool) {
        if is_there {
            self.lost.insert(lost);
        }
    }
}
