//! Metadata of photo files: what a result carries, and notes about the rest.
//!
//! | metadata | in the result |
//! |---|---|
//! | ICC profile | carried, byte by byte |
//! | colours stated otherwise ([`StatedColours`]) | carried as an ICC profile |
//! | EXIF, GPS | carried with the result's sizes and no thumbnail |
//! | description, camera, program, date, artist, copyright of a TIFF or raw photo | as EXIF |
//! | orientation | applied, and the tag cleared |
//! | all else | not carried, with a note ([`Lost`]) |
//!
//! Each format has a [`PartTable`].

use std::borrow::Cow;
use std::collections::BTreeSet;
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

/// A part of a photo file that its result lacks, in the user's words.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Lost(Cow<'static, str>);

impl Lost {
    pub(super) const CREDENTIALS: Lost = Lost::of("Content Credentials");
    pub(super) const DENSITY: Lost = Lost::of("dots per inch");
    pub(super) const IPTC: Lost = Lost::of("IPTC data");
    pub(super) const MAKER_NOTES: Lost = Lost::of("the camera maker's own notes");
    pub(super) const PICTURES: Lost = Lost::of("the pictures after the first");
    pub(super) const PROFILE: Lost = Lost::of("the colour profile, which was not used");
    pub(super) const TEXTS: Lost =
        Lost::of("texts outside EXIF (such as comment, artist, date, camera)");
    pub(super) const XMP: Lost = Lost::of("XMP data");

    /// A part called `words`.
    pub(super) const fn of(words: &'static str) -> Lost {
        Lost(Cow::Borrowed(words))
    }

    /// Data that no table lists, by their `kind` and their name in the file.
    pub(super) fn unknown(kind: &str, name: &[u8]) -> Lost {
        let printed = name.iter().filter(|b| b.is_ascii_graphic()).take(16);
        let printed: String = printed.map(|&b| char::from(b)).collect();
        Lost(format!("{kind} \"{printed}\"").into())
    }

    /// The sentence for the report.
    pub(super) fn note(self) -> String {
        format!("not in the result: {}", self.0)
    }
}

/// Most parts that are noted: a longer list would not help. Guess.
const LOST_MAX: usize = 16;

/// The parts of a format by the beginnings of their names: those that are used, carried or mean
/// nothing beside the picture, and those that are lost.
pub(super) struct PartTable {
    pub(super) used: &'static [&'static [u8]],
    pub(super) lost: &'static [(&'static [u8], Lost)],
}

/// Findings of a walk over a whole photo file, in which nothing is decoded.
#[derive(Debug, Default)]
pub(super) struct Walked {
    /// Width and height in the header; `None` where only the decoder reads them.
    pub(super) size: Option<Size>,
    pub(super) lost: BTreeSet<Lost>,
    /// The longest run of zero bytes if it may be a hole: it is picture data only if the file
    /// decodes to its end.
    pub(super) zeros: Option<Range<usize>>,
    /// Colours stated elsewhere than in an ICC profile.
    pub(super) colours: Option<StatedColours>,
    /// Whether the colours are multiplied by alpha (TIFF 6.0, §18).
    pub(super) is_multiplied: bool,
    /// Metadata as an EXIF block, from its TIFF header on, where the decoder finds none.
    pub(super) exif: Option<Vec<u8>>,
}

impl Walked {
    /// Notes that the result lacks `lost`, if `is_there`.
    pub(super) fn lose(&mut self, lost: Lost, is_there: bool) {
        if is_there {
            self.lost.insert(lost);
        }
    }

    /// Notes the loss of the part `name` of a file, by the `table` of its format. A part that the
    /// table does not list is noted as unknown data of `kind`.
    pub(super) fn look_up(&mut self, table: &PartTable, kind: &str, name: &[u8]) {
        if !table.used.iter().any(|begin| name.starts_with(begin)) && self.lost.len() < LOST_MAX {
            let row = table.lost.iter().find(|(begin, _)| name.starts_with(begin));
            self.lost.insert(row.map_or_else(|| Lost::unknown(kind, name), |(_, l)| l.clone()));
        }
    }
}
