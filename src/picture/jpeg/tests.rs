//! The walk over a JPEG's markers, and its coefficients against the decoded picture.

use super::*;
use crate::frame::block_transform::{cosines, transform, transposed};
use crate::frame::{BLOCK_AREA, CodedComponent, Plane};

/// Walks `bytes`, and decodes them if long runs of zeros require it.
fn whole(bytes: &[u8]) -> Result<(), Flaw> {
    crate::picture::decode::walk(bytes, &Default::default()).map(drop)
}

const ROCKET: &[u8] = include_bytes!("../../../tests/scenes/rocket.jpg");

#[test]
fn a_whole_photo_passes_and_every_cut_of_it_does_not() {
    assert!(walk(ROCKET).unwrap().size.is_some());
    for percent in 0..100 {
        let cut = &ROCKET[..(ROCKET.len() * percent / 100).max(2)];
        assert!(matches!(walk(cut), Err(Flaw::Truncated { .. })), "cut to {percent} %");
    }
    assert!(walk(&ROCKET[..ROCKET.len() - 1]).is_err(), "one byte short");
}

#[test]
fn zeros_in_place_of_data_are_reported_as_a_hole() {
    let half = ROCKET.len() / 2;
    let mut tail = ROCKET.to_vec();
    tail[half..].fill(0);
    let Err(Flaw::ZeroFilled { from, to, .. }) = whole(&tail) else { panic!("tail") };
    assert!(from.abs_diff(half) < 8 && to == tail.len());
    let mut middle = ROCKET.to_vec();
    middle[half..half + 4096].fill(0);
    assert!(matches!(whole(&middle), Err(Flaw::ZeroFilled { .. })));
}

/// A white picture of 512×512 with many grey blocks at its lower end, and its own code tables.
fn mostly_white(progressive: bool) -> Vec<u8> {
    let block = |n: u32| (n / 512 / 8 * 64 + n % 512 / 8).wrapping_mul(2_654_435_761);
    let pixels: Vec<u8> = (0..512 * 512u32)
        .map(|n| if n < 512 * 384 { 255 } else { (block(n) >> 24) as u8 })
        .collect();
    let mut bytes = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, 100);
    encoder.set_optimized_huffman_tables(true);
    encoder.set_progressive(progressive);
    encoder.encode(&pixels, 512, 512, jpeg_encoder::ColorType::Luma).unwrap();
    bytes
}

#[test]
fn zeros_that_are_picture_are_no_hole() {
    for progressive in [false, true] {
        let white = mostly_white(progressive);
        let run = longest_zero_run(&white);
        // In a progressive file the run is half as long.
        let wanted = if progressive { HOLE_BYTES / 2 } else { HOLE_BYTES };
        assert!(run.len() >= wanted, "{run:?}: the picture is coded in zeros");
        assert!(whole(&white).is_ok());
        // A run of zeros in place of grey blocks is a hole.
        let mut hole = white.clone();
        hole[run.end + 100..][..600].fill(0);
        assert!(matches!(whole(&hole), Err(Flaw::ZeroFilled { .. })), "{progressive}");
    }
}

#[test]
fn a_picture_too_large_for_that_is_refused_for_its_size() {
    let mut large = mostly_white(false);
    let sof = large.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    large[sof + 5..sof + 9].copy_from_slice(&[0xff, 0xdc, 0xff, 0xdc]);
    let flaw = crate::picture::decode::decode(&large, &Default::default()).unwrap_err();
    assert!(flaw.to_string().contains("65500×65500"), "{flaw}");
}

#[test]
fn a_file_that_the_decoder_misreads_is_refused() {
    let whole = image::load_from_memory(&files()[1].1).unwrap().into_rgb8();
    let decoded = |interleaved: bool| {
        let mut bytes = Vec::new();
        let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, 90);
        encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::F_2_2);
        // With optimised tables, the encoder writes one scan for each colour.
        encoder.set_optimized_huffman_tables(!interleaved);
        encoder.encode(&whole, 75, 50, jpeg_encoder::ColorType::Rgb).unwrap();
        crate::picture::decode::decode(&bytes, &Default::default())
    };
    assert!(decoded(true).unwrap().coding.is_some());
    let flaw = decoded(false).unwrap_err().to_string();
    assert!(flaw.contains("one for each colour") && flaw.contains("save it so"), "{flaw}");
}

#[test]
fn bytes_between_segments_are_skipped_and_rare_codings_named() {
    let (_, plain) = files().into_iter().nth(1).unwrap();
    let second = 4 + usize::from(u16::from_be_bytes([plain[4], plain[5]]));
    let padded = [&plain[..second], &[0, 0, 7], &plain[second..]].concat();
    assert_eq!(walk(&padded).unwrap().size, walk(&plain).unwrap().size);
    let read = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_rgb8();
    assert_eq!(read(&padded), read(&plain), "the decoder skips them, too");
    let sof = plain.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    for (marker, words) in [(0xc9, "arithmetic"), (0xc3, "lossless"), (0xc5, "hierarchical")] {
        let mut other = plain.clone();
        other[sof + 1] = marker;
        let flaw = walk(&other).unwrap_err().to_string();
        assert!(flaw.contains(words) && flaw.contains("save it so"), "{flaw}");
    }
}

#[test]
fn data_after_the_end_is_ignored() {
    let mut more = ROCKET.to_vec();
    more.extend_from_slice(&[0; 5000]);
    assert!(walk(&more).is_ok());
}

/// Files of another coder, and one of this program's own.
fn files() -> Vec<(&'static str, Vec<u8>)> {
    use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder};
    let whole = include_bytes!("../../../tests/jpegs/baseline-444.jpg");
    let picture = image::load_from_memory(whole).unwrap().into_rgb8();
    let mut own = Vec::new();
    JpegEncoder::new_with_quality(&mut own, 80)
        .write_image(&picture, 75, 50, ExtendedColorType::Rgb8)
        .unwrap();
    vec![
        ("own", own),
        ("baseline-444", whole.to_vec()),
        ("baseline-422", include_bytes!("../../../tests/jpegs/baseline-422.jpg").to_vec()),
        ("progressive-420", include_bytes!("../../../tests/jpegs/progressive-420.jpg").to_vec()),
        ("progressive-444", include_bytes!("../../../tests/jpegs/progressive-444.jpg").to_vec()),
        ("restart-420", include_bytes!("../../../tests/jpegs/restart-420.jpg").to_vec()),
        ("grey", include_bytes!("../../../tests/jpegs/grey.jpg").to_vec()),
    ]
}

/// The samples of one component, less 128 levels.
fn samples(component: &CodedComponent) -> Plane {
    let back = transposed(&cosines());
    let blocks = component.blocks;
    let mut plane = Plane::zeros(Size::new(8 * blocks.width, 8 * blocks.height));
    for (n, block) in component.coefficients.chunks_exact(BLOCK_AREA).enumerate() {
        let stated = |k: usize| f32::from(block[k]) * f32::from(component.steps[k]);
        let mut light = std::array::from_fn(stated);
        transform(&mut light, &back);
        for (k, v) in light.into_iter().enumerate() {
            plane.set(n % blocks.width * 8 + k % 8, n / blocks.width * 8 + k / 8, v);
        }
    }
    plane
}

/// `plane` interpolated to `size` as by the decoder: the nearer sample counts three quarters.
fn enlarged(plane: &Plane, (across, down): (u8, u8), size: Size) -> Plane {
    let own = Size::new(
        size.width.div_ceil(usize::from(across)),
        size.height.div_ceil(usize::from(down)),
    );
    let near = |at: usize, pixels: u8, end: usize| match (pixels, at % 2) {
        (1, _) => (at, at),
        (_, 0) => (at / 2, (at / 2).saturating_sub(1)),
        _ => (at / 2, (at / 2 + 1).min(end - 1)),
    };
    Plane::from_fn(size, |x, y| {
        let ((x0, x1), (y0, y1)) = (near(x, across, own.width), near(y, down, own.height));
        let row = |y| 0.75 * plane.at(x0, y) + 0.25 * plane.at(x1, y);
        0.75 * row(y0) + 0.25 * row(y1)
    })
}

#[test]
fn coefficients_give_the_decoded_picture() {
    for (name, bytes) in files() {
        let coding = coefficients(&bytes).unwrap().unwrap_or_else(|| panic!("{name}"));
        assert_eq!(coding.size, Size::new(75, 50), "{name}");
        let shown = image::load_from_memory(&bytes).unwrap().into_rgb8();
        let planes: Vec<Plane> = (coding.components.iter())
            .map(|component| enlarged(&samples(component), component.pixels, coding.size))
            .collect();
        let (mut worst, mut total) = (0.0f32, 0.0);
        for (x, y) in (0..75 * 50).map(|n| (n % 75, n / 75)) {
            let light = planes[0].at(x, y) + 128.0;
            let [cb, cr] = [1, 2].map(|n| planes.get(n).map_or(0.0, |plane| plane.at(x, y)));
            // ITU-T T.871, clause 7.
            let stated =
                [light + 1.402 * cr, light - 0.344_136 * cb - 0.714_136 * cr, light + 1.772 * cb];
            for (stated, &shown) in stated.iter().zip(&shown.get_pixel(x as u32, y as u32).0) {
                let apart = (stated - f32::from(shown)).abs();
                (worst, total) = (worst.max(apart), total + apart);
            }
        }
        // Half a code each for brightness, the colour, a sample of chroma and interpolation along
        // either axis; errors of chroma are multiplied by up to 1.772.
        let between = |component: &CodedComponent| {
            f32::from(component.pixels.0 - 1) + f32::from(component.pixels.1 - 1)
        };
        let ways = coding.components.last().map_or(0.0, between);
        assert!(worst < 0.5 + 0.5 + 1.772 * (0.5 + 0.5 * ways), "{name}: {worst}");
        // The mean error of many roundings is about half a code.
        let mean = total / (3.0 * 75.0 * 50.0);
        assert!(mean < 0.6, "{name}: {mean} in the mean");
    }
}

#[test]
fn damaged_files_give_no_coefficients_or_whole_ones() {
    for (name, whole) in files() {
        let mut state = 7u64;
        for round in 0..400 {
            let mut bytes = whole.clone();
            for _ in 0..1 + round % 5 {
                // Numerical Recipes' linear congruential generator; any will do.
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                let at = 2 + (state >> 33) as usize % (bytes.len() - 2);
                bytes[at] = (state >> 20) as u8;
            }
            // The walk comes first, and bounds the size.
            if walk(&bytes)
                .is_ok_and(|walked| walked.size.is_some_and(|size| size.area() < 1 << 20))
            {
                let read = coefficients(&bytes).unwrap_or_default();
                assert!(read.is_none_or(|coding| coding.is_whole()), "{name}");
            }
        }
    }
}

#[test]
fn metadata_that_no_result_carries_is_noted() {
    let (name, plain) = files().into_iter().next().unwrap();
    let lost = |segments: &[&[u8]]| {
        let bytes = [&plain[..2], &segments.concat(), &plain[2..]].concat();
        let walked = walk(&bytes).unwrap_or_else(|flaw| panic!("{name}: {flaw}"));
        walked.lost.into_iter().collect::<Vec<_>>()
    };
    let inches = b"\xff\xe0\0\x10JFIF\0\x01\x02\x01\x01\x2c\x01\x2c\0\0";
    let ratio = b"\xff\xe0\0\x10JFIF\0\x01\x02\0\0\x01\0\x01\0\0";
    let exif = b"\xff\xe1\0\x08Exif\0\0";
    let iptc = b"\xff\xed\0\x1ePhotoshop 3.0\x008BIM\x04\x04\0\0\0\0\0\x02\x1c\x02";
    let size = b"\xff\xed\0\x1ePhotoshop 3.0\x008BIM\x03\xed\0\0\0\0\0\x02\0\x48";
    assert_eq!(lost(&[]), []);
    assert_eq!(lost(&[b"\xff\xfe\0\x07hello"]), [Lost::TEXTS]);
    assert_eq!(lost(&[inches]), [Lost::DENSITY]);
    assert_eq!(lost(&[ratio]), []);
    assert_eq!(lost(&[inches, exif]), [], "EXIF carries it");
    assert_eq!((lost(&[iptc]), lost(&[size])), (vec![Lost::IPTC], vec![]));
    let credentials = b"\xff\xeb\0\x0cJP\0\x01\0\0\0\x01\0\0";
    assert_eq!(lost(&[credentials]), [Lost::CREDENTIALS]);
    let other = lost(&[b"\xff\xe7\0\x08Kamera"]).remove(0).note();
    assert!(other.contains("application data 7") && other.contains("Kamera"), "{other}");
    for (more, wanted) in [
        (&b"\0\0\0\x18ftypmp42"[..], Some(Lost::of("the movie of a motion photo"))),
        (b"\xff\xd8\xff", Some(Lost::PICTURES)),
        (b"SEFT", Some(Lost::of("the data behind the picture"))),
        (&[0; 99], None),
    ] {
        let walked = walk(&[&plain[..], more].concat()).unwrap();
        assert_eq!(walked.lost.into_iter().next(), wanted, "{more:?}");
    }
}

#[test]
fn most_damaged_codes_are_found() {
    let mut state = 7u64;
    let mut random = || {
        // The same generator as above.
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let mut found = 0;
    for _ in 0..50 {
        let mut bytes = ROCKET.to_vec();
        let at = bytes.len() / 3 + random() % (bytes.len() / 2);
        // Without 0xff, since the walk would notice new markers.
        bytes[at..at + 512].fill_with(|| (random() % 255) as u8);
        found += usize::from(coefficients(&bytes).is_err());
    }
    // By chance, damaged codes may decode to the right number of blocks.
    assert!(found >= 48, "{found} of 50");
    let last_restart = [&ROCKET[..ROCKET.len() - 2], b"\xff\xd3\xff\xd9"].concat();
    assert!(coefficients(&last_restart).is_ok_and(|coding| coding.is_some()));
}
