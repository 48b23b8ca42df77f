//! Photos of scenes nearer or farther than the panel, restored with the lens measured at the
//! panel's focus alone and at two more.

use relens::calibration::Calibration;
use relens::chart::table::Table;
use relens::chart::test_rig::{PHOTO_SEED, TestPhoto, TestRig};
use relens::config::RigFile;
use relens::frame::{Channels, Frame, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::Tone;
use relens::pipeline::method;
use relens::rig::simulated::{Witness, open};

use crate::appearance::{Appearance, AppearanceScores};
use crate::change::lens;
use crate::made::Made;
use crate::{Failure, colour, seconds};

/// Focus offsets measured besides the panel's, dioptres: 3 px of blur on `simulated.toml`.
const OFFSETS: [f32; 2] = [-0.02, 0.02];

/// Focus offsets of the scenes from the panel, dioptres.
const SCENES_AT: [f64; 4] = [-0.013, 0.0, 0.013, 0.026];

/// Table of the scenes at each distance.
pub(crate) fn run(rig: &RigFile, quick: bool) -> Result<Made, Failure> {
    let (alone, series) = calibrations(rig)?;
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let scenes = colour::with_kept(rig.photo.size(), &tone)?;
    let head = [
        "scene",
        "offset",
        "lens at",
        "found",
        "SSIM",
        "RGB dB",
        "C*ab",
        "99 %",
        "b* of dark",
        "ΔE",
    ];
    let mut table = Table::new(
        format!("Photos of `{}` at focus offsets from the panel's, dioptres.", rig.name),
        &head,
    );
    for offset in SCENES_AT {
        let witness = open(&at(rig, offset))?.1;
        let step = if quick { 4 } else { 1 };
        for (n, (name, scene)) in scenes.iter().enumerate().step_by(step) {
            let photo = TestPhoto::taken(&witness, rig.photo.curve, scene, PHOTO_SEED + n as u64);
            for (calibration, lens_at) in [(&alone, "one focus"), (&series, "three")] {
                let (found, scores) = restored(rig, &witness, calibration, &photo, scene)?;
                let AppearanceScores {
                    ssim,
                    rgb_db,
                    chroma,
                    chroma_99th,
                    dark_cast,
                    difference,
                    ..
                } = scores;
                let row = [
                    name.clone(),
                    format!("{offset:+.3}"),
                    lens_at.to_owned(),
                    found.map_or("–".to_owned(), |found| format!("{found:+.3}")),
                    format!("{ssim:.4}"),
                    format!("{rgb_db:.2}"),
                    format!("{chroma:.1}"),
                    format!("{chroma_99th:.0}"),
                    format!("{:+.1}", dark_cast[1]),
                    format!("{difference:.2}"),
                ];
                log::info!("{}", row.join(" "));
                table.row(row.into());
            }
        }
    }
    Ok(Made::table(format!("{}-focus", rig.name), table))
}

/// The calibration at the panel's focus alone, and with [`OFFSETS`].
fn calibrations(rig: &RigFile) -> Result<(Calibration, Calibration), Failure> {
    let measure = |rig: &RigFile| {
        calibrate(&mut open(rig)?.0, rig, None, &mut to_the_end).map_err(Failure::from)
    };
    let alone = measure(rig)?;
    let mut series = alone.clone();
    for offset in OFFSETS {
        let turned = rig.refocused(offset).ok_or("a focus beyond infinity")?;
        series = series.with_focus(offset, &measure(&turned)?)?;
    }
    Ok((alone, series))
}

/// `rig` with scenes at an `offset` from the panel, dioptres.
fn at(rig: &RigFile, offset: f64) -> RigFile {
    let mut moved = rig.clone();
    lens(&mut moved, |lens| {
        lens.scene_distance_mm = Some(1000.0 / (1000.0 / lens.object_distance_mm + offset));
    });
    moved
}

/// The focus found for `photo` and the scores of its result by the rig's own method.
fn restored(
    rig: &RigFile,
    witness: &Witness,
    calibration: &Calibration,
    photo: &TestPhoto,
    scene: &Frame<Work>,
) -> Result<(Option<f32>, AppearanceScores), Failure> {
    let mut test_rig = TestRig::on(rig.clone(), open(rig)?.0, calibration, seconds)?;
    let found = photo.prepared(test_rig.parts().0, Channels::Colour).focus.map(|of| of.offset);
    let own = method(rig, rig.restore.method);
    let (solved, _) = test_rig.solve(photo, Channels::Colour, &*own, &mut |_, _| {})?;
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let [result, truth] =
        [&solved.picture, &witness.shaded(scene)].map(|light| Appearance::new(&tone, light));
    Ok((found, result.scores(&truth)))
}
