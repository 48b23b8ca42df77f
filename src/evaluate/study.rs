//! "What must be seen": the methods side by side under the study's conditions, with known truth.
//!
//! One grey channel (green) of the study's rig; see `rig-config/study.toml`. Each [`Condition`] is a rig file
//! with one thing changed; the rig is calibrated from its own captures under that condition. Truth enters
//! the score and nothing else.

use super::scenes::Scene;
use super::stand::{Score, Stand, StandError};
use super::table::Table;
use crate::config::{self, Glare, Kind, Lens};
use crate::restore::method::Method;

/// What is changed against `study.toml`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// One grey level of noise, as the file says.
    AsFiled,
    /// Photo and captures without noise; 8 bits stay.
    NoNoise,
    /// A share of the light scattered over a Gaussian of 60 px.
    Glare(f32),
    /// A lens model of one function for the whole field.
    OneFunction,
}

impl Condition {
    /// The words for tables.
    pub fn name(self) -> String {
        match self {
            Condition::AsFiled => "σ = 1".to_owned(),
            Condition::NoNoise => "no noise".to_owned(),
            Condition::Glare(share) => format!("σ = 1, glare {:.0} %", 100.0 * share),
            Condition::OneFunction => "σ = 1, one function".to_owned(),
        }
    }

    /// `rig` under this condition.
    pub fn apply(self, mut rig: config::Rig) -> config::Rig {
        if self == Condition::OneFunction {
            (rig.calibration.function_columns, rig.calibration.function_rows) = (1, 1);
        }
        if let Kind::Simulated(simulation) = &mut rig.kind {
            match self {
                Condition::NoNoise => simulation.sensor.read_noise_levels = 0.0,
                Condition::Glare(share) => {
                    let (Lens::Prescription(_, glare) | Lens::Measured(_, glare)) = &mut simulation.lens;
                    *glare = Glare { share, radius_px: 60.0 };
                }
                Condition::AsFiled | Condition::OneFunction => {}
            }
        }
        rig
    }
}

/// The study's rig under one condition, calibrated.
pub struct Study {
    /// The condition.
    pub condition: Condition,
    stand: Stand,
}

impl Study {
    /// Opens and calibrates.
    ///
    /// # Errors
    /// When the rig cannot be opened or calibrated.
    pub fn open(rig: config::Rig, condition: Condition) -> Result<Study, StandError> {
        Ok(Study { condition, stand: Stand::open(condition.apply(rig))? })
    }

    /// The rig, calibrated under the condition.
    pub fn stand(&mut self) -> &mut Stand {
        &mut self.stand
    }

    /// `method` on the grey `scene`, scored.
    ///
    /// # Errors
    /// When the method fails.
    pub fn score(&mut self, scene: Scene, name: &str, method: &dyn Method) -> Result<Score, StandError> {
        self.stand.score_grey(scene, name, method)
    }
}

/// The scores as a table.
pub fn table(condition: Condition, scores: &[Score]) -> Table {
    let mut table = Table::new(
        format!("Condition: {}. SSIM and PSNR of the green channel against the scene.", condition.name()),
        &[
            "scene",
            "method",
            "captures",
            "SSIM",
            "PSNR dB",
            "gain SSIM",
            "gain dB",
            "certificate",
            "computing s",
        ],
    );
    for s in scores {
        let certificate =
            s.restored.solution.certificate.ratio().map_or("–".to_owned(), |r| format!("{r:.2}"));
        let harm = if s.ssim < s.blurred_ssim { " (below the blurred photo)" } else { "" };
        table.row(vec![
            s.scene.name().to_owned(),
            s.method.clone(),
            s.restored.captures.to_string(),
            format!("{:.4}", s.ssim),
            format!("{:.2}", s.psnr_db),
            format!("{:+.4}{harm}", s.ssim - s.blurred_ssim),
            format!("{:+.2}", s.psnr_db - s.blurred_psnr_db),
            certificate,
            format!("{:.2}", s.computing_seconds),
        ]);
    }
    table
}
