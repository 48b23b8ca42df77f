//! Walks a TIFF's first directory and sees that its strips or tiles lie inside the file (TIFF 6.0,
//! §2).

use crate::frame::Size;

use super::Flaw;
use super::iptc;
use super::kind::tiff_of_a_camera;

/// What the walk learns without decoding anything.
pub(super) struct Walked {
    pub(super) size: Size,
    /// Whether the file holds further pictures, which are not restored.
    pub(super) more_pages: bool,
    /// Whether the file holds an EXIF directory, which cannot be carried over.
    pub(super) exif: bool,
    /// Whether it names an artist, a description, a camera or the like.
    pub(super) words: bool,
    /// Whether it states dots per inch or centimetre.
    pub(super) density: bool,
    /// Whether it holds IPTC data.
    pub(super) iptc: bool,
}

pub(super) const NEW_SUBFILE_TYPE: u16 = 254;
const SUBFILE_TYPE: u16 = 255;
pub(super) const IMAGE_WIDTH: u16 = 256;
pub(super) const IMAGE_LENGTH: u16 = 257;
pub(super) const BITS_PER_SAMPLE: u16 = 258;
pub(super) const COMPRESSION: u16 = 259;
pub(super) const PHOTOMETRIC: u16 = 262;
const DOCUMENT_NAME: u16 = 269;
const DESCRIPTION: u16 = 270;
const MAKE: u16 = 271;
const MODEL: u16 = 272;
const RESOLUTION_UNIT: u16 = 296;
const DATE_TIME: u16 = 306;
const ARTIST: u16 = 315;
const COPYRIGHT: u16 = 33432;
const IPTC: u16 = 33723;
const IMAGE_RESOURCES: u16 = 34377;
pub(super) const STRIP_OFFSETS: u16 = 273;
pub(super) const ROWS_PER_STRIP: u16 = 278;
pub(super) const STRIP_BYTE_COUNTS: u16 = 279;
pub(super) const TILE_OFFSETS: u16 = 324;
pub(super) const TILE_BYTE_COUNTS: u16 = 325;
pub(super) const SUB_DIRECTORIES: u16 = 330;
pub(super) const SAMPLE_FORMAT: u16 = 339;
pub(super) const EXIF_DIRECTORY: u16 = 34665;
const GPS_DIRECTORY: u16 = 34853;

/// What is not read, in words: of [`PHOTOMETRIC`] and of [`COMPRESSION`] (TIFF 6.0; the last three
/// by LibTIFF).
const INKS: [(usize, &str); 3] = [
    (3, "a palette of colours"),
    (5, "four inks (CMYK)"),
    (6, "brightness and differences of colours (YCbCr)"),
];
const PACKED: [(usize, &str); 8] = [
    (2, "a fax's compression"),
    (3, "a fax's compression"),
    (4, "a fax's compression"),
    (6, "a JPEG's compression"),
    (7, "a JPEG's compression"),
    (34925, "compression by LZMA"),
    (50000, "compression by Zstandard"),
    (50001, "a WebP's compression"),
];
/// What is.
const READ: &str = "grey and RGB of 8 or 16 bits, as they are or packed by LZW, Deflate or \
                    PackBits; save it so in an image program";
/// Pictures below one another that are looked at. Guess.
const BELOW_MAX: usize = 32;

/// More strips than this are no photo of ours but a file made to keep us busy. Guess.
const STRIPS_MAX: usize = 1 << 20;

/// Walks the first directory of `bytes`.
///
/// # Errors
/// [`Flaw::Truncated`], [`Flaw::ZeroFilled`] or [`Flaw::Damaged`].
pub(super) fn walk(bytes: &[u8]) -> Result<Walked, Flaw> {
    let file = File::new(bytes);
    let directory = file.u32(4)? as usize;
    let mut preview = false;
    let entries = usize::from(file.u16(directory)?);
    let mut walked = Walked {
        size: Size::new(0, 0),
        more_pages: false,
        exif: false,
        words: false,
        density: false,
        iptc: false,
    };
    let (mut offsets, mut counts, mut below) = (Vec::new(), Vec::new(), Vec::new());
    // Without the fields: grey or RGB, plain, whole numbers.
    let (mut inks, mut packing, mut bits, mut fractions) = (1, 1, 1, false);
    for n in 0..entries {
        let entry = directory + 2 + 12 * n;
        match file.u16(entry)? {
            IMAGE_WIDTH => walked.size.width = file.first(entry)?,
            IMAGE_LENGTH => walked.size.height = file.first(entry)?,
            // Bit 0: a smaller picture of another one in the file.
            NEW_SUBFILE_TYPE => preview |= file.first(entry)? & 1 == 1,
            SUBFILE_TYPE => preview |= file.first(entry)? == 2,
            BITS_PER_SAMPLE => bits = file.first(entry)?,
            COMPRESSION => packing = file.first(entry)?,
            PHOTOMETRIC => inks = file.first(entry)?,
            SUB_DIRECTORIES => below = file.numbers(entry)?,
            SAMPLE_FORMAT => fractions = file.first(entry)? == 3,
            STRIP_OFFSETS | TILE_OFFSETS => offsets = file.numbers(entry)?,
            STRIP_BYTE_COUNTS | TILE_BYTE_COUNTS => counts = file.numbers(entry)?,
            EXIF_DIRECTORY | GPS_DIRECTORY => walked.exif = true,
            DOCUMENT_NAME | DESCRIPTION | MAKE | MODEL | DATE_TIME | ARTIST | COPYRIGHT => {
                walked.words = true;
            }
            IPTC => walked.iptc = true,
            IMAGE_RESOURCES => {
                let (length, at) = file.place(entry, 1)?;
                walked.iptc |= at
                    .checked_add(length)
                    .and_then(|to| bytes.get(at..to))
                    .is_some_and(iptc::is_in);
            }
            // 1 is a shape of pixels alone.
            RESOLUTION_UNIT => walked.density = file.first(entry)? > 1,
            _ => {}
        }
    }
    // A picture below this one that is larger is the photo, and this one its preview.
    let larger = |&at: &usize| file.size(at).is_ok_and(|size| size.area() > walked.size.area());
    if preview || below.iter().take(BELOW_MAX).any(larger) {
        return Err(tiff_of_a_camera());
    }
    let words = |of: &[(usize, &str)], number: usize| {
        of.iter().find(|(one, _)| *one == number).map(|(_, words)| (*words).to_owned())
    };
    let deep = (bits > 16 && !fractions).then(|| format!("samples of {bits} bits"));
    if let Some(found) = words(&INKS, inks).or(words(&PACKED, packing)).or(deep) {
        return Err(Flaw::Unsupported { kind: "TIFF", found, allowed: READ });
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
    file.strips(&offsets, &counts, packing == 1)?;
    Ok(walked)
}

/// The bytes with the byte order their header states.
pub(super) struct File<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) big_endian: bool,
}

impl<'a> File<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> File<'a> {
        File { bytes, big_endian: bytes.starts_with(b"MM") }
    }

    /// Width and height that the directory at `at` states.
    fn size(&self, at: usize) -> Result<Size, Flaw> {
        let mut size = Size::new(0, 0);
        for n in 0..usize::from(self.u16(at)?) {
            let entry = at + 2 + 12 * n;
            match self.u16(entry)? {
                IMAGE_WIDTH => size.width = self.first(entry)?,
                IMAGE_LENGTH => size.height = self.first(entry)?,
                _ => {}
            }
        }
        Ok(size)
    }

    /// Sees that these strips or tiles, `plain` or packed, lie in the file and were filled.
    pub(super) fn strips(
        &self,
        offsets: &[usize],
        counts: &[usize],
        plain: bool,
    ) -> Result<(), Flaw> {
        let mut zeros_at_end = 0;
        let mut total = 0;
        for (&from, &length) in offsets.iter().zip(counts) {
            let Some(strip) = from.checked_add(length).and_then(|to| self.bytes.get(from..to))
            else {
                return Err(self.ended_early("picture data past the end"));
            };
            total += length;
            let trailing = strip.iter().rev().take_while(|&&b| b == 0).count();
            zeros_at_end = if trailing == length { zeros_at_end + length } else { trailing };
        }
        // Plain data may hold zeros, black pixels; a whole quarter of exact zeros at the end is a
        // hole, for no sensor is that quiet. Guess. Packed data never holds them.
        let allowed = if plain { (total / 4).max(512) } else { 512 };
        if zeros_at_end >= allowed {
            let length = self.bytes.len();
            let to = offsets.iter().zip(counts).map(|(o, c)| o + c).max().unwrap_or(length);
            return Err(Flaw::ZeroFilled { from: to.saturating_sub(zeros_at_end), to, length });
        }
        Ok(())
    }

    pub(super) fn u16(&self, at: usize) -> Result<u16, Flaw> {
        let b = self
            .bytes
            .get(at..at + 2)
            .ok_or_else(|| self.ended_early("a directory past the end"))?;
        let b = [b[0], b[1]];
        Ok(if self.big_endian { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
    }

    pub(super) fn u32(&self, at: usize) -> Result<u32, Flaw> {
        let b = self
            .bytes
            .get(at..at + 4)
            .ok_or_else(|| self.ended_early("a directory past the end"))?;
        let b = [b[0], b[1], b[2], b[3]];
        Ok(if self.big_endian { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) })
    }

    pub(super) fn f64(&self, at: usize) -> Result<f64, Flaw> {
        let (first, second) = (u64::from(self.u32(at)?), u64::from(self.u32(at + 4)?));
        let (high, low) = if self.big_endian { (first, second) } else { (second, first) };
        Ok(f64::from_bits(high << 32 | low))
    }

    /// The whole numbers (BYTE, SHORT, LONG or a directory's place) of the entry at `entry`.
    pub(super) fn numbers(&self, entry: usize) -> Result<Vec<usize>, Flaw> {
        let width = match self.u16(entry + 2)? {
            1 | 7 => 1,
            3 => 2,
            4 | 13 => 4,
            other => return Err(self.damaged(&format!("a field of type {other}"), "SHORT or LONG")),
        };
        let (count, at) = self.place(entry, width)?;
        (0..count)
            .map(|n| match width {
                1 => {
                    let byte = self.bytes.get(at + n).copied().map(usize::from);
                    byte.ok_or_else(|| self.ended_early("a directory past the end"))
                }
                2 => self.u16(at + 2 * n).map(usize::from),
                _ => self.u32(at + 4 * n).map(|v| v as usize),
            })
            .collect()
    }

    /// How many values the entry at `entry` has, each `width` bytes wide, and where they begin.
    pub(super) fn place(&self, entry: usize, width: usize) -> Result<(usize, usize), Flaw> {
        let count = self.u32(entry + 4)? as usize;
        if count > STRIPS_MAX {
            return Err(self.damaged(&format!("{count} strips"), &format!("at most {STRIPS_MAX}")));
        }
        let at = if count * width <= 4 { entry + 8 } else { self.u32(entry + 8)? as usize };
        Ok((count, at))
    }

    pub(super) fn first(&self, entry: usize) -> Result<usize, Flaw> {
        self.numbers(entry)?
            .first()
            .copied()
            .ok_or_else(|| self.damaged("an empty field", "one number"))
    }

    pub(super) fn ended_early(&self, found: &str) -> Flaw {
        let length = self.bytes.len();
        let zeros = self.bytes.iter().rev().take_while(|&&b| b == 0).count();
        if zeros >= 512 {
            return Flaw::ZeroFilled { from: length - zeros, to: length, length };
        }
        let found = format!("{found} of {length} bytes");
        Flaw::Truncated { kind: "TIFF", found, end: "the end of its last strip and its directory" }
    }

    pub(super) fn damaged(&self, found: &str, allowed: &str) -> Flaw {
        // A directory read out of a never-filled tail is all zeros: say that instead.
        let length = self.bytes.len();
        let zeros = self.bytes.iter().rev().take_while(|&&b| b == 0).count();
        if zeros >= 512 {
            return Flaw::ZeroFilled { from: length - zeros, to: length, length };
        }
        Flaw::Damaged { kind: "TIFF", found: found.to_owned(), allowed: allowed.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 16×12 with one more field, `tag`, whose data lie at byte 74.
    fn with(tag: u16, kind: u16, count: u32, data: &[u8]) -> Vec<u8> {
        let value = if data.is_empty() { count } else { 74 };
        let count = if data.is_empty() { 1 } else { count };
        let from = 74 + data.len() as u32;
        let entries = [
            (tag, kind, count, value),
            (IMAGE_WIDTH, 4, 1, 16),
            (IMAGE_LENGTH, 4, 1, 12),
            (STRIP_OFFSETS, 4, 1, from),
            (STRIP_BYTE_COUNTS, 4, 1, 192),
        ];
        let mut bytes = b"II*\0\x08\0\0\0".to_vec();
        bytes.extend(5u16.to_le_bytes());
        for (tag, kind, count, value) in entries {
            bytes.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
            bytes.extend([count.to_le_bytes(), value.to_le_bytes()].concat());
        }
        bytes.extend([0; 4]);
        bytes.extend(data);
        bytes.extend([100; 192]);
        bytes
    }

    #[test]
    fn words_and_iptc_that_are_lost_are_told_of() {
        let told = |tag, kind, data: &[u8]| {
            let walked = walk(&with(tag, kind, data.len() as u32, data));
            walked.map(|walked| (walked.words, walked.iptc)).map_err(|flaw| flaw.to_string())
        };
        assert_eq!(told(NEW_SUBFILE_TYPE, 4, &[0; 4]), Ok((false, false)));
        for tag in [ARTIST, MAKE, DATE_TIME] {
            assert_eq!(told(tag, 2, b"camera\0\0"), Ok((true, false)), "{tag}");
        }
        assert_eq!(told(IPTC, 7, b"\x1c\x02\x50\0\x03Ada"), Ok((false, true)));
        let resources = |number: u8| [b"8BIM\x04", &[number, 0, 0, 0, 0, 0, 2, 1, 1][..]].concat();
        assert_eq!(told(IMAGE_RESOURCES, 1, &resources(4)), Ok((false, true)));
        assert_eq!(told(IMAGE_RESOURCES, 1, &resources(5)), Ok((false, false)));
        let past = walk(&with(IMAGE_RESOURCES, 1, 9999, b"8BIM"));
        assert!(past.is_ok_and(|walked| !walked.iptc), "resources past the end are not looked at");
    }

    #[test]
    fn a_preview_of_a_raw_photo_is_never_taken_for_the_photo() {
        let file = |kind: u32| with(NEW_SUBFILE_TYPE, 4, kind, &[]);
        assert_eq!(walk(&file(0)).ok().map(|walked| walked.size), Some(Size::new(16, 12)));
        let words = walk(&file(1)).err().map(|flaw| flaw.to_string()).unwrap_or_default();
        assert!(words.contains("a camera raw photo") && words.contains("develop it"), "{words}");
        // By the older field, and one whose photo is a larger picture below it.
        assert!(walk(&with(SUBFILE_TYPE, 3, 2, &[])).is_err());
        let file = |width: u8| {
            let mut below = vec![2, 0];
            for tag in [0, 1] {
                below.extend([tag, 1, 4, 0, 1, 0, 0, 0, width, 0, 0, 0]);
            }
            let mut bytes = with(SUB_DIRECTORIES, 4, 0, &below);
            // One directory, where the field's data lie.
            bytes[14..18].copy_from_slice(&1u32.to_le_bytes());
            bytes
        };
        assert!(walk(&file(12)).is_ok(), "a smaller one is a preview of this");
        assert!(walk(&file(40)).is_err());
    }

    #[test]
    fn what_is_not_read_is_told_by_its_reason() {
        for (tag, value, words) in [
            (PHOTOMETRIC, 5, "four inks (CMYK)"),
            (PHOTOMETRIC, 3, "a palette"),
            (COMPRESSION, 50000, "Zstandard"),
            (COMPRESSION, 7, "a JPEG's compression"),
            (BITS_PER_SAMPLE, 32, "samples of 32 bits"),
        ] {
            let told = walk(&with(tag, 4, value, &[])).err().map(|flaw| flaw.to_string());
            assert!(told.as_ref().is_some_and(|told| told.contains(words)), "{words}: {told:?}");
        }
        assert!(walk(&with(GPS_DIRECTORY, 4, 20, &[])).is_ok_and(|walked| walked.exif));
    }
}
