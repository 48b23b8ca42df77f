//! Scenes that call for different stages: which one the box delivers, and what the others would
//! have given.
//!
//! | stage | what is run for the table |
//! |---|---|
//! | 0 | nothing: the photo |
//! | 1 | the lens model with one function for the whole field, no capture |
//! | 2 | the lens model, no capture |
//! | 3 | the lens model and captures |
//!
//! The box has stages 0, 2 and 3. Stage 1 is run for comparison: it would do for a wall, a
//! night sky and a small thing in the middle.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use relens::chart::table::Table;
use relens::chart::test_rig::{TestPhoto, seen};
use relens::config::{MethodName, RigFile};
use relens::deconvolution::quality::ssim;
use relens::deconvolution::stage::ResultStage;
use relens::frame::{FULL_SCALE, Frame, Plane, Work};
use relens::picture::Tone;
use relens::pipeline::{Pipeline, Restoration, method};

use crate::harness::Harness;
use crate::made::Made;
use crate::varied::{Varied, varied};
use crate::{Failure, seconds};

/// Seed of what is drawn and of the photos' noise.
const SEED: u64 = 20_261_121;
/// Noise of photos that no lens has seen, grey levels.
const NOISE_LEVELS: f32 = 1.0;

/// A scene by stages.
pub(crate) struct Row {
    name: &'static str,
    /// SSIM of the photo, and of what stages 1, 2 and 3 make of it.
    ssim: [f64; 4],
    /// The stage that the box delivers.
    pub(crate) taken: usize,
    /// SSIM of what the box delivers.
    pub(crate) delivered_ssim: f64,
    captures: usize,
    /// Seconds of computing.
    seconds: f64,
    why: String,
}

impl Row {
    /// What the next stage would have gained over what was delivered; nothing above the last.
    fn next_gains(&self) -> Option<f64> {
        // From stage 0 the next one that the box has is 2.
        self.ssim.get((self.taken + 1).max(2)).map(|next| next - self.delivered_ssim)
    }
}

/// All stages on the simulated rig of `rig`.
pub(crate) fn run(rig: &RigFile) -> Result<Made, Failure> {
    let (mut harness, calibration) = Harness::open(rig.clone())?;
    let mut one = calibration;
    one.functions = one.functions.mean();
    let one_function = Pipeline::new(rig, &one)?;
    let mut rows = Vec::new();
    for scene in varied(rig.photo.size(), SEED) {
        let row = climb(&mut harness, &one_function, &scene)?;
        log::info!("{}: stage {}, SSIM {:.4}", row.name, row.taken, row.delivered_ssim);
        rows.push(row);
    }
    Ok(Made::table("ladder".to_owned(), table(&rig.name, &rows)))
}

fn climb(harness: &mut Harness, one_function: &Pipeline, scene: &Varied) -> Result<Row, Failure> {
    let config = harness.config().clone();
    let curve = config.photo.curve;
    let photo = photo(harness, scene)?;
    let truth = if scene.through_lens { harness.truth(&scene.light) } else { scene.light.clone() };
    let truth = seen(curve, scene.channels, &truth);
    let score = |light: &Frame<Work>| ssim(&seen(curve, scene.channels, light), &truth);
    let mut scores = [score(&photo.light), 0.0, 0.0, 0.0];
    let stages =
        [(true, MethodName::Digital), (false, MethodName::Digital), (false, MethodName::Hybrid)];
    let (pipeline, rig) = harness.test_rig.parts();
    let prepared = photo.prepared(pipeline, scene.channels);
    for (found, (one, which)) in scores[1..].iter_mut().zip(stages) {
        let solver = method(&config, which);
        let pipeline = if one { one_function } else { pipeline };
        *found = score(&pipeline.solve(rig, &prepared, &*solver, &mut |_, _| {})?.picture);
    }
    let solver = method(&config, config.restore.method);
    let begun = seconds();
    let Restoration { outcome, solved } =
        pipeline.restore(rig, &prepared, &*solver, &mut |_, _| {})?;
    let waited = solved.map_or(0.0, |solved| solved.waited_seconds);
    Ok(Row {
        name: scene.name,
        delivered_ssim: score(&outcome.picture),
        ssim: scores,
        taken: match outcome.stage {
            ResultStage::Photo => 0,
            ResultStage::LensModel => 2,
            ResultStage::Captures => 3,
        },
        captures: outcome.captures,
        seconds: seconds() - begun - waited,
        why: outcome.reason,
    })
}

/// The photo of a scene through the lens, or of the scene itself with noise.
fn photo(harness: &Harness, scene: &Varied) -> Result<TestPhoto, Failure> {
    if scene.through_lens {
        return harness.photograph(&scene.light, SEED);
    }
    let tone = Tone::of_curve(harness.config().photo.curve, 8);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut noisy = |v: f32| {
        let noise: f32 = StandardNormal.sample(&mut random);
        (v + NOISE_LEVELS * noise).clamp(0.0, FULL_SCALE)
    };
    Ok(TestPhoto::developed(Frame::from_fn(|c| {
        let light = scene.light.plane(c);
        let plane: Plane = Plane::from_fn(light.size(), |x, y| noisy(light.at(x, y)));
        tone.plane(c, &tone.display(c, &plane).map(|v: f32| v.round() as u8))
    })))
}

fn table(rig: &str, rows: &[Row]) -> Table {
    let gains: Vec<f64> = rows.iter().filter_map(Row::next_gains).collect();
    let caption = format!(
        "{rig}: the stage that each scene takes, and what the others would have given (SSIM, \
         luminance of display values). The next stage would have gained {:+.4} on average \
         (0.002 allowed).",
        gains.iter().sum::<f64>() / gains.len().max(1) as f64
    );
    let head = [
        "scene",
        "photo",
        "one function",
        "lens model",
        "and captures",
        "stage taken",
        "delivered",
        "next would gain",
        "captures",
        "computing s",
        "why",
    ];
    let mut table = Table::new(caption, &head);
    for row in rows {
        let mut cells = vec![row.name.to_owned()];
        cells.extend(row.ssim.map(|v| format!("{v:.4}")));
        cells.push(row.taken.to_string());
        cells.push(format!("{:.4}", row.delivered_ssim));
        cells.push(row.next_gains().map_or("—".to_owned(), |gain| format!("{gain:+.4}")));
        cells.push(row.captures.to_string());
        cells.push(format!("{:.2}", row.seconds));
        cells.push(row.why.clone());
        table.row(cells);
    }
    table
}
