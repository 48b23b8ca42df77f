//! Photos and results: formats, bad files, names, orientation, profiles, shapes.

use std::collections::BTreeSet;

use image::ImageEncoder;
use relens::config::{Curve, LargerPhotos};
use relens::daemon::{Daemon, Folders, PhotoCounts, Report, State};
use relens::frame::{Plane, Size};
use relens::picture::{ColorType, Format, Manner, Orientation, encode};

use crate::bed::*;

#[test]
fn results_have_the_format_of_their_photos() {
    let root = fresh_root();
    let root = root.path();
    for (name, format, bits) in [
        ("a.jpg", Format::Jpeg, 8),
        ("b.png", Format::Png, 8),
        ("c.png", Format::Png, 16),
        ("d.tif", Format::Tiff, 16),
        ("e.tiff", Format::Tiff, 8),
    ] {
        drop_in(root, name, &file(format, bits, RIG));
        let summary = once(root);
        assert_eq!(summary.restored.len(), 1, "{name}: {:?}", summary.failed);
        let result = read_back(&root.join("outbox").join(name));
        let depth = result.manner.colour.bits_per_pixel() / 3;
        assert_eq!((result.manner.format, depth), (format, bits.into()), "{name}");
        let original = read_back(&root.join("done").join(name));
        let brighter = result.light.planes()[1].mean() - original.light.planes()[1].mean();
        assert!((brighter - 10.0).abs() < 1.0, "{name}: brighter by {brighter}");
        let report = std::fs::read(root.join("outbox").join(format!("{name}.json"))).unwrap();
        let report: Report = serde_json::from_slice(&report).unwrap();
        assert_eq!((report.captures, report.method.as_str()), (1, "brighten"));
        assert!(root.join("outbox").join(&report.before).is_file());
        assert!(root.join("outbox").join(&report.after).is_file());
    }
    assert!(names(&root.join("inbox")).is_empty() && names(&root.join("working")).is_empty());
    let page = std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    assert!(["a.jpg", "b.png", "c.png", "d.tif", "e.tiff"].iter().all(|name| page.contains(name)));
}

#[test]
fn a_raw_photo_is_delivered_developed() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "a.dng", &raw_file(RIG));
    drop_in(root, "wide.dng", &raw_file(Size::new(128, 96)));
    drop_in(root, "b.jpg", &raw_file(RIG));
    let summary = once(root);
    assert_eq!(summary.restored.len(), 2, "{:?}", summary.failed);
    let result = read_back(&root.join("outbox/a.tif"));
    assert_eq!((result.manner.format, result.manner.colour), (Format::Tiff, ColorType::Rgb16));
    assert!(result.raw.is_none() && read_back(&root.join("done/a.dng")).raw.is_some());
    assert!(root.join("outbox/a.tif.json").is_file());
    let failed = format!("{:?}", summary.failed);
    assert!(
        failed.contains("not resampled: found 128×96 sites, allowed the rig's whole sensor, 64×48"),
        "{failed}"
    );
    let notes = summary.restored.iter().map(|report| report.notes.concat()).collect::<String>();
    assert!(notes.contains("named .jpg and holds a DNG"), "{notes}");
    assert!(root.join("outbox/b.tif").is_file());
}

#[test]
fn each_bad_file_is_kept_with_its_own_reason() {
    let root = fresh_root();
    let root = root.path();
    let jpeg = file(Format::Jpeg, 8, Size::new(512, 384));
    let png = file(Format::Png, 8, RIG);
    let tiff = file(Format::Tiff, 16, RIG);
    let mut tail = jpeg.clone();
    tail[jpeg.len() / 2..].fill(0);
    let mut oversized = jpeg.clone();
    let sof = oversized.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    oversized[sof + 5..sof + 9].copy_from_slice(&[0xff; 4]);
    let mut flipped = png.clone();
    flipped[png.len() / 2] ^= 1;
    let mut floats = Vec::new();
    let pixels: Vec<u8> = [0.5f32; 3 * 64 * 48].iter().flat_map(|v| v.to_ne_bytes()).collect();
    image::codecs::tiff::TiffEncoder::new(std::io::Cursor::new(&mut floats))
        .write_image(&pixels, 64, 48, image::ExtendedColorType::Rgb32F)
        .unwrap();
    let cases: [(&str, &[u8], &str); 14] = [
        ("empty.jpg", b"", "empty: found 0 bytes"),
        ("cut.jpg", &jpeg[..jpeg.len() / 100], "JPEG file is cut short"),
        ("cut.png", &png[..png.len() / 2], "PNG file is cut short"),
        ("cut.tif", &tiff[..tiff.len() - 1], "TIFF file is cut short"),
        ("zeros.jpg", &[0; 5000], "never filled"),
        ("tail.jpg", &tail, "never filled"),
        ("big.jpg", &oversized, "found 65535×65535 pixels by its header"),
        ("floats.tif", &floats, "found 3 numbers with fractions"),
        ("phone.jpg", b"\0\0\0\x18ftypheic\0\0\0\0", "an HEIC picture"),
        ("DSCF0001.RAF", b"FUJIFILMCCD-RAW 0201", "a camera raw photo (Fujifilm RAF)"),
        ("paper.jpg", b"%PDF-1.7\nhello", "a PDF document"),
        ("letter.txt", b"Dear Sir or Madam", "a text"),
        ("flipped.png", &flipped, "PNG file is damaged"),
        ("wide.png", &file(Format::Png, 8, Size::new(64, 30)), "found 64×30, allowed 64×48"),
    ];
    for (name, bytes, _) in &cases {
        drop_in(root, name, bytes);
    }
    let summary = once(root);
    assert_eq!(
        (summary.failed.len(), summary.restored.len()),
        (cases.len(), 0),
        "{:?}",
        summary.deferred
    );
    let page = std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    let mut sentences = BTreeSet::new();
    for (name, bytes, wanted) in &cases {
        assert_eq!(
            &std::fs::read(root.join("failed").join(name)).unwrap(),
            bytes,
            "{name} is unchanged"
        );
        let note =
            std::fs::read_to_string(root.join("failed").join(format!("{name}.txt"))).unwrap();
        assert!(note.contains(wanted) && note.contains("allowed") && note.contains(name), "{note}");
        let reason = &summary.failed.iter().find(|f| f.photo == *name).unwrap().reason;
        sentences.insert(reason.replace(name, ""));
        assert!(page.contains(name), "{name} is in the gallery");
    }
    assert_eq!(sentences.len(), cases.len(), "no two share a reason");
    assert!(names(&root.join("inbox")).is_empty() && names(&root.join("working")).is_empty());
}

#[test]
fn formats_are_recognised_by_content_and_unwritable_ones_become_png() {
    let root = fresh_root();
    let root = root.path();
    let rgb: Vec<u8> = (0..64 * 48 * 3).map(|n| (n % 200) as u8).collect();
    let as_rgb = image::ExtendedColorType::Rgb8;
    let (mut webp, mut bmp, mut gif) = (Vec::new(), Vec::new(), Vec::new());
    image::codecs::webp::WebPEncoder::new_lossless(&mut webp)
        .write_image(&rgb, 64, 48, as_rgb)
        .unwrap();
    image::codecs::bmp::BmpEncoder::new(&mut bmp).write_image(&rgb, 64, 48, as_rgb).unwrap();
    image::codecs::gif::GifEncoder::new(&mut gif).encode(&rgb, 64, 48, as_rgb).unwrap();
    let png = file(Format::Png, 8, RIG);
    let photos: [(&str, &[u8], &str); 5] = [
        ("a.webp", &webp, "comes back as PNG"),
        ("b.BMP", &bmp, "comes back as PNG"),
        ("c.gif", &gif, "comes back as PNG"),
        ("d.jpg", &png, "named .jpg and holds a PNG"),
        ("12.5.2024", &png, "named .2024 and holds a PNG"),
    ];
    for (name, bytes, _) in photos {
        drop_in(root, name, bytes);
    }
    let summary = once(root);
    assert_eq!(summary.restored.len(), photos.len(), "{:?}", summary.failed);
    for (report, result) in summary
        .restored
        .iter()
        .map(|report| (report, read_back(&root.join("outbox").join(&report.result))))
    {
        let (_, _, content) = photos.iter().find(|(name, ..)| *name == report.photo).unwrap();
        assert_eq!(result.manner.format, Format::Png, "{}", report.photo);
        assert!(report.notes.iter().any(|note| note.contains(content)), "{:?}", report.notes);
        assert!(report.result.ends_with(".png"), "{}", report.result);
    }
    assert!(root.join("outbox/12.5.2024.png").is_file());
    // A GIF without its trailer, or cut within a later picture, is restored.
    for (name, end) in [("d.gif", &b""[..]), ("e.gif", b",\0\0")] {
        drop_in(root, name, &[&gif[..gif.len() - 1], end].concat());
        assert_eq!(once(root).restored.len(), 1, "{name}");
    }
    // Incomplete files are rejected; files of unchanged photos are delivered as they are.
    for (name, bytes) in [("a.webp", &webp), ("b.bmp", &bmp), ("c.gif", &gif)] {
        drop_in(root, name, &bytes[..bytes.len() / 2]);
        let failed = once(root).failed;
        assert!(failed[0].reason.contains("is cut short"), "{failed:?}");
    }
    for (name, bytes) in [("a.webp", &webp), ("b.bmp", &bmp), ("c.gif", &gif)] {
        drop_in(root, &format!("sharp-{name}"), bytes);
    }
    let mut restorer = Brightener { untouched: true, ..Brightener::default() };
    assert_eq!(once_with(root, &mut restorer, &mut ()).unwrap().untouched.len(), 3);
    assert_eq!(std::fs::read(root.join("outbox/sharp-a.webp")).unwrap(), webp);
}

#[test]
fn duplicate_names_overwrite_nothing() {
    let root = fresh_root();
    let root = root.path();
    let first = file(Format::Png, 8, RIG);
    let second = file(Format::Png, 16, RIG);
    drop_in(root, "a.png", &first);
    once(root);
    drop_in(root, "a.png", &second);
    once(root);
    assert_eq!(
        names(&root.join("outbox")),
        set(&["a.png", "a.png.json", "a-2.png", "a-2.png.json"])
    );
    assert_eq!(std::fs::read(root.join("done/a.png")).unwrap(), first);
    assert_eq!(std::fs::read(root.join("done/a-2.png")).unwrap(), second);
    for _ in 0..2 {
        drop_in(root, "bad.png", b"");
        once(root);
    }
    assert_eq!(
        names(&root.join("failed")),
        set(&["bad.png", "bad.png.txt", "bad-2.png", "bad-2.png.txt"])
    );
}

#[test]
fn names_may_be_any_bytes_hostile_or_long() {
    use std::os::unix::ffi::OsStringExt;
    let root = fresh_root();
    let root = root.path();
    std::fs::create_dir_all(root.join("inbox")).unwrap();
    let latin = std::ffi::OsString::from_vec(b"M\xfcnchen.png".to_vec());
    let long = std::ffi::OsString::from("x".repeat(251) + ".png");
    let hostile = std::ffi::OsString::from("\"><script>alert(1)<&.png");
    for name in [&latin, &long, &hostile] {
        std::fs::write(root.join("inbox").join(name), file(Format::Png, 8, RIG)).unwrap();
    }
    let summary = once(root);
    assert_eq!(summary.restored.len(), 3, "{:?}", summary.failed);
    assert!(
        root.join("outbox").join(&latin).is_file() && root.join("outbox").join(&hostile).is_file()
    );
    let page = std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    assert_eq!(page.matches("<script>").count(), 2, "the page's own");
    assert!(page.contains("M%FCnchen.png"));
}

#[test]
fn junk_and_uploads_under_way_are_ignored() {
    let root = fresh_root();
    let root = root.path();
    for name in [".DS_Store", "a.jpg.part", "Thumbs.db", "b.jpg~"] {
        drop_in(root, name, b"x");
    }
    let summary = once(root);
    assert!(summary.failed.is_empty() && summary.deferred.is_empty());
    assert_eq!(names(&root.join("inbox")), set(&["a.jpg.part", "Thumbs.db", "b.jpg~"]));
}

#[test]
fn links_and_pipes_are_rejected() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "secret", &file(Format::Png, 8, RIG));
    std::fs::rename(root.join("inbox/secret"), root.join("secret.png")).unwrap();
    std::os::unix::fs::symlink(root.join("secret.png"), root.join("inbox/link.png")).unwrap();
    let pipe = root.join("inbox/pipe.png");
    let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
    rustix::fs::mknodat(rustix::fs::CWD, &pipe, rustix::fs::FileType::Fifo, mode, 0).unwrap();
    let summary = once(root);
    assert_eq!(summary.failed.len(), 2, "{summary:?}");
    assert!(summary.failed.iter().any(|f| f.reason.contains("found a link")));
    assert!(summary.failed.iter().any(|f| f.reason.contains("found a pipe")));
    assert!(root.join("secret.png").is_file());
}

#[test]
fn a_rotated_photo_is_restored_in_sensor_orientation_and_delivered_upright() {
    let root = fresh_root();
    let root = root.path();
    // EXIF: one directory with one entry, orientation 6. And a profile that the result must keep.
    let mut exif = b"II*\0\x08\0\0\0\x01\0".to_vec();
    exif.extend_from_slice(&[0x12, 0x01, 3, 0, 1, 0, 0, 0, 6, 0, 0, 0, 0, 0, 0, 0]);
    let icc = moxcms::ColorProfile::new_display_p3().encode().unwrap();
    for (name, format) in [("a.jpg", Format::Jpeg), ("a.png", Format::Png)] {
        let mut manner = Manner::plain(format, 8, Curve::Srgb);
        (manner.exif, manner.icc) = (Some(exif.clone()), Some(icc.clone()));
        drop_in(root, name, &encode("scene", &scene(RIG), &manner, false).unwrap());
        let summary = once(root);
        assert_eq!(summary.restored.len(), 1, "{:?}", summary.failed);
        let result = read_back(&root.join("outbox").join(name));
        assert_eq!(result.light.size(), Size::new(48, 64), "upright");
        assert_eq!(result.manner.orientation, Orientation::NoTransforms, "and tagged so");
        assert_eq!(result.manner.icc.as_ref(), Some(&icc));
        assert_eq!(result.manner.exif.as_ref().map(Vec::len), Some(exif.len()));
    }
    // A photo stored upright does not state which way the camera was turned, and this rig has no
    // gain pattern of the sensor that would show it.
    drop_in(root, "upright.png", &file(Format::Png, 8, Size::new(48, 64)));
    let failed = once(root).failed;
    assert!(failed[0].reason.contains("found 48×64 in portrait"), "{failed:?}");
}

#[test]
fn another_size_of_the_same_shape_is_resampled_with_a_note() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "big.png", &file(Format::Png, 8, Size::new(256, 192)));
    let summary = once(root);
    assert!(
        summary.restored[0]
            .notes
            .iter()
            .any(|n| n.contains("resampled from 256×192 to the rig's 64×48"))
    );
    assert_eq!(read_back(&root.join("outbox/big.png")).light.size(), RIG);
    let report = &summary.restored[0];
    assert!(report.notes[0].contains("its result is smaller"), "first of all: {:?}", report.notes);
    assert!(report.line().starts_with("big.png: restored smaller, 64×48 instead of 256×192"));
    // An unchanged photo is delivered as the file itself, at full size.
    drop_in(root, "left.png", &file(Format::Png, 8, Size::new(256, 192)));
    let mut restorer = Brightener { untouched: true, ..Brightener::default() };
    let untouched = once_with(root, &mut restorer, &mut ()).unwrap().untouched;
    assert!(untouched[0].notes.is_empty(), "{:?}", untouched[0].notes);
    assert_eq!(read_back(&root.join("outbox/left.png")).light.size(), Size::new(256, 192));
    // Larger photos are rejected if the rig file says so.
    drop_in(root, "big.png", &file(Format::Png, 8, Size::new(256, 192)));
    drop_in(root, "small.png", &file(Format::Png, 8, Size::new(32, 24)));
    let mut refusing = setting();
    refusing.reading.larger_photos = LargerPhotos::Refuse;
    let (clock, calendar) = (TestClock::default(), || std::time::SystemTime::now());
    let (mut restorer, mut watcher) = (Brightener::default(), ());
    let folders = Folders::open(root).unwrap();
    let mut daemon =
        Daemon::open(folders, refusing, &mut restorer, &clock, &calendar, &mut watcher).unwrap();
    let summary = daemon.once(&|| false).unwrap();
    assert_eq!((summary.restored.len(), summary.failed.len()), (1, 1), "{summary:?}");
    assert!(summary.failed[0].reason.contains("larger-photos"), "{:?}", summary.failed);
}

#[test]
fn grey_photos_stay_grey_and_alpha_is_kept() {
    let root = fresh_root();
    let root = root.path();
    let mut manner = Manner::plain(Format::Png, 8, Curve::Srgb);
    manner.colour = ColorType::L8;
    drop_in(root, "grey.png", &encode("g", &scene(RIG), &manner, true).unwrap());
    manner.colour = ColorType::Rgba8;
    let alpha = Plane::from_fn(RIG, |x, _| x as f32 / 255.0);
    manner.alpha = Some(alpha.clone());
    drop_in(root, "alpha.png", &encode("a", &scene(RIG), &manner, false).unwrap());
    let summary = once(root);
    assert!(summary.restored.iter().any(|r| r.grey && r.photo == "grey.png"));
    assert_eq!(read_back(&root.join("outbox/grey.png")).manner.colour, ColorType::L8);
    assert_eq!(read_back(&root.join("outbox/alpha.png")).manner.alpha, Some(alpha));
}

#[test]
fn an_unchanged_photo_is_delivered_byte_by_byte() {
    let root = fresh_root();
    let root = root.path();
    let photos = [("a.jpg", file(Format::Jpeg, 8, RIG)), ("b.dng", raw_file(RIG))];
    photos.iter().for_each(|(name, bytes)| drop_in(root, name, bytes));
    let mut restorer = Brightener { untouched: true, ..Brightener::default() };
    once_with(root, &mut restorer, &mut ()).unwrap();
    for (name, bytes) in photos {
        assert_eq!(std::fs::read(root.join("outbox").join(name)).unwrap(), bytes);
    }
}

#[test]
fn outcomes_are_counted_separately_everywhere() {
    let root = fresh_root();
    let root = root.path();
    drop_in(root, "whole.png", &file(Format::Png, 8, RIG));
    drop_in(root, "broken.png", b"no png");
    let mut restorer = Brightener { untouched: true, ..Brightener::default() };
    let summary = once_with(root, &mut restorer, &mut ()).unwrap();
    let counts = PhotoCounts { untouched: 1, failed: 1, ..PhotoCounts::default() };
    assert_eq!((summary.counts(), State::read(root).unwrap().unwrap().counts), (counts, counts));
    let words = "0 restored, 1 unchanged, 1 failed, 0 waiting";
    assert_eq!(counts.to_string(), words);
    assert!(summary.untouched[0].line().contains("returned unchanged: told to (1 c"), "the log");
    let page = std::fs::read_to_string(root.join("outbox/index.html")).unwrap();
    for words in ["<b>0</b> restored", "<b>1</b> unchanged", "<b>1</b> failed"] {
        assert!(page.contains(words), "{words}");
    }
}
