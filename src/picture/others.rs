//! Walks a BMP, GIF, PNM or WebP to its end; the decoders check the rest.

use super::Flaw;
use super::kind::Content;
use super::metadata::{HOLE_BYTES, Lost, Walked};

/// Pixels a metre that programs write into a BMP by default: none, 72 and 96 an inch.
const USUAL_DENSITIES: [u32; 3] = [0, 2835, 3780];

/// Walks `bytes` of a BMP, GIF, PNM or WebP to the end that they state (BITMAPFILEHEADER; GIF89a,
/// §27; RFC 9649, §2.4).
///
/// # Errors
/// [`Flaw::Truncated`] or [`Flaw::ZeroFilled`].
pub(super) fn walk(bytes: &[u8], content: Content) -> Result<Walked, Flaw> {
    let length = bytes.len();
    let zeros = bytes.iter().rev().take_while(|&&b| b == 0).count();
    let stated = |at: usize| word(bytes, at).map_or(usize::MAX, |length| length as usize);
    let gif = if content == Content::Gif { gif_blocks(bytes) } else { None };
    let (whole, end) = match content {
        Content::Gif => (gif.is_some(), "its trailer"),
        Content::Bmp => (bmp_end(bytes) <= length, "its last row"),
        Content::Pnm => (pnm_end(bytes) <= length, "its last row"),
        _ => (stated(4).saturating_add(8) <= length, "the length it states"),
    };
    // Bytes behind the end are none of the picture's.
    let is_hole = content == Content::Webp
        && (length - zeros).saturating_add(HOLE_BYTES) <= stated(4).saturating_add(8);
    if !whole || is_hole {
        let found = format!("an end after {length} bytes");
        let cut = Flaw::Truncated { kind: content.name(), found, end };
        return Err(Flaw::hole_or(bytes, cut));
    }
    let mut walked = Walked::default();
    match content {
        Content::Gif => {
            let GifBlocks { pictures, has_comment } = gif.unwrap_or_default();
            walked.lose(Lost::Pictures, pictures > 1);
            walked.lose(Lost::Texts, has_comment);
        }
        Content::Webp => walked.lose(Lost::Pictures, webp_pictures(bytes) > 1),
        Content::Pnm => {}
        _ => {
            let density = word(bytes, 38);
            let is_unusual = density.is_some_and(|density| !USUAL_DENSITIES.contains(&density));
            walked.lose(Lost::Density, is_unusual);
        }
    }
    Ok(walked)
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
}

/// Where the rows of a BMP end; for packed rows the length that it states (BITMAPFILEHEADER,
/// BITMAPINFOHEADER). The stated length of others is often a few bytes off, or absent.
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

/// Where the samples of a binary PNM end (Netpbm, pgm(5) and ppm(5)); the file's length for its
/// other varieties, which the decoder checks.
fn pnm_end(bytes: &[u8]) -> usize {
    let samples = match bytes.get(..2) {
        Some(b"P5") => 1,
        Some(b"P6") => 3,
        _ => return bytes.len(),
    };
    let mut at = 2;
    let mut number = || {
        while let Some(byte) = bytes.get(at).filter(|b| !b.is_ascii_digit()) {
            // A comment goes on to the end of its line.
            let comment = bytes[at..].iter().take_while(|&&b| b != b'\n').count();
            at += if *byte == b'#' { comment.max(1) } else { 1 };
        }
        let digits = bytes[at..].iter().take_while(|b| b.is_ascii_digit()).count();
        at += digits;
        std::str::from_utf8(&bytes[at - digits..at]).ok()?.parse::<usize>().ok()
    };
    let (Some(width), Some(height), Some(most)) = (number(), number(), number()) else {
        return usize::MAX;
    };
    let each = samples * if most > 255 { 2 } else { 1 };
    // One blank ends the header.
    width.saturating_mul(height).saturating_mul(each).saturating_add(at + 1)
}

#[derive(Debug, Default, PartialEq)]
struct GifBlocks {
    pictures: usize,
    has_comment: bool,
}

/// The blocks of a GIF to its trailer; `None` where they are cut (GIF89a, §17 to §26).
fn gif_blocks(bytes: &[u8]) -> Option<GifBlocks> {
    // Bytes of the colour table that `flags` state.
    let table = |flags: u8| if flags & 0x80 == 0 { 0 } else { 3usize << ((flags & 7) + 1) };
    let mut at = 13 + table(*bytes.get(10)?);
    let mut found = GifBlocks::default();
    loop {
        match bytes.get(at)? {
            b'!' => {
                found.has_comment |= *bytes.get(at + 1)? == 0xfe;
                at += 2;
            }
            b',' => {
                found.pictures += 1;
                at += 10 + table(*bytes.get(at + 9)?) + 1;
            }
            b';' => return Some(found),
            _ => return None,
        }
        // Blocks of data, to the empty one.
        loop {
            let length = usize::from(*bytes.get(at)?);
            at += 1 + length;
            if length == 0 {
                break;
            }
        }
    }
}

/// The number of frames of an animated WebP, 0 for a still one (RFC 9649, §2.7.1).
fn webp_pictures(bytes: &[u8]) -> usize {
    let (mut at, mut pictures) = (12usize, 0);
    while let (Some(name), Some(length)) = (bytes.get(at..at + 4), word(bytes, at + 4)) {
        pictures += usize::from(name == b"ANMF");
        at = at.saturating_add(8).saturating_add((length as usize).next_multiple_of(2));
        if at > bytes.len() {
            break;
        }
    }
    pictures
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
        assert_eq!(gif_blocks(&gif), Some(GifBlocks { pictures: 2, has_comment: true }));
        let lost = walk(&gif, Content::Gif).unwrap().lost;
        assert!(lost.into_iter().eq([Lost::Pictures, Lost::Texts]));
        (0..gif.len()).for_each(|cut| {
            let _ = gif_blocks(&gif[..cut]);
        });

        let chunk = |name: &[u8; 4], data: &[u8]| {
            let padded = if data.len() % 2 == 1 { &b"\0"[..] } else { b"" };
            [&name[..], &(data.len() as u32).to_le_bytes(), data, padded].concat()
        };
        let webp = [b"RIFF\0\0\0\0WEBP".to_vec(), chunk(b"ANMF", b"abc"), chunk(b"ANMF", b"")];
        assert_eq!(webp_pictures(&webp.concat()), 2);
        assert_eq!(webp_pictures(&webp[..2].concat()), 1);
    }
}
