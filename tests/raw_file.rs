//! A raw photo as a file, all the way: taken by the program, read, restored at its sites, written.

// A failed unwrap is a failed test, also in the functions the tests share.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::Command;

use relens::chart::scenes::cut;
use relens::config::{self, Curve};
use relens::deconvolution::quality::{psnr, ssim};
use relens::frame::{Channel, Frame, Work};
use relens::picture::{Format, Limits, Photo, PhotoCamera, RigSetting};
use relens::rig::simulated;
use relens::{Rig, Verdict};

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/coffee.png");

/// The rig file truthful.toml with this `mosaic` in place of its own.
fn rig_file(folder: &Path, name: &str, mosaic: &str) -> PathBuf {
    let truthful = Path::new(env!("CARGO_MANIFEST_DIR")).join("rig-config/truthful.toml");
    let text = std::fs::read_to_string(truthful).unwrap();
    let own = "mosaic = \"rggb\"";
    assert!(text.contains(own));
    let path = folder.join(name);
    std::fs::write(&path, text.replace(own, mosaic)).unwrap();
    path
}

/// Has the program take a photo of the scene; what it says on standard error.
fn shoot(folder: &Path, rig: &Path, out: &str, options: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_relens"))
        .args(["shoot", "--rig"])
        .arg(rig)
        .args(["--scene", SCENE, "-o", out])
        .args(options)
        .current_dir(folder)
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// SSIM and dB of linear light, means over the channels.
fn score(picture: &Frame<Work>, truth: &Frame<Work>) -> [f64; 2] {
    let each = Channel::ALL.map(|c| (picture.plane(c), truth.plane(c)));
    [each.map(|(a, b)| ssim(a, b)), each.map(|(a, b)| psnr(a, b))]
        .map(|scores| scores.iter().sum::<f64>() / 3.0)
}

#[test]
fn a_raw_photo_is_restored_at_its_sites_and_by_its_own_rig_alone() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let filtered = rig_file(folder, "rggb.toml", "mosaic = \"rggb\"");
    assert_eq!(shoot(folder, &filtered, "x.dng", &[]), (Some(0), String::new()));
    let plain = rig_file(folder, "plain.toml", "");
    let (code, told) = shoot(folder, &plain, "y.dng", &[]);
    assert!(code == Some(2) && told.contains("has no colour filters"), "{told}");

    let mut rig = Rig::open(&filtered).unwrap();
    let slots = folder.join("slots");
    rig.calibrate(&slots).unwrap();
    let photo = rig.read(folder.join("x.dng")).unwrap();
    let raw = photo.raw.unwrap();
    // The file's white is the largest count, the scene's lies below it.
    let file = config::load(&filtered).unwrap();
    let (_, witness) = simulated::open(&file).unwrap();
    let levels = (witness.counts_per_level() / f64::from(raw.counts_per_level)) as f32;
    let sharp = Photo::read(Path::new(SCENE), Curve::Srgb, &Limits::default()).unwrap();
    let grid = file.photo_grid();
    let scene = cut(&sharp.in_colour(), grid.sensor);
    let mut truth = witness.shaded(&Frame::from_fn(|c| scene.plane(c).crop(grid.photo)));
    for plane in truth.planes_mut() {
        plane.data_mut().iter_mut().for_each(|v| *v *= levels);
    }

    let mut restorer = rig.restorer(&slots).unwrap();
    let outcome = restorer.restore(&photo).unwrap();
    let interpolated = Photo { raw: None, ..photo.clone() };
    let before = restorer.restore(&interpolated).unwrap();
    let all = [&photo.light, &before.picture, &outcome.picture].map(|p| score(p, &truth));
    println!("photo, interpolated before, at its sites: {all:.4?}; {}", outcome.reason);
    let [taken, filled, sites] = all;
    assert_eq!(outcome.verdict, Verdict::Sound);
    assert!(sites[0] > filled[0] + 0.01 && sites[1] > filled[1] + 1.0, "{all:?}");
    assert!(sites[0] > taken[0] + 0.02 && sites[1] > taken[1] + 1.0, "{all:?}");

    // As a file: 16 bits with the rig's curve, fine enough to lose nothing that was won.
    let bytes = photo.with_picture(&outcome.picture, Format::Tiff).unwrap();
    let back = Photo::from_bytes("x.tif", &bytes, Curve::Srgb, &Limits::default()).unwrap();
    let written = score(&back.light, &truth);
    assert!(back.manner.bits == 16 && written[1] > sites[1] - 0.05, "{written:?} {sites:?}");

    // The whole sensor is in the file, and a mean of more exposures is as good a photo of it.
    let more = ["--frames", "4", "--exposure", "auto"];
    assert_eq!(shoot(folder, &filtered, "z.dng", &more), (Some(0), String::new()));
    let whole = Photo::read(&folder.join("z.dng"), Curve::Srgb, &Limits::default()).unwrap();
    assert_eq!((whole.light.size(), photo.light.size()), (grid.sensor, grid.photo.size));
    let full = 0.998 * 255.0;
    let clipped = whole.light.planes().iter().flat_map(|p| p.data()).filter(|&&v| v > full);
    assert!(clipped.count() <= grid.sensor.area() / 300, "auto clips next to nothing");

    let camera = photo.camera.clone().unwrap();
    let by = |camera| Photo { camera: Some(camera), ..photo.clone() };
    let strange = PhotoCamera { name: "relens someone's".to_owned(), ..camera.clone() };
    let told = restorer.restore(&by(strange)).unwrap_err().to_string();
    assert!(told.contains("taken by another rig") && told.contains("relens truthful"), "{told}");
    let ours = camera.setting.clone().unwrap();
    assert_eq!((ours.identity, &ours.focus), (file.identity, &None));
    let focus = Some("nearer".to_owned());
    let setting = Some(RigSetting { identity: ours.identity, focus });
    let nearer = PhotoCamera { setting, ..camera.clone() };
    let told = restorer.restore(&by(nearer)).unwrap_err().to_string();
    assert!(told.contains("found \"nearer\", allowed none said"), "{told}");
    let setting = Some(RigSetting { identity: !ours.identity, ..ours });
    let before = PhotoCamera { setting, ..camera };
    let notes = restorer.restore(&by(before)).unwrap().notes;
    assert!(notes.iter().any(|note| note.contains("rig file said otherwise")), "{notes:?}");
    let mut other = raw;
    other.mosaic = raw.mosaic.from_place(1, 0);
    let refused = restorer.restore(&Photo { raw: Some(other), ..photo.clone() }).unwrap_err();
    let told = refused.to_string();
    assert!(told.contains("found colour filters GRBG, allowed RGGB"), "{told}");
    let mut unfiltered = Rig::open(&plain).unwrap();
    unfiltered.calibrate(folder.join("plain")).unwrap();
    let mut unfiltered = unfiltered.restorer(folder.join("plain")).unwrap();
    let told = unfiltered.restore(&photo).unwrap_err().to_string();
    assert!(told.contains("gives no raw sites"), "{told}");
}
