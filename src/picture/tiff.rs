//! Walks a TIFF's first directory and checks that its strips or tiles lie inside the file (TIFF
//! 6.0, §2).

mod directory;

use std::ops::RangeInclusive;

use ::tiff::tags::Tag;

use super::Flaw;
use super::iptc;
use super::kind::tiff_of_a_camera;
use super::metadata::{HOLE_BYTES, Lost, Walked};
use super::tone::StatedColours;
use crate::frame::Size;

pub(super) use directory::{Directory, Field, LETTERS_MAX, samples_of};

pub(super) const NEW_SUBFILE_TYPE: u16 = 254;
const SUBFILE_TYPE: u16 = 255;
pub(super) const IMAGE_WIDTH: u16 = 256;
pub(super) const IMAGE_LENGTH: u16 = 257;
pub(super) const BITS_PER_SAMPLE: u16 = 258;
pub(super) const COMPRESSION: u16 = 259;
pub(super) const PHOTOMETRIC: u16 = 262;
pub(super) const FILL_ORDER: u16 = 266;
const TRANSFER_FUNCTION: u16 = 301;
const WHITE_POINT: u16 = 318;
const PRIMARIES: u16 = 319;
const RESOLUTION_UNIT: u16 = 296;
pub(super) const IPTC: u16 = 33723;
const IMAGE_RESOURCES: u16 = 34377;
pub(super) const STRIP_OFFSETS: u16 = 273;
pub(super) const SAMPLES_PER_PIXEL: u16 = 277;
pub(super) const ROWS_PER_STRIP: u16 = 278;
pub(super) const STRIP_BYTE_COUNTS: u16 = 279;
const PLANAR_CONFIGURATION: u16 = 284;
pub(super) const TILE_OFFSETS: u16 = 324;
pub(super) const TILE_BYTE_COUNTS: u16 = 325;
pub(super) const SUB_DIRECTORIES: u16 = 330;
const EXTRA_SAMPLES: u16 = 338;
pub(super) const SAMPLE_FORMAT: u16 = 339;
pub(super) const DNG_VERSION: u16 = 50706;
pub(super) const EXIF_DIRECTORY: u16 = 34665;
pub(super) const GPS_DIRECTORY: u16 = 34853;
pub(super) const MAKER_NOTE: u16 = 37500;
const PIXEL_WIDTH: u16 = 40962;

/// Varieties that are read, and what to do with others, for messages.
const READ: &str = "grey and RGB of 8 or 16 bits, as they are or packed by LZW, Deflate or \
                    PackBits; save it so in an image program";
/// Values of [`COMPRESSION`] in makers' raw photos (LibTIFF, tiff.h; ExifTool's table of
/// compressions): Sony, Epson, Samsung, Nikon, Kodak, Pentax.
const MAKERS_PACKINGS: [usize; 8] = [32767, 32769, 32770, 32772, 34713, 65000, 65024, 65535];
/// Ratio of the width that the camera states to the picture's, above which the picture is a
/// preview. Guess: in raw photos it is 10 to 40, and few people shrink a photo so much in TIFF.
const PREVIEW_TIMES: usize = 4;
/// Most sub-directories searched for a larger picture. Guess.
const BELOW_MAX: usize = 32;
/// Ranges of tags whose fields are used, carried or examined, or mean nothing beside the picture
/// (TIFF 6.0; LibTIFF's tags).
const RANGES_HELD: [RangeInclusive<u16>; 10] = [
    254..=259,
    262..=266,
    270..=284,
    286..=292,
    296..=297,
    305..=306,
    315..=325,
    330..=331,
    338..=347,
    512..=532,
];
/// Further tags of the kind in [`RANGES_HELD`].
const HELD: [u16; 15] = [
    301, 700, 33432, 33433, 33434, 33437, 33723, 34377, 34665, 34675, 34853, 34855, 36867, 37386,
    50341,
];
/// Tags of text fields that no result carries: document, page and host.
const TEXTS: [u16; 3] = [269, 285, 316];

/// Most values of a field, so that a hostile file does not keep the program busy. Guess.
const VALUES_MAX: usize = 1 << 20;

/// Whether `file` holds one plain picture, and no raw photo.
pub(super) fn is_single(file: &std::fs::File) -> ::tiff::TiffResult<bool> {
    let mut decoder = ::tiff::decoder::Decoder::new(std::io::BufReader::new(file))?;
    let mut has = |tag| decoder.find_tag(Tag::Unknown(tag)).map(|found| found.is_some());
    let is_raw = has(SUB_DIRECTORIES)? || has(DNG_VERSION)? || has(MAKER_NOTE)?;
    let colours = decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation)?;
    // White or black at zero, or RGB.
    Ok(!is_raw && !decoder.more_images() && matches!(colours, Some(0..=2)))
}

/// Walks the first directory of `bytes`.
///
/// # Errors
/// [`Flaw::Truncated`], [`Flaw::ZeroFilled`] or [`Flaw::Damaged`]; [`Flaw::Unread`] or
/// [`Flaw::Unsupported`] for a picture that is not read.
pub(super) fn walk(bytes: &[u8]) -> Result<Walked, Flaw> {
    let file = File::new(bytes);
    let directory = Directory::first(&file)?;
    let size = directory.size()?;
    if directory.is_of_raw(size) {
        return Err(tiff_of_a_camera());
    }
    if directory.is_reduced() {
        return Err(Flaw::Unsupported {
            kind: "TIFF",
            found: "a picture marked as the reduced copy of another one".to_owned(),
            allowed: "a file whose first picture is the photo; open it in an image program and \
                      save the photo by itself",
        });
    }
    directory.check_coding()?;
    let list = |tiles, strips| match directory.numbers(tiles)? {
        Some(numbers) => Ok(numbers),
        None => directory.numbers(strips).map(Option::unwrap_or_default),
    };
    let offsets = list(TILE_OFFSETS, STRIP_OFFSETS)?;
    let counts = list(TILE_BYTE_COUNTS, STRIP_BYTE_COUNTS)?;
    if size.area() == 0 || offsets.is_empty() || offsets.len() != counts.len() {
        let (strips, lengths) = (offsets.len(), counts.len());
        return Err(file.damaged(
            &format!("a picture of {size} in {strips} strips of {lengths} lengths"),
            "at least 1×1 and a length for every strip",
        ));
    }
    file.strips(&offsets, &counts, directory.number(COMPRESSION)?.unwrap_or(1) == 1)?;
    let mut walked = Walked { size: Some(size), ..Walked::default() };
    walked.lose(Lost::PICTURES, directory.next().is_ok_and(|next| next != 0));
    let has = |tag: &u16| directory.find(*tag).is_some();
    walked.lose(Lost::TEXTS, TEXTS.iter().any(has));
    let is_held =
        |tag: &u16| RANGES_HELD.iter().any(|range| range.contains(tag)) || HELD.contains(tag);
    let unknown = directory.entries.iter().map(|(tag, _)| tag);
    for tag in unknown.filter(|tag| !is_held(tag) && !TEXTS.contains(tag)).take(8) {
        walked.lost.insert(Lost::unknown("the TIFF's field", tag.to_string().as_bytes()));
    }
    walked.lose(Lost::MAKER_NOTES, directory.has_maker_notes());
    walked.colours = directory.stated_colours();
    walked.is_multiplied = directory.number(EXTRA_SAMPLES).ok().flatten() == Some(1);
    walked.lose(Lost::IPTC, has(&IPTC) || directory.has_iptc_resource().unwrap_or(false));
    // Unit 1 states no density, only a ratio of the sides.
    let unit = directory.number(RESOLUTION_UNIT).ok().flatten();
    walked.lose(Lost::DENSITY, unit.is_some_and(|unit| unit > 1));
    Ok(walked)
}

impl Directory<'_> {
    /// Width and height, 0 where they are not stated.
    fn size(&self) -> Result<Size, Flaw> {
        let side = |tag| self.number(tag).map(Option::unwrap_or_default);
        Ok(Size::new(side(IMAGE_WIDTH)?, side(IMAGE_LENGTH)?))
    }

    /// Whether the picture is marked as a reduced copy of another one in the file.
    fn is_reduced(&self) -> bool {
        let number = |tag| self.number(tag).ok().flatten();
        // In the newer field, bit 0 marks a reduced copy.
        number(NEW_SUBFILE_TYPE).is_some_and(|kind| kind & 1 == 1)
            || number(SUBFILE_TYPE) == Some(2)
    }

    /// Whether this picture, of `size`, is the preview in a camera's raw photo: a sub-directory
    /// holds a larger picture, a directory holds a sensor's counts in a maker's compression, or the
    /// EXIF data with a maker's notes state a far larger photo.
    fn is_of_raw(&self, size: Size) -> bool {
        let places = self.numbers(SUB_DIRECTORIES).ok().flatten().unwrap_or_default();
        let read = |at: usize| Directory::read(self.file, at).ok();
        let is_photo = |below: Directory<'_>| {
            below.size().is_ok_and(|below| below.area() > size.area()) || below.is_packed_by_maker()
        };
        let next = self.next().ok().filter(|&at| at > 0).and_then(read);
        let inner = places.into_iter().take(BELOW_MAX).filter_map(read);
        self.is_packed_by_maker()
            || next.is_some_and(|next| next.is_packed_by_maker())
            || inner.into_iter().any(is_photo)
            || self.below(EXIF_DIRECTORY).is_some_and(|exif| {
                let width = exif.number(PIXEL_WIDTH).ok().flatten().unwrap_or(0);
                exif.find(MAKER_NOTE).is_some() && width > PREVIEW_TIMES * size.width
            })
    }

    fn is_packed_by_maker(&self) -> bool {
        let packing = self.number(COMPRESSION).ok().flatten();
        packing.is_some_and(|packing| MAKERS_PACKINGS.contains(&packing))
    }

    /// Whether the EXIF data contain a camera maker's notes.
    pub(super) fn has_maker_notes(&self) -> bool {
        self.below(EXIF_DIRECTORY).is_some_and(|exif| exif.find(MAKER_NOTE).is_some())
    }

    /// The colours that the directory states, if any (TIFF 6.0, §20).
    fn stated_colours(&self) -> Option<StatedColours> {
        let reals = |tag| self.reals(tag).ok().flatten().unwrap_or_default();
        let xy = [reals(WHITE_POINT), reals(PRIMARIES)].concat();
        let xy: Option<[f64; 8]> =
            xy.into_iter().map(f64::from).collect::<Vec<_>>().try_into().ok();
        let curves = self.numbers(TRANSFER_FUNCTION).ok().flatten().unwrap_or_default();
        let steps = 1usize << self.number(BITS_PER_SAMPLE).ok().flatten().unwrap_or(1).min(16);
        let tables = curves
            .chunks_exact(steps)
            .map(|table| table.iter().map(|&v| u16::try_from(v).unwrap_or(u16::MAX)).collect());
        match (curves.len() / steps, xy) {
            (1 | 3, xy) => Some(StatedColours::Tables { tables: tables.collect(), xy }),
            (_, Some(xy)) => Some(StatedColours::Measured { gamma: None, xy: Some(xy) }),
            _ => None,
        }
    }

    /// Checks that inks, compression and depth are supported (TIFF 6.0; the last three compressions
    /// by LibTIFF).
    fn check_coding(&self) -> Result<(), Flaw> {
        // A missing field has the value 1: grey, uncompressed, one bit, whole numbers.
        let number = |tag| self.number(tag).map(|number| number.unwrap_or(1));
        let (inks, packing, bits) =
            (number(PHOTOMETRIC)?, number(COMPRESSION)?, number(BITS_PER_SAMPLE)?);
        let is_deep = bits > 16 && number(SAMPLE_FORMAT)? != 3;
        let is_parted = number(PLANAR_CONFIGURATION)? == 2 && self.find(TILE_OFFSETS).is_some();
        let is_reversed = number(FILL_ORDER)? == 2;
        let found = match (inks, packing) {
            (3, _) => "a palette of colours",
            (5, _) => "four inks (CMYK)",
            (6, _) => "brightness and differences of colours (YCbCr)",
            (8, _) => "brightness and colours of CIELab",
            (_, 2..=4) => "a fax's compression",
            (_, 6 | 7) => "a JPEG's compression",
            (_, 34925) => "compression by LZMA",
            (_, 50000) => "compression by Zstandard",
            (_, 50001) => "a WebP's compression",
            _ if is_deep => &*format!("samples of {bits} bits"),
            _ if is_parted => "tiles of a single colour each",
            _ if is_reversed => "bytes with their bits reversed",
            _ => return Ok(()),
        };
        Err(Flaw::Unsupported { kind: "TIFF", found: found.to_owned(), allowed: READ })
    }

    /// Whether Photoshop's image resources contain IPTC data.
    fn has_iptc_resource(&self) -> Result<bool, Flaw> {
        let Some(entry) = self.find(IMAGE_RESOURCES) else { return Ok(false) };
        let (length, at) = self.file.place(entry, 1)?;
        let resources = at.checked_add(length).and_then(|to| self.file.bytes.get(at..to));
        Ok(resources.is_some_and(iptc::has_iptc))
    }
}

/// A TIFF's bytes, with the byte order of its header.
pub(super) struct File<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) big_endian: bool,
}

impl<'a> File<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> File<'a> {
        File { bytes, big_endian: bytes.starts_with(b"MM") }
    }

    /// Checks that these strips or tiles, `plain` or packed, lie in the file and, if packed, are no
    /// hole.
    pub(super) fn strips(
        &self,
        offsets: &[usize],
        counts: &[usize],
        plain: bool,
    ) -> Result<(), Flaw> {
        for (&from, &length) in offsets.iter().zip(counts) {
            let Some(strip) = from.checked_add(length).and_then(|to| self.bytes.get(from..to))
            else {
                return Err(self.ended_early("picture data past the end"));
            };
            // Zeros in plain data are black pixels. Packed data neither begin nor end with many.
            let zeros =
                |bytes: &mut dyn Iterator<Item = &u8>| bytes.take_while(|b| **b == 0).count();
            let (head, tail) = (zeros(&mut strip.iter()), zeros(&mut strip.iter().rev()));
            if !plain && head.max(tail) >= HOLE_BYTES.min(length) && length > 0 {
                let (from, to) = match head > tail {
                    true => (from, from + head),
                    false => (from + length - tail, from + length),
                };
                return Err(Flaw::ZeroFilled { from, to, length: self.bytes.len() });
            }
        }
        Ok(())
    }

    fn array<const N: usize>(&self, at: usize) -> Result<[u8; N], Flaw> {
        let here = self.bytes.get(at..).and_then(|rest| rest.first_chunk().copied());
        here.ok_or_else(|| self.ended_early("a directory past the end"))
    }

    pub(super) fn u16(&self, at: usize) -> Result<u16, Flaw> {
        let b = self.array(at)?;
        Ok(if self.big_endian { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
    }

    pub(super) fn u32(&self, at: usize) -> Result<u32, Flaw> {
        let b = self.array(at)?;
        Ok(if self.big_endian { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) })
    }

    /// The whole numbers (BYTE, SHORT, LONG or IFD) of the entry at `entry`.
    pub(super) fn numbers(&self, entry: usize) -> Result<Vec<usize>, Flaw> {
        let Field { kind, bytes, .. } = Field::read(self, entry, VALUES_MAX)?;
        let width = match kind {
            1 | 7 => 1,
            3 => 2,
            4 | 13 => 4,
            other => return Err(self.damaged(&format!("a field of type {other}"), "SHORT or LONG")),
        };
        let number = |value: &[u8]| value.iter().rev().fold(0, |sum, &b| sum << 8 | usize::from(b));
        Ok(bytes.chunks_exact(width).map(number).collect())
    }

    /// The number of values of the entry at `entry`, `width` bytes each, and where they begin.
    pub(super) fn place(&self, entry: usize, width: usize) -> Result<(usize, usize), Flaw> {
        let count = self.u32(entry + 4)? as usize;
        let is_here = count.saturating_mul(width) <= 4;
        Ok((count, if is_here { entry + 8 } else { self.u32(entry + 8)? as usize }))
    }

    pub(super) fn first(&self, entry: usize) -> Result<usize, Flaw> {
        self.numbers(entry)?
            .first()
            .copied()
            .ok_or_else(|| self.damaged("an empty field", "one number"))
    }

    pub(super) fn ended_early(&self, found: &str) -> Flaw {
        let found = format!("{found} of {} bytes", self.bytes.len());
        let end = "the end of its last strip and its directory";
        Flaw::hole_or(self.bytes, Flaw::Truncated { kind: "TIFF", found, end })
    }

    /// The flaw of a damaged file; a directory in a tail of zeros is a hole, not damage.
    pub(super) fn damaged(&self, found: &str, allowed: &str) -> Flaw {
        let (found, allowed) = (found.to_owned(), allowed.to_owned());
        Flaw::hole_or(self.bytes, Flaw::Damaged { kind: "TIFF", found, allowed })
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
    fn lost_texts_and_iptc_are_noted() {
        let lost = |tag, kind, data: &[u8]| {
            let walked = walk(&with(tag, kind, data.len() as u32, data)).unwrap();
            walked.lost.into_iter().collect::<Vec<_>>()
        };
        assert_eq!(lost(NEW_SUBFILE_TYPE, 4, &[0; 4]), []);
        for (tag, wanted) in [(315, vec![]), (271, vec![]), (269, vec![Lost::TEXTS])] {
            assert_eq!(lost(tag, 2, b"camera\0\0"), wanted, "{tag}");
        }
        let other = lost(65111, 2, b"camera\0\0").remove(0).note();
        assert!(other.contains("65111"), "{other}");
        assert_eq!(lost(IPTC, 7, b"\x1c\x02\x50\0\x03Ada"), [Lost::IPTC]);
        let resources = |number: u8| [b"8BIM\x04", &[number, 0, 0, 0, 0, 0, 2, 1, 1][..]].concat();
        assert_eq!(lost(IMAGE_RESOURCES, 1, &resources(4)), [Lost::IPTC]);
        assert_eq!(lost(IMAGE_RESOURCES, 1, &resources(5)), []);
        let past = walk(&with(IMAGE_RESOURCES, 1, 9999, b"8BIM")).unwrap();
        assert!(past.lost.is_empty(), "resources past the end are ignored");
    }

    #[test]
    fn a_preview_of_a_raw_photo_is_never_taken_for_the_photo() {
        let file = |kind: u32| with(NEW_SUBFILE_TYPE, 4, kind, &[]);
        assert_eq!(walk(&file(0)).unwrap().size, Some(Size::new(16, 12)));
        let words = walk(&file(1)).err().map(|flaw| flaw.to_string()).unwrap_or_default();
        assert!(words.contains("reduced copy") && words.contains("save the photo"), "{words}");
        // Also refused: by the older field, a maker's compression, a larger picture below it.
        assert!(walk(&with(SUBFILE_TYPE, 4, 2, &[])).is_err());
        let words = walk(&with(COMPRESSION, 4, 34713, &[])).unwrap_err().to_string();
        assert!(words.contains("a camera raw photo") && words.contains("develop it"), "{words}");
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
    fn black_pictures_are_whole_and_side_fields_no_reason() {
        let black = |packing: u32| {
            let mut bytes = with(COMPRESSION, 4, packing, &[]);
            let from = bytes.len() - 192;
            bytes[from..].fill(0);
            walk(&bytes)
        };
        assert!(black(1).is_ok(), "plain pixels");
        assert!(matches!(black(5), Err(Flaw::ZeroFilled { .. })), "LZW codes no picture so");
        let large = vec![7; VALUES_MAX + 1];
        assert!(walk(&with(IMAGE_RESOURCES, 7, large.len() as u32, &large)).is_ok());
        assert!(walk(&with(RESOLUTION_UNIT, 12, 9, &[])).is_ok(), "a number of another type");
    }

    #[test]
    fn pictures_that_are_not_read_have_a_reason() {
        for (tag, value, words) in [
            (PHOTOMETRIC, 5, "four inks (CMYK)"),
            (PHOTOMETRIC, 3, "a palette"),
            (PHOTOMETRIC, 8, "CIELab"),
            (FILL_ORDER, 2, "bits reversed"),
            (COMPRESSION, 50000, "Zstandard"),
            (COMPRESSION, 7, "a JPEG's compression"),
            (BITS_PER_SAMPLE, 32, "samples of 32 bits"),
        ] {
            let flaw = walk(&with(tag, 4, value, &[])).unwrap_err().to_string();
            assert!(flaw.contains(words), "{words}: {flaw}");
        }
        let deep =
            crate::picture::decode::decode(&with(BITS_PER_SAMPLE, 4, 12, &[]), &Default::default());
        let flaw = deep.unwrap_err().to_string();
        assert!(flaw.contains("found 1 numbers of 12 bits a pixel"), "{flaw}");
        let mut parted = with(PLANAR_CONFIGURATION, 4, 2, &[]);
        assert!(walk(&parted).is_ok(), "strips of a single colour each");
        let tiles = [(STRIP_OFFSETS, TILE_OFFSETS), (STRIP_BYTE_COUNTS, TILE_BYTE_COUNTS)];
        for (strips, tiles) in tiles.map(|(from, to)| (from.to_le_bytes(), to.to_le_bytes())) {
            let at = parted.windows(2).position(|of| of == strips).unwrap();
            parted[at..at + 2].copy_from_slice(&tiles);
        }
        let flaw = walk(&parted).unwrap_err().to_string();
        assert!(flaw.contains("tiles of a single colour each"), "{flaw}");
        let light: Vec<u8> = (0..6u16).flat_map(|n| (60000 * (n % 2)).to_le_bytes()).collect();
        let stated = walk(&with(TRANSFER_FUNCTION, 3, 6, &light));
        let Some(StatedColours::Tables { tables, xy: None }) = stated.unwrap().colours else {
            panic!("a table of one bit")
        };
        assert_eq!(tables, [[0, 60000]; 3]);
    }
}
