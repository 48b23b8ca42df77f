//! The kind of a file, by its content and never by its name.

use std::ffi::{OsStr, OsString};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Flaw;
use super::metadata::HOLE_BYTES;

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
    /// The name in messages.
    pub fn name(self) -> &'static str {
        Content::Written(self).name()
    }

    /// The usual file ending, without the dot.
    pub fn extension(self) -> &'static str {
        Content::Written(self).endings()[0]
    }

    /// The format of a file ending (without the dot, any case).
    pub fn of_extension(extension: &str) -> Option<Format> {
        let formats = [Format::Jpeg, Format::Png, Format::Tiff];
        formats.into_iter().find(|&format| Content::Written(format).has_ending(extension))
    }
}

/// The kinds of files that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Content {
    /// A kind that is written, too.
    Written(Format),
    Bmp,
    Gif,
    Pnm,
    Webp,
}

impl Content {
    /// The name in messages.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Content::Written(Format::Jpeg) => "JPEG",
            Content::Written(Format::Png) => "PNG",
            Content::Written(Format::Tiff) => "TIFF",
            Content::Bmp => "BMP",
            Content::Gif => "GIF",
            Content::Pnm => "PPM",
            Content::Webp => "WebP",
        }
    }

    /// Its file endings, the usual one first.
    const fn endings(self) -> &'static [&'static str] {
        match self {
            Content::Written(Format::Jpeg) => &["jpg", "jpeg", "jpe", "jfif"],
            Content::Written(Format::Png) => &["png"],
            Content::Written(Format::Tiff) => &["tif", "tiff"],
            Content::Bmp => &["bmp"],
            Content::Gif => &["gif"],
            Content::Pnm => &["ppm", "pgm", "pnm", "pbm", "pam"],
            Content::Webp => &["webp"],
        }
    }

    pub(super) const fn written(self) -> Format {
        match self {
            Content::Written(format) => format,
            Content::Bmp | Content::Gif | Content::Pnm | Content::Webp => Format::Png,
        }
    }

    fn has_ending(self, extension: &str) -> bool {
        self.endings().iter().any(|ending| ending.eq_ignore_ascii_case(extension))
    }
}

/// The ending of raw photos, which are TIFFs.
const RAW_ENDING: &str = "dng";

/// Whether files of this ending (without the dot, any case) are read.
fn is_photo_ending(extension: &str) -> bool {
    let others = [Content::Bmp, Content::Gif, Content::Pnm, Content::Webp];
    Format::of_extension(extension).is_some()
        || others.into_iter().any(|content| content.has_ending(extension))
        || extension.eq_ignore_ascii_case(RAW_ENDING)
}

/// The name of a result of `format` for a photo called `name`: with the format's ending added, or
/// in place of another photo ending.
pub fn result_name(name: &OsStr, format: Format) -> OsString {
    let ending = Path::new(name).extension().map(|ending| ending.to_string_lossy());
    match ending {
        Some(ending) if Format::of_extension(&ending) == Some(format) => name.to_owned(),
        Some(ending) if is_photo_ending(&ending) => {
            Path::new(name).with_extension(format.extension()).into()
        }
        // `12.5.2024` has no photo ending to replace.
        _ => {
            let mut wanted = name.to_owned();
            wanted.push(format!(".{}", format.extension()));
            wanted
        }
    }
}

/// The advice on a raw photo of a camera maker's own format.
const DEVELOP: &str = "develop it with the camera maker's program, without sharpening and lens \
                       corrections, and save it as TIFF of 16 bits; previews are not restored";
/// The advice on pictures that image programs read.
const SAVE: &str = "open it in an image program and save it as JPEG or PNG";
/// The advice on telephone photos.
const TELEPHONE: &str = "save it as JPEG, and set the telephone or camera to do so (iPhone: \
                         Settings, Camera, Formats, Most Compatible; cameras: image quality JPEG)";

/// Kinds of photos that are not read: place and bytes of the signature, name, advice.
const UNREAD: &[(usize, &[u8], &str, &str)] = &[
    (4, b"ftypcrx", "a camera raw photo (Canon CR3)", DEVELOP),
    (4, b"ftypavif", "an AVIF picture", SAVE),
    (4, b"ftypavis", "an AVIF picture", SAVE),
    (4, b"ftyphe", "an HEIC picture", TELEPHONE),
    (4, b"ftypmif1", "an HEIC or AVIF picture", TELEPHONE),
    (4, b"ftypmsf1", "an HEIC or AVIF picture", TELEPHONE),
    (0, b"II\x1a\0\0\0HEAPCCDR", "a camera raw photo (Canon CRW)", DEVELOP),
    (8, b"CR\x02", "a camera raw photo (Canon CR2)", DEVELOP),
    (0, b"FUJIFILM", "a camera raw photo (Fujifilm RAF)", DEVELOP),
    (0, b"FOVb", "a camera raw photo (Sigma X3F)", DEVELOP),
    (0, b"IIRO", "a camera raw photo (Olympus ORF)", DEVELOP),
    (0, b"MMOR", "a camera raw photo (Olympus ORF)", DEVELOP),
    (0, b"IIRS", "a camera raw photo (Olympus ORF)", DEVELOP),
    (0, b"IIU\0", "a camera raw photo (Panasonic RW2)", DEVELOP),
    (0, b"\0MRM", "a camera raw photo (Minolta MRW)", DEVELOP),
    (0, b"\xff\x0a", "a JPEG XL picture", SAVE),
    (0, b"\0\0\0\x0cJXL ", "a JPEG XL picture", SAVE),
    (0, b"\0\0\0\x0cjP  ", "a JPEG 2000 picture", SAVE),
    (0, b"\xff\x4f\xff\x51", "a JPEG 2000 picture", SAVE),
    (0, b"II\xbc\x01", "a JPEG XR picture", SAVE),
    (0, b"\x76\x2f\x31\x01", "an OpenEXR picture", "save it as TIFF of 16 bits"),
    (0, b"#?RADIANCE", "a Radiance HDR picture", "save it as TIFF of 16 bits"),
    (0, b"qoif", "a QOI picture", SAVE),
    (0, b"gimp xcf", "a GIMP document", SAVE),
    (8, b"IIII", "a camera raw photo (Phase One IIQ)", DEVELOP),
    (8, b"MMMM", "a camera raw photo (Phase One IIQ)", DEVELOP),
    (0, b"8BPS", "a Photoshop document", SAVE),
    (0, b"II+\0", "a BigTIFF picture", "save it as a plain TIFF"),
    (0, b"MM\0+", "a BigTIFF picture", "save it as a plain TIFF"),
];

/// The refusal of a camera raw photo in a TIFF.
pub(super) fn tiff_of_a_camera() -> Flaw {
    Flaw::Unread { found: "a camera raw photo", to_do: DEVELOP }
}

/// Signatures of files that programs and cameras write beside photos: place, bytes, name.
const BESIDE: &[(usize, &[u8], &str)] = &[
    (4, b"ftyp", "a video"),
    (4, b"moov", "a video"),
    (0, b"\x1a\x45\xdf\xa3", "a video"),
    (0, b"RIFF", "a RIFF sound or video file"),
    (0, b"ID3", "a sound file"),
    (0, b"<?xml", "an XML text"),
    (0, b"<x:xmpmeta", "an XML text"),
    (0, b"<?xpacket", "an XML text"),
    (0, b"SQLite format 3\0", "a database"),
];

/// Signatures of other files: place, bytes, name.
const FOREIGN: &[(usize, &[u8], &str)] = &[
    (0, b"%PDF", "a PDF document"),
    (0, b"PK\x03\x04", "a ZIP archive or office document"),
    (0, b"\x1f\x8b", "a gzip archive"),
    (0, b"7z\xbc\xaf", "a 7z archive"),
    (0, b"\x7fELF", "a program"),
    (0, b"MZ", "a Windows program"),
    (0, b"<svg", "an SVG drawing"),
    (0, b"<!DOCTYPE html", "a web page"),
    (0, b"<html", "a web page"),
];

/// Bytes at the beginning of a file that [`is_companion`] examines.
pub const HEAD_BYTES: u64 = 512;

/// Whether a file called `name`, beginning with `head`, is a companion of photos and no photo.
/// `usual` states whether the name is usual for companions. A file that is named as a photo, or
/// begins like one, is never a companion.
pub fn is_companion(name: &OsStr, usual: bool, head: impl FnOnce() -> Option<Vec<u8>>) -> bool {
    let ending = Path::new(name).extension().map(|ending| ending.to_string_lossy());
    if ending.is_some_and(|ending| is_photo_ending(&ending)) {
        return false;
    }
    let Some(head) = head() else { return usual };
    match recognise(&head) {
        Ok(_) | Err(Flaw::Unread { .. }) => false,
        Err(_) => usual || BESIDE.iter().any(|(from, magic, _)| begins(&head, *from, magic)),
    }
}

fn begins(bytes: &[u8], from: usize, magic: &[u8]) -> bool {
    bytes.get(from..).is_some_and(|bytes| bytes.starts_with(magic))
}

/// The kind of `bytes`.
///
/// # Errors
/// [`Flaw::Empty`], [`Flaw::ZeroFilled`], [`Flaw::Unread`] or [`Flaw::NotAPhoto`].
pub(super) fn recognise(bytes: &[u8]) -> Result<Content, Flaw> {
    if bytes.is_empty() {
        return Err(Flaw::Empty);
    }
    // A head of zeros may also be one still to come, where a copy fills its file from the end.
    let zeros = bytes.iter().take_while(|&&b| b == 0).count();
    if zeros >= HOLE_BYTES.min(bytes.len()) {
        return Err(Flaw::ZeroFilled { from: 0, to: zeros, length: bytes.len() });
    }
    let at = |from: usize, magic: &[u8]| begins(bytes, from, magic);
    if let Some((.., found, to_do)) = UNREAD.iter().find(|(from, magic, ..)| at(*from, magic)) {
        return Err(Flaw::Unread { found, to_do });
    }
    // Half of PNG's signature is enough, so that a copy cut inside it is a PNG cut short.
    let read = [
        (at(0, b"\xff\xd8"), Content::Written(Format::Jpeg)),
        (at(0, b"\x89PNG"), Content::Written(Format::Png)),
        (at(0, b"II*\0") || at(0, b"MM\0*"), Content::Written(Format::Tiff)),
        (at(0, b"RIFF") && at(8, b"WEBP"), Content::Webp),
        (at(0, b"BM") && has_bmp_header(bytes), Content::Bmp),
        (at(0, b"GIF8"), Content::Gif),
        (is_pnm(bytes), Content::Pnm),
    ];
    if let Some((_, content)) = read.into_iter().find(|(is, _)| *is) {
        return Ok(content);
    }
    let foreign = BESIDE.iter().chain(FOREIGN).find(|(from, magic, _)| at(*from, magic));
    let found = match foreign {
        Some((_, _, name)) => (*name).to_owned(),
        None if looks_like_text(bytes) => "a text".to_owned(),
        None => format!("unknown data beginning {}", first_bytes(bytes)),
    };
    Err(Flaw::NotAPhoto { found })
}

/// Whether `bytes`, which begin with `BM`, continue as a bitmap and not as text. The reserved
/// fields are not tested, because some programs use them.
fn has_bmp_header(bytes: &[u8]) -> bool {
    let header = bytes.get(14..18);
    // The lengths of the headers of OS/2 and Windows.
    header
        .is_none_or(|b| matches!(b[0], 12 | 16 | 40 | 52 | 56 | 64 | 108 | 124) && b[1..] == [0; 3])
}

/// Whether `bytes` begin as a PNM: its number, then a blank and a size or a comment.
fn is_pnm(bytes: &[u8]) -> bool {
    let [b'P', b'1'..=b'7', blank, next, ..] = bytes else { return false };
    blank.is_ascii_whitespace() && (next.is_ascii_digit() || b"#W".contains(next))
}

/// The endings of makers' raw photos that are TIFFs.
const RAW_TIFFS: [&str; 21] = [
    "3fr", "arw", "cr2", "dcr", "dcs", "erf", "fff", "iiq", "k25", "kdc", "mef", "mos", "nef",
    "nrw", "pef", "ptx", "raw", "rwl", "sr2", "srf", "srw",
];

/// Whether a TIFF called `name` is a maker's raw photo, whose pictures are previews unless it
/// declares the sensor's sites.
pub(super) fn is_raw_name(name: &str) -> bool {
    let ending = Path::new(name).extension().map(|ending| ending.to_string_lossy());
    ending.is_some_and(|ending| RAW_TIFFS.contains(&&*ending.to_ascii_lowercase()))
}

/// A note if the ending of `name` belongs to another kind than the content. `raw` is set for a TIFF
/// with a sensor's sites.
pub(super) fn misnamed(name: &str, content: Content, raw: bool) -> Option<String> {
    let extension = Path::new(name).extension()?.to_string_lossy().into_owned();
    let fits = content.has_ending(&extension) || raw && extension.eq_ignore_ascii_case(RAW_ENDING);
    let found = if raw { "DNG" } else { content.name() };
    (!fits).then(|| format!("the file is named .{extension} and holds a {found}, which was read"))
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
    fn files_are_recognised_by_their_content() {
        let found = |bytes: &[u8]| recognise(bytes).unwrap_err().to_string();
        assert_eq!(recognise(b"\xff\xd8\xff\xe0").unwrap(), Content::Written(Format::Jpeg));
        assert_eq!(recognise(b"MM\0*....").unwrap(), Content::Written(Format::Tiff));
        assert!(found(b"").contains("empty"));
        assert!(found(&[0; 100]).contains("never filled"));
        let head_to_come = [vec![0; 600], b"the rest".to_vec()].concat();
        assert!(found(&head_to_come).contains("never filled"));
        // A bitmap with its reserved fields used, and a text.
        let header = b"BM\x36\0\0\0\x01\0\0\0\x36\0\0\0\x28\0\0\0";
        assert_eq!(recognise(header).unwrap(), Content::Bmp);
        assert!(found(b"BMW drivers, please move your cars").contains("a text"));
        assert_eq!(recognise(b"P6\n# by dcraw\n4 3\n255\n").unwrap(), Content::Pnm);
        assert!(found(b"P6 is a sensor").contains("a text"));
        assert!(found(b"%PDF-1.7 ...").contains("a PDF document"));
        assert!(found(b"Dear Sir or Madam,\n").contains("a text"));
        assert!(found(b"\0\0\0\x18ftypheic").contains("HEIC"));
        assert!(found(b"\x01\x02\x03\x04\x05").contains("01 02 03 04"));
    }

    #[test]
    fn a_wrong_ending_is_noted() {
        let png = Content::Written(Format::Png);
        assert_eq!(misnamed("holiday.JPEG", Content::Written(Format::Jpeg), false), None);
        assert_eq!(misnamed("holiday", png, false), None);
        assert_eq!(misnamed("holiday.webp", Content::Webp, false), None);
        assert_eq!(misnamed("holiday.DNG", Content::Written(Format::Tiff), true), None);
        assert!(misnamed("holiday.dng", Content::Written(Format::Tiff), false).is_some());
        let words = misnamed("holiday.jpg", png, false).unwrap();
        assert!(words.contains("named .jpg and holds a PNG"), "{words}");
    }

    #[test]
    fn companions_are_known_by_name_and_content() {
        let is = |name: &str, usual: bool, head: &[u8]| {
            is_companion(OsStr::new(name), usual, || Some(head.to_vec()))
        };
        assert!(is("IMG_1.MOV", true, b"\0\0\0\x14ftypqt  "));
        assert!(is("PXL_1.MP", false, b"\0\0\0\x18ftypmp42"));
        assert!(is("Photos", false, b"SQLite format 3\0"));
        assert!(is("a.json", true, b"{}") && is("a.log", true, b""));
        // No companions: photos under other names, and other files under the name of a photo.
        assert!(!is("a.log", true, b"\xff\xd8\xff\xe0"));
        assert!(!is("a.bin", true, b"\0\0\0\x18ftypheic"));
        assert!(!is("a.jpg", false, b"\0\0\0\x18ftypmp42"));
        assert!(!is("letter", false, b"Dear Sir or Madam,\n"));
        let unreadable = |usual| is_companion(OsStr::new("a.xmp"), usual, || None);
        assert!(unreadable(true) && !unreadable(false));
    }

    #[test]
    fn photo_endings_are_recognised() {
        assert!(["JPEG", "tif", "dng", "WebP", "bmp", "GIF"].into_iter().all(is_photo_ending));
        assert!(!["2024", "heic", "txt", ""].into_iter().any(is_photo_ending));
    }

    #[test]
    fn kinds_that_are_not_read_come_with_advice() {
        for (bytes, found, to_do) in [
            (&b"\0\0\0\x18ftypheic"[..], "an HEIC picture", "Most Compatible"),
            (b"\0\0\0\x18ftypavif", "an AVIF picture", "save it as JPEG"),
            (b"\0\0\0\x0cJXL \r\n", "a JPEG XL picture", "save it as JPEG"),
            (b"FUJIFILMCCD-RAW", "a camera raw photo (Fujifilm RAF)", "TIFF of 16 bits"),
            (b"II*\0\x10\0\0\0CR\x02\0", "a camera raw photo (Canon CR2)", "TIFF of 16 bits"),
            (b"II+\0\x08\0\0\0", "a BigTIFF picture", "a plain TIFF"),
        ] {
            let words = recognise(bytes).unwrap_err().to_string();
            assert!(words.contains(found) && words.contains(to_do), "{words}");
            assert_eq!(words.lines().count(), 1, "{words}");
        }
    }
}
