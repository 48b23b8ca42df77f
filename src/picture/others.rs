//! Walks a BMP, GIF, PNM or WebP to its end; the decoders check the rest.

use std::io::Cursor;

use image::ImageDecoder;
use image::codecs::pnm::PnmDecoder;

use super::Flaw;
use super::kind::Content;
use super::metadata::{HOLE_BYTES, Lost, PartTable, Walked};

/// Densities that programs write into a BMP by default, pixels per metre: none, 72 and 96 an inch.
const USUAL_DENSITIES: [u32; 3] = [0, 2835, 3780];

/// Walks `bytes` of a BMP, GIF, PNM or WebP to the end that they state (BITMAPFILEHEADER; GIF89a,
/// §27; RFC 9649, §2.4).
pub(super) fn walk(bytes: &[u8], content: Content) -> Result<Walked, Flaw> {
    let length = bytes.len();
    let zeros = bytes.iter().rev().take_while(|&&b| b == 0).count();
    let stated = word(bytes, 4).map_or(usize::MAX, |length| (length as usize).saturating_add(8));
    let gif = if content == Content::Gif { gif_blocks(bytes) } else { None };
    let (whole, end) = match content {
        Content::Gif => (gif.is_some(), "the end of its first picture"),
        Content::Bmp => (bmp_end(bytes) <= length, "its last row"),
        Content::Pnm => (pnm_end(bytes) <= length, "its last row"),
        _ => (stated <= length, "the length it states"),
    };
    // Only zeros before the stated end are a hole; what follows the end is not the picture's.
    let is_hole = content == Content::Webp && (length - zeros).saturating_add(HOLE_BYTES) <= stated;
    if !whole || is_hole {
        let found = format!("an end after {length} bytes");
        let cut = Flaw::Truncated { kind: content.name(), found, end };
        return Err(Flaw::hole_or(bytes, cut));
    }
    let mut walked = Walked::default();
    match content {
        Content::Gif => {
            let GifBlocks { pictures, extensions, .. } = gif.unwrap_or_default();
            walked.lose(Lost::PICTURES, pictures > 1);
            for name in extensions {
                walked.look_up(&GIF_EXTENSIONS, "the GIF's data", name);
            }
        }
        Content::Webp => {
            let names = webp_chunks(bytes);
            for name in &names {
                walked.look_up(&WEBP_CHUNKS, "the WebP's data", name);
            }
            walked.lose(Lost::PICTURES, names.iter().filter(|name| **name == *b"ANMF").count() > 1);
        }
        Content::Pnm => {}
        _ => {
            let density = word(bytes, 38);
            let is_unusual = density.is_some_and(|density| !USUAL_DENSITIES.contains(&density));
            walked.lose(Lost::DENSITY, is_unusual);
            // bV5CSType: an embedded or linked profile.
            let has_profile = word(bytes, 14).is_some_and(|header| header >= 124)
                && matches!(bytes.get(70..74), Some(b"DEBM" | b"KNIL"));
            walked.lose(Lost::PROFILE, has_profile);
        }
    }
    Ok(walked)
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
}

/// The place at which the rows of a BMP end; for compressed rows, the stated file length
/// (BITMAPFILEHEADER, BITMAPINFOHEADER). For others that length is often a few bytes off, or
/// absent.
fn bmp_end(bytes: &[u8]) -> usize {
    let field = |at: usize| word(bytes, at).map_or(usize::MAX, |value| value as usize);
    let half = |at: usize| field(at) & 0xffff;
    let (begin, header) = (field(10), field(14));
    let (width, height, bits) = match header {
        12 => (half(18), half(20), half(24)),
        _ => (
            field(18),
            word(bytes, 22).map_or(0, |h| h.cast_signed().unsigned_abs() as usize),
            half(28),
        ),
    };
    let is_plain = header == 12 || matches!(field(30), 0 | 3 | 6);
    if !is_plain {
        return field(2);
    }
    // Each row ends at a multiple of four bytes.
    let row = width.saturating_mul(bits).div_ceil(32).saturating_mul(4);
    begin.saturating_add(row.saturating_mul(height))
}

/// The place at which the samples of a binary PNM end (Netpbm, pgm(5) and ppm(5)); the file's
/// length for other varieties, which the decoder checks.
fn pnm_end(bytes: &[u8]) -> usize {
    if !bytes.starts_with(b"P5") && !bytes.starts_with(b"P6") {
        return bytes.len();
    }
    let Ok(decoder) = PnmDecoder::new(Cursor::new(bytes)) else { return usize::MAX };
    let length = decoder.total_bytes();
    usize::try_from(decoder.into_inner().0.position().saturating_add(length)).unwrap_or(usize::MAX)
}

/// Extensions of a GIF by their label and, behind its length, the application's name, and what is
/// lost with them.
const GIF_EXTENSIONS: PartTable = PartTable {
    used: &[b"\xf9", b"\xff\x0bNETSCAPE2.0", b"\xff\x0bANIMEXTS1.0"],
    lost: &[
        (b"\x01", Lost::TEXTS),
        (b"\xfe", Lost::TEXTS),
        (b"\xff\x0bXMP DataXMP", Lost::XMP),
        (b"\xff\x0bICCRGBG1012", Lost::PROFILE),
    ],
};

/// Chunks of a WebP, and what is lost with them.
const WEBP_CHUNKS: PartTable = PartTable {
    used: &[b"VP8", b"ALPH", b"ANIM", b"ANMF", b"ICCP", b"EXIF"],
    lost: &[(b"XMP ", Lost::XMP)],
};

#[derive(Debug, Default, PartialEq)]
struct GifBlocks<'a> {
    pictures: usize,
    /// Place at which the first picture ends.
    first_end: Option<usize>,
    /// Label and first data block of each extension.
    extensions: Vec<&'a [u8]>,
}

/// The blocks of a GIF up to its trailer, or up to damage behind its first picture; `None` if that
/// picture is cut (GIF89a, §17 to §26).
fn gif_blocks(bytes: &[u8]) -> Option<GifBlocks<'_>> {
    let mut found = GifBlocks::default();
    let is_all = found.read(bytes).is_some();
    let rest = &bytes[found.first_end?..];
    let zeros = rest.iter().take_while(|&&b| b == 0).count();
    // In a hole, the first zero looks like the end of the picture.
    (is_all || rest.is_empty() || zeros < HOLE_BYTES.min(rest.len())).then_some(found)
}

impl<'a> GifBlocks<'a> {
    fn read(&mut self, bytes: &'a [u8]) -> Option<()> {
        // Length in bytes of the colour table that `flags` describe.
        let table = |flags: u8| if flags & 0x80 == 0 { 0 } else { 3usize << ((flags & 7) + 1) };
        let mut at = 13 + table(*bytes.get(10)?);
        loop {
            match bytes.get(at)? {
                b'!' => {
                    at += 2;
                    self.extensions.push(bytes.get(at - 1..(at + 12).min(bytes.len()))?);
                }
                b',' => {
                    self.pictures += 1;
                    at += 10 + table(*bytes.get(at + 9)?) + 1;
                }
                b';' => return Some(()),
                _ => return None,
            }
            // An empty block ends the blocks of data.
            while let length @ 1.. = usize::from(*bytes.get(at)?) {
                at += 1 + length;
            }
            at += 1;
            self.first_end = self.first_end.or((self.pictures > 0).then_some(at));
        }
    }
}

/// The names of a WebP's chunks (RFC 9649, §2.3).
fn webp_chunks(bytes: &[u8]) -> Vec<[u8; 4]> {
    let (mut at, mut names) = (12usize, Vec::new());
    let end = word(bytes, 4).map_or(0, |length| length as usize).saturating_add(8);
    let bytes = &bytes[..bytes.len().min(end)];
    while let (Some(name), Some(length)) = (bytes.get(at..at + 4), word(bytes, at + 4)) {
        names.extend(<[u8; 4]>::try_from(name));
        at = at.saturating_add(8).saturating_add((length as usize).next_multiple_of(2));
        if at > bytes.len() {
            break;
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_whole_to_their_last_row() {
        let mut bmp = Vec::new();
        let pixels = [90; 3 * 5 * 4];
        image::ImageEncoder::write_image(
            image::codecs::bmp::BmpEncoder::new(&mut bmp),
            &pixels,
            5,
            4,
            image::ExtendedColorType::Rgb8,
        )
        .unwrap();
        // A stated length that is too long does not matter.
        bmp[2] += 2;
        assert!(walk(&bmp, Content::Bmp).is_ok());
        assert!(walk(&bmp[..bmp.len() - 1], Content::Bmp).is_err());
        for (header, each) in [("P6\n#a 9\n5 4 255\n", 3), ("P5 5 4 65535\n", 2)] {
            let whole = [header.as_bytes(), &vec![0; 5 * 4 * each]].concat();
            assert!(walk(&whole, Content::Pnm).is_ok(), "black, and no hole");
            assert!(walk(&whole[..whole.len() - 1], Content::Pnm).is_err());
        }
        assert!(walk(b"P6 5", Content::Pnm).is_err());
    }

    #[test]
    fn lost_pictures_and_texts_are_noted() {
        // A screen with two colours; a comment; two pictures with two bytes of data each.
        let mut gif = b"GIF89a\x01\0\x01\0\x80\0\0".to_vec();
        gif.extend([0; 6]);
        gif.extend(b"!\xfe\x02hi\0");
        (0..2).for_each(|_| gif.extend(b",\0\0\0\0\x01\0\x01\0\0\x02\x02\x4c\x01\0"));
        gif.push(b';');
        assert_eq!(gif_blocks(&gif).map(|found| found.pictures), Some(2));
        let lost = walk(&gif, Content::Gif).unwrap().lost;
        assert!(lost.into_iter().eq([Lost::TEXTS, Lost::PICTURES]));
        let with = |name: &[u8]| {
            let extension = [b"!\xff\x0b", name, b"\x03\x01\0\0\0"].concat();
            walk(&[&gif[..19], &extension, &gif[19..]].concat(), Content::Gif).unwrap().lost
        };
        assert!(with(b"NETSCAPE2.0").into_iter().eq([Lost::TEXTS, Lost::PICTURES]));
        assert!(with(b"XMP DataXMP").contains(&Lost::XMP));
        // A file counts as whole from the end of the first picture on, unless a hole follows.
        let first_end = gif.len() - 1 - 15;
        let whole = |bytes: &[u8]| walk(bytes, Content::Gif).is_ok();
        assert!((0..first_end).all(|cut| !whole(&gif[..cut])));
        assert!((first_end..gif.len()).all(|cut| whole(&gif[..cut])));
        for hole in [1, 2000] {
            assert!(!whole(&[&gif[..first_end], &vec![0; hole]].concat()), "{hole}");
        }
        let out_of_order = [&gif[..first_end], &[0; 4096], &gif[first_end..]].concat();
        assert!(!whole(&out_of_order));

        let chunk = |name: &[u8; 4], data: &[u8]| {
            let padded = if data.len() % 2 == 1 { &b"\0"[..] } else { b"" };
            [&name[..], &(data.len() as u32).to_le_bytes(), data, padded].concat()
        };
        let webp = |chunks: &[Vec<u8>]| {
            let body = chunks.concat();
            let head = [b"RIFF", &(body.len() as u32 + 4).to_le_bytes()[..], b"WEBP"].concat();
            walk(&[head, body].concat(), Content::Webp)
                .unwrap()
                .lost
                .into_iter()
                .collect::<Vec<_>>()
        };
        let frame = || chunk(b"ANMF", b"abc");
        assert_eq!(webp(&[frame(), chunk(b"EXIF", b"")]), []);
        assert_eq!(webp(&[frame(), frame()]), [Lost::PICTURES]);
        assert!(webp(&[chunk(b"Zoom", b"")]).remove(0).note().contains("Zoom"));
    }
}
