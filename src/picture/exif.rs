//! The EXIF block of a result, with the result's picture sizes and without a thumbnail (EXIF 2.3,
//! §4.5, §4.6). It is made from a TIFF's fields, too, and written into a TIFF.

use std::collections::BTreeMap;

use super::Flaw;
use super::tiff::{
    Directory, EXIF_DIRECTORY, Field, File, GPS_DIRECTORY, IMAGE_LENGTH, IMAGE_WIDTH, MAKER_NOTE,
};
use crate::frame::Size;

pub(super) const MAKE: u16 = 271;
pub(super) const MODEL: u16 = 272;
const INTEROPERABILITY: u16 = 0xa005;
const INTEROPERABILITY_INDEX: u16 = 1;
const COLOUR_SPACE: u16 = 0xa001;

/// Fields of a first directory that describe the photo (TIFF 6.0): description, maker, model,
/// program, date, artist, copyright.
const DESCRIPTIVE: [u16; 7] = [270, MAKE, MODEL, 305, 306, 315, 33432];
/// Fields of EXIF that TIFF/EP keeps in the first directory: exposure time, aperture, sensitivity,
/// date, focal length.
const EXPOSURE: [u16; 5] = [33434, 33437, 34855, 36867, 37386];
/// Longest EXIF block, in bytes: a JPEG's segment holds it beside its name, with some to spare.
const BLOCK_BYTES_MAX: usize = 65_000;

/// The fields of a directory by their tags.
type Fields = BTreeMap<u16, Field>;

/// The field that points to the directory at `to`.
fn pointer(to: u32) -> Field {
    Field { kind: 4, count: 1, bytes: to.to_le_bytes().to_vec() }
}

/// The fields of `directory` that are `wanted`.
fn fields(file: &File<'_>, directory: &Directory<'_>, wanted: impl Fn(u16) -> bool) -> Fields {
    // In reverse, so that the first of two entries with the same tag is kept.
    let each = directory.entries.iter().rev().filter(|(tag, _)| wanted(*tag));
    each.filter_map(|&(tag, entry)| Some((tag, Field::read(file, entry, usize::MAX).ok()?)))
        .collect()
}

/// Appends a directory of `fields` to the little-endian file `out`; returns its place.
fn append(out: &mut Vec<u8>, fields: &Fields) -> u32 {
    out.resize(out.len().next_multiple_of(2), 0);
    let at = out.len();
    let beyond = at + 2 + 12 * fields.len() + 4;
    let mut long = Vec::new();
    out.extend((fields.len() as u16).to_le_bytes());
    for (tag, Field { kind, count, bytes }) in fields {
        out.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        out.extend((*count as u32).to_le_bytes());
        if bytes.len() <= 4 {
            out.extend(bytes.iter().copied().chain([0; 4]).take(4));
        } else {
            out.extend(((beyond + long.len()) as u32).to_le_bytes());
            long.extend_from_slice(bytes);
            long.resize(long.len().next_multiple_of(2), 0);
        }
    }
    out.extend([0; 4]);
    out.extend(long);
    at as u32
}

/// Adds to `main` the descriptive fields of the directories at `from` in `file`, and appends their
/// EXIF and GPS directories to `out`. Makers' notes are not carried: they contain file positions.
fn describe(file: &File<'_>, from: &[usize], main: &mut Fields, out: &mut Vec<u8>) {
    let (mut exif, mut gps) = (Fields::new(), Fields::new());
    for first in from.iter().rev().filter_map(|&at| Directory::read(file, at).ok()) {
        main.extend(fields(file, &first, |tag| DESCRIPTIVE.contains(&tag)));
        exif.extend(fields(file, &first, |tag| EXPOSURE.contains(&tag)));
        if let Some(own) = first.below(EXIF_DIRECTORY) {
            exif.extend(fields(file, &own, |tag| ![INTEROPERABILITY, MAKER_NOTE].contains(&tag)));
        }
        if let Some(place) = first.below(GPS_DIRECTORY) {
            gps.extend(fields(file, &place, |_| true));
        }
    }
    for (tag, fields) in [(EXIF_DIRECTORY, exif), (GPS_DIRECTORY, gps)] {
        if !fields.is_empty() {
            let at = append(out, &fields);
            main.insert(tag, pointer(at));
        }
    }
}

/// Sets the place of the first directory of the little-endian file `out`.
fn begin_at(out: &mut [u8], at: u32) {
    out[4..8].copy_from_slice(&at.to_le_bytes());
}

/// The EXIF block of a TIFF or raw photo, made from the directories at `from` in `file`; `None` if
/// no field describes the photo, or the block is too long.
pub(super) fn of_tiff(file: &File<'_>, from: &[usize]) -> Option<Vec<u8>> {
    let (mut out, mut main) = (b"II*\0\0\0\0\0".to_vec(), Fields::new());
    describe(file, from, &mut main, &mut out);
    let at = append(&mut out, &main);
    begin_at(&mut out, at);
    (!main.is_empty() && out.len() <= BLOCK_BYTES_MAX).then_some(out)
}

/// Adds the photo's `exif` to `bytes`, a result's little-endian TIFF. Its first directory is
/// written anew; the data to which it points stay in place.
pub(super) fn into_tiff(mut bytes: Vec<u8>, exif: &[u8]) -> Vec<u8> {
    let (result, photo) = (File::new(&bytes), File::new(exif));
    let (Ok(first), Ok(described)) = (Directory::first(&result), photo.u32(4)) else {
        return bytes;
    };
    if result.big_endian {
        return bytes;
    }
    let mut main = fields(&result, &first, |_| true);
    describe(&photo, &[described as usize], &mut main, &mut bytes);
    let at = append(&mut bytes, &main);
    begin_at(&mut bytes, at);
    bytes
}

/// Maker and model in `directory`, if stated.
pub(super) fn camera_in(directory: &Directory<'_>) -> Option<String> {
    let text = |tag| directory.text(tag).ok().flatten().unwrap_or_default();
    let name = [MAKE, MODEL].map(text).join(" ").trim().to_owned();
    (!name.is_empty()).then_some(name)
}

/// Maker and model in the block `exif`; rpicam-apps state them in the EXIF directory.
pub(super) fn camera(exif: &[u8]) -> Option<String> {
    let file = File::new(exif);
    let first = Directory::first(&file).ok()?;
    camera_in(&first).or_else(|| camera_in(&first.below(EXIF_DIRECTORY)?))
}

/// Whether the block `exif` states Adobe RGB (DCF 2.0, §4.6; EXIF 2.3, §4.6.5).
pub(super) fn is_adobe_rgb(exif: &[u8]) -> bool {
    let file = File::new(exif);
    let first = Directory::first(&file).ok();
    let Some(exif) = first.and_then(|first| first.below(EXIF_DIRECTORY)) else { return false };
    let index = || exif.below(INTEROPERABILITY)?.text(INTEROPERABILITY_INDEX).ok().flatten();
    match exif.number(COLOUR_SPACE) {
        Ok(Some(space)) => space == 2 || space == 0xffff && index().as_deref() == Some("R03"),
        _ => false,
    }
}

/// A chain of directories from the first one: the tags of width, height and the next directory.
const DIRECTORIES: [[u16; 3]; 3] = [
    [IMAGE_WIDTH, IMAGE_LENGTH, EXIF_DIRECTORY],
    [0xa002, 0xa003, INTEROPERABILITY],
    // The sizes as the camera first wrote them.
    [0x1001, 0x1002, 0],
];

/// The block `exif`, from its TIFF header on, for a result of `size`: with that size and without
/// the photo's thumbnail. What cannot be read stays as it is.
pub(super) fn of_result(exif: &[u8], size: Size) -> Vec<u8> {
    let mut updated = exif.to_vec();
    let _ = update(exif, &mut updated, size);
    updated
}

fn update(exif: &[u8], updated: &mut [u8], size: Size) -> Result<(), Flaw> {
    let file = File::new(exif);
    let mut at = Some(file.u32(4)? as usize);
    for [width, height, below] in DIRECTORIES {
        let Some(place) = at else { break };
        let directory = Directory::read(&file, place)?;
        for (tag, side) in [(width, size.width), (height, size.height)] {
            if let Some(entry) = directory.find(tag) {
                write(&file, updated, entry, side)?;
            }
        }
        // The second directory describes the thumbnail.
        if width == IMAGE_WIDTH && directory.next()? != 0 {
            let field = directory.next_field();
            updated[field..field + 4].fill(0);
        }
        at = directory.number(below)?;
    }
    Ok(())
}

/// Writes `value` into the entry at `entry`, a SHORT or a LONG.
fn write(file: &File<'_>, updated: &mut [u8], entry: usize, value: usize) -> Result<(), Flaw> {
    file.first(entry)?;
    let (at, big) = (entry + 8, file.big_endian);
    let (width, most) = if file.u16(entry + 2)? == 3 { (2, 0xffff) } else { (4, u32::MAX) };
    let number = u32::try_from(value).unwrap_or(most).min(most);
    let (greatest_first, least_first) = (number.to_be_bytes(), number.to_le_bytes());
    let bytes = if big { &greatest_first[4 - width..] } else { &least_first[..width] };
    updated[at..at + width].copy_from_slice(bytes);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block with a width in the first directory, a height in its EXIF directory, another width
    /// in the directory below that, and a thumbnail.
    fn block(big: bool) -> Vec<u8> {
        let short = |v: u16| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let long = |v: u32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let mut all = if big { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
        let entry = |all: &mut Vec<u8>, tag: u16, kind: u16, value: [u8; 4]| {
            all.extend(short(tag).into_iter().chain(short(kind)).chain(long(1)).chain(value));
        };
        let of_short = |v: u16| {
            let [a, b] = short(v);
            [a, b, 0, 0]
        };
        all.extend(long(8).into_iter().chain(short(2)));
        entry(&mut all, IMAGE_WIDTH, 4, long(4000));
        entry(&mut all, EXIF_DIRECTORY, 4, long(38));
        all.extend(long(86).into_iter().chain(short(2)));
        entry(&mut all, 0xa003, 3, of_short(3000));
        entry(&mut all, INTEROPERABILITY, 4, long(68));
        all.extend(long(0));
        all.extend(short(1));
        entry(&mut all, 0x1001, 3, of_short(4000));
        all.extend(long(0));
        all.extend(short(1));
        entry(&mut all, 0x0201, 4, long(0));
        all.extend(long(0));
        all
    }

    #[test]
    fn a_tiff_s_fields_go_into_a_block_and_back_into_a_tiff() {
        for big in [false, true] {
            let mut photo = block(big);
            photo[10..12].copy_from_slice(&if big {
                271u16.to_be_bytes()
            } else {
                271u16.to_le_bytes()
            });
            let file = File::new(&photo);
            let made = of_tiff(&file, &[8]).unwrap();
            let empty = Fields::from([(IMAGE_WIDTH, pointer(7))]);
            let mut plain = b"II*\0\0\0\0\0".to_vec();
            let at = append(&mut plain, &empty);
            begin_at(&mut plain, at);
            let result = into_tiff(plain, &made);
            let file = File::new(&result);
            let first = Directory::read(&file, file.u32(4).unwrap() as usize).unwrap();
            assert_eq!(first.number(IMAGE_WIDTH).unwrap(), Some(7), "the result's own");
            assert_eq!(first.number(271).unwrap(), Some(4000));
            let below = first.number(EXIF_DIRECTORY).unwrap().unwrap();
            let exif = Directory::read(&file, below).unwrap();
            assert_eq!(exif.number(0xa003).unwrap(), Some(3000));
            assert!(exif.find(INTEROPERABILITY).is_none());
            (0..made.len()).for_each(|cut| drop(of_tiff(&File::new(&made[..cut]), &[8])));
        }
        assert_eq!(into_tiff(b"II*\0".to_vec(), b"II"), b"II*\0");
        let nothing = append(&mut b"II*\0\x08\0\0\0".to_vec(), &Fields::new());
        assert!(of_tiff(&File::new(b"II*\0"), &[nothing as usize]).is_none());
    }

    #[test]
    fn a_camera_is_named_in_the_first_directory_or_beside_the_exposure() {
        let text = |words: &[u8]| Field { kind: 2, count: words.len(), bytes: words.to_vec() };
        let names = || Fields::from([(MAKE, text(b"Raspberry Pi\0")), (MODEL, text(b"imx296\0"))]);
        for below in [false, true] {
            let mut out = b"II*\0\0\0\0\0".to_vec();
            let mut at = append(&mut out, &names());
            if below {
                at = append(&mut out, &Fields::from([(EXIF_DIRECTORY, pointer(at))]));
            }
            begin_at(&mut out, at);
            assert_eq!(camera(&out).as_deref(), Some("Raspberry Pi imx296"));
            (0..out.len()).for_each(|cut| drop(camera(&out[..cut])));
        }
        assert_eq!(camera(b"II*\0\xff\xff\xff\xff"), None);
    }

    #[test]
    fn adobe_rgb_is_recognised_by_number_or_by_index() {
        let with = |space: u32, index: Option<&[u8]>| {
            let mut out = b"II*\0\0\0\0\0".to_vec();
            let mut exif = Fields::from([(COLOUR_SPACE, pointer(space))]);
            if let Some(index) = index {
                let text = Field { kind: 2, count: index.len(), bytes: index.to_vec() };
                let at = append(&mut out, &Fields::from([(INTEROPERABILITY_INDEX, text)]));
                exif.insert(INTEROPERABILITY, pointer(at));
            }
            let at = append(&mut out, &exif);
            let at = append(&mut out, &Fields::from([(EXIF_DIRECTORY, pointer(at))]));
            begin_at(&mut out, at);
            is_adobe_rgb(&out)
        };
        assert!(with(2, None) && with(0xffff, Some(b"R03\0")));
        assert!(!with(1, None) && !with(0xffff, None) && !with(1, Some(b"R98\0")));
        assert!(!is_adobe_rgb(b"II*"));
    }

    #[test]
    fn a_result_has_its_own_sizes_and_no_thumbnail() {
        for big in [false, true] {
            let updated = of_result(&block(big), Size::new(1024, 768));
            let file = File::new(&updated);
            assert_eq!(file.first(10).unwrap(), 1024, "width");
            assert_eq!(file.first(40).unwrap(), 768, "height");
            assert_eq!(file.first(70).unwrap(), 1024, "width in the lowest directory");
            assert_eq!(file.u32(34).unwrap(), 0, "no thumbnail");
            assert_eq!(updated.len(), block(big).len(), "all else stays in place");
        }
        let broken = b"II*\0\xff\xff\xff\xff";
        assert_eq!(of_result(broken, Size::new(1, 1)), broken);
    }
}
