//! Raw photos as other programs lay them out: a Raspberry Pi's, by `rpicam-still --raw`, which
//! writes with libtiff. Its layout is put together here tag by tag.

use super::tests::{SIZE, sites};
use super::*;
use crate::config::{Curve, RawResults};
use crate::frame::{Channel, Frame, Work};
use crate::picture::tiff::EXIF_DIRECTORY;
use crate::picture::{ColorType, Format, Limits, Photo, ReadOptions};

const ASCII: u16 = 2;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const RATIONAL: u16 = 5;
const SRATIONAL: u16 = 10;

/// Tag, type, number of values, and their bytes.
type Entry = (u16, u16, u32, Vec<u8>);

fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn longs(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Fractions to which libtiff converts floating-point numbers.
fn fractions(values: &[f64]) -> Vec<u8> {
    let each = |v: &f64| [((v * 1e6).round() as i32).to_le_bytes(), 1_000_000i32.to_le_bytes()];
    values.iter().flat_map(each).flatten().collect()
}

/// Appends a directory with its longer values after it; returns its place.
fn directory(bytes: &mut Vec<u8>, entries: Vec<Entry>) -> u32 {
    let at = bytes.len() as u32;
    let mut beyond = at + 2 + 12 * entries.len() as u32 + 4;
    let mut after = Vec::new();
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in entries {
        bytes.extend([shorts(&[tag, kind]), longs(&[count])].concat());
        if value.len() <= 4 {
            bytes.extend(value.iter().copied().chain([0; 4]).take(4));
        } else {
            bytes.extend(beyond.to_le_bytes());
            beyond += value.len() as u32;
            after.extend(value);
        }
    }
    bytes.extend([0; 4]);
    bytes.extend(after);
    at
}

/// A camera's automatic white balance and colour correction: gains of red and blue, and the matrix
/// from balanced channels to sRGB.
const GAINS: [f64; 3] = [2.0, 1.0, 1.6];
const TO_SRGB: [f64; 9] = [1.8, -0.6, -0.2, -0.3, 1.7, -0.4, 0.0, -0.5, 1.5];

/// A Raspberry Pi's file of the sites, blue first, in strips of seven rows behind a thumbnail.
fn raspberry_pi_file() -> Vec<u8> {
    const ROWS: usize = 7;
    let mut bytes = b"II*\0\0\0\0\0".to_vec();
    let thumbnail = bytes.len() as u32;
    bytes.extend([90; 12]);
    let (mut offsets, mut counts) = (Vec::new(), Vec::new());
    for rows in sites().data().chunks(ROWS * SIZE.width) {
        offsets.push(bytes.len() as u32);
        counts.push(2 * rows.len() as u32);
        bytes.extend(shorts(rows));
    }
    let strips = offsets.len() as u32;
    let raw = directory(
        &mut bytes,
        vec![
            (NEW_SUBFILE_TYPE, LONG, 1, longs(&[0])),
            (IMAGE_WIDTH, SHORT, 1, shorts(&[SIZE.width as u16])),
            (IMAGE_LENGTH, SHORT, 1, shorts(&[SIZE.height as u16])),
            (BITS_PER_SAMPLE, SHORT, 1, shorts(&[16])),
            (COMPRESSION, SHORT, 1, shorts(&[1])),
            (PHOTOMETRIC, SHORT, 1, shorts(&[SITES as u16])),
            (STRIP_OFFSETS, LONG, strips, longs(&offsets)),
            (SAMPLES_PER_PIXEL, SHORT, 1, shorts(&[1])),
            (ROWS_PER_STRIP, SHORT, 1, shorts(&[ROWS as u16])),
            (STRIP_BYTE_COUNTS, LONG, strips, longs(&counts)),
            (CFA_REPEAT, SHORT, 2, shorts(&[2, 2])),
            (CFA_PATTERN, 1, 4, vec![2, 1, 1, 0]),
            (BLACK_REPEAT, SHORT, 2, shorts(&[2, 2])),
            (BLACK_LEVEL, RATIONAL, 4, fractions(&[60.0; 4])),
            (WHITE_LEVEL, LONG, 1, longs(&[1023])),
        ],
    );
    let exif = directory(&mut bytes, vec![(34855, SHORT, 1, shorts(&[100]))]);
    // XYZ to the camera: the inverse of gains, correction and sRGB's primaries together.
    let of_xyz = nalgebra::Matrix3::from_row_slice(&[
        3.2406, -1.5372, -0.4986, -0.9689, 1.8758, 0.0415, 0.0557, -0.2040, 1.0570,
    ]);
    let balance = nalgebra::Matrix3::from_diagonal(&GAINS.into());
    let to_srgb = nalgebra::Matrix3::from_row_slice(&TO_SRGB) * balance;
    let camera_of_xyz = (to_srgb.try_inverse().unwrap() * of_xyz).transpose();
    let first = directory(
        &mut bytes,
        vec![
            (NEW_SUBFILE_TYPE, LONG, 1, longs(&[1])),
            (IMAGE_WIDTH, SHORT, 1, shorts(&[2])),
            (IMAGE_LENGTH, SHORT, 1, shorts(&[2])),
            (BITS_PER_SAMPLE, SHORT, 3, shorts(&[8, 8, 8])),
            (COMPRESSION, SHORT, 1, shorts(&[1])),
            (PHOTOMETRIC, SHORT, 1, shorts(&[2])),
            (MAKE, ASCII, 13, b"Raspberry Pi\0".to_vec()),
            (MODEL, ASCII, 7, b"imx296\0".to_vec()),
            (STRIP_OFFSETS, LONG, 1, longs(&[thumbnail])),
            (ORIENTATION, SHORT, 1, shorts(&[1])),
            (SAMPLES_PER_PIXEL, SHORT, 1, shorts(&[3])),
            (STRIP_BYTE_COUNTS, LONG, 1, longs(&[12])),
            (SUB_DIRECTORIES, LONG, 1, longs(&[raw])),
            (EXIF_DIRECTORY, LONG, 1, longs(&[exif])),
            (DNG_VERSION, 1, 4, vec![1, 1, 0, 0]),
            (COLOUR_MATRICES[0], SRATIONAL, 9, fractions(camera_of_xyz.as_slice())),
            (AS_SHOT_NEUTRAL, RATIONAL, 3, fractions(&GAINS.map(|gain| 1.0 / gain))),
            (CALIBRATION_ILLUMINANTS[0], SHORT, 1, shorts(&[D65])),
        ],
    );
    bytes[4..8].copy_from_slice(&first.to_le_bytes());
    bytes
}

fn read() -> Photo {
    Photo::from_bytes("a.dng", &raspberry_pi_file(), Curve::Linear, &Limits::default()).unwrap()
}

#[test]
fn a_raspberry_pi_s_raw_photo_is_read_with_its_colours() {
    let photo = read();
    let raw = photo.raw.unwrap();
    assert_eq!((raw.mosaic, photo.light.size()), (Mosaic::Bggr, SIZE));
    let camera = photo.camera.clone().unwrap();
    assert_eq!((camera.name.as_str(), camera.setting), ("Raspberry Pi imx296", None));
    let light = sites().map(|count| (f32::from(count) - 60.0) / (1023.0 - 60.0) * 255.0);
    let wanted: Frame<Work> = Mosaic::Bggr.interpolated(&light);
    for c in Channel::ALL {
        let pairs = photo.light.plane(c).data().iter().zip(wanted.plane(c).data());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-3), "{c:?}");
    }
    // The result has the colours that the Pi's own program makes of its balanced light.
    let seen: Frame<Work> = Frame::from_fn(|c| Plane::filled(SIZE, [30.0, 90.0, 40.0][c.index()]));
    let balanced = [30.0 * GAINS[0], 90.0 * GAINS[1], 40.0 * GAINS[2]];
    let written = photo.with_picture(&seen, Format::Tiff).unwrap();
    let back = Photo::from_bytes("a.tif", &written, Curve::Srgb, &Limits::default()).unwrap();
    assert_eq!((back.manner.colour, back.manner.tone.origin()), (ColorType::Rgb16, "ICC profile"));
    for (c, row) in Channel::ALL.into_iter().zip(TO_SRGB.chunks_exact(3)) {
        let wanted: f64 = row.iter().zip(balanced).map(|(share, light)| share * light).sum();
        let found = f64::from(back.light.plane(c).at(3, 3));
        assert!((found - wanted).abs() < 0.05, "{c:?}: {found}, wanted {wanted}");
    }
}

#[test]
fn a_raw_photo_s_result_has_the_rig_file_s_format() {
    let formats = [RawResults::Tiff, RawResults::Jpeg].map(|results| {
        let reading = ReadOptions { raw_results: results, ..ReadOptions::new(SIZE, Curve::Srgb) };
        let photo = reading.finish(read()).unwrap();
        let bytes = photo.with_picture(&photo.light, photo.manner.format).unwrap();
        let back = Photo::from_bytes("a", &bytes, Curve::Srgb, &Limits::default()).unwrap();
        assert_eq!(back.light.size(), SIZE);
        (back.manner.format, back.manner.colour)
    });
    assert_eq!(formats, [(Format::Tiff, ColorType::Rgb16), (Format::Jpeg, ColorType::Rgb8)]);
}
