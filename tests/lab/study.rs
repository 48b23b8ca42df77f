//! The methods side by side, under the study's conditions or on any simulated rig, with known
//! truth.
//!
//! One grey channel (green) of the study's rig; see `rig-config/study.toml`. Each [`Condition`] is
//! a rig file with one thing changed; the rig is calibrated from its own captures under that
//! condition. Truth enters the score and nothing else.

use super::scenes::Scene;
use super::table::Table;
use super::test_rig::{Score, Stopwatch, TestRig, TestRigError};
use crate::config::{self, Glare, Kind, Lens};
use crate::deconvolution::method::Method;
use crate::deconvolution::method::hybrid::Hybrid;
use crate::deconvolution::method::paper::{Backward, Paper};
use crate::deconvolution::patches::PatchShape;
use crate::pipeline::{hybrid, method, paper};

/// What is changed against the rig file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// As the file says; the study's has one grey level of noise.
    AsFiled,
    /// Photo and captures without noise; 8 bits stay.
    NoNoise,
    /// A share of the light scattered over a Gaussian of 60 px.
    Glare(f32),
    /// A lens model of one function for the whole field.
    OneFunction,
}

/// A method and the name of its row.
pub type Contestant = (String, Box<dyn Method>);

impl Condition {
    /// The study's conditions.
    pub const STUDY: [Condition; 4] =
        [Condition::NoNoise, Condition::AsFiled, Condition::Glare(0.1), Condition::OneFunction];

    /// The words for tables.
    pub fn name(self) -> String {
        match self {
            Condition::AsFiled => "as filed".to_owned(),
            Condition::NoNoise => "without noise".to_owned(),
            Condition::Glare(share) => format!("with {:.0} % of veiling glare", 100.0 * share),
            Condition::OneFunction => "with a lens model of one function".to_owned(),
        }
    }

    /// `rig` under this condition.
    #[must_use]
    pub fn apply(self, mut rig: config::Rig) -> config::Rig {
        if self == Condition::OneFunction {
            (rig.calibration.function_columns, rig.calibration.function_rows) = (1, 1);
        }
        if let Kind::Simulated(simulation) = &mut rig.kind {
            match self {
                Condition::NoNoise => {
                    simulation.sensor.read_noise_levels = 0.0;
                    simulation.sensor.full_well_electrons = f64::INFINITY;
                }
                Condition::Glare(share) => {
                    let (Lens::Prescription(_, glare) | Lens::Measured(_, glare)) =
                        &mut simulation.lens;
                    *glare = Glare { share, radius_px: 60.0 };
                }
                Condition::AsFiled | Condition::OneFunction => {}
            }
        }
        rig
    }

    /// The methods worth comparing under this condition.
    pub fn contestants(self, rig: &config::Rig) -> Vec<Contestant> {
        use config::Method::{
            BlockMatching, Digital, Hybrid, Paper, Residual, RichardsonLucy, Unmatched, Wiener,
        };
        let named = |which| {
            let solver = method(rig, which);
            (solver.name().to_owned(), solver as Box<dyn Method>)
        };
        let mut rows: Vec<Contestant> = match self {
            Condition::NoNoise | Condition::AsFiled => {
                [Paper, Residual, Unmatched, Digital, Hybrid, BlockMatching, Wiener, RichardsonLucy]
                    .map(named)
                    .into()
            }
            Condition::Glare(_) | Condition::OneFunction => {
                [Digital, Hybrid, BlockMatching].map(named).into()
            }
        };
        match self {
            Condition::NoNoise => {
                rows.push(("paper, one whole-frame patch".to_owned(), Box::new(whole_frame(rig))));
            }
            Condition::AsFiled => {
                rows.push(("paper, margin 0".to_owned(), Box::new(without_margin(rig))))
            }
            Condition::Glare(_) | Condition::OneFunction => {}
        }
        if self != Condition::NoNoise {
            rows.push(("hybrid, 1 capture".to_owned(), Box::new(one_capture(rig))));
        }
        rows
    }
}

/// The paper's loop with one patch for the whole frame, where flip–FC–flip is no adjoint any more;
/// nothing holds it back.
pub fn whole_frame(rig: &config::Rig) -> Paper {
    let patch_px = rig.photo.width_px.max(rig.photo.height_px);
    let shape = PatchShape { patch_px, margin_px: rig.paper.margin_px };
    Paper { backward: Backward::Light(shape), bounded: false, ..paper(rig) }
}

/// The paper's loop with nothing sewn around the patches.
fn without_margin(rig: &config::Rig) -> Paper {
    Paper {
        backward: Backward::Light(PatchShape { patch_px: rig.paper.patch_px, margin_px: 0 }),
        ..paper(rig)
    }
}

/// `hybrid` with a single capture, whose correction is not confirmed.
pub fn one_capture(rig: &config::Rig) -> Hybrid {
    Hybrid { captures_max: 1, ..hybrid(rig) }
}

/// The simulated rig of `rig` under `condition`, calibrated.
///
/// # Errors
/// When the rig cannot be opened or calibrated.
pub fn open(
    rig: config::Rig,
    condition: Condition,
    stopwatch: Stopwatch,
) -> Result<TestRig, TestRigError> {
    TestRig::open(condition.apply(rig), stopwatch)
}

/// All contestants of `condition` on `scenes` in green; `each` is called with every score as it
/// comes.
///
/// # Errors
/// When the rig cannot be opened or calibrated, or a method fails.
pub fn compare(
    rig: config::Rig,
    condition: Condition,
    stopwatch: Stopwatch,
    scenes: &[Scene],
    each: &mut dyn FnMut(&Score),
) -> Result<Vec<Score>, TestRigError> {
    let mut test_rig = open(rig, condition, stopwatch)?;
    let contestants = condition.contestants(test_rig.config());
    let mut scores = Vec::new();
    for &scene in scenes {
        for (name, solver) in &contestants {
            let score = test_rig.score_grey(scene, name, &**solver)?;
            each(&score);
            scores.push(score);
        }
    }
    Ok(scores)
}

