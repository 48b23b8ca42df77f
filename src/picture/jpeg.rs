//! Walks a JPEG's markers to its end, because the decoder would take one percent of a file for a
//! photo.
//!
//! Marker syntax: ITU-T T.81 annex B. A file is whole when its first image runs from SOI over at
//! least one scan to EOI; whatever cameras append after EOI (previews, depth maps) is not looked
//! at.

mod agreement;
mod coefficients;
mod huffman;
mod scan;
#[cfg(test)]
mod tests;
mod usual_codes;

use crate::frame::Size;

use super::Flaw;
use super::iptc::{self, RESOURCES};
pub(super) use agreement::agrees;
pub(super) use coefficients::coefficients;
pub(super) use usual_codes::with_usual_codes;

/// What the walk learns without decoding anything.
pub(super) struct WalkedJpeg {
    pub(super) size: Size,
    /// Number of colour components.
    pub(super) components: u8,
    /// It holds a comment.
    pub(super) words: bool,
    /// It states dots per inch or centimetre, and not in EXIF, which is carried over.
    pub(super) density: bool,
    /// It holds IPTC data.
    pub(super) iptc: bool,
}

/// A run of zero bytes this long inside the coded data is a hole, unless the picture is nearly
/// blank. Guess: coded photographs hold runs of a few bytes; file systems leave holes of whole
/// blocks, 512 and up.
const HOLE_BYTES: usize = 512;

/// Below this many coded bits a pixel a picture is so blank that zero runs may be its code. Guess.
const BLANK_BITS_PER_PIXEL: f64 = 0.1;

/// Walks `bytes` from SOI to EOI.
///
/// # Errors
/// [`Flaw::Truncated`], [`Flaw::ZeroFilled`] or [`Flaw::Damaged`].
pub(super) fn walk(bytes: &[u8]) -> Result<WalkedJpeg, Flaw> {
    let mut at = 2; // past SOI, which made it a JPEG
    let mut frame: Option<WalkedJpeg> = None;
    let mut coded_bytes = 0;
    let mut hole: Option<(usize, usize)> = None;
    let (mut words, mut density, mut exif, mut iptc) = (false, false, false, false);
    loop {
        let marker = next_marker(bytes, &mut at)?;
        match marker {
            0xd9 => break,
            0x01 | 0xd0..=0xd8 => continue,
            _ => {}
        }
        let segment = segment(bytes, at)?;
        at += segment.len() + 2;
        match marker {
            // SOF0..SOF15 but for DHT, JPG and DAC, which share the range.
            0xc0..=0xcf if !matches!(marker, 0xc4 | 0xc8 | 0xcc) => {
                frame = Some(frame_header(segment)?);
            }
            // JFIF, ITU-T T.871: two bytes of version, then the unit, 0 for a mere ratio.
            0xe0 if segment.starts_with(b"JFIF\0") => {
                density |= segment.get(7).is_some_and(|&unit| unit != 0);
            }
            0xe1 if segment.starts_with(b"Exif\0") => exif = true,
            0xed => iptc |= segment.strip_prefix(RESOURCES).is_some_and(iptc::is_in),
            0xfe => words |= !segment.is_empty(),
            0xda => {
                let end = end_of_scan(bytes, at);
                let zeros = longest_zero_run(&bytes[at..end]);
                if zeros.1 > hole.map_or(0, |(from, to)| to - from) {
                    hole = Some((at + zeros.0, at + zeros.0 + zeros.1));
                }
                coded_bytes += end - at;
                at = end;
                if end == bytes.len() {
                    return Err(ended_early(bytes, "coded data without an end-of-image marker"));
                }
            }
            _ => {}
        }
    }
    let Some(walked) = frame.filter(|_| coded_bytes > 0) else {
        return Err(damaged(
            "an end-of-image marker before any picture",
            "a frame header and a scan",
        ));
    };
    let blank = (coded_bytes as f64) * 8.0 < BLANK_BITS_PER_PIXEL * walked.size.area() as f64;
    match hole {
        Some((from, to)) if to - from >= HOLE_BYTES && !blank => {
            Err(Flaw::ZeroFilled { from, to, length: bytes.len() })
        }
        _ => Ok(WalkedJpeg { words, density: density && !exif, iptc, ..walked }),
    }
}

/// The marker at `at`, fill bytes skipped; `at` ends up past it.
fn next_marker(bytes: &[u8], at: &mut usize) -> Result<u8, Flaw> {
    match bytes.get(*at) {
        None => return Err(ended_early(bytes, "no end-of-image marker")),
        Some(0xff) => {}
        Some(_) if bytes[*at..].iter().all(|&b| b == 0) => {
            return Err(ended_early(bytes, "no end-of-image marker"));
        }
        Some(other) => return Err(damaged(&format!("byte {other:02x} at {at}"), "a marker, ff")),
    }
    while bytes.get(*at) == Some(&0xff) {
        *at += 1;
    }
    let marker = *bytes.get(*at).ok_or_else(|| ended_early(bytes, "half a marker"))?;
    *at += 1;
    if marker == 0 {
        return Err(damaged(&format!("a stray ff 00 at {}", *at - 2), "a marker"));
    }
    Ok(marker)
}

/// The body of the segment whose length field is at `at`.
fn segment(bytes: &[u8], at: usize) -> Result<&[u8], Flaw> {
    let short = || ended_early(bytes, "a segment that is not all there");
    let field = bytes.get(at..at + 2).ok_or_else(short)?;
    let length = usize::from(u16::from_be_bytes([field[0], field[1]]));
    if length < 2 {
        return Err(damaged(&format!("a segment of length {length} at {at}"), "2 or more"));
    }
    bytes.get(at + 2..at + length).ok_or_else(short)
}

fn frame_header(segment: &[u8]) -> Result<WalkedJpeg, Flaw> {
    let [precision, h1, h0, w1, w0, components, ..] = *segment else {
        return Err(damaged("a short frame header", "at least 6 bytes"));
    };
    if precision != 8 {
        return Err(Flaw::Unsupported {
            kind: "JPEG",
            found: format!("{precision} bits a sample"),
            allowed: "8 bits a sample",
        });
    }
    let size = Size::new(u16::from_be_bytes([w1, w0]).into(), u16::from_be_bytes([h1, h0]).into());
    if size.area() == 0 {
        return Err(damaged(&format!("a frame of {size}"), "at least 1×1"));
    }
    Ok(WalkedJpeg { size, components, words: false, density: false, iptc: false })
}

/// Where the entropy-coded data from `at` on ends: at the next marker that is no restart, or at the
/// end.
fn end_of_scan(bytes: &[u8], at: usize) -> usize {
    let mut i = at;
    while let Some(step) = bytes[i..].iter().position(|&b| b == 0xff) {
        i += step;
        match bytes.get(i + 1) {
            Some(0x00 | 0xd0..=0xd7) => i += 2,
            Some(0xff) => i += 1,
            Some(_) => return i,
            None => break,
        }
    }
    bytes.len()
}

/// Start and length of the longest run of zero bytes.
fn longest_zero_run(data: &[u8]) -> (usize, usize) {
    let (mut best, mut start) = ((0, 0), 0);
    for (i, &b) in data.iter().enumerate() {
        if b != 0 {
            start = i + 1;
        } else if i + 1 - start > best.1 {
            best = (start, i + 1 - start);
        }
    }
    best
}

/// The right words for a file that stops: cut short, or never filled to its end.
fn ended_early(bytes: &[u8], found: &str) -> Flaw {
    let zeros = bytes.iter().rev().take_while(|&&b| b == 0).count();
    if zeros >= HOLE_BYTES {
        return Flaw::ZeroFilled {
            from: bytes.len() - zeros,
            to: bytes.len(),
            length: bytes.len(),
        };
    }
    Flaw::Truncated {
        kind: "JPEG",
        found: format!("{found} in {} bytes", bytes.len()),
        end: "its end-of-image marker",
    }
}

fn damaged(found: &str, allowed: &str) -> Flaw {
    Flaw::Damaged { kind: "JPEG", found: found.to_owned(), allowed: allowed.to_owned() }
}
