//! Scenes nearer or farther than the panel: photos are restored with the lens measured at a few
//! focus offsets, and the offset is estimated from the photo (see `focus` in
//! `tests/tables/README.md`).

use std::path::Path;
use std::process::Command;

use relens::calibration::Calibration;
use relens::chart::scenes::Scene;
use relens::chart::test_rig::TestPhoto;
use relens::config::{Curve, Kind, RigFile};
use relens::deconvolution::quality::{psnr, ssim};
use relens::frame::{Channel, Channels, Frame, Work};
use relens::picture::Tone;
use relens::pipeline::{CertifiedFocus, Pipeline, hybrid};
use relens::rig::simulated::{self, Witness};

use crate::{load, measured};

/// Focus offsets of the lens, dioptres, with about equal steps of blur.
const OFFSETS: [f32; 7] = [-0.14, -0.09, -0.04, -0.015, 0.015, 0.04, 0.07];

/// small.toml with functions wide enough for scenes far out of focus.
fn rig() -> RigFile {
    let mut rig = load("small.toml");
    rig.calibration.function_support_px = 17;
    rig
}

/// `rig` with a scene at `scene_mm` and the panel at `panel_mm`, with unchanged focus.
fn at(rig: &RigFile, panel_mm: f64, scene_mm: f64) -> RigFile {
    let mut moved = rig.clone();
    if let Kind::Simulated(simulation) = &mut moved.kind {
        let lens = &mut simulation.lens;
        lens.focus_distance_mm = Some(lens.focus_distance_mm.unwrap_or(lens.object_distance_mm));
        lens.object_distance_mm = panel_mm;
        lens.scene_distance_mm = Some(scene_mm);
    }
    moved
}

/// Calibrations at the panel's focus alone, and at the panel's focus and `offsets`.
fn calibrations(rig: &RigFile, offsets: &[f32]) -> [Calibration; 2] {
    let alone = measured(rig).unwrap();
    let mut series = alone.clone();
    for &offset in offsets {
        series =
            series.with_focus(offset, &measured(&rig.refocused(offset).unwrap()).unwrap()).unwrap();
    }
    [alone, series]
}

/// SSIM and PSNR (dB) of linear light, means over the channels.
fn score(picture: &Frame<Work>, truth: &Frame<Work>) -> [f64; 2] {
    let each = Channel::ALL.map(|c| (picture.plane(c), truth.plane(c)));
    [each.map(|(a, b)| ssim(a, b)), each.map(|(a, b)| psnr(a, b))]
        .map(|scores| scores.iter().sum::<f64>() / 3.0)
}

fn scene_light(rig: &RigFile, scene: Scene) -> Frame<Work> {
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let codes = scene.codes(rig.photo.size());
    Frame::from_fn(|c| {
        let rounded = codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
        tone.plane(c, &rounded)
    })
}

/// A photo and its truth.
struct Taken {
    photo: TestPhoto,
    truth: Frame<Work>,
}

fn taken(rig: &RigFile, witness: &Witness, scene: Scene, raw: bool) -> Taken {
    let (light, seed) = (scene_light(rig, scene), 40 + scene as u64);
    let photo = match raw {
        true => TestPhoto::taken(witness, rig.photo.curve, &light, seed),
        false => {
            let tone = Tone::of_curve(rig.photo.curve, 8);
            let codes = witness.photograph(&light, seed);
            TestPhoto::developed(Frame::from_fn(|c| tone.plane(c, codes.plane(c))))
        }
    };
    Taken { photo, truth: witness.shaded(&light) }
}

/// Result of a photo: scores, focus offset, the certificate's ratio, the verdict.
struct Delivered {
    score: [f64; 2],
    offset: f32,
    ratio: f64,
    verdict: String,
}

/// Restores `taken` on `rig` with `calibration`.
fn delivered(rig: &RigFile, calibration: &Calibration, taken: &Taken) -> Delivered {
    let (mut devices, _) = simulated::open(rig).unwrap();
    let pipeline = Pipeline::new(rig, calibration).unwrap();
    let prepared = taken.photo.prepared(&pipeline, Channels::Colour);
    let offset = prepared.focus.as_ref().map_or(0.0, |focus| focus.offset);
    let restored = pipeline.restore(&mut devices, &prepared, &hybrid(rig), &mut |_, _| {});
    let outcome = restored.unwrap().outcome;
    let is_panel = outcome.certificate.is_some_and(|made| made.focus == CertifiedFocus::Panel);
    let certified = outcome.certificate.is_some();
    assert_eq!(is_panel, certified && calibration.focuses.is_empty());
    Delivered {
        score: score(&outcome.picture, &taken.truth),
        offset,
        ratio: outcome.certificate.map_or(f64::NAN, |certificate| certificate.ratio()),
        verdict: format!("{:?}", outcome.verdict),
    }
}

/// Gains in SSIM and PSNR (dB) for photos from one distance, summed over the scenes: with the
/// panel's focus alone, with the estimated focus, and with the panel at the scene's distance.
#[derive(Default)]
struct Gains {
    alone: [f64; 2],
    found: [f64; 2],
    own: [f64; 2],
    worst: f64,
}

fn gains(
    rig: &RigFile,
    [alone, series]: &[Calibration; 2],
    mm: f64,
    scenes: &[Scene],
    raw: bool,
) -> Gains {
    let own_rig = at(rig, mm, mm);
    let own = measured(&own_rig).unwrap();
    let panel_rig = at(rig, 4000.0, mm);
    let (_, witness) = simulated::open(&panel_rig).unwrap();
    let mut gains = Gains { worst: f64::INFINITY, ..Gains::default() };
    for &scene in scenes {
        let taken = taken(rig, &witness, scene, raw);
        let before = score(&taken.photo.light, &taken.truth);
        let each = [(rig, alone), (rig, series), (&own_rig, &own)]
            .map(|(rig, calibration)| delivered(rig, calibration, &taken));
        let sums = [&mut gains.alone, &mut gains.found, &mut gains.own];
        for (sum, delivered) in sums.into_iter().zip(&each) {
            let gained = delivered.score.iter().zip(before).map(|(after, before)| after - before);
            sum.iter_mut().zip(gained).for_each(|(sum, gained)| *sum += gained);
        }
        gains.worst = gains.worst.min(each[1].score[0] - before[0]);
        let cell = |of: &Delivered| {
            let Delivered { score: [ssim, db], offset, ratio, verdict } = of;
            format!("{ssim:.3}/{db:.1} at {offset:+.3}, {ratio:.2}, {verdict}")
        };
        println!(
            "| {} m | {} | {:.3}/{:.1} | {} | {} | {} |",
            mm / 1000.0,
            scene.name(),
            before[0],
            before[1],
            cell(&each[0]),
            cell(&each[1]),
            cell(&each[2])
        );
    }
    gains
}

#[test]
#[ignore = "makes a table; some minutes"]
fn what_a_photo_s_own_focus_is_worth() {
    // FILTERS=1: developed photos of a camera with colour filters; RAW=1: its raw photos.
    let [raw, filters] = ["RAW", "FILTERS"].map(|name| std::env::var_os(name).is_some());
    let mut rig = rig();
    if let (true, Kind::Simulated(simulation)) = (raw || filters, &mut rig.kind) {
        let truthful = load("truthful.toml");
        simulation.sensor.mosaic = truthful.simulation().unwrap().sensor.mosaic;
    }
    let both = calibrations(&rig, &OFFSETS);
    println!("| distance | scene | photo | panel's focus alone | focus found | panel there |");
    println!("|---|---|---|---|---|---|");
    let all = [3200.0, 3600.0, 4000.0, 4400.0, 5000.0, 8000.0]
        .map(|mm| (mm, gains(&rig, &both, mm, &Scene::ALL, raw)));
    println!("| distance | share alone, SSIM/dB | share found | least gain of one |");
    println!("|---|---|---|---|");
    for (mm, Gains { alone, found, own, worst }) in all {
        let share = |of: [f64; 2]| format!("{:.2}/{:.2}", of[0] / own[0], of[1] / own[1]);
        println!("| {} m | {} | {} | {worst:+.3} |", mm / 1000.0, share(alone), share(found));
    }
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn a_photo_out_of_focus_gains_as_with_a_panel_at_its_distance() {
    let rig = rig();
    let both = calibrations(&rig, &[-0.09, -0.04, 0.04, 0.07]);
    for (mm, least) in [(3200.0, [0.9, 0.8]), (5000.0, [0.9, 0.8])] {
        let Gains { alone, found, own, worst } =
            gains(&rig, &both, mm, &[Scene::Coffee, Scene::Rocket], false);
        for n in 0..2 {
            assert!(found[n] >= least[n] * own[n], "{mm}: {found:?} of {own:?}");
            // The panel's focus alone does not reach them.
            assert!(alone[n] < least[n] * own[n], "{mm}: {alone:?} of {own:?}");
        }
        assert!(worst > 0.0, "{mm}: {worst}");
    }
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_photo_in_the_panel_s_focus_keeps_it() {
    let rig = rig();
    let [_, series] = calibrations(&rig, &[-0.04, 0.04]);
    let (_, witness) = simulated::open(&rig).unwrap();
    let pipeline = Pipeline::new(&rig, &series).unwrap();
    assert_eq!(rig.photo.curve, Curve::Srgb);
    for scene in Scene::ALL {
        let taken = taken(&rig, &witness, scene, false);
        let found = taken.photo.prepared(&pipeline, Channels::Colour).focus;
        let offset = found.map_or(0.0, |focus| focus.offset);
        println!("{}: {offset:+.4}", scene.name());
        // Half of an offset that matters: 0.028 dioptres (a scene at 3.6 m) cost 0.006 SSIM.
        assert!(offset.abs() < 0.014, "{}: {offset}", scene.name());
    }
}

/// Runs the program in `folder`; returns exit code and output.
fn run(folder: &Path, words: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_relens"))
        .args(words)
        .current_dir(folder)
        .output()
        .unwrap();
    let text = [output.stdout, output.stderr].map(|of| String::from_utf8_lossy(&of).into_owned());
    (output.status.code(), text.concat())
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn other_focuses_are_measured_survive_a_calibration_and_are_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let calibrate = |more: &[&str]| {
        let words = ["calibrate", "--rig", "small.toml", "--folder", "."];
        run(folder.path(), &[&words[..], more].concat())
    };
    let (code, text) = calibrate(&["--focus-offset", "-0.04"]);
    assert!(code != Some(0) && text.contains("run `relens calibrate`"), "{text}");
    assert_eq!(calibrate(&[]).0, Some(0));
    // A lens focused at 4 m reaches infinity, the end of its range, a quarter of a dioptre away.
    for wrong in ["0", "20", "nan", "0.25", "5"] {
        let (code, text) = calibrate(&["--focus-offset", wrong]);
        let is_explained = text.contains("dioptres") && text.contains("allowed");
        assert!(code != Some(0) && is_explained, "{text}");
    }
    let (code, text) = calibrate(&["--focus-offset", "-0.04"]);
    assert!(code == Some(0) && text.contains("the panel's focus and -0.040 dioptres"), "{text}");
    let (_, text) = calibrate(&["--focus-offset=0.03"]);
    assert!(text.contains("-0.040, +0.030 dioptres"), "{text}");
    assert_eq!(calibrate(&[]).0, Some(0));
    let (code, text) = calibrate(&["--forget-focuses"]);
    assert!(code == Some(0) && text.contains("removed 2 focuses"), "{text}");
    let (_, text) = calibrate(&["--forget-focuses"]);
    assert!(text.contains("removed 0 focuses"), "{text}");
}
