//! Methods made from the keys of a rig file.
//!
//! A new method is a file of [`crate::deconvolution::method`], a row of [`MethodName`] and an arm
//! of [`MethodName::with`]; help, messages, `rig-config/README.md`, charts and the judge follow.

use super::method_name::MethodName;
use super::parts::{ColourChoice, PaperTable, Restore};
use crate::deconvolution::method::blocks::Blocks;
use crate::deconvolution::method::digital::{self, Digital};
use crate::deconvolution::method::hybrid::{self, Hybrid};
use crate::deconvolution::method::paper::{Backward, Paper};
use crate::deconvolution::method::richardson_lucy::{self, RichardsonLucy};
use crate::deconvolution::method::total_variation::{self, TotalVariation};
use crate::deconvolution::method::wiener::{self, Wiener};
use crate::deconvolution::method::{Method, Strength};
use crate::deconvolution::patches::PatchShape;

/// Parameters of a method: the keys of a rig file, and numbers that may replace them.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<'a> {
    /// `[restore]`.
    pub restore: &'a Restore,
    /// `[paper]`.
    pub paper: &'a PaperTable,
    /// Steps of the solve with the lens model.
    pub steps: u32,
    /// Steps of each correction.
    pub correction_steps: u32,
    /// Limit of captures per photo.
    pub captures_max: u32,
    /// Rounds of block matching per solve.
    pub rounds: u32,
}

/// A method with its parameters.
pub type Solving = Box<dyn Method + Send + Sync>;

impl MethodName {
    /// The method with the parameters `numbers`.
    pub fn with(self, numbers: &Numbers<'_>) -> Solving {
        match self {
            MethodName::Paper => Box::new(paper(numbers)),
            MethodName::Digital => Box::new(digital(numbers)),
            MethodName::Hybrid => Box::new(hybrid(numbers)),
            MethodName::BlockMatching => {
                let blocks = Some(Blocks { rounds: numbers.rounds, model_error: [0.0; 3] });
                let digital = Digital { blocks, ..digital(numbers) };
                match numbers.captures_max {
                    0 => Box::new(digital),
                    _ => Box::new(Hybrid { digital, ..hybrid(numbers) }),
                }
            }
            MethodName::Wiener => Box::new(Wiener { noise_to_signal: wiener::NOISE_TO_SIGNAL }),
            MethodName::RichardsonLucy => {
                Box::new(RichardsonLucy { steps: richardson_lucy::STEPS })
            }
        }
    }
}

/// The method `paper`.
pub fn paper(numbers: &Numbers<'_>) -> Paper {
    let Numbers { restore, paper, .. } = *numbers;
    Paper {
        iterations: paper.iterations as u32,
        tau: paper.tau,
        lambda: paper.lambda,
        backward: Backward::Light(patches(paper)),
        levels: restore.levels,
        bounded: true,
    }
}

/// The method `digital`.
pub fn digital(numbers: &Numbers<'_>) -> Digital {
    let restore = numbers.restore;
    Digital {
        steps: numbers.steps,
        strength: strength(numbers, 1.0),
        levels: restore.levels,
        cycle_spun: restore.cycle_spun,
        colours: match restore.colours {
            ColourChoice::AlongAxes => digital::Colours::AlongAxes,
            ColourChoice::Together => digital::Colours::Together,
            ColourChoice::Apart => digital::Colours::Apart,
        },
        blocks: None,
    }
}

/// The method `hybrid`.
pub fn hybrid(numbers: &Numbers<'_>) -> Hybrid {
    Hybrid {
        digital: digital(numbers),
        correction_steps: numbers.correction_steps,
        captures_max: numbers.captures_max,
        defect_threshold: hybrid::DEFECT_THRESHOLD,
        defect_floor: hybrid::DEFECT_FLOOR,
        carefulness: hybrid::CAREFULNESS,
    }
}

/// Total variation with the measured lens: the reference solution that results are judged by, since
/// it keeps flat areas flat.
pub fn total_variation(numbers: &Numbers<'_>) -> TotalVariation {
    let strength = strength(numbers, total_variation::STRENGTH_FACTOR);
    TotalVariation { steps: total_variation::STEPS, strength }
}

/// The shrinkage of `[restore]`, scaled by `factor`.
fn strength(numbers: &Numbers<'_>, factor: f32) -> Strength {
    Strength { at_one_grey_level: factor * numbers.restore.shrinkage_at_one_grey_level }
}

/// Patches of backward convolution.
fn patches(paper: &PaperTable) -> PatchShape {
    PatchShape { patch_px: paper.patch_px, margin_px: paper.margin_px }
}
