//! What an EXIF block says of the picture itself, made true of a result (EXIF 2.3, §4.5 and §4.6).

use crate::frame::Size;

use super::Flaw;
use super::tiff::{EXIF_DIRECTORY, File, IMAGE_LENGTH, IMAGE_WIDTH};

const PIXEL_WIDTH: u16 = 0xa002;
const PIXEL_HEIGHT: u16 = 0xa003;
const INTEROPERABILITY: u16 = 0xa005;
/// In the directory of that: the sizes as the camera first wrote them.
const RELATED_WIDTH: u16 = 0x1001;
const RELATED_HEIGHT: u16 = 0x1002;

/// The block `exif`, from its TIFF header on, of a picture of `size` that was made anew: sizes that
/// it states are those, and it holds no thumbnail of the old one. What of it cannot be read stays.
pub(super) fn of_result(exif: &[u8], size: Size) -> Vec<u8> {
    let mut made = exif.to_vec();
    let _ = make_true(exif, &mut made, size);
    made
}

fn make_true(exif: &[u8], made: &mut [u8], size: Size) -> Result<(), Flaw> {
    let file = File::new(exif);
    let first = file.u32(4)? as usize;
    let mut below = None;
    for entry in entries(&file, first)? {
        match file.u16(entry)? {
            IMAGE_WIDTH => write(&file, made, entry, size.width)?,
            IMAGE_LENGTH => write(&file, made, entry, size.height)?,
            EXIF_DIRECTORY => below = Some(file.first(entry)?),
            _ => {}
        }
    }
    // The second directory is the thumbnail's: without a way to it there is none.
    let next = first + 2 + 12 * usize::from(file.u16(first)?);
    if file.u32(next)? != 0 {
        made[next..next + 4].fill(0);
    }
    let mut further = None;
    for entry in below.map_or(Ok(Vec::new()), |below| entries(&file, below))? {
        match file.u16(entry)? {
            PIXEL_WIDTH => write(&file, made, entry, size.width)?,
            PIXEL_HEIGHT => write(&file, made, entry, size.height)?,
            INTEROPERABILITY => further = Some(file.first(entry)?),
            _ => {}
        }
    }
    for entry in further.map_or(Ok(Vec::new()), |further| entries(&file, further))? {
        match file.u16(entry)? {
            RELATED_WIDTH => write(&file, made, entry, size.width)?,
            RELATED_HEIGHT => write(&file, made, entry, size.height)?,
            _ => {}
        }
    }
    Ok(())
}

/// Where the entries of the directory at `at` are.
fn entries(file: &File<'_>, at: usize) -> Result<Vec<usize>, Flaw> {
    Ok((0..usize::from(file.u16(at)?)).map(|n| at + 2 + 12 * n).collect())
}

/// Writes the one number of the entry at `entry`, a SHORT or a LONG.
fn write(file: &File<'_>, made: &mut [u8], entry: usize, value: usize) -> Result<(), Flaw> {
    file.first(entry)?;
    let (at, big) = (entry + 8, file.big_endian);
    match file.u16(entry + 2)? {
        3 => {
            let short = u16::try_from(value).unwrap_or(u16::MAX);
            let bytes = if big { short.to_be_bytes() } else { short.to_le_bytes() };
            made[at..at + 2].copy_from_slice(&bytes);
        }
        _ => {
            let long = value as u32;
            let bytes = if big { long.to_be_bytes() } else { long.to_le_bytes() };
            made[at..at + 4].copy_from_slice(&bytes);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block with a width in its first directory, a height in the EXIF one, a width in the one
    /// below that, and a thumbnail.
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
        entry(&mut all, PIXEL_HEIGHT, 3, of_short(3000));
        entry(&mut all, INTEROPERABILITY, 4, long(68));
        all.extend(long(0));
        all.extend(short(1));
        entry(&mut all, RELATED_WIDTH, 3, of_short(4000));
        all.extend(long(0));
        all.extend(short(1));
        entry(&mut all, 0x0201, 4, long(0));
        all.extend(long(0));
        all
    }

    #[test]
    fn sizes_are_the_result_s_and_the_old_thumbnail_is_gone() {
        for big in [false, true] {
            let made = of_result(&block(big), Size::new(1024, 768));
            let file = File::new(&made);
            assert_eq!(file.first(10).unwrap(), 1024, "width");
            assert_eq!(file.first(40).unwrap(), 768, "height");
            assert_eq!(file.first(70).unwrap(), 1024, "width in the directory of that");
            assert_eq!(file.u32(34).unwrap(), 0, "no way to the thumbnail");
            assert_eq!(made.len(), block(big).len(), "and all else stays where it is");
        }
        let broken = b"II*\0\xff\xff\xff\xff";
        assert_eq!(of_result(broken, Size::new(1, 1)), broken);
    }
}
