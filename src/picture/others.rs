//! Whether a BMP, GIF or WebP is all there. What such files hold is their decoders' to say.

use super::Flaw;
use super::kind::Content;
use super::losses::{DENSITY_LOST, WORDS_LOST};

/// Zeros at the end of packed data: as many as a file system's block, and no picture. Guess.
const HOLE_BYTES: usize = 512;

/// Pixels a metre that programs write into a BMP about which nobody said anything: none, 72 and 96
/// an inch.
const USUAL_DENSITIES: [u32; 3] = [0, 2835, 3780];

/// What of a whole BMP, GIF or WebP a result has not.
pub(super) fn losses(bytes: &[u8], content: Content) -> Vec<String> {
    let (frames, words) = match content {
        Content::Gif => frames_of_gif(bytes).unwrap_or_default(),
        Content::Webp => (frames_of_webp(bytes), false),
        _ => (1, false),
    };
    let density = content == Content::Bmp
        && word(bytes, 38).is_some_and(|found| !USUAL_DENSITIES.contains(&found));
    let kind = content.name();
    let moving = format!("only the first of the {frames} pictures of this {kind} was restored");
    let told =
        [(frames > 1, moving), (words, WORDS_LOST.to_owned()), (density, DENSITY_LOST.to_owned())];
    told.into_iter().filter(|(is, _)| *is).map(|(_, words)| words).collect()
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
}

/// Pictures of a GIF, and whether a comment is among them (GIF89a, §17 to §26).
fn frames_of_gif(bytes: &[u8]) -> Option<(usize, bool)> {
    // A table of colours, if its flag says so, behind the flags and some bytes more.
    let table = |flags: u8| if flags & 0x80 == 0 { 0 } else { 3usize << ((flags & 7) + 1) };
    let mut at = 13 + table(*bytes.get(10)?);
    let (mut frames, mut words) = (0, false);
    loop {
        match bytes.get(at)? {
            b'!' => {
                words |= *bytes.get(at + 1)? == 0xfe;
                at += 2;
            }
            b',' => {
                frames += 1;
                at += 10 + table(*bytes.get(at + 9)?) + 1;
            }
            _ => return Some((frames, words)),
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

/// Pictures of a WebP (RFC 9649, §2.7.1).
fn frames_of_webp(bytes: &[u8]) -> usize {
    let (mut at, mut frames) = (12usize, 0);
    while let (Some(name), Some(length)) = (bytes.get(at..at + 4), word(bytes, at + 4)) {
        frames += usize::from(name == b"ANMF");
        at = at.saturating_add(8).saturating_add((length as usize).next_multiple_of(2));
        if at > bytes.len() {
            break;
        }
    }
    frames
}

/// Sees that `bytes` of a BMP, GIF or WebP go on to the end that they state (BITMAPFILEHEADER;
/// GIF89a, §27; RFC 9649, §2.4).
///
/// # Errors
/// [`Flaw::Truncated`] or [`Flaw::ZeroFilled`].
pub(super) fn walk(bytes: &[u8], content: Content) -> Result<(), Flaw> {
    let stated = |at: usize| {
        let field = bytes.get(at..at + 4).and_then(|b| <[u8; 4]>::try_from(b).ok());
        field.map_or(usize::MAX, |b| u32::from_le_bytes(b) as usize)
    };
    let length = bytes.len();
    let zeros = bytes.iter().rev().take_while(|&&b| b == 0).count();
    if content != Content::Bmp && zeros >= HOLE_BYTES {
        return Err(Flaw::ZeroFilled { from: length - zeros, to: length, length });
    }
    let (whole, end) = match content {
        Content::Gif => (bytes[..length - zeros].ends_with(b";"), "its trailer"),
        // A stream that was not rewound to state its length has none.
        Content::Bmp => (stated(2) <= length || stated(2) == 0, "the length it states"),
        _ => (stated(4).saturating_add(8) <= length, "the length it states"),
    };
    let found = format!("an end after {length} bytes");
    if whole { Ok(()) } else { Err(Flaw::Truncated { kind: content.name(), found, end }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_and_what_is_said_in_words_is_told_as_lost() {
        // A screen with two colours; a comment; two pictures with two bytes of data each.
        let mut gif = b"GIF89a\x01\0\x01\0\x80\0\0".to_vec();
        gif.extend([0; 6]);
        gif.extend(b"!\xfe\x02hi\0");
        (0..2).for_each(|_| gif.extend(b",\0\0\0\0\x01\0\x01\0\0\x02\x02\x4c\x01\0"));
        gif.push(b';');
        assert_eq!(frames_of_gif(&gif), Some((2, true)));
        let told = losses(&gif, Content::Gif);
        assert!(told[0].contains("first of the 2 pictures") && told[1] == WORDS_LOST, "{told:?}");
        (0..gif.len()).for_each(|cut| drop(losses(&gif[..cut], Content::Gif)));

        let chunk = |name: &[u8; 4], data: &[u8]| {
            let padded = if data.len() % 2 == 1 { &b"\0"[..] } else { b"" };
            [&name[..], &(data.len() as u32).to_le_bytes(), data, padded].concat()
        };
        let webp = [b"RIFF\0\0\0\0WEBP".to_vec(), chunk(b"ANMF", b"abc"), chunk(b"ANMF", b"")];
        assert!(losses(&webp.concat(), Content::Webp)[0].contains("first of the 2 pictures"));
        assert!(losses(&webp[..2].concat(), Content::Webp).is_empty());
    }
}
