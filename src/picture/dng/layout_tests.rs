//! Raw photos in each supported layout: strips and tiles, bits per site, either byte order, dark
//! sites around the picture.

use super::super::tiff::TILE_OFFSETS;
use super::tests::{SIZE, sites, with};
use super::*;
use crate::config::Curve;
use crate::frame::{Channel, Frame, Work};
use crate::picture::{Limits, Photo};

/// The layout of a file of the [`sites`].
#[derive(Debug, Clone, Copy)]
struct Laid {
    bits: usize,
    /// Size of a strip or tile.
    block: Size,
    in_tiles: bool,
    big_endian: bool,
    /// Top, left, bottom and right of the active sites.
    active: Option<[u32; 4]>,
}

const STRIPS: Laid = Laid {
    bits: 16,
    block: Size { width: SIZE.width, height: 7 },
    in_tiles: false,
    big_endian: false,
    active: None,
};

/// One tile of all sites, as PiDNG writes it for picamera2.
const PI_DNG: Laid = Laid { block: SIZE, in_tiles: true, ..STRIPS };

impl Laid {
    fn number(&self, value: u32, wide: usize) -> Vec<u8> {
        let bytes = value.to_be_bytes()[4 - wide..].to_vec();
        if self.big_endian { bytes } else { bytes.into_iter().rev().collect() }
    }

    /// The counts, cut to the layout's bits.
    fn counts(&self) -> Plane<u16> {
        sites().map(|count| if self.bits == 8 { count >> 2 } else { count })
    }

    fn block(&self, x0: usize, y0: usize) -> Vec<u8> {
        let (counts, mut bytes) = (self.counts(), Vec::new());
        let rows =
            if self.in_tiles { self.block.height } else { self.block.height.min(SIZE.height - y0) };
        for y in y0..y0 + rows {
            let row =
                (x0..x0 + self.block.width).map(|x| match x < SIZE.width && y < SIZE.height {
                    true => u32::from(counts.at(x, y)),
                    false => 0,
                });
            if self.bits == 16 {
                bytes.extend(row.flat_map(|count| self.number(count, 2)));
                continue;
            }
            // Bit by bit, the most significant first; each row begins with a new byte.
            let bits: Vec<u32> = row
                .flat_map(|count| (0..self.bits).rev().map(move |bit| count >> bit & 1))
                .collect();
            let byte =
                |bits: &[u32]| (0..8).fold(0, |b, n| b << 1 | bits.get(n).unwrap_or(&0)) as u8;
            bytes.extend(bits.chunks(8).map(byte));
        }
        bytes
    }

    /// The file's bytes.
    fn file(&self) -> Vec<u8> {
        let mut bytes = if self.big_endian { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
        bytes.extend([0; 4]);
        let (mut offsets, mut counts) = (Vec::new(), Vec::new());
        for y in (0..SIZE.height).step_by(self.block.height) {
            for x in (0..SIZE.width).step_by(self.block.width) {
                let block = self.block(x, y);
                offsets.push(bytes.len() as u32);
                counts.push(block.len() as u32);
                bytes.extend(block);
            }
        }
        let (white, black) = if self.bits == 8 { (255, 15) } else { (1023, 60) };
        let (width, height) = (self.block.width as u32, self.block.height as u32);
        let (byte, short, long) = (1usize, 2usize, 4usize);
        let mut entries = vec![
            (NEW_SUBFILE_TYPE, long, vec![0]),
            (IMAGE_WIDTH, long, vec![SIZE.width as u32]),
            (IMAGE_LENGTH, long, vec![SIZE.height as u32]),
            (BITS_PER_SAMPLE, short, vec![self.bits as u32]),
            (COMPRESSION, short, vec![1]),
            (PHOTOMETRIC, short, vec![SITES as u32]),
            (SAMPLES_PER_PIXEL, short, vec![1]),
            (CFA_REPEAT, short, vec![2, 2]),
            (CFA_PATTERN, byte, vec![2, 1, 1, 0]),
            (DNG_VERSION, byte, vec![1, 4, 0, 0]),
            (BLACK_REPEAT, short, vec![2, 2]),
            (BLACK_LEVEL, short, vec![black, black + 1, black + 2, black + 3]),
            (WHITE_LEVEL, short, vec![white]),
        ];
        if self.in_tiles {
            entries.extend([(322, short, vec![width]), (323, short, vec![height])]);
            entries.extend([(TILE_OFFSETS, long, offsets), (325, long, counts)]);
        } else {
            entries.push((ROWS_PER_STRIP, long, vec![height]));
            entries.extend([(STRIP_OFFSETS, long, offsets), (STRIP_BYTE_COUNTS, long, counts)]);
        }
        entries.extend(self.active.map(|area| (ACTIVE_AREA, long, area.to_vec())));
        let at = bytes.len() as u32;
        bytes[4..8].copy_from_slice(&self.number(at, 4));
        bytes.extend(self.number(entries.len() as u32, 2));
        let mut after = Vec::new();
        let beyond = at + 2 + 12 * entries.len() as u32 + 4;
        for (tag, wide, values) in entries {
            let kind = [0, 1, 3, 0, 4][wide];
            bytes.extend([self.number(u32::from(tag), 2), self.number(kind, 2)].concat());
            bytes.extend(self.number(values.len() as u32, 4));
            let value: Vec<u8> = values.iter().flat_map(|&v| self.number(v, wide)).collect();
            if value.len() <= 4 {
                bytes.extend(value.iter().copied().chain([0; 4]).take(4));
            } else {
                bytes.extend(self.number(beyond + after.len() as u32, 4));
                after.extend(value);
            }
        }
        bytes.extend([0; 4]);
        bytes.extend(after);
        bytes
    }

    /// The expected light, at the active sites.
    fn light(&self) -> (Plane, Mosaic) {
        let [top, left, bottom, right] = self
            .active
            .unwrap_or([0, 0, SIZE.height as u32, SIZE.width as u32])
            .map(|v| v as usize);
        let (white, black) = if self.bits == 8 { (255.0, 15.0) } else { (1023.0, 60.0) };
        let counts = self.counts();
        let light = Plane::from_fn(Size::new(right - left, bottom - top), |x, y| {
            let black = black + (2 * (y % 2) + x % 2) as f32;
            let mean = if self.bits == 8 { 16.5 } else { 61.5 };
            (f32::from(counts.at(left + x, top + y)) - black) / (white - mean) * 255.0
        });
        (light, Mosaic::Bggr)
    }
}

fn read(bytes: &[u8]) -> Result<Photo, String> {
    let read = Photo::from_bytes("a.dng", bytes, Curve::Srgb, &Limits::default());
    read.map_err(|error| error.to_string())
}

#[test]
fn strips_and_tiles_of_eight_to_sixteen_bits_are_read() {
    let tiles = Laid { block: Size { width: 16, height: 16 }, in_tiles: true, ..STRIPS };
    let mut layouts = Vec::new();
    for bits in [8, 10, 12, 14, 16] {
        for layout in [STRIPS, PI_DNG, tiles] {
            for big_endian in [false, true] {
                layouts.push(Laid { bits, big_endian, ..layout });
            }
        }
    }
    // Two dark rows above, two dark columns on the left, and one dark row below.
    layouts.push(Laid { active: Some([2, 2, 29, 42]), ..STRIPS });
    layouts.push(Laid { active: Some([3, 1, 30, 40]), bits: 12, ..tiles });
    for layout in layouts {
        let photo = read(&layout.file()).unwrap_or_else(|error| panic!("{layout:?}: {error}"));
        let (light, mosaic) = layout.light();
        assert_eq!((photo.light.size(), photo.raw.unwrap().mosaic), (light.size(), mosaic));
        let wanted: Frame<Work> = mosaic.interpolated(&light);
        for c in Channel::ALL {
            let pairs = photo.light.plane(c).data().iter().zip(wanted.plane(c).data());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-3), "{layout:?} {c:?}");
        }
    }
}

#[test]
fn layouts_without_a_picture_are_refused_by_name() {
    let refused = |layout: &Laid, change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = layout.file();
        change(&mut bytes);
        read(&bytes).expect_err("no picture")
    };
    let whole = |_: &mut Vec<u8>| {};
    let short = |bytes: &mut Vec<u8>, tag: u16, value: u16| {
        let at = bytes.windows(4).position(|w| w == [tag.to_le_bytes(), [3, 0]].concat()).unwrap();
        bytes[at + 8..at + 10].copy_from_slice(&value.to_le_bytes());
    };
    for (words, wanted) in [
        (refused(&Laid { active: Some([0, 0, 31, 42]), ..STRIPS }, &whole), "active area"),
        (refused(&Laid { active: Some([9, 0, 9, 42]), ..STRIPS }, &whole), "active area"),
        (refused(&PI_DNG, &|b| short(b, 322, 21)), "1 tiles of 21×30"),
        (refused(&PI_DNG, &|b| short(b, 323, 0)), "1 tiles of 42×0"),
        (refused(&PI_DNG, &|b| short(b, 322, 60000)), "1 tiles of 60000×30"),
        (refused(&PI_DNG, &|b| short(b, BITS_PER_SAMPLE, 12)), "1 tiles of 42×30"),
        (refused(&PI_DNG, &|b| short(b, BITS_PER_SAMPLE, 11)), "bits a sample 11"),
    ] {
        assert!(words.contains(wanted) && words.contains("allowed"), "{wanted}: {words}");
    }
}

/// The upright place of a site, by EXIF's visual sides of row 0 and column 0.
fn upright(orientation: u8, (column, row): (usize, usize)) -> (usize, usize) {
    let (right, bottom) = (SIZE.width - 1, SIZE.height - 1);
    match orientation {
        3 => (right - column, bottom - row),
        6 => (bottom - row, column),
        8 => (row, right - column),
        _ => (column, row),
    }
}

#[test]
fn a_turned_raw_photo_comes_back_upright_pixel_for_pixel() {
    let delivered = |orientation: u8| {
        let bytes = with(ORIENTATION, 3, 1, [orientation, 0, 0, 0]);
        let photo = read(&bytes).unwrap();
        let written = photo.with_picture(&photo.light, crate::picture::Format::Tiff).unwrap();
        read(&written).unwrap()
    };
    let stored = delivered(1);
    for orientation in [1, 3, 6, 8] {
        let result = delivered(orientation);
        // Viewers must not turn it once more.
        assert_eq!(result.turned(), None, "{orientation}");
        for c in Channel::ALL {
            for (column, row) in (0..SIZE.area()).map(|n| (n % SIZE.width, n / SIZE.width)) {
                let (x, y) = upright(orientation, (column, row));
                let pair = (result.light.plane(c).at(x, y), stored.light.plane(c).at(column, row));
                assert!(pair.0 == pair.1, "{orientation} {c:?} {column} {row}: {pair:?}");
            }
        }
    }
}
