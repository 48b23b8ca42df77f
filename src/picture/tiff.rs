//! Walks a TIFF's first directory and sees that its strips or tiles lie inside the file (TIFF 6.0,
//! §2).

use crate::frame::Size;

use super::Flaw;

/// What the walk learns without decoding anything.
pub(super) struct Walked {
    pub(super) size: Size,
    /// Whether the file holds further pictures, which are not restored.
    pub(super) more_pages: bool,
    /// Whether the file holds an EXIF directory, which cannot be carried over.
    pub(super) exif: bool,
}

const IMAGE_WIDTH: u16 = 256;
const IMAGE_LENGTH: u16 = 257;
const COMPRESSION: u16 = 259;
const STRIP_OFFSETS: u16 = 273;
const STRIP_BYTE_COUNTS: u16 = 279;
const TILE_OFFSETS: u16 = 324;
const TILE_BYTE_COUNTS: u16 = 325;
const EXIF_DIRECTORY: u16 = 34665;

/// More strips than this are no photo of ours but a file made to keep us busy. Guess.
const STRIPS_MAX: usize = 1 << 20;

/// Walks the first directory of `bytes`.
///
/// # Errors
/// [`Flaw::Truncated`], [`Flaw::ZeroFilled`] or [`Flaw::Damaged`].
pub(super) fn walk(bytes: &[u8]) -> Result<Walked, Flaw> {
    let file = File { bytes, big_endian: bytes.starts_with(b"MM") };
    let directory = file.u32(4)? as usize;
    let entries = usize::from(file.u16(directory)?);
    let mut walked = Walked { size: Size::new(0, 0), more_pages: false, exif: false };
    let (mut offsets, mut counts, mut plain) = (Vec::new(), Vec::new(), true);
    for n in 0..entries {
        let entry = directory + 2 + 12 * n;
        match file.u16(entry)? {
            IMAGE_WIDTH => walked.size.width = file.first(entry)?,
            IMAGE_LENGTH => walked.size.height = file.first(entry)?,
            COMPRESSION => plain = file.first(entry)? == 1,
            STRIP_OFFSETS | TILE_OFFSETS => offsets = file.numbers(entry)?,
            STRIP_BYTE_COUNTS | TILE_BYTE_COUNTS => counts = file.numbers(entry)?,
            EXIF_DIRECTORY => walked.exif = true,
            _ => {}
        }
    }
    walked.more_pages = file.u32(directory + 2 + 12 * entries)? != 0;
    if walked.size.area() == 0 || offsets.is_empty() || offsets.len() != counts.len() {
        return Err(file.damaged(
            &format!(
                "a picture of {} in {} strips of {} lengths",
                walked.size,
                offsets.len(),
                counts.len()
            ),
            "at least 1×1 and a length for every strip",
        ));
    }
    let mut zeros_at_end = 0;
    let mut total = 0;
    for (&from, &length) in offsets.iter().zip(&counts) {
        let Some(strip) = from.checked_add(length).and_then(|to| bytes.get(from..to)) else {
            return Err(file.ended_early("picture data past the end"));
        };
        total += length;
        let trailing = strip.iter().rev().take_while(|&&b| b == 0).count();
        zeros_at_end = if trailing == length { zeros_at_end + length } else { trailing };
    }
    // Plain data may hold zeros, black pixels; a whole quarter of exact zeros at the end is a hole,
    // for no sensor is that quiet. Guess. Packed data never holds them.
    let allowed = if plain { (total / 4).max(512) } else { 512 };
    if zeros_at_end >= allowed {
        let to = offsets.iter().zip(&counts).map(|(o, c)| o + c).max().unwrap_or(bytes.len());
        return Err(Flaw::ZeroFilled {
            from: to.saturating_sub(zeros_at_end),
            to,
            length: bytes.len(),
        });
    }
    Ok(walked)
}

/// The bytes with the byte order their header states.
struct File<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl File<'_> {
    fn u16(&self, at: usize) -> Result<u16, Flaw> {
        let b = self
            .bytes
            .get(at..at + 2)
            .ok_or_else(|| self.ended_early("a directory past the end"))?;
        let b = [b[0], b[1]];
        Ok(if self.big_endian { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
    }

    fn u32(&self, at: usize) -> Result<u32, Flaw> {
        let b = self
            .bytes
            .get(at..at + 4)
            .ok_or_else(|| self.ended_early("a directory past the end"))?;
        let b = [b[0], b[1], b[2], b[3]];
        Ok(if self.big_endian { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) })
    }

    /// The numbers (SHORT or LONG) of the entry at `entry`.
    fn numbers(&self, entry: usize) -> Result<Vec<usize>, Flaw> {
        let width = match self.u16(entry + 2)? {
            3 => 2,
            4 => 4,
            other => return Err(self.damaged(&format!("a field of type {other}"), "SHORT or LONG")),
        };
        let count = self.u32(entry + 4)? as usize;
        if count > STRIPS_MAX {
            return Err(self.damaged(&format!("{count} strips"), &format!("at most {STRIPS_MAX}")));
        }
        let at = if count * width <= 4 { entry + 8 } else { self.u32(entry + 8)? as usize };
        (0..count)
            .map(|n| match width {
                2 => self.u16(at + 2 * n).map(usize::from),
                _ => self.u32(at + 4 * n).map(|v| v as usize),
            })
            .collect()
    }

    fn first(&self, entry: usize) -> Result<usize, Flaw> {
        self.numbers(entry)?
            .first()
            .copied()
            .ok_or_else(|| self.damaged("an empty field", "one number"))
    }

    fn ended_early(&self, found: &str) -> Flaw {
        let length = self.bytes.len();
        let zeros = self.bytes.iter().rev().take_while(|&&b| b == 0).count();
        if zeros >= 512 {
            return Flaw::ZeroFilled { from: length - zeros, to: length, length };
        }
        let found = format!("{found} of {length} bytes");
        Flaw::Truncated { kind: "TIFF", found, end: "the end of its last strip and its directory" }
    }

    fn damaged(&self, found: &str, allowed: &str) -> Flaw {
        // A directory read out of a never-filled tail is all zeros: say that instead.
        let length = self.bytes.len();
        let zeros = self.bytes.iter().rev().take_while(|&&b| b == 0).count();
        if zeros >= 512 {
            return Flaw::ZeroFilled { from: length - zeros, to: length, length };
        }
        Flaw::Damaged { kind: "TIFF", found: found.to_owned(), allowed: allowed.to_owned() }
    }
}
