//! "What must be seen": the methods side by side under the study's conditions, with known truth.
//!
//! One grey channel (green) of the study's rig; see `rig-config/study.toml`. Each [`Condition`] is a rig file
//! with one thing changed; the rig is calibrated from its own captures under that condition. Truth enters
//! the score and nothing else.

use super::scenes::Scene;
use super::stand::{Stand, StandError};
use super::table::Table;
use crate::config::{self, Kind};
use crate::restore::method::{Method, Solution};

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
                    simulation.lens.glare_share = share.into();
                    simulation.lens.glare_radius_px = 60.0;
                }
                Condition::AsFiled | Condition::OneFunction => {}
            }
        }
        rig
    }
}

/// One method on one scene.
#[derive(Debug, Clone)]
pub struct Score {
    /// The scene.
    pub scene: Scene,
    /// The method, with what sets it apart from the rig file's settings.
    pub method: String,
    /// Captures of this photo.
    pub captures: usize,
    /// Seconds on the rig's clock for those captures.
    pub capture_seconds: f64,
    /// Seconds of computing, captures not counted.
    pub computing_seconds: f64,
    /// SSIM against the scene.
    pub ssim: f64,
    /// PSNR against the scene, dB.
    pub psnr_db: f64,
    /// SSIM of the untouched photo.
    pub blurred_ssim: f64,
    /// PSNR of the untouched photo, dB.
    pub blurred_psnr_db: f64,
    /// What the method returned.
    pub solution: Solution,
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

    /// The rig file as changed.
    pub fn rig(&self) -> &config::Rig {
        self.stand.rig()
    }

    /// `method` on the grey `scene`, scored.
    ///
    /// # Errors
    /// When the method fails.
    pub fn score(&mut self, scene: Scene, name: &str, method: &dyn Method) -> Result<Score, StandError> {
        let truth = scene.grey(self.stand.rig().photo.size());
        self.stand.score_green(scene, &truth, name, method)
    }
}

/// The scores as a table.
pub fn table(condition: Condition, scores: &[Score]) -> Table {
    let mut table = Table::new(
        format!("Condition: {}. SSIM and PSNR of the green channel against the scene.", condition.name()),
        &["scene", "method", "captures", "SSIM", "PSNR dB", "gain SSIM", "gain dB", "certificate", "computing s"],
    );
    for s in scores {
        let certificate = s.solution.certificate.ratio().map_or("–".to_owned(), |r| format!("{r:.2}"));
        let harm = if s.ssim < s.blurred_ssim { " (below the blurred photo)" } else { "" };
        table.row(vec![
            s.scene.name().to_owned(),
            s.method.clone(),
            s.captures.to_string(),
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
