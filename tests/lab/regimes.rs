//! Where light earns its place: the default method against the measured lens alone, where that
//! measurement falls short.
//!
//! Photo and captures go through the same lens. The lens was measured as it is (glare, one
//! function), or before something happened to it (another distance, off centre, a greasy finger).
//! Grey scenes in the green channel, as the study did.

use std::collections::BTreeMap;

use super::scenes::Scene;
use super::study::one_capture;
use super::table::Table;
use super::test_rig::{Score, Stopwatch, TestRig, TestRigError};
use crate::config::{self, Glare, Kind, Lens, Simulation};
use crate::deconvolution::method::Method;
use crate::deconvolution::method::hybrid::Hybrid;
use crate::pipeline::{digital, hybrid};

/// What falls short.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Regime {
    /// Nothing.
    AsMeasured,
    /// A share of the light is scattered over a Gaussian of 60 px, wider than any function of the
    /// model, which has no broad term.
    Glare(f32),
    /// The same, and the model has a broad term.
    GlareMeasured(f32),
    /// The model has one function for the whole field.
    OneFunction,
    /// Panel and scene are at this share of the distance at which the lens was measured, and
    /// focused there.
    Distance(f64),
    /// The lens has slid sideways by this share of the photo's width since it was measured.
    Decentred(f64),
    /// The lens has been touched since it was measured: this share of the light is scattered over a
    /// Gaussian of 12 px.
    Dirty(f32),
}

/// Width of the veil, pixels; the study's.
const VEIL_PX: f32 = 60.0;
/// Width of what a greasy finger leaves, pixels. Guess: wider than the blur, narrower than a veil.
const SMEAR_PX: f32 = 12.0;
/// What light must gain to have earned its place, dB.
const EARNS_DB: f64 = 1.0;

impl Regime {
    /// All that are tried.
    pub const ALL: [Regime; 13] = [
        Regime::AsMeasured,
        Regime::Glare(0.05),
        Regime::Glare(0.10),
        Regime::Glare(0.20),
        Regime::GlareMeasured(0.05),
        Regime::GlareMeasured(0.10),
        Regime::GlareMeasured(0.20),
        Regime::OneFunction,
        Regime::Distance(0.25),
        Regime::Distance(0.1),
        Regime::Decentred(0.1),
        Regime::Decentred(0.25),
        Regime::Dirty(0.15),
    ];

    /// The words for tables.
    pub fn name(self) -> String {
        match self {
            Regime::AsMeasured => "as measured".to_owned(),
            Regime::Glare(share) => format!("{:.0} % of veiling glare", 100.0 * share),
            Regime::GlareMeasured(share) => {
                format!("{:.0} % of veiling glare, a broad term in the model", 100.0 * share)
            }
            Regime::OneFunction => "a model of one function".to_owned(),
            Regime::Distance(share) => format!("{:.0} times nearer since, refocused", 1.0 / share),
            Regime::Decentred(share) => {
                format!("off centre by {:.0} % of the width since", 100.0 * share)
            }
            Regime::Dirty(share) => format!("{:.0} % smeared by a finger since", 100.0 * share),
        }
    }

    /// The rig when it was measured and the rig now.
    fn rigs(self, rig: &config::Rig) -> (config::Rig, config::Rig) {
        let changed = |change: &dyn Fn(&mut Simulation)| {
            let mut rig = rig.clone();
            if let Kind::Simulated(simulation) = &mut rig.kind {
                change(simulation);
            }
            rig
        };
        let veiled = |share, radius_px| {
            changed(&|simulation| {
                let (Lens::Prescription(_, glare) | Lens::Measured(_, glare)) =
                    &mut simulation.lens;
                *glare = Glare { share, radius_px };
            })
        };
        match self {
            Regime::AsMeasured => (rig.clone(), rig.clone()),
            Regime::Glare(share) | Regime::GlareMeasured(share) => {
                let mut veiled = veiled(share, VEIL_PX);
                veiled.calibration.broad_term = matches!(self, Regime::GlareMeasured(_));
                (veiled.clone(), veiled)
            }
            Regime::OneFunction => {
                let mut one = rig.clone();
                (one.calibration.function_columns, one.calibration.function_rows) = (1, 1);
                (one.clone(), one)
            }
            Regime::Distance(share) => {
                let nearer = changed(&|simulation| {
                    if let Lens::Prescription(lens, _) = &mut simulation.lens {
                        lens.object_distance_mm *= share;
                    }
                });
                (rig.clone(), nearer)
            }
            Regime::Decentred(share) => {
                let aside = share * rig.photo.width_px as f64;
                let slid = changed(&|simulation| {
                    if let Lens::Prescription(lens, _) = &mut simulation.lens {
                        lens.axis_offset_px = [aside, 0.0];
                    }
                });
                (rig.clone(), slid)
            }
            Regime::Dirty(share) => (rig.clone(), veiled(share, SMEAR_PX)),
        }
    }
}

/// A method's means over the scenes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// Captures a photo.
    pub captures: f64,
    /// SSIM.
    pub ssim: f64,
    /// PSNR, dB.
    pub psnr_db: f64,
}

/// One regime.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Which.
    pub regime: Regime,
    /// The untouched photos.
    pub photo: Mean,
    /// The measured lens alone; as many captures as the rig file allows, the lens staying as
    /// measured; one capture; as the rig file has it.
    pub methods: [Mean; 4],
}

impl Row {
    /// What light gains over the measured lens alone, dB: the better of one capture and more.
    pub fn gain_db(&self) -> f64 {
        let [digital, _, one, hybrid] = &self.methods;
        one.psnr_db.max(hybrid.psnr_db) - digital.psnr_db
    }
}

/// `regimes` on the simulated rig of `rig`, on `scenes`; `each` is told of every score.
///
/// # Errors
/// When a rig cannot be opened or calibrated, or a method fails.
pub fn measure(
    rig: &config::Rig,
    regimes: &[Regime],
    scenes: &[Scene],
    stopwatch: Stopwatch,
    each: &mut dyn FnMut(Regime, &Score),
) -> Result<Vec<Row>, TestRigError> {
    let mut rows = Vec::new();
    for &regime in regimes {
        let (then, now) = regime.rigs(rig);
        let mut test_rig = TestRig::open_changed(&then, now, stopwatch)?;
        let as_measured = Hybrid { refine: false, ..hybrid(rig) };
        let solvers: [Box<dyn Method>; 4] = [
            Box::new(digital(rig)),
            Box::new(as_measured),
            Box::new(one_capture(rig)),
            Box::new(hybrid(rig)),
        ];
        let mut photos = BTreeMap::new();
        let mut methods = [Mean { captures: 0.0, ssim: 0.0, psnr_db: 0.0 }; 4];
        let share = 1.0 / scenes.len() as f64;
        for (solver, mean) in solvers.iter().zip(&mut methods) {
            for &scene in scenes {
                let score = test_rig.score_grey(scene, solver.name(), &**solver)?;
                each(regime, &score);
                mean.captures += share * score.restored.captures as f64;
                mean.ssim += share * score.ssim;
                mean.psnr_db += share * score.psnr_db;
                photos.insert(scene.name(), (score.blurred_ssim, score.blurred_psnr_db));
            }
        }
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| share * photos.values().map(of).sum::<f64>();
        let photo = Mean { captures: 0.0, ssim: mean(&|p| p.0), psnr_db: mean(&|p| p.1) };
        rows.push(Row { regime, photo, methods });
    }
    Ok(rows)
}

/// The rows as a table.
pub fn table(rig: &config::Rig, rows: &[Row]) -> Table {
    let caption = format!(
        "Where light earns its place, rig {0}, green channel, mean of astronaut and coffee: the \
         measured lens alone, and \
         captures with it: the lens as measured, at most {1} captures; the lens refined by the \
         photo's first capture where that calls for \
         it, one capture and at most {1}.",
        rig.name,
        1 + rig.restore.corrections_max
    );
    let head = [
        "regime",
        "photo",
        "digital",
        "hybrid, lens as measured",
        "one capture",
        "hybrid",
        "captures",
        "light gains dB",
        "light helps",
    ];
    let mut table = Table::new(caption, &head);
    for row in rows {
        let both = |mean: &Mean| format!("{:.4}/{:.2}", mean.ssim, mean.psnr_db);
        let words = match row.gain_db() {
            gain if gain >= EARNS_DB => "yes",
            gain if gain > 0.0 => "a little",
            _ => "no",
        };
        let [digital, as_measured, one, hybrid] = &row.methods;
        table.row(vec![
            row.regime.name(),
            both(&row.photo),
            both(digital),
            both(as_measured),
            both(one),
            both(hybrid),
            format!("{:.1}", hybrid.captures),
            format!("{:+.2}", row.gain_db()),
            words.to_owned(),
        ]);
    }
    table
}
