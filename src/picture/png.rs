//! Walks a PNG's chunks to IEND, checking each CRC (PNG specification, third edition, §5).

use super::Flaw;
use super::metadata::{Lost, Walked};
use crate::frame::Size;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// A chunk with a valid CRC.
struct Chunk<'a> {
    name: &'a [u8; 4],
    body: &'a [u8],
}

/// Walks `bytes` from the signature to IEND.
///
/// # Errors
/// [`Flaw::Truncated`], [`Flaw::ZeroFilled`] or [`Flaw::Damaged`].
pub(super) fn walk(bytes: &[u8]) -> Result<Walked, Flaw> {
    if !bytes.starts_with(SIGNATURE) {
        if SIGNATURE.starts_with(bytes) {
            return Err(ended_early(bytes, 0));
        }
        return Err(damaged(
            "a signature changed in transfer",
            "a copy made byte by byte, not as text",
        ));
    }
    let mut at = SIGNATURE.len();
    let mut walked = Walked::default();
    loop {
        let Chunk { name, body } = chunk(bytes, &mut at)?;
        match name {
            b"IHDR" => walked.size = header(body),
            b"IEND" => break,
            b"tEXt" | b"zTXt" | b"iTXt" => {
                // As ImageMagick and exiftool write it; the decoder reports XMP.
                let is_iptc = body.starts_with(b"Raw profile type iptc\0");
                walked.lose(Lost::Iptc, is_iptc);
                walked.lose(Lost::Texts, !is_iptc && !body.starts_with(b"XML:com.adobe.xmp"));
            }
            b"pHYs" => walked.lose(Lost::Density, true),
            _ => {}
        }
    }
    match walked.size {
        Some(size) if size.area() > 0 => Ok(walked),
        _ => Err(damaged("no header, or one of zero pixels", "a header of at least 1×1")),
    }
}

/// The chunk at `at`, which moves past it.
fn chunk<'a>(bytes: &'a [u8], at: &mut usize) -> Result<Chunk<'a>, Flaw> {
    let begin = *at;
    let cut = || ended_early(bytes, begin);
    let rest = &bytes[begin..];
    let (&[l3, l2, l1, l0, ref name @ ..], after) =
        rest.split_first_chunk::<8>().ok_or_else(cut)?;
    if !name.iter().all(u8::is_ascii_alphabetic) {
        return Err(match rest.iter().all(|&b| b == 0) {
            true => cut(),
            false => {
                damaged(&format!("no chunk at byte {begin}"), "a chunk's name of four letters")
            }
        });
    }
    let length = u32::from_be_bytes([l3, l2, l1, l0]) as usize;
    let (body, after) = after.split_at_checked(length).ok_or_else(cut)?;
    let (crc, after) = after.split_first_chunk::<4>().ok_or_else(cut)?;
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(name);
    hasher.update(body);
    if hasher.finalize() != u32::from_be_bytes(*crc) {
        if after.iter().all(|&b| b == 0) && crc == &[0; 4] {
            return Err(cut());
        }
        let name = String::from_utf8_lossy(name);
        return Err(damaged(
            &format!("a wrong checksum of chunk {name} at byte {begin}"),
            "the CRC of its data",
        ));
    }
    *at = bytes.len() - after.len();
    Ok(Chunk { name, body })
}

fn header(body: &[u8]) -> Option<Size> {
    let number = |at: usize| {
        body.get(at..at + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]) as usize)
    };
    Some(Size::new(number(0)?, number(4)?))
}

/// The flaw of a file that ends inside the chunk at `at`.
fn ended_early(bytes: &[u8], at: usize) -> Flaw {
    let found = format!("{} bytes that stop inside the chunk at byte {at}", bytes.len());
    Flaw::hole_or(bytes, Flaw::Truncated { kind: "PNG", found, end: "its end chunk, IEND" })
}

fn damaged(found: &str, allowed: &str) -> Flaw {
    Flaw::Damaged { kind: "PNG", found: found.to_owned(), allowed: allowed.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COFFEE: &[u8] = include_bytes!("../../tests/scenes/coffee.png");

    #[test]
    fn lost_texts_and_density_are_noted() {
        let mut bytes = COFFEE[..33].to_vec();
        for (kind, body) in [
            (b"tEXt", &b"Artist\0Ada"[..]),
            (b"zTXt", b"Raw profile type iptc\0\0packed"),
            (b"pHYs", &[0; 9]),
            (b"IEND", &[]),
        ] {
            bytes.extend((body.len() as u32).to_be_bytes());
            let mut hasher = crc32fast::Hasher::new();
            for part in [&kind[..], body] {
                hasher.update(part);
                bytes.extend(part);
            }
            bytes.extend(hasher.finalize().to_be_bytes());
        }
        let lost = walk(&bytes).unwrap().lost;
        assert!(lost.into_iter().eq([Lost::Texts, Lost::Iptc, Lost::Density]));
    }

    #[test]
    fn a_whole_photo_passes_and_every_cut_of_it_does_not() {
        assert!(walk(COFFEE).unwrap().size.unwrap().area() > 0);
        for percent in 0..100 {
            let cut = &COFFEE[..(COFFEE.len() * percent / 100).max(4)];
            assert!(matches!(walk(cut), Err(Flaw::Truncated { .. })), "cut to {percent} %");
        }
    }

    #[test]
    fn a_changed_byte_is_damage_and_a_zero_tail_a_hole() {
        let mut changed = COFFEE.to_vec();
        changed[COFFEE.len() / 2] ^= 1;
        assert!(matches!(walk(&changed), Err(Flaw::Damaged { .. })));
        let mut tail = COFFEE.to_vec();
        tail[COFFEE.len() / 2..].fill(0);
        assert!(matches!(walk(&tail), Err(Flaw::ZeroFilled { .. })));
    }

    #[test]
    fn an_absurd_length_is_a_cut_and_does_not_overflow() {
        let mut long = COFFEE.to_vec();
        long[33..37].copy_from_slice(&[0xff; 4]);
        assert!(matches!(walk(&long), Err(Flaw::Truncated { .. })));
    }
}
