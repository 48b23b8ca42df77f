//! Updates the EXIF block of a result: its picture sizes, and no thumbnail (EXIF 2.3, §4.5, §4.6).

use super::Flaw;
use super::tiff::{Directory, EXIF_DIRECTORY, File, IMAGE_LENGTH, IMAGE_WIDTH};
use crate::frame::Size;

const INTEROPERABILITY: u16 = 0xa005;

/// The directories in a chain: width, height, and the tag of the next one.
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
        // The second directory is the thumbnail's.
        if width == IMAGE_WIDTH && directory.next()? != 0 {
            let field = directory.next_field();
            updated[field..field + 4].fill(0);
        }
        at = directory.number(below)?;
    }
    Ok(())
}

/// Writes the number of the entry at `entry`, a SHORT or a LONG.
fn write(file: &File<'_>, updated: &mut [u8], entry: usize, value: usize) -> Result<(), Flaw> {
    file.first(entry)?;
    let (at, big) = (entry + 8, file.big_endian);
    match file.u16(entry + 2)? {
        3 => {
            let short = u16::try_from(value).unwrap_or(u16::MAX);
            let bytes = if big { short.to_be_bytes() } else { short.to_le_bytes() };
            updated[at..at + 2].copy_from_slice(&bytes);
        }
        _ => {
            let long = value as u32;
            let bytes = if big { long.to_be_bytes() } else { long.to_le_bytes() };
            updated[at..at + 4].copy_from_slice(&bytes);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block with a width in the first directory, a height in the EXIF one, a width in the one
    /// below, and a thumbnail.
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
