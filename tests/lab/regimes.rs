//! Gain of captures over the measured lens alone where the lens model is wrong. Photo and captures
//! go through the same lens.

use relens::chart::scenes::Scene;
use relens::chart::table::Table;
use relens::config::{Curve, RigFile};
use relens::deconvolution::method::Method;
use relens::deconvolution::method::digital::Digital;
use relens::pipeline::hybrid;

use crate::change::{
    Change, DECENTRED, NEARER, NOTHING, ONE_FUNCTION, SMEARED, VEIL_MEASURED, VEIL_MISSED,
};
use crate::conditions::one_capture;
use crate::harness::{Harness, calibrated};
use crate::made::Made;
use crate::{Failure, report};

/// A change and its strength.
pub(crate) type Regime = (&'static Change, f64);

const REGIMES: [Regime; 13] = [
    (&NOTHING, 0.0),
    (&VEIL_MISSED, 5.0),
    (&VEIL_MISSED, 10.0),
    (&VEIL_MISSED, 20.0),
    (&VEIL_MEASURED, 5.0),
    (&VEIL_MEASURED, 10.0),
    (&VEIL_MEASURED, 20.0),
    (&ONE_FUNCTION, 0.0),
    (&NEARER, 4.0),
    (&NEARER, 10.0),
    (&DECENTRED, 10.0),
    (&DECENTRED, 25.0),
    (&SMEARED, 15.0),
];

/// Gain from which captures are worth taking, dB.
const EARNS_DB: f64 = 1.0;

/// Means over scenes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Mean {
    pub(crate) captures: f64,
    pub(crate) ssim: f64,
    pub(crate) psnr_db: f64,
}

/// Means under one regime.
pub(crate) struct Row {
    pub(crate) name: String,
    /// Untouched photos.
    photo: Mean,
    /// Lens model alone.
    pub(crate) digital: Mean,
    /// The hybrid method with one capture.
    one: Mean,
    /// The hybrid method with captures as filed.
    pub(crate) hybrid: Mean,
}

impl Row {
    /// Gain of captures over the lens model alone, dB: the better of one capture and more.
    pub(crate) fn gain_db(&self) -> f64 {
        self.one.psnr_db.max(self.hybrid.psnr_db) - self.digital.psnr_db
    }
}

/// Measures all regimes on the simulated rig of `rig`.
pub(crate) fn run(rig: &RigFile) -> Result<Made, Failure> {
    let rows = REGIMES.iter().map(|&regime| measure(rig, regime));
    let rows: Vec<Row> = rows.collect::<Result<_, _>>()?;
    Ok(Made::table(format!("{}-regimes", rig.name), table(rig, &rows)))
}

/// Measures one regime on the study's photographs.
pub(crate) fn measure(rig: &RigFile, (change, strength): Regime) -> Result<Row, Failure> {
    let (rig, calibration) = &calibrated(rig, change, strength)?;
    let mut harness = Harness::changed(rig, calibration, change, strength)?;
    let mut photo = Mean::default();
    let mut mean = |solver: &dyn Method| -> Result<Mean, Failure> {
        let (mut mean, share) = (Mean::default(), 1.0 / Scene::STUDY_PHOTOGRAPHS.len() as f64);
        photo = Mean::default();
        for scene in Scene::STUDY_PHOTOGRAPHS {
            let score = harness.score(scene, solver)?;
            report(solver.name(), &score);
            mean.captures += share * score.captures as f64;
            mean.ssim += share * score.result.ssim;
            mean.psnr_db += share * score.result.psnr_db;
            photo.ssim += share * score.photo.ssim;
            photo.psnr_db += share * score.photo.psnr_db;
        }
        Ok(mean)
    };
    let name = change.words(strength);
    log::info!("{name}");
    let (digital, hybrid) = (mean(&Digital::default())?, hybrid(rig));
    let (one, hybrid) = (mean(&one_capture(rig))?, mean(&hybrid)?);
    Ok(Row { name, photo, digital, one, hybrid })
}

fn table(rig: &RigFile, rows: &[Row]) -> Table {
    let channels = match rig.photo.curve {
        Curve::Linear => "green channel",
        Curve::Srgb => "luma of photos in colour",
    };
    let caption = format!(
        "Gain of captures, rig {0}, {channels}, mean of astronaut and coffee: lens model alone, \
         with one capture, and with at most {1}.",
        rig.name,
        1 + rig.restore.corrections_max
    );
    let head =
        ["regime", "photo", "digital", "one capture", "hybrid", "captures", "gain dB", "worth it"];
    let mut table = Table::new(caption, &head);
    for row in rows {
        let both = |mean: &Mean| format!("{:.4}/{:.2}", mean.ssim, mean.psnr_db);
        let words = match row.gain_db() {
            EARNS_DB.. => "yes",
            0.0.. => "a little",
            _ => "no",
        };
        let means = [&row.photo, &row.digital, &row.one, &row.hybrid];
        let mut cells = vec![row.name.clone()];
        cells.extend(means.map(both));
        cells.push(format!("{:.1}", row.hybrid.captures));
        cells.push(format!("{:+.2}", row.gain_db()));
        cells.push(words.to_owned());
        table.row(cells);
    }
    table
}
