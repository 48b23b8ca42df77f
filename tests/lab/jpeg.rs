//! Cost of JPEG coding: one photo of each scene, uncoded and in four qualities, solved from decoded
//! pixels and from coefficients.

use std::path::Path;

use relens::chart::table::Table;
use relens::chart::test_rig::PHOTO_SEED;
use relens::config::{Curve, MethodName, RigFile};
use relens::deconvolution::method::Method;
use relens::frame::{Channels, Frame, Work};
use relens::measurement::{calibrate, to_the_end};
use relens::picture::{Limits, Photo, Tone};
use relens::pipeline::{PhotoData, Pipeline, method};
use relens::rig::exposure::Devices;
use relens::rig::simulated::{Witness, open};

use crate::Failure;
use crate::appearance::Appearance;
use crate::colour::{INKED, scenes};
use crate::jpeg_coder::{Quality, coded};
use crate::made::Made;

/// Coding of a photo as a file.
pub(crate) struct FileCoding {
    pub(crate) name: String,
    /// Encodes a camera's codes as a file.
    pub(crate) file: Coder,
    pub(crate) quality: Quality,
}

type Coder = fn(&FileCoding, &Frame<Work, u8>) -> Result<Vec<u8>, Failure>;

/// The study's four codings, 4:4:4 and 4:2:0, by the laboratory's coder.
fn studied() -> Vec<FileCoding> {
    let of = |quality, pixels| {
        let quality = Quality { quality, pixels: (pixels, pixels) };
        FileCoding { name: quality.name(), file: |of, codes| Ok(coded(codes, of.quality)), quality }
    };
    vec![of(95, 1), of(90, 2), of(85, 2), of(60, 2)]
}

/// SSIM of luminance, RGB dB, ΔE.
type Scores = [f64; 3];

fn scores(picture: &Appearance, scene: &Appearance) -> Scores {
    let found = picture.scores(scene);
    [found.ssim, found.rgb_db, found.difference]
}

/// Table on the simulated rig of `rig`; `quick` takes `digital` alone.
pub(crate) fn run(rig: &RigFile, quick: bool, pictures: Option<&Path>) -> Result<Made, Failure> {
    let methods: &[MethodName] =
        if quick { &[MethodName::Digital] } else { &[MethodName::Digital, MethodName::Hybrid] };
    let tone = Tone::of_curve(rig.photo.curve, 8);
    let mut scenes = scenes(rig.photo.size(), &tone, pictures)?;
    // Photographs only: coding takes nearly all of a chart's gain.
    scenes.drain(..INKED);
    costs(rig, "jpeg", (methods, &studied()), &scenes)
}

/// Scores of one scene with one coding.
#[derive(Clone, Copy)]
struct CodedScores {
    photo: Scores,
    decoded: Scores,
    coefficients: Scores,
}

/// Scores of one scene by one method.
struct SceneScores {
    /// Gain in SSIM if the uncoded photo is solved.
    gain: f64,
    /// Scores for each coding.
    coded: Vec<CodedScores>,
}

/// Rig, pipeline and table of one experiment.
struct Bench<'a> {
    devices: Devices,
    witness: Witness,
    pipeline: Pipeline,
    tone: Tone,
    codings: &'a [FileCoding],
    table: Table,
}

/// Cost of `codings` for photos of `scenes` by `methods` on the simulated rig of `rig`.
pub(crate) fn costs(
    rig: &RigFile,
    stem: &str,
    (methods, codings): (&[MethodName], &[FileCoding]),
    scenes: &[(String, Frame<Work>)],
) -> Result<Made, Failure> {
    let (mut devices, witness) = open(rig)?;
    let calibration = calibrate(&mut devices, rig, None, &mut to_the_end)?;
    let pipeline = Pipeline::new(rig, &calibration)?;
    let words = format!("{}, {}: cost of coding.", rig.name, rig.photo.size());
    let head = ["scene", "method", "coding", "solved from", "SSIM", "RGB dB", "ΔE", "share kept"];
    let (tone, table) = (Tone::of_curve(rig.photo.curve, 8), Table::new(words, &head));
    let mut bench = Bench { devices, witness, pipeline, tone, codings, table };
    let words = format!("{}, {}: means over the scenes.", rig.name, rig.photo.size());
    let head = [
        "method",
        "coding",
        "SSIM kept: decoded",
        "coefficients",
        "ΔE: photo",
        "decoded",
        "coefficients",
        "worse than the photo: decoded",
        "coefficients",
    ];
    let mut means = Table::new(words, &head);
    for &which in methods {
        let solver = method(rig, which);
        let mut all = Vec::new();
        for (n, (name, light)) in scenes.iter().enumerate() {
            all.push(bench.score(PHOTO_SEED + n as u64, name, light, &*solver)?);
        }
        for (n, coding) in codings.iter().enumerate() {
            means.row(mean_cells(which, &coding.name, &all, n));
        }
    }
    let stem = format!("{}-{stem}", rig.name);
    let tables = vec![(format!("{stem}-scenes"), bench.table), (stem, means)];
    Ok(Made { tables, ..Made::default() })
}

impl Bench<'_> {
    /// Scores the photo of a scene with `light`, uncoded and in every coding.
    fn score(
        &mut self,
        seed: u64,
        name: &str,
        light: &Frame<Work>,
        solver: &dyn Method,
    ) -> Result<SceneScores, Failure> {
        let codes = self.witness.photograph(light, seed);
        let scene = Appearance::new(&self.tone, &self.witness.shaded(light));
        let photo: Frame<Work> = Frame::from_fn(|c| self.tone.plane(c, codes.plane(c)));
        let untouched = scores(&Appearance::new(&self.tone, &photo), &scene);
        let best = self.solve(PhotoData::developed(&photo, Channels::Colour), solver, &scene)?;
        let gain = best[0] - untouched[0];
        let words = [name, solver.name(), "none"];
        self.add(words, "photo", untouched, None);
        self.add(words, "decoded", best, None);
        let mut coded = Vec::new();
        for coding in self.codings {
            let file = (coding.file)(coding, &codes)?;
            let photo = Photo::from_bytes("photo.jpg", &file, Curve::Srgb, &Limits::default())?;
            let before = scores(&Appearance::new(&self.tone, &photo.light), &scene);
            let pixels = PhotoData::developed(&photo.light, Channels::Colour);
            let decoded = self.solve(pixels, solver, &scene)?;
            // Files other than JPEGs have no coefficients.
            let coefficients = match photo.coding {
                None => decoded,
                Some(_) => self.solve(&photo, solver, &scene)?,
            };
            let kept = |of: Scores| Some((of[0] - before[0]) / gain);
            let words = [name, solver.name(), &coding.name];
            self.add(words, "photo", before, None);
            self.add(words, "decoded", decoded, kept(decoded));
            self.add(words, "coefficients", coefficients, kept(coefficients));
            coded.push(CodedScores { photo: before, decoded, coefficients });
        }
        Ok(SceneScores { gain, coded })
    }

    /// Solves a photo and scores the result.
    fn solve<'a>(
        &mut self,
        photo: impl Into<PhotoData<'a>>,
        solver: &dyn Method,
        scene: &Appearance,
    ) -> Result<Scores, Failure> {
        let prepared = self.pipeline.prepare(photo);
        let solved = self.pipeline.solve(&mut self.devices, &prepared, solver, &mut |_, _| {})?;
        Ok(scores(&Appearance::new(&self.tone, &solved.picture), scene))
    }

    /// Adds a row: scene, method and coding (`words`), then the data solved and the scores.
    fn add(&mut self, words: [&str; 3], solved_from: &str, of: Scores, kept: Option<f64>) {
        let mut cells: Vec<String> = words.map(str::to_owned).into();
        cells.push(solved_from.to_owned());
        cells.extend([format!("{:.4}", of[0]), format!("{:.2}", of[1]), format!("{:.2}", of[2])]);
        cells.push(kept.map_or(String::new(), |kept| format!("{kept:.2}")));
        log::info!("{}", cells.join(" | "));
        self.table.row(cells);
    }
}

/// Means of the `n`-th coding over all scenes.
fn mean_cells(which: MethodName, coding: &str, all: &[SceneScores], n: usize) -> Vec<String> {
    let coded: Vec<CodedScores> = all.iter().map(|scene| scene.coded[n]).collect();
    let sum = |of: &dyn Fn(&CodedScores) -> f64| coded.iter().map(of).sum::<f64>();
    let gain: f64 = all.iter().map(|scene| scene.gain).sum();
    let count = coded.len().max(1) as f64;
    let worse = |of: &dyn Fn(&CodedScores) -> Scores| {
        coded.iter().filter(|scores| of(scores)[2] > scores.photo[2]).count().to_string()
    };
    vec![
        which.name().to_owned(),
        coding.to_owned(),
        format!("{:.2}", sum(&|s| s.decoded[0] - s.photo[0]) / gain),
        format!("{:.2}", sum(&|s| s.coefficients[0] - s.photo[0]) / gain),
        format!("{:.2}", sum(&|s| s.photo[2]) / count),
        format!("{:.2}", sum(&|s| s.decoded[2]) / count),
        format!("{:.2}", sum(&|s| s.coefficients[2]) / count),
        worse(&|s| s.decoded),
        worse(&|s| s.coefficients),
    ]
}
