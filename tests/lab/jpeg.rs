//! What coding as a JPEG costs: of each scene one photo, not coded and coded in four qualities,
//! taken as its decoder shows it and as what its file states.

use std::path::Path;

use relens::chart::looks::Looks;
use relens::chart::table::Table;
use relens::chart::test_rig::PHOTO_SEED;
use relens::config::{Curve, MethodName, RigFile};
use relens::frame::{Channels, Frame, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::{Limits, Photo, Tone};
use relens::pipeline::{PhotoData, Pipeline, Prepared, method};
use relens::rig::exposure::Devices;
use relens::rig::simulated::jpeg_coder::{Quality, coded};
use relens::rig::simulated::open;

use crate::Failure;
use crate::colour::{INKED, scenes};
use crate::made::Made;

/// How a photo comes to be a file.
pub(crate) struct FileCoding {
    pub(crate) name: String,
    /// The file of a camera's codes.
    pub(crate) file: Coder,
    pub(crate) quality: Quality,
}

type Coder = fn(&FileCoding, &Frame<Work, u8>) -> Result<Vec<u8>, Failure>;

/// The independent study's four, 4:4:4 and 4:2:0, by the laboratory's own coder.
fn studied() -> Vec<FileCoding> {
    let of = |quality, pixels| {
        let quality = Quality { quality, pixels: (pixels, pixels) };
        FileCoding { name: quality.name(), file: |of, codes| Ok(coded(codes, of.quality)), quality }
    };
    vec![of(95, 1), of(90, 2), of(85, 2), of(60, 2)]
}

/// SSIM of luminance, RGB dB, ΔE.
type Scores = [f64; 3];

fn scores(picture: &Looks, scene: &Looks) -> Scores {
    let found = picture.scores(scene);
    [found.ssim, found.rgb_db, found.difference]
}

/// The table on the simulated rig of `rig`; `quick` takes `digital` alone.
pub(crate) fn run(rig: &RigFile, quick: bool, pictures: Option<&Path>) -> Result<Made, Failure> {
    let methods: &[MethodName] =
        if quick { &[MethodName::Digital] } else { &[MethodName::Digital, MethodName::Hybrid] };
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let mut scenes = scenes(rig.photo.size(), &tone, pictures)?;
    // Photographs; a chart has hardly anything that coding keeps.
    scenes.drain(..INKED);
    costs(rig, "jpeg", (methods, &studied()), &scenes)
}

/// What `codings` cost photos of `scenes` by `methods` on the simulated rig of `rig`.
pub(crate) fn costs(
    rig: &RigFile,
    stem: &str,
    (methods, codings): (&[MethodName], &[FileCoding]),
    scenes: &[(String, Frame<Work>)],
) -> Result<Made, Failure> {
    let (mut devices, witness) = open(rig)?;
    let calibration = calibrate(&mut devices, rig, None, &mut to_the_end)?;
    let pipeline = Pipeline::new(rig, &calibration)?;
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let words = format!("{}, {}: what coding costs.", rig.name, rig.photo.size());
    let head = ["scene", "method", "coding", "taken as", "SSIM", "RGB dB", "ΔE", "share kept"];
    let mut table = Table::new(words, &head);
    let words = format!("{}, {}: means over the scenes.", rig.name, rig.photo.size());
    let head = [
        "method",
        "coding",
        "SSIM kept: decoded",
        "stated",
        "ΔE: photo",
        "decoded",
        "stated",
        "worse than the photo: decoded",
        "stated",
    ];
    let mut means = Table::new(words, &head);
    for &which in methods {
        let solver = method(rig, which);
        // Photo, decoded and stated of each scene, one list a coding.
        let mut all: Vec<Vec<[Scores; 3]>> = vec![Vec::new(); codings.len()];
        let mut gain = 0.0;
        for (n, (name, light)) in scenes.iter().enumerate() {
            let codes = witness.photograph(light, PHOTO_SEED + n as u64);
            let scene = Looks::of(&tone, &witness.shaded(light));
            let scored = |light: &Frame<Work>| scores(&Looks::of(&tone, light), &scene);
            let solve = |devices: &mut Devices, prepared: &Prepared<'_>| {
                let solved = pipeline.solve(devices, prepared, &*solver, &mut |_, _| {})?;
                Ok::<_, Failure>(scored(&solved.picture))
            };
            let photo: Frame<Work> = Frame::from_fn(|c| tone.plane(c, codes.plane(c)));
            let untouched = scored(&photo);
            let best = solve(
                &mut devices,
                &pipeline.prepare(PhotoData::developed(&photo, Channels::Colour)),
            )?;
            gain += best[0] - untouched[0];
            let mut told = |coding: &str, taken: &str, of: Scores, kept: Option<f64>| {
                let mut cells = vec![name.clone(), which.name().to_owned()];
                cells.extend([coding.to_owned(), taken.to_owned()]);
                cells.extend([format!("{:.4}", of[0]), format!("{:.2}", of[1])]);
                cells.push(format!("{:.2}", of[2]));
                cells.push(kept.map_or(String::new(), |kept| format!("{kept:.2}")));
                log::info!("{}", cells.join(" | "));
                table.row(cells);
            };
            told("none", "photo", untouched, None);
            told("none", "decoded", best, None);
            for (coding, all) in codings.iter().zip(&mut all) {
                let file = (coding.file)(coding, &codes)?;
                let curve = Curve::Srgb;
                let photo = Photo::from_bytes("photo.jpg", &file, curve, &Limits::default())?;
                let prepared =
                    pipeline.prepare(PhotoData::developed(&photo.light, Channels::Colour));
                let decoded = solve(&mut devices, &prepared)?;
                // No other file states anything.
                let stated = match photo.coding {
                    None => decoded,
                    Some(_) => solve(&mut devices, &pipeline.prepare(&photo))?,
                };
                let before = scored(&photo.light);
                let kept = |of: Scores| Some((of[0] - before[0]) / (best[0] - untouched[0]));
                let coding = &coding.name;
                told(coding, "photo", before, None);
                told(coding, "decoded", decoded, kept(decoded));
                told(coding, "stated", stated, kept(stated));
                all.push([before, decoded, stated]);
            }
        }
        let mean = |of: &dyn Fn(usize) -> f64| {
            (0..scenes.len()).map(of).sum::<f64>() / scenes.len().max(1) as f64
        };
        for (coding, all) in codings.iter().zip(&all) {
            let kept =
                |way: usize| mean(&|n| all[n][way][0] - all[n][0][0]) * scenes.len() as f64 / gain;
            let apart = |way: usize| format!("{:.2}", mean(&|n| all[n][way][2]));
            let worse =
                |way: usize| all.iter().filter(|of| of[way][2] > of[0][2]).count().to_string();
            means.row(vec![
                which.name().to_owned(),
                coding.name.clone(),
                format!("{:.2}", kept(1)),
                format!("{:.2}", kept(2)),
                apart(0),
                apart(1),
                apart(2),
                worse(1),
                worse(2),
            ]);
        }
    }
    let stem = format!("{}-{stem}", rig.name);
    Ok(Made { tables: vec![(format!("{stem}-scenes"), table), (stem, means)], ..Made::default() })
}
