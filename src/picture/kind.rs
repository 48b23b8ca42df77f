//! What a file is, told by its content and never by its name.

use serde::{Deserialize, Serialize};

use super::Flaw;

/// A photo format that is read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// JPEG, 8 bits a sample.
    Jpeg,
    /// PNG, 8 or 16 bits a sample.
    Png,
    /// TIFF, 8 or 16 bits a sample.
    Tiff,
}

impl Format {
    /// The word for messages.
    pub const fn name(self) -> &'static str {
        match self {
            Format::Jpeg => "JPEG",
            Format::Png => "PNG",
            Format::Tiff => "TIFF",
        }
    }

    /// The usual ending of a file name, without the dot.
    pub const fn extension(self) -> &'static str {
        match self {
            Format::Jpeg => "jpg",
            Format::Png => "png",
            Format::Tiff => "tif",
        }
    }

    /// The format that a file name's ending (without the dot, any case) promises.
    pub fn of_extension(extension: &str) -> Option<Format> {
        match extension.to_ascii_lowercase().as_str() {
            "jpg" | "jpeg" | "jpe" | "jfif" => Some(Format::Jpeg),
            "png" => Some(Format::Png),
            "tif" | "tiff" => Some(Format::Tiff),
            _ => None,
        }
    }

    const fn endings(self) -> &'static str {
        match self {
            Format::Jpeg => ".jpg or .jpeg",
            Format::Png => ".png",
            Format::Tiff => ".tif or .tiff",
        }
    }
}

/// First bytes of files that people have beside their photos, and what to call them.
const FOREIGN: &[(usize, &[u8], &str)] = &[
    (0, b"GIF8", "a GIF picture"),
    (8, b"WEBP", "a WebP picture"),
    (0, b"BM", "a BMP picture"),
    (0, b"8BPS", "a Photoshop document"),
    (0, b"%PDF", "a PDF document"),
    (0, b"PK\x03\x04", "a ZIP archive or office document"),
    (0, b"\x1f\x8b", "a gzip archive"),
    (0, b"7z\xbc\xaf", "a 7z archive"),
    (0, b"\x7fELF", "a program"),
    (0, b"MZ", "a Windows program"),
    (4, b"ftypheic", "an HEIC picture"),
    (4, b"ftypmif1", "an HEIF picture"),
    (4, b"ftypavif", "an AVIF picture"),
    (4, b"ftypcrx", "a Canon raw photo"),
    (4, b"ftyp", "a video"),
    (0, b"II\x1a\0\0\0HEAPCCDR", "a Canon raw photo"),
    (0, b"FUJIFILM", "a Fujifilm raw photo"),
    (0, b"IIRO", "an Olympus raw photo"),
    (0, b"IIU\0", "a Panasonic raw photo"),
    (0, b"\xff\x0a", "a JPEG XL picture"),
    (0, b"\0\0\0\x0cJXL ", "a JPEG XL picture"),
    (0, b"\0\0\0\x0cjP  ", "a JPEG 2000 picture"),
    (0, b"<svg", "an SVG drawing"),
    (0, b"<?xml", "an XML text"),
    (0, b"<!DOCTYPE html", "a web page"),
    (0, b"<html", "a web page"),
    (0, b"ID3", "a sound file"),
    (0, b"RIFF", "a RIFF sound or video file"),
];

/// The format of `bytes`, or what they are instead.
///
/// # Errors
/// [`Flaw::Empty`], [`Flaw::ZeroFilled`] or [`Flaw::NotAPhoto`] with the kind of file by name.
pub(super) fn recognise(bytes: &[u8]) -> Result<Format, Flaw> {
    if bytes.is_empty() {
        return Err(Flaw::Empty);
    }
    if bytes.iter().all(|&b| b == 0) {
        return Err(Flaw::ZeroFilled { from: 0, to: bytes.len(), length: bytes.len() });
    }
    if bytes.starts_with(b"\xff\xd8") {
        return Ok(Format::Jpeg);
    }
    // The signature's first half is enough: a copy cut inside it is a PNG cut short.
    if bytes.starts_with(b"\x89PNG") {
        return Ok(Format::Png);
    }
    if bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*") {
        return Ok(Format::Tiff);
    }
    if bytes.starts_with(b"II+\0") || bytes.starts_with(b"MM\0+") {
        return Err(Flaw::Unsupported {
            kind: "TIFF",
            found: "a BigTIFF file".to_owned(),
            allowed: "TIFF files below 4 GiB",
        });
    }
    let foreign = FOREIGN
        .iter()
        .find(|(at, magic, _)| bytes.get(*at..).is_some_and(|b| b.starts_with(magic)));
    let found = match foreign {
        Some((_, _, name)) => (*name).to_owned(),
        None if looks_like_text(bytes) => "a text".to_owned(),
        None => format!("unknown data beginning {}", first_bytes(bytes)),
    };
    Err(Flaw::NotAPhoto { found })
}

/// Refuses a name whose ending contradicts the content; a name without an ending promises nothing.
pub(super) fn check_name(name: &str, format: Format) -> Result<(), Flaw> {
    let Some(extension) =
        std::path::Path::new(name).extension().map(|e| e.to_string_lossy().into_owned())
    else {
        return Ok(());
    };
    if Format::of_extension(&extension) == Some(format) {
        return Ok(());
    }
    Err(Flaw::Misnamed { found: format.name(), extension, allowed: format.endings() })
}

fn looks_like_text(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(512)];
    let plain = |b: &u8| matches!(b, b'\t' | b'\n' | b'\r' | 0x20..=0x7e) || *b >= 0x80;
    head.iter().all(plain) && head.iter().filter(|b| b.is_ascii()).count() * 2 > head.len()
}

fn first_bytes(bytes: &[u8]) -> String {
    bytes.iter().take(4).map(|b| format!("{b:02x}")).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_decides_and_is_named() {
        let found = |bytes: &[u8]| recognise(bytes).unwrap_err().to_string();
        assert_eq!(recognise(b"\xff\xd8\xff\xe0").unwrap(), Format::Jpeg);
        assert_eq!(recognise(b"MM\0*....").unwrap(), Format::Tiff);
        assert!(found(b"").contains("empty"));
        assert!(found(&[0; 100]).contains("never filled"));
        assert!(found(b"%PDF-1.7 ...").contains("a PDF document"));
        assert!(found(b"Dear Sir or Madam,\n").contains("a text"));
        assert!(found(b"\0\0\0\x18ftypheic").contains("HEIC"));
        assert!(found(b"\x01\x02\x03\x04\x05").contains("01 02 03 04"));
    }

    #[test]
    fn a_name_that_lies_is_refused_and_no_ending_is_no_lie() {
        assert!(check_name("holiday.JPEG", Format::Jpeg).is_ok());
        assert!(check_name("holiday", Format::Png).is_ok());
        let words = check_name("holiday.jpg", Format::Png).unwrap_err().to_string();
        assert!(words.contains("a PNG file named .jpg") && words.contains(".png"), "{words}");
    }
}
