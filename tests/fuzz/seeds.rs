//! Seeds for fuzzing: `seeds PROGRAM DIR` writes small valid files of every kind for each target of
//! `tests/fuzz` into `DIR/TARGET`, made by the program itself.
#![allow(clippy::unwrap_used, missing_docs)] // a bench program: it stops at the first failure

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use relens::calibration::geometric::Geometry;
use relens::calibration::response_pattern::{EvenlyLit, ResponsePattern};
use relens::calibration::surface::{Domain, Surface};
use relens::calibration::{
    Calibration, CameraCurve, CrossChannel, Noise, OperatorNorms, ResponseCurve, store,
};
use relens::config;
use relens::deconvolution::lens_model::{Halo, LensFunctions};
use relens::deconvolution::panel_beat::ColumnWave;
use relens::frame::{Channel, Frame, Mosaic, Plane, Size, Work};
use relens::picture::{ColorType, Dng, Format, Limits, Manner, Photo, RawTags, encode, worker};

/// Writes photos of each format, depth and layout, with or without a profile, and a raw one.
fn photos(folder: &Path) {
    let icc = moxcms::ColorProfile::new_display_p3().encode().unwrap();
    let scene: Frame<Work> = Frame::from_fn(|c| {
        Plane::from_fn(Size::new(16, 12), |x, y| ((9 * x + 5 * y) % 200 + 20 * c.index()) as f32)
    });
    for (n, (format, bits, colour, profile)) in [
        (Format::Jpeg, 8, ColorType::Rgb8, true),
        (Format::Jpeg, 8, ColorType::L8, false),
        (Format::Png, 8, ColorType::Rgb8, true),
        (Format::Png, 16, ColorType::Rgba16, false),
        (Format::Png, 8, ColorType::La8, false),
        (Format::Tiff, 8, ColorType::L8, false),
        (Format::Tiff, 16, ColorType::Rgb16, true),
        (Format::Tiff, 8, ColorType::Rgba8, false),
    ]
    .into_iter()
    .enumerate()
    {
        let mut manner = Manner::plain(format, bits, config::Curve::Srgb);
        (manner.colour, manner.icc) = (colour, profile.then(|| icc.clone()));
        let bytes = encode("seed", &scene, &manner, !colour.has_color()).unwrap();
        Photo::from_bytes("seed", &bytes, config::Curve::Srgb, &Limits::default()).unwrap();
        fs::write(folder.join(format!("{n}.{}", format.extension())), bytes).unwrap();
    }
    let sites = scene.plane(Channel::Green).map(|v: f32| 64 + v as u16);
    let (mosaic, camera) = (Mosaic::Rggb, "seed");
    let raw = Dng {
        sites: &sites,
        mosaic,
        black: 64.0,
        white: 1023,
        camera,
        exposure_s: None,
        crop: None,
        tags: RawTags::default(),
    };
    fs::write(folder.join("raw.dng"), raw.bytes()).unwrap();
}

/// Writes the answers of a worker of `program` to two photos, a raw photo and a file that is no
/// photo.
fn answers(program: &Path, photos: &Path, folder: &Path) {
    let size = Size::new(16, 12);
    let grid = format!(r#"{{"width":{},"height":{}}}"#, size.width, size.height);
    for name in ["1.jpg", "2.png", "raw.dng", "no-photo"] {
        let path = photos.join(name);
        let file = File::open(if path.exists() { &path } else { program }).unwrap();
        let ask = format!(
            r#"{{"name":"{name}",
            "limits":{{"bytes_max":1000000000,"pixels_max":10000,"decoder_bytes_max":1000000}},
            "purpose":{{"Photo":["srgb",
            {{"sensor":{grid},"photo":{{"x":0,"y":0,"size":{grid}}}}}]}},
            "memory_bytes_max":1000000000,"processor_s_max":10}}"#
        );
        let out = Command::new(program)
            .args([worker::WORD, &ask])
            .stdin(Stdio::from(file))
            .output()
            .unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        assert_eq!(
            worker::photo_of_answer(name, &out.stdout, size).is_ok(),
            path.exists(),
            "{name}"
        );
        fs::write(folder.join(name), out.stdout).unwrap();
    }
}

/// Writes the program's own rig files without comments.
fn rig_files(from: &Path, folder: &Path) {
    for entry in fs::read_dir(from).unwrap().flatten() {
        if entry.path().extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let text = fs::read_to_string(entry.path()).unwrap();
        // Comments only slow the fuzzer down.
        let bare: Vec<&str> = text
            .lines()
            .map(|line| line.split(" #").next().unwrap_or(line))
            .filter(|l| !l.starts_with('#'))
            .collect();
        let bare = bare.join("\n");
        // A rig of devices is parsed to its end, then refused by a program built without devices.
        if let Err(refused) = config::parse(&bare, "seed") {
            assert!(
                refused.to_string().contains("a rig of real devices"),
                "{}: {refused}",
                entry.path().display()
            );
        }
        fs::write(folder.join(entry.file_name()), bare).unwrap();
    }
}

/// Writes a calibration of the rig of `targets/calibration.rs`.
fn calibration(folder: &Path) {
    let canvas = Domain { left: -4.0, top: -4.0, right: 43.0, bottom: 33.0 };
    let geometry = Geometry::one_to_one(canvas, 5.0, 5.0);
    let flat = |v: f32| Frame::from_fn(|_| Plane::filled(Size::new(48, 38), v));
    let (ratio, dark): (Frame<Work>, Frame<Work>) = (flat(1.0), flat(0.0));
    let seen = EvenlyLit {
        wave: &ColumnWave::of(&Plane::zeros(Size::new(48, 38))),
        ratio: &ratio,
        share: &ratio,
        dark: &dark,
        mosaic: None,
        rim_px: 0,
    };
    let identity = [[1.0, 0.1, 0.0], [0.0, 1.0, 0.1], [0.1, 0.0, 1.0]];
    let calibration = Calibration {
        rig: 7,
        generation: 3,
        photo: Size::new(40, 30),
        margin_px: 4,
        geometry,
        dark_corner: [1.0, 1.1, 0.9].map(|d| Surface::plane(canvas, d, -0.005, 0.0)),
        cross_channel: CrossChannel { c: identity },
        camera_curve: CameraCurve::straight(),
        curves: [ResponseCurve::linear(), ResponseCurve::linear(), ResponseCurve::linear()],
        black: [64.0, 65.0, 66.0].map(|b| Surface::constant(canvas, b)),
        counts_per_level: [3.0, 3.2, 2.9],
        pattern: ResponsePattern::fit(&seen).unwrap(),
        noise: [Noise { at_black: 0.04, per_level: 0.008 }; 3],
        functions: LensFunctions {
            rows: 1,
            columns: 2,
            support_px: 1,
            taps: [vec![1.0; 2], vec![1.0; 2], vec![1.0; 2]],
        },
        broad: std::array::from_fn(|n| vec![Halo { radius_px: 5.0, share: 0.1 }; n]),
        norms: OperatorNorms::uniform(4, 1.0),
        at_sites: None,
        focuses: Vec::new(),
        norm_squared_seen: 1.0,
        operator_error: [1.0; 3],
        captures: 30,
    };
    store::save(folder, &calibration).unwrap();
    assert_eq!(store::load(folder, 7).unwrap(), calibration);
}

/// Writes records of the daemon. The target, knowing the photo, fills in `@file`, `@crc` and
/// `@bytes`.
fn records(folder: &Path) {
    let name = "[97,46,112,110,103]";
    let ledger = |attempts: u32, result: &str| {
        format!(r#"{{"photo":{name},"file":@file,"attempts":{attempts},"result":{result}}}"#)
    };
    let delivered =
        r#"{"kept":{"Unix":[99,46,112,110,103]},"result":{"Unix":[99,46,112,110,103]}}"#;
    let night = |again: bool| {
        format!(
            r#"{{"floor_unix_s":1.0,"unproven":[{delivered}],"must_repeat":{again},
                "is_withdrawing":{again}}}"#
        )
    };
    let report = r#"{"photo":"a.png","result":"a.png","result-address":"a.png",
        "outcome":"untouched","rig":"test","method":"none","stage":"photo","reason":"",
        "captures":0,"seconds":0.0,"certificate":null,"meaning":null,
        "size":{"width":16,"height":12},"stored":{"width":16,"height":12},
        "curve":"sRGB","grey":true,"turned":null,
        "notes":[],"iterations":[],"photo-crc32":"@crc","photo-bytes":@bytes,"finished-unix-s":1,
        "before":"gallery/1-before.jpg","after":"gallery/1-after.jpg"}"#;
    serde_json::from_str::<relens::daemon::Report>(&report.replace("@bytes", "1")).unwrap();
    let note =
        "d.png was not restored.\n\nd.png: it is no photo\n\nThe file lies beside this note.\n";
    let state = r#"{"rig":"test",
        "doing":{"is":"restoring","photo":"a.png","done":0.5,"remaining_s":null},
        "restored":1,"untouched":0,"failed":0,"waiting":{"turn":0,"button":0,"window":0,"panel":0,
        "rig":0,"settling":0,"unfinished":0,"retry":0},"needs-button":true,
        "written-unix-s":1}"#;
    serde_json::from_str::<relens::daemon::State>(state).unwrap();
    let all = [
        ("begun", [ledger(1, "null"), night(false), String::new(), note.into(), state.into()]),
        (
            "delivered",
            [ledger(1, name), night(false), report.into(), note.into(), "the result".into()],
        ),
        ("again", [ledger(9, name), night(true), report.into(), String::new(), String::new()]),
    ];
    for (name, sections) in all {
        let mut text = sections.join("\0");
        if name == "delivered" {
            text.push_str("\0the result");
        }
        fs::write(folder.join(name), text).unwrap();
    }
}

fn main() {
    let words: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [program, seeds] = words.as_slice() else { panic!("seeds PROGRAM DIR") };
    let folder = |target: &str| {
        let folder = seeds.join(target);
        fs::create_dir_all(&folder).unwrap();
        folder
    };
    photos(&folder("photo"));
    answers(program, &folder("photo"), &folder("answer"));
    rig_files(Path::new("rig-config"), &folder("rig-file"));
    calibration(&folder("calibration"));
    records(&folder("records"));
}
