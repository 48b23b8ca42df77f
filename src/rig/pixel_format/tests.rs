//! Frames in the layout of the formats' documentation, and their counts.

use super::*;
use crate::frame::Channel;

fn unpacked(code: &str, bytes: &[u8], size: Size, stride_bytes: usize) -> Counts {
    let mut counts = Counts::zeros(size);
    let format = PixelFormat::from_code(code).unwrap();
    format.unpack(bytes, stride_bytes, &mut counts, &mut Plane::zeros(Size::new(0, 0))).unwrap();
    counts
}

#[test]
fn codes_and_formats_round_trip() {
    for (code, format) in PixelFormat::ALL {
        assert_eq!(format.code(), code);
        assert_eq!(format.mosaic(), Mosaic::of_format(code));
        assert_eq!(
            PixelFormat::from_code(std::str::from_utf8(&format.fourcc()).unwrap()),
            Some(format)
        );
    }
    assert_eq!(PixelFormat::from_code("H264"), None);
}

#[test]
fn grey_rows_skip_the_padding_at_their_end() {
    let counts = unpacked("GREY", &[1, 2, 99, 3, 4], Size::new(2, 2), 3);
    for channel in Channel::ALL {
        assert_eq!(counts.plane(channel).data(), &[1, 2, 3, 4]);
    }
}

#[test]
fn wide_grey_is_little_endian_and_masked_to_its_bits() {
    let bytes = [0x34, 0x12, 0xff, 0xff];
    for (code, want) in
        [("Y10", [0x234, 0x3ff]), ("Y12", [0x234, 0xfff]), ("Y16", [0x1234, 0xffff])]
    {
        assert_eq!(
            unpacked(code, &bytes, Size::new(2, 1), 4).plane(Channel::Green).data(),
            &want,
            "{code}"
        );
    }
}

#[test]
fn names_of_the_naming_convention_have_its_packings() {
    // Figures of PFNC 2.4 for `p`; those of GigE Vision 2.0 for `Packed`.
    for (name, bytes, want) in [
        ("Mono8", &[7, 8][..], &[7, 8][..]),
        ("Mono16", &[0x34, 0x12], &[0x1234]),
        ("Mono12p", &[0x34, 0x52, 0x67], &[0x234, 0x675]),
        ("Mono10p", &[0xff, 0x03, 0xf0, 0x7f, 0x40], &[0x3ff, 0, 0x3ff, 0x101]),
        ("Mono12Packed", &[0xab, 0xdc, 0xef], &[0xabc, 0xefd]),
        ("Mono10Packed", &[0xff, 0x13, 0x40], &[0x3ff, 0x101]),
    ] {
        let size = Size::new(want.len(), 1);
        let counts = unpacked(name, bytes, size, bytes.len());
        assert_eq!(counts.plane(Channel::Green).data(), want, "{name}");
    }
    let mosaics =
        [("RG", Mosaic::Rggb), ("GR", Mosaic::Grbg), ("GB", Mosaic::Gbrg), ("BG", Mosaic::Bggr)];
    for (letters, mosaic) in mosaics {
        let format = PixelFormat::from_code(&format!("Bayer{letters}12p")).expect("a format");
        assert_eq!((format.mosaic(), format.bits()), (Some(mosaic), 12));
        assert_eq!(Mosaic::of_format(&format!("Bayer{letters}12p")), Some(mosaic));
        assert!(format.has_whole_rows(1328) && !format.has_whole_rows(1327));
    }
    for unknown in ["Mono", "Mono14", "BayerRG", "BayerXX8", "Bayer", "BayerRG8é", "é"] {
        assert_eq!(PixelFormat::from_code(unknown), None, "{unknown}");
    }
    let upper = PixelFormat::from_code_and_bits("BayerRG16", 12).expect("the upper bits");
    assert_eq!(upper.bits(), 12);
}

#[test]
fn three_bytes_keep_their_order() {
    let want = [vec![1, 4], vec![2, 5], vec![3, 6]];
    for (code, bytes) in [("RGB3", [1, 2, 3, 4, 5, 6]), ("BGR3", [3, 2, 1, 6, 5, 4])] {
        let counts = unpacked(code, &bytes, Size::new(2, 1), 6);
        assert_eq!(counts.planes().each_ref().map(|p| p.data().to_vec()), want, "{code}");
    }
}

#[test]
fn y_cb_cr_gives_the_colour_bars_of_bt601() {
    // 100 % bars, limited range: white, red and blue (BT.601-7 table values, rounded).
    let bars = [
        (235, 128, 128, [255, 255, 255]),
        (81, 90, 240, [255, 0, 0]),
        (41, 240, 110, [0, 0, 255]),
        (16, 128, 128, [0; 3]),
    ];
    for (y, cb, cr, want) in bars {
        let frames: [(&str, &[u8], Size, usize); 3] = [
            ("YUYV", &[y, cb, y, cr], Size::new(2, 1), 4),
            ("UYVY", &[cb, y, cr, y], Size::new(2, 1), 4),
            // Two rows of luma, then one of chroma for both, each padded by a byte.
            ("NV12", &[y, y, 9, y, y, 9, cb, cr, 9], Size::new(2, 2), 3),
        ];
        for (code, bytes, size, stride_bytes) in frames {
            let counts = unpacked(code, bytes, size, stride_bytes);
            for place in 0..size.area() {
                let got = counts.planes().each_ref().map(|p| i32::from(p.data()[place]));
                assert!(
                    got.iter().zip(want).all(|(a, b): (&i32, i32)| (a - b).abs() <= 1),
                    "{code}: {got:?} for {want:?}"
                );
            }
        }
    }
}

#[test]
fn sites_of_every_mosaic_and_depth_are_in_their_channel() {
    let size = Size::new(6, 4);
    for (code, format) in PixelFormat::ALL {
        let PixelFormat::Bayer { mosaic, samples } = format else { continue };
        let bits = samples.bits();
        let value = |x: usize, y: usize| (((y * 6 + x) * 7) as u16 + 1) << (bits - 8);
        let packed = matches!(samples, Samples::Packed { .. });
        let wide = if bits == 8 || packed { 1 } else { 2 };
        let mut bytes = Vec::new();
        for y in 0..4 {
            match (packed, bits) {
                // Values are multiples of four or sixteen: the bytes of lower bits are 0.
                (true, 10) => (0..8).for_each(|x| {
                    bytes.push((value(x.min(5), y) >> 2) as u8);
                    bytes.extend((x % 4 == 3).then_some(0));
                }),
                (true, _) => (0..6).for_each(|x| {
                    bytes.push((value(x, y) >> 4) as u8);
                    bytes.extend((x % 2 == 1).then_some(0));
                }),
                _ => (0..6).for_each(|x| bytes.extend(&value(x, y).to_le_bytes()[..wide])),
            }
        }
        let counts = unpacked(code, &bytes, size, bytes.len() / 4);
        for y in 0..4 {
            for x in 0..6 {
                assert_eq!(
                    counts.plane(mosaic.colour_at(x, y)).at(x, y),
                    value(x, y),
                    "{code} at {x},{y}"
                );
            }
        }
    }
}

#[test]
fn lower_bits_of_packed_samples_are_in_the_group_s_last_byte() {
    // V4L2_PIX_FMT_SBGGR10P: the fifth byte has the lower bits of the fourth sample in bits 7 and
    // 6, of the third in 5 and 4, of the second in 3 and 2, of the first in 1 and 0.
    let counts = unpacked("Y10P", &[0x80, 0x01, 0xff, 0x00, 0b11_10_01_00], Size::new(4, 1), 5);
    assert_eq!(counts.plane(Channel::Green).data(), &[0x200, 0x005, 0x3fe, 0x003]);
    // SBGGR12P: the third byte has those of the second sample in bits 7 to 4, of the first in 3 to
    // 0. The row ends within a group.
    let counts = unpacked("Y12P", &[0x12, 0x34, 0xba, 0xff, 0x00, 0x0f], Size::new(3, 1), 6);
    assert_eq!(counts.plane(Channel::Green).data(), &[0x12a, 0x34b, 0xfff]);
}

#[test]
fn narrow_counts_are_the_upper_bits_of_wide_words() {
    let ten = PixelFormat::from_code_and_bits("Y16", 10).unwrap();
    assert_eq!((ten.bits(), ten.code()), (10, "Y16"));
    let mut counts = Counts::zeros(Size::new(2, 1));
    // Full scale, and half of it.
    let bytes = [0xc0, 0xff, 0x00, 0x80];
    ten.unpack(&bytes, 4, &mut counts, &mut Plane::zeros(Size::new(0, 0))).unwrap();
    assert_eq!(counts.plane(Channel::Green).data(), &[0x3ff, 0x200]);
    let raw = PixelFormat::from_code_and_bits("RG16", 12).unwrap();
    assert_eq!((raw.bits(), raw.code(), raw.mosaic()), (12, "RG16", Some(Mosaic::Rggb)));
    assert_eq!(PixelFormat::from_code_and_bits("RG10", 8), None);
    assert_eq!(PixelFormat::from_code_and_bits("RGB3", 10), None);
}

/// A frame of 16×8 by libjpeg at quality 85, 4:2:2, the left half (200, 40, 90) and the right
/// (30, 160, 60), without its code tables, as UVC cameras send them.
fn coded_frame() -> Vec<u8> {
    let head = "ffd8ffdb0043000503040404030504040405050506070c08070707070f0b0b090c110f1212110f\
                111113161c1713141a1511111821181a1d1d1f1f1f13172224221e241c1e1f1effdb0043010505\
                050706070e08080e1e1411141e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e\
                1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1e1effc00011080008001003012100021101\
                031101ffda000c03010002110311003f00";
    let data = "e26b66bc7ccfecfcff0043bfc60ff983ff00b89ffb61ffd9";
    let digits: Vec<u8> = [head, data].concat().into_bytes();
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
    digits.chunks_exact(2).map(byte).collect()
}

#[test]
fn a_coded_frame_without_huffman_tables_has_libjpeg_s_colours() {
    let counts = unpacked("MJPG", &coded_frame(), Size::new(16, 8), 0);
    // As decoded by libjpeg.
    for ((x, y), want) in [((2, 2), [199, 41, 90]), ((13, 5), [31, 160, 60])] {
        let got = counts.planes().each_ref().map(|p| i32::from(p.at(x, y)));
        let near = got.iter().zip(want).all(|(a, b): (&i32, i32)| (a - b).abs() <= 1);
        assert!(near, "{got:?} for {want:?}");
    }
    // Bytes behind the frame are ignored.
    let padded = [&coded_frame()[..], &[0; 100]].concat();
    assert_eq!(unpacked("MJPG", &padded, Size::new(16, 8), 0), counts);
}

#[test]
fn a_truncated_or_foreign_coded_frame_is_refused() {
    let (bytes, size) = (coded_frame(), Size::new(16, 8));
    let refused = |bytes: &[u8], size: Size| {
        let mut counts = Counts::zeros(size);
        let scratch = &mut Plane::zeros(Size::new(0, 0));
        PixelFormat::Jpeg.unpack(bytes, 0, &mut counts, scratch).is_err()
    };
    assert!(!refused(&bytes, size));
    for length in 0..bytes.len() {
        assert!(refused(&bytes[..length], size), "{length} bytes");
    }
    // Missing data before the end, as after the loss of a packet.
    let data = bytes.len() - 24..bytes.len() - 2;
    for lost in 8..data.len() {
        let holed = [&bytes[..data.end - lost], &bytes[data.end..]].concat();
        assert!(refused(&holed, size), "{lost} bytes lost");
    }
    assert!(refused(&bytes, Size::new(8, 16)) && refused(&bytes, Size::new(32, 8)));
    let grown = bytes.iter().copied().chain([9; 70_000]).collect::<Vec<_>>();
    assert!(refused(&grown, size), "longer than any frame of its size");
}

#[test]
fn a_short_frame_is_refused_with_its_lengths() {
    let mut counts = Counts::zeros(Size::new(4, 2));
    let error = PixelFormat::Grey(Samples::Bytes)
        .unpack(&[0; 7], 4, &mut counts, &mut Plane::zeros(Size::new(0, 0)))
        .unwrap_err();
    assert!(matches!(error, BadFrame::Short { found: 7, wanted: 8, .. }), "{error}");
}
