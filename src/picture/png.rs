//! Walks a PNG's chunks to IEND, checking each CRC (PNG specification, third edition, §5).

use super::Flaw;
use super::metadata::{Lost, PartTable, Walked};
use super::tone::StatedColours;
use crate::frame::Size;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Names of the chunks that are used, and of those that are lost, with what is lost. [`walk`]
/// examines the texts.
const CHUNKS: PartTable = PartTable {
    used: &[
        b"IHDR", b"PLTE", b"IDAT", b"tRNS", b"iCCP", b"sRGB", b"gAMA", b"cHRM", b"cICP", b"eXIf",
        b"sBIT", b"hIST", b"fcTL", b"fdAT", b"tEXt", b"zTXt", b"iTXt",
    ],
    lost: &[
        (b"pHYs", Lost::DENSITY),
        (b"acTL", Lost::PICTURES),
        (b"tIME", Lost::of("the time of the file's last change")),
        (b"bKGD", Lost::of("the background colour")),
        (b"caBX", Lost::CREDENTIALS),
    ],
};

/// Walks `bytes` from the signature to IEND.
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
    let (mut walked, mut colours) = (Walked::default(), PngColours::default());
    loop {
        let (name, body) = chunk(bytes, &mut at)?;
        let numbers = || body.chunks_exact(4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]));
        if name != b"IEND" {
            walked.look_up(&CHUNKS, "the PNG's data", name);
        }
        match name {
            b"IHDR" => {
                let sides = numbers().next().zip(numbers().nth(1));
                walked.size = sides.map(|(w, h)| Size::new(w as usize, h as usize));
            }
            b"sRGB" => colours.is_srgb = true,
            b"gAMA" => colours.gamma = numbers().next().filter(|&g| g > 0),
            b"cHRM" => colours.xy = numbers().collect::<Vec<_>>().try_into().ok(),
            b"cICP" => colours.coded = body.try_into().ok(),
            b"IEND" => break,
            b"tEXt" | b"zTXt" | b"iTXt" => {
                // ImageMagick and exiftool write IPTC data so; XMP is found by the decoder.
                let is_iptc = body.starts_with(b"Raw profile type iptc\0");
                walked.lose(Lost::IPTC, is_iptc);
                walked.lose(Lost::TEXTS, !is_iptc && !body.starts_with(b"XML:com.adobe.xmp"));
            }
            _ => {}
        }
    }
    walked.colours = colours.stated()?;
    match walked.size {
        Some(size) if size.area() > 0 => Ok(walked),
        _ => Err(damaged("no header, or one of zero pixels", "a header of at least 1×1")),
    }
}

/// Colours in chunks of their own (PNG specification, third edition, §11.3.2).
#[derive(Default)]
struct PngColours {
    is_srgb: bool,
    /// Exponent of the transfer function from light to code, times 100,000 (gAMA).
    gamma: Option<u32>,
    /// x and y of white, red, green and blue, times 100,000 (cHRM).
    xy: Option<[u32; 8]>,
    /// Numbers of ITU-T H.273: primaries, transfer, matrix, and whether the range is full (cICP).
    coded: Option<[u8; 4]>,
}

impl PngColours {
    /// The colours stated by the chunk that takes precedence; `None` if no chunk states any.
    fn stated(self) -> Result<Option<StatedColours>, Flaw> {
        let xy = self.xy.map(|xy| xy.map(|v| f64::from(v) / 1e5));
        // Values that files in sRGB state are dropped; libpng takes gammas within 5 % for the same.
        let near = |v: f64, of: f64| (v / of - 1.0).abs() < 0.05;
        let gamma = self.gamma.map(|g| 1e5 / f64::from(g)).filter(|&g| !near(g, 2.2));
        let srgb = [0.3127, 0.329, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06];
        let xy = xy.filter(|xy| xy.iter().zip(srgb).any(|(v, of)| (v - of).abs() > 0.001));
        match self {
            PngColours { coded: Some([primaries, transfer, matrix, full]), .. } => {
                let known = (matrix == 0 && full == 1)
                    .then(|| StatedColours::coded(primaries, transfer))
                    .flatten();
                let found = format!("colours coded as {primaries}, {transfer}, {matrix}, {full}");
                known.map(Some).ok_or(Flaw::Unsupported {
                    kind: "PNG",
                    found: format!("{found} (cICP), which are used for bright (HDR) screens"),
                    allowed: "colours of ordinary screens; save it as sRGB in an image program",
                })
            }
            PngColours { is_srgb: true, .. } => Ok(Some(StatedColours::Srgb)),
            _ if gamma.is_some() || xy.is_some() => Ok(Some(StatedColours::Measured { gamma, xy })),
            PngColours { gamma, xy, .. } => {
                Ok((gamma.is_some() || xy.is_some()).then_some(StatedColours::Srgb))
            }
        }
    }
}

/// Name and body of the chunk at `at`, with its CRC checked; `at` moves past the chunk.
fn chunk<'a>(bytes: &'a [u8], at: &mut usize) -> Result<(&'a [u8; 4], &'a [u8]), Flaw> {
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
    Ok((name, body))
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

    /// The header of [`COFFEE`], then chunks of these names and bodies.
    fn with(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut bytes = COFFEE[..33].to_vec();
        for (kind, body) in chunks.iter().chain([&(b"IEND", &b""[..])]) {
            bytes.extend((body.len() as u32).to_be_bytes());
            let mut hasher = crc32fast::Hasher::new();
            for part in [&kind[..], body] {
                hasher.update(part);
                bytes.extend(part);
            }
            bytes.extend(hasher.finalize().to_be_bytes());
        }
        bytes
    }

    #[test]
    fn lost_data_are_noted() {
        let lost = |chunks: &[(&[u8; 4], &[u8])]| {
            walk(&with(chunks)).unwrap().lost.into_iter().collect::<Vec<_>>()
        };
        let texts = lost(&[
            (b"tEXt", b"Artist\0Ada"),
            (b"zTXt", b"Raw profile type iptc\0\0packed"),
            (b"pHYs", &[0; 9]),
        ]);
        assert_eq!(texts, [Lost::IPTC, Lost::DENSITY, Lost::TEXTS]);
        assert_eq!(lost(&[(b"acTL", &[0; 8])]), [Lost::PICTURES]);
        let other = lost(&[(b"smRt", b"x")]).remove(0).note();
        assert!(other.contains("smRt"), "{other}");
    }

    #[test]
    fn colours_are_taken_by_the_chunk_that_counts_most() {
        let stated = |chunks: &[(&[u8; 4], &[u8])]| walk(&with(chunks)).map(|w| w.colours);
        let gamma = |gamma: u32| gamma.to_be_bytes();
        let is_srgb = |chunks: &[(&[u8; 4], &[u8])]| {
            matches!(stated(chunks).unwrap(), Some(StatedColours::Srgb))
        };
        assert!(stated(&[]).unwrap().is_none());
        assert!(is_srgb(&[(b"gAMA", &gamma(45_455))]));
        assert!(is_srgb(&[(b"gAMA", &gamma(100_000)), (b"sRGB", &[0])]));
        assert!(is_srgb(&[(b"cICP", &[1, 13, 0, 1])]));
        let Some(StatedColours::Measured { gamma: Some(linear), xy: None }) =
            stated(&[(b"gAMA", &gamma(100_000))]).unwrap()
        else {
            panic!("a gamma of 1")
        };
        assert!((linear - 1.0).abs() < 1e-9);
        let bright = stated(&[(b"cICP", &[9, 16, 0, 1])]).unwrap_err().to_string();
        assert!(bright.contains("9, 16, 0, 1") && bright.contains("save it as sRGB"), "{bright}");
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
