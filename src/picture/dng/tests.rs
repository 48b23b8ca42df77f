//! Raw photos are read back as written, and those of other varieties are refused.

use super::*;
use crate::config::Curve;
use crate::frame::{Channel, Channels, Frame, Work};
use crate::picture::tiff::LETTERS_MAX;
use crate::picture::{ColorType, Format, Growth, Limits, Photo, PictureError};

pub(super) const SIZE: Size = Size { width: 42, height: 30 };

pub(super) fn sites() -> Plane<u16> {
    Plane::from_fn(SIZE, |x, y| (60 + (x * 37 + y * 101 + x * y * 7) % 960) as u16)
}

fn file(mosaic: Mosaic) -> Vec<u8> {
    let (sites, camera) = (sites(), "a rig");
    let exposure_s = Some(0.05);
    Dng {
        sites: &sites,
        mosaic,
        black: 64.25,
        white: 1023,
        camera,
        exposure_s,
        crop: None,
        tags: RawTags::default(),
    }
    .bytes()
}

fn read(bytes: &[u8]) -> Result<Photo, PictureError> {
    Photo::from_bytes("a.dng", bytes, Curve::Srgb, &Limits::default())
}

fn words(bytes: &[u8]) -> String {
    read(bytes).unwrap_err().to_string()
}

/// The place of the first directory.
fn first(bytes: &[u8]) -> usize {
    File::new(bytes).u32(4).unwrap() as usize
}

/// The place of the entry of `tag`.
fn entry(bytes: &[u8], tag: u16) -> usize {
    Directory::read(&File::new(bytes), first(bytes)).unwrap().find(tag).unwrap()
}

/// The file with another type, count and value in the entry of `tag`.
pub(super) fn with(tag: u16, kind: u16, count: u32, value: [u8; 4]) -> Vec<u8> {
    let mut bytes = file(Mosaic::Rggb);
    let at = entry(&bytes, tag);
    bytes[at + 2..at + 4].copy_from_slice(&kind.to_le_bytes());
    bytes[at + 4..at + 8].copy_from_slice(&count.to_le_bytes());
    bytes[at + 8..at + 12].copy_from_slice(&value);
    bytes
}

/// The file with the entry of `tag` renamed to `to`.
fn renamed(tag: u16, to: u16) -> Vec<u8> {
    let mut bytes = file(Mosaic::Rggb);
    let at = entry(&bytes, tag);
    bytes[at..at + 2].copy_from_slice(&to.to_le_bytes());
    bytes
}

/// The file without its filter pattern, with `samples` per pixel and this [`PHOTOMETRIC`].
fn of_no_filters(photometric: usize, samples: u16) -> Vec<u8> {
    let mut bytes = renamed(CFA_PATTERN, 40000);
    for (tag, value) in [(PHOTOMETRIC, photometric as u16), (SAMPLES_PER_PIXEL, samples)] {
        let at = entry(&bytes, tag);
        bytes[at + 8..at + 10].copy_from_slice(&value.to_le_bytes());
    }
    bytes
}

/// `raw` as the sub-directory of a preview of 2×2 coloured pixels.
fn behind_a_preview(raw: &[u8]) -> Vec<u8> {
    let mut bytes = raw.to_vec();
    let pixels = bytes.len() as u32;
    bytes.extend([200; 12]);
    let bits = bytes.len() as u32;
    bytes.extend([8, 0, 8, 0, 8, 0]);
    let directory = bytes.len() as u32;
    let entries: [(u16, u16, u32, u32); 12] = [
        (NEW_SUBFILE_TYPE, 4, 1, 1),
        (IMAGE_WIDTH, 4, 1, 2),
        (IMAGE_LENGTH, 4, 1, 2),
        (BITS_PER_SAMPLE, 3, 3, bits),
        (COMPRESSION, 3, 1, 1),
        (PHOTOMETRIC, 3, 1, 2),
        (STRIP_OFFSETS, 4, 1, pixels),
        (ORIENTATION, 3, 1, 6),
        (SAMPLES_PER_PIXEL, 3, 1, 3),
        (STRIP_BYTE_COUNTS, 4, 1, 12),
        (SUB_DIRECTORIES, 4, 1, first(raw) as u32),
        (DNG_VERSION, 1, 4, 0x0401),
    ];
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in entries {
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(count.to_le_bytes());
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([0; 4]);
    bytes[4..8].copy_from_slice(&directory.to_le_bytes());
    bytes
}

/// The same file in big-endian order.
fn big_endian(bytes: &[u8]) -> Vec<u8> {
    let file = File::new(bytes);
    let directory = Directory::read(&file, first(bytes)).unwrap();
    let mut out = bytes.to_vec();
    let mut turn = |at: usize, wide: usize, count: usize| {
        out[at..at + wide * count].chunks_exact_mut(wide).for_each(<[u8]>::reverse);
    };
    turn(4, 4, 1);
    turn(first(bytes), 2, 1);
    for &(tag, entry) in &directory.entries {
        let wide = match file.u16(entry + 2).unwrap() {
            3 => 2,
            4 | 5 | 10 => 4,
            12 => 8,
            _ => 1,
        };
        let fraction = matches!(file.u16(entry + 2).unwrap(), 5 | 10);
        let count = file.u32(entry + 4).unwrap() as usize * if fraction { 2 } else { 1 };
        if count * wide <= 4 {
            turn(entry + 8, wide, count);
        } else {
            turn(file.u32(entry + 8).unwrap() as usize, wide, count);
            turn(entry + 8, 4, 1);
        }
        if tag == STRIP_OFFSETS {
            turn(file.u32(entry + 8).unwrap() as usize, 2, SIZE.area());
        }
        turn(entry, 2, 2);
        turn(entry + 4, 4, 1);
    }
    out[..4].copy_from_slice(b"MM\0*");
    out
}

#[test]
fn written_sites_are_read_back() {
    let counts = sites();
    let light = counts.map(|count| (f32::from(count) - 64.25) / (1023.0 - 64.25) * 255.0);
    for mosaic in Mosaic::ALL {
        let photo = read(&file(mosaic)).unwrap();
        let raw = photo.raw.unwrap();
        assert_eq!(raw.mosaic, mosaic);
        assert!((raw.counts_per_level * 255.0 - (1023.0 - 64.25)).abs() < 0.01);
        let wanted: Frame<Work> = mosaic.interpolated(&light);
        for c in Channel::ALL {
            let pairs = photo.light.plane(c).data().iter().zip(wanted.plane(c).data());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-3), "{mosaic:?} {c:?}");
        }
        assert_eq!((photo.manner.format, photo.manner.colour), (Format::Tiff, ColorType::Rgb16));
        let back = photo.with_picture(&photo.light, Format::Tiff).unwrap();
        let back = Photo::from_bytes("a.tif", &back, Curve::Srgb, &Limits::default()).unwrap();
        assert!(back.raw.is_none() && back.light.size() == SIZE);
    }
    let turned = read(&big_endian(&file(Mosaic::Gbrg))).unwrap();
    assert_eq!(turned.light, read(&file(Mosaic::Gbrg)).unwrap().light);
}

#[test]
fn a_photo_names_its_rig_however_long_the_name() {
    for name in ["a rig".to_owned(), "läng ".repeat(30), "x".repeat(LETTERS_MAX + 1)] {
        let (sites, mosaic) = (sites(), Mosaic::Rggb);
        let file = Dng {
            sites: &sites,
            mosaic,
            black: 64.0,
            white: 1023,
            camera: &name,
            exposure_s: None,
            crop: None,
            tags: RawTags::default(),
        };
        assert_eq!(read(&file.bytes()).unwrap().camera.unwrap().name, camera_of(&name));
    }
}

#[test]
fn a_photo_names_its_camera_and_settings() {
    let focus = Some("2.5 m, f/4; tape at the second mark".to_owned());
    for setting in
        [RigSetting { identity: 0x18f, focus }, RigSetting { identity: u64::MAX, focus: None }]
    {
        let (sites, mosaic) = (sites(), Mosaic::Rggb);
        let gains = Some([[4.0, 1.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.5, 7.0]]);
        let noise = Some([[1e-4, 2e-6], [3e-4, 4e-6], [5e-4, 6e-6]]);
        let tags = RawTags { serial: Some("4711"), setting: Some(&setting), gains, noise };
        let (black, white, exposure_s, crop) = (64.0, 1023, None, None);
        let camera = "a rig";
        let raw = Dng { sites: &sites, mosaic, black, white, camera, exposure_s, crop, tags };
        let bytes = raw.bytes();
        let neutral = Directory::read(&File::new(&bytes), first(&bytes)).unwrap().reals(50728);
        assert_eq!(neutral.unwrap().unwrap(), [0.5, 1.0, 0.75]);
        let expected = PhotoCamera {
            name: "relens a rig".to_owned(),
            serial: Some("4711".to_owned()),
            setting: Some(setting.clone()),
        };
        let photo = read(&bytes).unwrap();
        assert_eq!(photo.camera, Some(expected));
        let noise = photo.raw.unwrap().noise.unwrap();
        let wanted = [[0.13005, 0.0255], [0.2601, 0.0765], [0.39015, 0.1275]];
        for (found, wanted) in noise.as_flattened().iter().zip(wanted.as_flattened()) {
            assert!((found / wanted - 1.0).abs() < 1e-5, "{noise:?}");
        }
    }
    let silent = read(&file(Mosaic::Rggb)).unwrap().camera.unwrap();
    assert_eq!((silent.serial, silent.setting), (None, None));
    assert_eq!(RigSetting::of_words("a sunny day; focus on the cat"), None);
}

#[test]
fn a_raw_photo_cut_anywhere_or_never_filled_is_refused() {
    for whole in [file(Mosaic::Rggb), behind_a_preview(&file(Mosaic::Rggb))] {
        assert!(read(&whole).is_ok());
        for percent in 0..100 {
            let error = read(&whole[..whole.len() * percent / 100]).unwrap_err();
            assert_eq!(error.growth(), Growth::Likely, "cut to {percent} %: {error}");
        }
        let mut hole = whole.clone();
        hole[whole.len() / 2..].fill(0);
        assert!(words(&hole).contains("never filled"), "{}", words(&hole));
    }
}

#[test]
fn the_sites_are_read_and_never_the_preview() {
    let photo = read(&behind_a_preview(&file(Mosaic::Grbg))).unwrap();
    assert_eq!(photo.light, read(&file(Mosaic::Grbg)).unwrap().light);
    assert_eq!(photo.turned(), Some(6), "by the first directory");
    let packed = behind_a_preview(&with(COMPRESSION, 3, 1, [7, 0, 0, 0]));
    assert!(words(&packed).contains("compressed counts (compression 7)"), "{}", words(&packed));
    let grey = read(&behind_a_preview(&of_no_filters(BLACK_IS_ZERO, 1))).unwrap();
    assert_eq!((grey.light.size(), grey.channels), (SIZE, Channels::Green));
    let without = behind_a_preview(&of_no_filters(5, 1));
    assert!(words(&without).contains("no picture of a sensor's sites"), "{}", words(&without));
    // A TIFF/EP file states no DNG version. Its sites may be missing all the same.
    let mut lost = behind_a_preview(&file(Mosaic::Rggb));
    let (version, below) = (entry(&lost, DNG_VERSION), entry(&lost, SUB_DIRECTORIES));
    lost[version..version + 2].copy_from_slice(&60000u16.to_le_bytes());
    assert!(read(&lost).unwrap().raw.is_some());
    let end = lost.len() as u32;
    lost[below + 8..below + 12].copy_from_slice(&end.to_le_bytes());
    for (bytes, wanted) in [(&packed, "compressed counts (compression 7)"), (&lost, "cut short")] {
        let read = Photo::from_bytes("a.tif", bytes, Curve::Srgb, &Limits::default());
        let words = read.unwrap_err().to_string();
        assert!(words.contains(wanted), "by another name: {words}");
    }
}

#[test]
fn other_varieties_are_refused_by_name() {
    let mosaic_of = |pattern| with(CFA_PATTERN, 1, 4, pattern);
    let half_a_file = u32::MAX / 2;
    for (bytes, wanted) in [
        (with(COMPRESSION, 3, 1, [7, 0, 0, 0]), "compressed counts (compression 7)"),
        (with(BITS_PER_SAMPLE, 3, 1, [12, 0, 0, 0]), "1 strips of 42×30 for 42×30"),
        (with(BITS_PER_SAMPLE, 3, 1, [24, 0, 0, 0]), "bits a sample 24"),
        (with(SAMPLES_PER_PIXEL, 3, 1, [3, 0, 0, 0]), "samples a pixel 3"),
        (with(CFA_LAYOUT, 3, 1, [2, 0, 0, 0]), "layout of the colour filters 2"),
        (of_no_filters(LINEAR_RAW, 3), "linear DNG"),
        (renamed(EXPOSURE, LINEARIZATION), "a table"),
        (renamed(EXPOSURE, BLACK_DOWN), "each row"),
        (renamed(CFA_PATTERN, 40000), "found no colour filters"),
        (mosaic_of([1, 1, 0, 2]), "colour filters [1, 1, 0, 2]"),
        (mosaic_of([0, 1, 1, 3]), "colour filters [0, 1, 1, 3]"),
        (with(CFA_REPEAT, 3, 2, [6, 0, 6, 0]), "repeating by [6, 6]"),
        (with(CFA_PLANE_COLOUR, 1, 3, [2, 1, 0, 0]), "colour filters"),
        (with(WHITE_LEVEL, 4, 1, [64, 0, 0, 0]), "black at 64.25 and white at 64"),
        (with(WHITE_LEVEL, 4, 1, [0, 0, 1, 0]), "white at 65536"),
        (with(BLACK_LEVEL, 3, 2, [64, 0, 64, 0]), "2 black levels"),
        (with(BLACK_LEVEL, 4, 1, [0, 0, 1, 0]), "black at 65536"),
        (with(IMAGE_WIDTH, 4, 1, [0; 4]), "a picture of 0×30"),
        (with(IMAGE_WIDTH, 4, 1, half_a_file.to_le_bytes()), "×30"),
        (with(IMAGE_WIDTH, 4, 1, [43, 0, 0, 0]), "strips of 43×30 for 43×30"),
        (with(ROWS_PER_STRIP, 4, 1, [0; 4]), "strips of 42×0"),
        (with(ROWS_PER_STRIP, 4, 1, [7, 0, 0, 0]), "strips of 42×7"),
        (with(STRIP_BYTE_COUNTS, 4, 1, [8, 0, 0, 0]), "1 strips"),
        (with(STRIP_OFFSETS, 4, 1, [255; 4]), "picture data past the end"),
        (with(STRIP_OFFSETS, 4, u32::MAX, [8, 0, 0, 0]), "a field of 4294967295 values"),
        (with(STRIP_OFFSETS, 12, 1, [8, 0, 0, 0]), "a field of type 12"),
        (with(BLACK_LEVEL, 5, 1, [0, 0, 0, 1]), "past the end"),
    ] {
        let words = words(&bytes);
        assert!(words.contains(wanted) && words.contains("allowed"), "{wanted}: {words}");
    }
    // A directory that lists itself as its sub-directory.
    assert!(read(&with(ORIENTATION, 3, 1, [1, 0, 0, 0])).is_ok());
    let mut ring = renamed(ORIENTATION, SUB_DIRECTORIES);
    let at = entry(&ring, SUB_DIRECTORIES);
    ring[at + 2] = 4;
    let itself = first(&ring) as u32;
    ring[at + 8..at + 12].copy_from_slice(&itself.to_le_bytes());
    assert!(read(&ring).is_ok());
    let limits = Limits { pixels_max: 1000, ..Limits::default() };
    let large = Photo::from_bytes("a.dng", &file(Mosaic::Rggb), Curve::Srgb, &limits).unwrap_err();
    assert!(large.to_string().contains("42×30"), "{large}");
    let other = read(&file(Mosaic::Rggb)).unwrap().fit(Size::new(21, 15)).unwrap_err().to_string();
    assert!(other.contains("found 42×30 sites, allowed the rig's whole sensor"), "{other}");
}

#[test]
fn a_sensor_without_filters_gives_a_grey_photo() {
    let light = sites().map(|count| (f32::from(count) - 64.25) / (1023.0 - 64.25) * 255.0);
    for photometric in [BLACK_IS_ZERO, LINEAR_RAW] {
        let bytes = of_no_filters(photometric, 1);
        for curve in [Curve::Linear, Curve::Srgb] {
            let read = |bytes: &[u8]| {
                Photo::from_bytes("a.dng", bytes, curve, &Limits::default()).unwrap()
            };
            let photo = read(&bytes);
            assert_eq!((photo.raw, photo.channels), (None, Channels::Green));
            assert!(photo.notes[0].contains("without colour filters"), "{:?}", photo.notes);
            let close = |found: &Plane, apart: f32| {
                let pairs = found.data().iter().zip(light.data());
                pairs.into_iter().all(|(a, b)| (a - b.max(0.0)).abs() < apart)
            };
            assert!(close(&photo.light.plane(Channel::Green).map(|v: f32| v.max(0.0)), 1e-3));
            // The result has its own curve's profile, and is resampled like any grey photo.
            let back = read(&photo.with_picture(&photo.light, Format::Tiff).unwrap());
            assert_eq!((back.channels, back.manner.colour), (Channels::Green, ColorType::L16));
            assert!(close(back.light.plane(Channel::Green), 0.05), "{curve:?}");
            assert!(photo.fit(Size::new(21, 15)).is_ok());
        }
        // A pattern of filters takes precedence over a photometric value for grey.
        let mut filtered = file(Mosaic::Rggb);
        let at = entry(&filtered, PHOTOMETRIC);
        filtered[at + 8..at + 10].copy_from_slice(&(photometric as u16).to_le_bytes());
        assert!(read(&filtered).unwrap().raw.is_some());
    }
}

#[test]
fn a_proposed_cut_of_the_rig_s_size_is_taken() {
    let (sites, rect) = (sites(), Rect { x: 3, y: 5, size: Size::new(32, 24) });
    let (mosaic, black, white, camera) = (Mosaic::Rggb, 64.0, 1023, "a rig");
    let (exposure_s, tags) = (None, RawTags::default());
    let raw =
        Dng { sites: &sites, mosaic, black, white, camera, exposure_s, crop: Some(rect), tags };
    let on = |grid: PhotoGrid| {
        let limits = Limits::default().on(grid);
        Photo::from_bytes("a.dng", &raw.bytes(), Curve::Srgb, &limits).unwrap().fit(grid)
    };
    let light = sites.map(|count| (f32::from(count) - 64.0) / (1023.0 - 64.0) * 255.0).crop(rect);
    let photo = on(rect.size.into()).unwrap();
    let raw = photo.raw.unwrap();
    assert_eq!(raw.mosaic, Mosaic::Rggb.from_place(3, 5));
    let wanted: Frame<Work> = raw.mosaic.interpolated(&light);
    for c in Channel::ALL {
        let pairs = photo.light.plane(c).data().iter().zip(wanted.plane(c).data());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-3), "{c:?}");
    }
    // The rig's own place on the sensor takes precedence over the file's.
    let rig = PhotoGrid {
        sensor: SIZE,
        photo: Rect { x: 2, y: 2, size: Size::new(20, 20) },
        pattern_px: None,
    };
    assert_eq!(on(rig).unwrap().raw.unwrap().mosaic, Mosaic::Rggb);
    let other = on(Size::new(20, 20).into()).unwrap_err().to_string();
    assert!(other.contains("found 42×30 sites") && other.contains("TIFF of 16 bits"), "{other}");
}

#[test]
fn counts_of_another_depth_and_floating_levels_are_read() {
    let light = read(&file(Mosaic::Rggb)).unwrap().light;
    let of_ten_bits = 42 * 30 * 10 / 8u32;
    let counts = with(STRIP_BYTE_COUNTS, 4, 1, of_ten_bits.to_le_bytes());
    assert_eq!(read(&counts).unwrap().light, light);
    let level = with(BLACK_LEVEL, 11, 1, 64.25f32.to_le_bytes());
    assert_eq!(read(&level).unwrap().light, light);
    let black = {
        let mut bytes = file(Mosaic::Rggb);
        bytes[8 + 42 * 30..8 + 2 * 42 * 30].fill(0);
        bytes
    };
    assert!(read(&black).is_ok(), "sites without light are no hole");
}

#[test]
fn a_result_names_camera_program_and_exposure() {
    let photo = read(&file(Mosaic::Rggb)).unwrap();
    let result = photo.with_picture(&photo.light, Format::Tiff).unwrap();
    let text = |tag| {
        let file = File::new(&result);
        Directory::read(&file, first(&result)).unwrap().text(tag).unwrap()
    };
    assert_eq!(text(MAKE).as_deref(), Some(OUR_MAKE));
    assert!(text(305).unwrap().starts_with("relens "));
    let file = File::new(&result);
    let main = Directory::read(&file, first(&result)).unwrap();
    let exif = main.number(crate::picture::tiff::EXIF_DIRECTORY).unwrap().unwrap();
    assert!(Directory::read(&file, exif).unwrap().find(EXPOSURE).is_some());
    assert!(image::load_from_memory(&result).is_ok(), "still a picture");
    let back = Photo::from_bytes("a.tif", &result, Curve::Srgb, &Limits::default()).unwrap();
    assert_eq!(back.losses, Vec::<String>::new());
}

/// A tag with a value outside its entry, for renaming.
const EXPOSURE: u16 = 33434;

#[test]
#[ignore = "a minute: the gate runs it"]
fn hostile_bytes_give_a_flaw_or_a_photo() {
    let raw = file(Mosaic::Bggr);
    let whole = behind_a_preview(&raw);
    let (mut photos, mut state) = (0, 1u64);
    let mut below = |n: usize| {
        // Numerical Recipes' linear congruential generator; any will do.
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    for _ in 0..4000 {
        let mut bytes = whole.clone();
        for _ in 0..=below(3) {
            // The header or one of the two directories.
            let at = match below(5) {
                0 => below(8),
                1 | 2 => first(&raw) + below(raw.len() - first(&raw)),
                _ => whole.len() - 1 - below(160),
            };
            bytes[at] = [0, 1, 255, 128, below(256) as u8][below(5)];
        }
        match read(&bytes) {
            Ok(photo) => {
                photos += 1;
                let finite = |plane: &Plane| plane.data().iter().all(|v| v.is_finite());
                assert!(photo.light.planes().iter().all(finite));
            }
            Err(error) => assert!(error.to_string().contains("allowed"), "{error}"),
        }
    }
    assert!((400..3800).contains(&photos), "{photos}");
}
