//! Walks a JPEG's markers to its end, because the decoder accepts a file that is mostly missing.
//!
//! Marker syntax: ITU-T T.81 annex B. A whole file runs from SOI through at least one scan to EOI;
//! what cameras append after EOI (previews, depth maps) is ignored.

mod agreement;
mod coefficients;
mod earlier;
mod huffman;
mod scan;
#[cfg(test)]
mod tests;
mod usual_codes;

use std::ops::Range;

use super::Flaw;
use super::iptc::{self, RESOURCES};
use super::metadata::{HOLE_BYTES, Lost, PartTable, Walked, longest_zero_run};
use crate::frame::Size;
pub(super) use agreement::agree;
pub(super) use coefficients::{coefficients, coefficients_with_zeros};
pub(super) use earlier::earlier_coding;
pub(super) use usual_codes::with_usual_codes;

/// Application segments that are used, and those that are lost with their names; each is given by
/// its marker and the beginning of its body. APP13 is searched for IPTC data.
const APPLICATIONS: PartTable = PartTable {
    used: &[
        b"\xe0JF",
        b"\xe1Exif\0",
        b"\xe2ICC_PROFILE\0",
        b"\xecDucky",
        b"\xedPhoto",
        b"\xeeAdobe",
    ],
    lost: &[
        (b"\xe1http://ns.adobe.com/x", Lost::XMP),
        (b"\xe1FLIR\0", Lost::of("the heat camera's data (FLIR)")),
        (b"\xe2MPF\0", Lost::PICTURES),
        (b"\xe2FPXR\0", Lost::of("FlashPix data")),
        (b"\xe2urn:iso:std:iso:ts:21496", Lost::of("the gain map for bright screens")),
        (b"\xe6GoPro\0", Lost::of("GoPro's data")),
        (b"\xebJP", Lost::CREDENTIALS),
    ],
};

/// The marker of a scan.
const SCAN: u8 = 0xda;

/// Walks `bytes` from SOI to EOI.
///
/// # Errors
/// [`Flaw::Truncated`], [`Flaw::ZeroFilled`], [`Flaw::Damaged`], or [`Flaw::Unsupported`] for a
/// picture in four inks.
pub(super) fn walk(bytes: &[u8]) -> Result<Walked, Flaw> {
    let mut walked = Walked::default();
    let mut frame = None;
    let (mut coded_bytes, mut hole) = (0, 0..0);
    let (mut has_density, mut has_exif) = (false, false);
    let mut segments = Segments::new(bytes);
    for segment in segments.by_ref() {
        let Segment { marker, body, coded } = segment?;
        if (0xe0..=0xef).contains(&marker) {
            let begin = [&[marker][..], &body[..body.len().min(32)]].concat();
            let kind = format!("the JPEG's application data {}", marker - 0xe0);
            walked.look_up(&APPLICATIONS, &kind, &begin);
        }
        match marker {
            // SOF0..SOF15 except DHT, JPG and DAC, which share the range.
            0xc0..=0xcf if !matches!(marker, 0xc4 | 0xc8 | 0xcc) => {
                check_coding(marker)?;
                frame = Some(frame_header(body)?);
            }
            // JFIF, ITU-T T.871: two bytes of version, then the unit, 0 if only a ratio is stated.
            0xe0 if body.starts_with(b"JFIF\0") => {
                has_density |= body.get(7).is_some_and(|&unit| unit != 0);
            }
            0xe1 if body.starts_with(b"Exif\0") => has_exif = true,
            0xed => {
                let resources = body.strip_prefix(RESOURCES);
                walked.lose(Lost::IPTC, resources.is_some_and(iptc::has_iptc));
            }
            0xfe => walked.lose(Lost::TEXTS, !body.is_empty()),
            SCAN => {
                let zeros = longest_zero_run(&bytes[coded.clone()]);
                if zeros.len() > hole.len() {
                    hole = coded.start + zeros.start..coded.start + zeros.end;
                }
                coded_bytes += coded.len();
            }
            _ => {}
        }
    }
    let Some((size, components)) = frame.filter(|_| coded_bytes > 0) else {
        return Err(damaged(
            "an end-of-image marker before any picture",
            "a frame header and a scan",
        ));
    };
    if components == 4 {
        return Err(unsupported("four inks (CMYK)"));
    }
    // EXIF states the density, too, and the result carries EXIF.
    walked.lose(Lost::DENSITY, has_density && !has_exif);
    walked.lost.extend(behind_the_picture(&bytes[segments.at..]));
    walked.size = Some(size);
    walked.zeros = (hole.len() >= HOLE_BYTES).then_some(hole);
    Ok(walked)
}

/// The data lost with `rest`, the bytes after the end-of-image marker.
fn behind_the_picture(rest: &[u8]) -> Option<Lost> {
    let is_filled = rest.iter().any(|&b| b != 0);
    let has = |words: &[u8]| rest.windows(words.len()).any(|w| w == words);
    match () {
        () if !is_filled => None,
        () if rest.starts_with(b"\xff\xd8") => Some(Lost::PICTURES),
        () if has(b"ftyp") => Some(Lost::of("the movie of a motion photo")),
        () => Some(Lost::of("the data behind the picture")),
    }
}

struct Segment<'a> {
    marker: u8,
    body: &'a [u8],
    /// Range of a scan's entropy-coded data; for other segments, the empty range at their end.
    coded: Range<usize>,
}

/// The segments of a JPEG from SOI to EOI; markers without a segment are passed over.
struct Segments<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Segments<'a> {
    /// Creates an iterator over the segments of `bytes`, which must begin with SOI.
    fn new(bytes: &'a [u8]) -> Self {
        Segments { bytes, at: 2 }
    }

    /// Reads the segment of `marker`, whose length field is next.
    fn segment(&mut self, marker: u8) -> Result<Segment<'a>, Flaw> {
        let (bytes, at) = (self.bytes, self.at);
        let short = || ended_early(bytes, "a segment that is not all there");
        let field = bytes.get(at..at + 2).ok_or_else(short)?;
        let length = usize::from(u16::from_be_bytes([field[0], field[1]]));
        if length < 2 {
            return Err(damaged(&format!("a segment of length {length} at {at}"), "2 or more"));
        }
        let body = bytes.get(at + 2..at + length).ok_or_else(short)?;
        let begin = at + length;
        let end = if marker == SCAN { end_of_scan(bytes, begin) } else { begin };
        if marker == SCAN && end == bytes.len() {
            return Err(ended_early(bytes, "coded data without an end-of-image marker"));
        }
        self.at = end;
        Ok(Segment { marker, body, coded: begin..end })
    }
}

impl<'a> Iterator for Segments<'a> {
    type Item = Result<Segment<'a>, Flaw>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match next_marker(self.bytes, &mut self.at) {
                Ok(0xd9) => return None,
                Ok(0x01 | 0xd0..=0xd8) => {}
                Ok(marker) => return Some(self.segment(marker)),
                Err(flaw) => return Some(Err(flaw)),
            }
        }
    }
}

/// The next marker at or after `at`, which moves past it. Bytes before the marker are skipped, as
/// viewers do: some cameras pad their segments.
fn next_marker(bytes: &[u8], at: &mut usize) -> Result<u8, Flaw> {
    loop {
        let rest = bytes.get(*at..).unwrap_or_default();
        let Some(begin) = rest.iter().position(|&b| b == 0xff) else {
            return Err(ended_early(bytes, "no end-of-image marker"));
        };
        let fill = rest[begin..].iter().take_while(|&&b| b == 0xff).count();
        let marker = *rest.get(begin + fill).ok_or_else(|| ended_early(bytes, "half a marker"))?;
        *at += begin + fill + 1;
        if marker != 0 {
            return Ok(marker);
        }
    }
}

/// Checks that the frame marker `sof` is of a coding that is read (T.81, table B.1).
fn check_coding(sof: u8) -> Result<(), Flaw> {
    let found = match sof {
        0xc0..=0xc2 => return Ok(()),
        0xc3 | 0xc7 | 0xcb | 0xcf => "lossless coding",
        0xc5 | 0xc6 => "hierarchical coding",
        _ => "arithmetic coding",
    };
    Err(unsupported(found))
}

fn unsupported(found: &str) -> Flaw {
    let allowed = "Huffman-coded grey and RGB of 8 bits a sample; save it so in an image program";
    Flaw::Unsupported { kind: "JPEG", found: found.to_owned(), allowed }
}

/// The picture's size and the number of its components.
fn frame_header(body: &[u8]) -> Result<(Size, u8), Flaw> {
    let [precision, h1, h0, w1, w0, components, ..] = *body else {
        return Err(damaged("a short frame header", "at least 6 bytes"));
    };
    if precision != 8 {
        return Err(unsupported(&format!("{precision} bits a sample")));
    }
    let size = Size::new(u16::from_be_bytes([w1, w0]).into(), u16::from_be_bytes([h1, h0]).into());
    if size.area() == 0 {
        return Err(damaged(&format!("a frame of {size}"), "at least 1×1"));
    }
    Ok((size, components))
}

/// The end of the entropy-coded data from `at`: the next marker but restarts, or the file's end.
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

/// The flaw of a file that ends too early.
fn ended_early(bytes: &[u8], found: &str) -> Flaw {
    let found = format!("{found} in {} bytes", bytes.len());
    Flaw::hole_or(bytes, Flaw::Truncated { kind: "JPEG", found, end: "its end-of-image marker" })
}

fn damaged(found: &str, allowed: &str) -> Flaw {
    Flaw::Damaged { kind: "JPEG", found: found.to_owned(), allowed: allowed.to_owned() }
}
