//! Whether a BMP, GIF or WebP is all there. What such files hold is their decoders' to say.

use super::Flaw;
use super::kind::Content;

/// Zeros at the end of packed data: as many as a file system's block, and no picture. Guess.
const HOLE_BYTES: usize = 512;

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
