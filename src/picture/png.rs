//! Walks a PNG's chunks to IEND, checking each CRC (PNG specification, third edition, §5).

use crate::frame::Size;

use super::Flaw;
use super::iptc::IPTC_LOST;
use super::losses::{DENSITY_LOST, WORDS_LOST};

/// Walks `bytes` from the signature to IEND and returns width and height by the header. What it
/// holds that no result can is added to `losses`.
///
/// # Errors
/// [`Flaw::Truncated`], [`Flaw::ZeroFilled`] or [`Flaw::Damaged`].
pub(super) fn walk(bytes: &[u8], losses: &mut Vec<String>) -> Result<Size, Flaw> {
    const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
    if !bytes.starts_with(SIGNATURE) {
        if SIGNATURE.starts_with(bytes) {
            return Err(ended_early(bytes, 0));
        }
        return Err(damaged(
            "a signature changed in transfer",
            "a copy made byte by byte, not as text",
        ));
    }
    let mut rest = &bytes[SIGNATURE.len()..];
    let (mut size, mut has_words, mut has_density, mut has_iptc) = (None, false, false, false);
    loop {
        let at = bytes.len() - rest.len();
        let Some((&[l3, l2, l1, l0, ref kind @ ..], after)) = rest.split_first_chunk::<8>() else {
            return Err(ended_early(bytes, at));
        };
        let length = u32::from_be_bytes([l3, l2, l1, l0]) as usize;
        if !kind.iter().all(u8::is_ascii_alphabetic) {
            if rest.iter().all(|&b| b == 0) {
                return Err(ended_early(bytes, at));
            }
            return Err(damaged(
                &format!("no chunk at byte {at}"),
                "a chunk's name of four letters",
            ));
        }
        let Some((body, after)) = after.split_at_checked(length) else {
            return Err(ended_early(bytes, at));
        };
        let Some((crc, after)) = after.split_first_chunk::<4>() else {
            return Err(ended_early(bytes, at));
        };
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(kind);
        hasher.update(body);
        if hasher.finalize() != u32::from_be_bytes(*crc) {
            if after.iter().all(|&b| b == 0) && crc == &[0; 4] {
                return Err(ended_early(bytes, at));
            }
            let name = String::from_utf8_lossy(kind);
            return Err(damaged(
                &format!("a wrong checksum of chunk {name} at byte {at}"),
                "the CRC of its data",
            ));
        }
        match kind {
            b"IHDR" => size = header(body),
            b"IEND" => break,
            // As ImageMagick and exiftool write it.
            b"tEXt" | b"zTXt" | b"iTXt" if body.starts_with(b"Raw profile type iptc\0") => {
                has_iptc = true;
            }
            // XMP is told of by itself.
            b"tEXt" | b"zTXt" | b"iTXt" => has_words |= !body.starts_with(b"XML:com.adobe.xmp"),
            b"pHYs" => has_density = true,
            _ => {}
        }
        rest = after;
    }
    losses.extend(has_words.then(|| WORDS_LOST.to_owned()));
    losses.extend(has_iptc.then(|| IPTC_LOST.to_owned()));
    losses.extend(has_density.then(|| DENSITY_LOST.to_owned()));
    match size {
        Some(size) if size.area() > 0 => Ok(size),
        _ => Err(damaged("no header, or one of zero pixels", "a header of at least 1×1")),
    }
}

fn header(body: &[u8]) -> Option<Size> {
    let number = |at: usize| {
        body.get(at..at + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]) as usize)
    };
    Some(Size::new(number(0)?, number(4)?))
}

/// The right words for a file that stops: cut short, or never filled to its end.
fn ended_early(bytes: &[u8], at: usize) -> Flaw {
    let zeros = bytes.iter().rev().take_while(|&&b| b == 0).count();
    if zeros >= 512 {
        return Flaw::ZeroFilled {
            from: bytes.len() - zeros,
            to: bytes.len(),
            length: bytes.len(),
        };
    }
    Flaw::Truncated {
        kind: "PNG",
        found: format!("{} bytes that stop inside the chunk at byte {at}", bytes.len()),
        end: "its end chunk, IEND",
    }
}

fn damaged(found: &str, allowed: &str) -> Flaw {
    Flaw::Damaged { kind: "PNG", found: found.to_owned(), allowed: allowed.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COFFEE: &[u8] = include_bytes!("../../tests/scenes/coffee.png");

    fn walk_alone(bytes: &[u8]) -> Result<Size, Flaw> {
        walk(bytes, &mut Vec::new())
    }

    #[test]
    fn words_and_density_that_are_lost_are_told_of() {
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
        let mut losses = Vec::new();
        assert!(walk(&bytes, &mut losses).is_ok() && losses.len() == 3, "{losses:?}");
        for (loss, of) in losses.iter().zip(["artist", "IPTC", "dots per inch"]) {
            assert!(loss.contains(of), "{losses:?}");
        }
    }

    #[test]
    fn a_whole_photo_passes_and_every_cut_of_it_does_not() {
        assert!(walk_alone(COFFEE).unwrap().area() > 0);
        for percent in 0..100 {
            let cut = &COFFEE[..(COFFEE.len() * percent / 100).max(4)];
            assert!(matches!(walk_alone(cut), Err(Flaw::Truncated { .. })), "cut to {percent} %");
        }
    }

    #[test]
    fn a_changed_byte_and_a_zero_tail_are_told_apart() {
        let mut changed = COFFEE.to_vec();
        changed[COFFEE.len() / 2] ^= 1;
        assert!(matches!(walk_alone(&changed), Err(Flaw::Damaged { .. })));
        let mut tail = COFFEE.to_vec();
        tail[COFFEE.len() / 2..].fill(0);
        assert!(matches!(walk_alone(&tail), Err(Flaw::ZeroFilled { .. })));
    }

    #[test]
    fn an_absurd_length_field_is_a_cut_and_no_overflow() {
        let mut long = COFFEE.to_vec();
        long[33..37].copy_from_slice(&[0xff; 4]);
        assert!(matches!(walk_alone(&long), Err(Flaw::Truncated { .. })));
    }
}
