//! Walks a BMP, GIF or WebP to its end; the decoders check the rest.

use super::Flaw;
use super::kind::Content;
use super::metadata::{HOLE_BYTES, Lost, Walked};

/// Pixels a metre that programs write into a BMP by default: none, 72 and 96 an inch.
const USUAL_DENSITIES: [u32; 3] = [0, 2835, 3780];

/// Walks `bytes` of a BMP, GIF or WebP to the end that they state (BITMAPFILEHEADER; GIF89a, §27;
/// RFC 9649, §2.4).
///
/// # Errors
/// [`Flaw::Truncated`] or [`Flaw::ZeroFilled`].
pub(super) fn walk(bytes: &[u8], content: Content) -> Result<Walked, Flaw> {
    let length = bytes.len();
    let zeros = bytes.iter().rev().take_while(|&&b| b == 0).count();
    if content != Content::Bmp && zeros >= HOLE_BYTES {
        return Err(Flaw::ZeroFilled { from: length - zeros, to: length, length });
    }
    let stated = |at: usize| word(bytes, at).map_or(usize::MAX, |length| length as usize);
    let (whole, end) = match content {
        Content::Gif => (bytes[..length - zeros].ends_with(b";"), "its trailer"),
        // A program that could not seek back states no length.
        Content::Bmp => (stated(2) <= length || stated(2) == 0, "the length it states"),
        _ => (stated(4).saturating_add(8) <= length, "the length it states"),
    };
    if !whole {
        let found = format!("an end after {length} bytes");
        return Err(Flaw::Truncated { kind: content.name(), found, end });
    }
    let mut walked = Walked::default();
    match content {
        Content::Gif => {
            let GifBlocks { pictures, has_comment } = gif_blocks(bytes).unwrap_or_default();
            walked.lose(Lost::Pictures, pictures > 1);
            walked.lose(Lost::Texts, has_comment);
        }
        Content::Webp => walked.lose(Lost::Pictures, webp_pictures(bytes) > 1),
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
            _ => return Some(found),
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
