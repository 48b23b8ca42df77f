//! Removal of the lens's vignetting by the built program. The vignetting is measured with a
//! diffuser; the panel has darker corners of its own.

// Shared test functions may panic as tests do.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

use relens::Curve;
use relens::chart::scenes::cut;
use relens::config;
use relens::frame::{Channel, Frame, Rect, Size, Work};
use relens::picture::{Format, Limits, Manner, Photo, encode};
use relens::rig::simulated;

const SIZE: Size = Size::new(256, 192);
/// Side of the compared corners, pixels.
const CORNER_PX: usize = 24;

/// Runs relens in `folder`; returns its output.
fn relens(words: &[&str], folder: &Path) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_relens"));
    let output = command.args(words).current_dir(folder).output().unwrap();
    let text = [output.stdout, output.stderr].map(|s| String::from_utf8_lossy(&s).into_owned());
    assert!(output.status.success(), "{words:?}: {text:?}");
    text.concat()
}

fn light(folder: &Path, name: &str) -> Frame<Work> {
    let path = folder.join(name);
    Photo::read(&path, Curve::Srgb, &Limits::default()).unwrap().in_colour()
}

/// Mean light of the four corners and of the middle, in one channel.
fn places(picture: &Frame<Work>, c: Channel) -> [f64; 5] {
    let size = Size::new(CORNER_PX, CORNER_PX);
    let (right, bottom) = (SIZE.width - CORNER_PX, SIZE.height - CORNER_PX);
    let all = [(0, 0), (right, 0), (0, bottom), (right, bottom), (right / 2, bottom / 2)];
    all.map(|(x, y)| picture.plane(c).crop(Rect { x, y, size }).mean())
}

#[test]
fn results_have_the_scene_s_corner_brightness() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // The lens loses a third in the corners; the panel loses 15 % there, which does not affect
    // photos.
    let small = include_str!("../rig-config/small.toml");
    assert!(small.contains("thickness-mm = 25.0") && small.contains("\n[restore]\n"));
    let rig = small.replace("thickness-mm = 25.0", "thickness-mm = 80.0");
    let rig = rig.replace("[sensor]\n", "[sensor]\nmosaic = \"rggb\"\n");
    let rig = rig.replace("[display]\n", "[display]\nuneven = true\n");
    // Noise in the measured broad light changes the light of the middle, by 0.4 % with single
    // captures.
    let rig = rig.replace("[calibration]\n", "[calibration]\ncaptures-averaged = 4\n");
    std::fs::write(folder.join("kept.toml"), &rig).unwrap();
    let asked = rig.replace("\n[restore]\n", "\n[restore]\nremove-vignetting = true\n");
    std::fs::write(folder.join("removed.toml"), &asked).unwrap();
    // A scene of the sensor's size with the photo in its middle. It is grey and far from black, so
    // that neither mixed colours nor the veil are mistaken for shading.
    let coffee = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/coffee.png");
    let coffee = Photo::read(&coffee, Curve::Srgb, &Limits::default()).unwrap();
    let coffee = cut(&coffee.in_colour(), Size::new(288, 224));
    let grey = coffee.plane(Channel::Green).map(|v: f32| 60.0 + 0.5 * v);
    let scene: Frame<Work> = Frame::from_fn(|_| grey.clone());
    let manner = Manner::plain(Format::Png, 8, Curve::Srgb);
    let bytes = encode("scene.png", &scene, &manner, false).unwrap();
    std::fs::write(folder.join("scene.png"), bytes).unwrap();

    relens(&["calibrate", "--rig", "kept.toml"], folder);
    let shoot = ["shoot", "--rig", "kept.toml", "--scene", "scene.png", "-o", "photo.dng"];
    relens(&shoot, folder);
    // Removal requested but vignetting not measured: a note says so, and corners stay dark.
    let restore = |rig: &str, more: &[&str]| {
        let words = ["restore", "--rig", rig, "--method", "digital", "photo.dng"];
        relens(&[&words, more].concat(), folder)
    };
    restore("removed.toml", &["--report", "early.json", "-o", "early.png"]);
    let early = std::fs::read_to_string(folder.join("early.json")).unwrap();
    assert!(early.contains("relens calibrate --diffuser"), "{early}");
    let text = relens(&["calibrate", "--rig", "kept.toml", "--diffuser"], folder);
    assert!(text.contains("% of the light at the brightest place"), "{text}");
    restore("kept.toml", &["-o", "kept.png"]);
    restore("removed.toml", &["-o", "removed.png"]);
    // The measurement survives another calibration.
    relens(&["calibrate", "--rig", "removed.toml"], folder);
    restore("removed.toml", &["-o", "again.png"]);

    let scene = light(folder, "scene.png").crop(Rect { x: 16, y: 16, size: SIZE });
    let filed = config::load(&folder.join("kept.toml")).unwrap();
    let shaded = simulated::open(&filed).unwrap().1.shaded(&scene);
    let [kept, removed, again, early] =
        ["kept.png", "removed.png", "again.png", "early.png"].map(|name| light(folder, name));
    assert_eq!(kept, early);
    for c in Channel::ALL {
        // Light relative to the middle, which a photo's exposure refers to.
        let against = |picture: &Frame<Work>, truth: &Frame<Work>| {
            let (found, wanted) = (places(picture, c), places(truth, c));
            [0, 1, 2, 3].map(|n| found[n] / wanted[n] / (found[4] / wanted[4]))
        };
        let lens = against(&shaded, &scene);
        let untouched = against(&kept, &shaded);
        let factor = against(&removed, &kept).map(|factor| factor.recip());
        println!("{}: the lens {lens:.3?}, measured {factor:.3?}", c.name());
        println!("  delivered with them against the shaded scene {untouched:.3?}");
        let delivered = [&removed, &again].map(|picture| against(picture, &scene));
        println!("  delivered without against the scene {delivered:.3?}");
        for n in 0..4 {
            assert!(lens[n] < 0.75, "the lens darkens: {lens:?}");
            // At the sensor's rim some of the veil that a wider scene would cause is missing.
            assert!((factor[n] / lens[n] - 1.0).abs() < 0.03, "{factor:?}, {lens:?}");
            for found in [delivered[0][n], delivered[1][n]] {
                assert!((found - 1.0).abs() < 0.01, "{}: {delivered:?}", c.name());
            }
        }
    }
}
