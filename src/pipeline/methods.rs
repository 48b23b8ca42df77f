//! The methods as a rig file sets them.

use crate::config::{self, Rig};
use crate::deconvolution::method::Method;
use crate::deconvolution::method::Strength;
use crate::deconvolution::method::blocks::Blocks;
use crate::deconvolution::method::digital::{Colours, Digital};
use crate::deconvolution::method::hybrid::Hybrid;
use crate::deconvolution::method::paper::{Backward, Paper};
use crate::deconvolution::method::residual::Residual;
use crate::deconvolution::method::richardson_lucy::RichardsonLucy;
use crate::deconvolution::method::total_variation::TotalVariation;
use crate::deconvolution::method::unmatched::Unmatched;
use crate::deconvolution::method::wiener::Wiener;
use crate::deconvolution::patches::PatchShape;

/// Iterations of `residual`: 25 captures, where the study compares it.
const RESIDUAL_ITERATIONS: u32 = 5;
/// Iterations of `unmatched`: 11 captures, where the study compares it.
const UNMATCHED_ITERATIONS: u32 = 11;
/// The optics-only method steps with a noisy backward convolution and shrinks more: the study's
/// best threshold at one grey level is 0.3, against 0.1 for the lens model.
const RESIDUAL_STRENGTH_FACTOR: f32 = 3.0;
/// Steps of Richardson–Lucy: where the study's quality peaks at one grey level of noise.
const RICHARDSON_LUCY_STEPS: u32 = 20;
/// Noise-to-signal power of the Wiener filter at one grey level: the study's best.
const WIENER_NOISE_TO_SIGNAL: f32 = 0.01;
/// Proximal steps of each correction. Measured 2026-11-21 on study.toml, mean SSIM/PSNR of the
/// photographs for 6, 8, 10 and 12 steps: 0.939/32.9, 0.940/33.0, 0.940/33.1, 0.937/33.1 (with an
/// earlier spinning).
pub(super) const CORRECTION_STEPS: u32 = 10;
/// Shrinkage of the measured defect, in standard deviations of its noise. Measured 2026-11-21 on
/// the study's photographs, mean SSIM with 0, 1 and 2 deviations: 0.9259, 0.9297, 0.9301.
const DEFECT_THRESHOLD: f32 = 2.0;
/// Defect below this share of the noise floor counts as none. Guess, from two trials: with 0.2 the
/// true lens is left alone (`tests/method.rs`), with 0.1 three corrections gained no more than one.
const DEFECT_FLOOR: f32 = 0.25;

/// Rounds of block matching in each correction; without a capture, of the only solve. Measured
/// 2026-11-22 on study.toml, two captures, mean SSIM/PSNR of the photographs for 1, 4, 8 and 12:
/// 0.947/33.5, 0.951/34.0, 0.953/34.2, 0.953/34.3.
pub(super) const BLOCK_ROUNDS: u32 = 8;

/// Steps of total variation, and its strength against the wavelets': the best of the chart of speed
/// against accuracy.
const VARIATION_STEPS: u32 = 40;
const VARIATION_STRENGTH_FACTOR: f32 = 3.0;

/// How much shorter a wrong model makes the steps of a correction. Measured 2026-11-21 on
/// study.toml with one function, mean PSNR for 0, 10 and 40: 25.0, 25.9, 27.0 dB; on simulated.toml
/// 31.9, 31.9, 31.9 dB.
const CAREFULNESS: f32 = 25.0;

/// The method `which` with the parameters of `rig`.
pub fn method(rig: &Rig, which: config::Method) -> Box<dyn Method + Send + Sync> {
    let (levels, cycle_spun) = (rig.restore.levels, rig.restore.cycle_spun);
    let strength = strength(rig);
    match which {
        config::Method::Paper => Box::new(paper(rig)),
        config::Method::Residual => Box::new(Residual {
            iterations: RESIDUAL_ITERATIONS,
            strength: Strength {
                at_one_grey_level: RESIDUAL_STRENGTH_FACTOR * strength.at_one_grey_level,
            },
            patches: patches(rig),
            levels,
            cycle_spun,
        }),
        config::Method::Unmatched => {
            Box::new(Unmatched { iterations: UNMATCHED_ITERATIONS, strength, levels, cycle_spun })
        }
        config::Method::Hybrid => Box::new(hybrid(rig)),
        config::Method::BlockMatching => Box::new(block_matching(rig)),
        config::Method::Digital => Box::new(digital(rig)),
        config::Method::Wiener => Box::new(Wiener { noise_to_signal: WIENER_NOISE_TO_SIGNAL }),
        config::Method::RichardsonLucy => Box::new(RichardsonLucy { steps: RICHARDSON_LUCY_STEPS }),
    }
}

/// The paper's loop with the parameters of `rig`.
pub fn paper(rig: &Rig) -> Paper {
    Paper {
        iterations: rig.paper.iterations as u32,
        tau: rig.paper.tau,
        lambda: rig.paper.lambda,
        backward: Backward::Light(patches(rig)),
        levels: rig.restore.levels,
        bounded: true,
    }
}

/// `digital` with the parameters of `rig`.
pub fn digital(rig: &Rig) -> Digital {
    let restore = &rig.restore;
    Digital {
        steps: restore.steps as u32,
        strength: strength(rig),
        levels: restore.levels,
        cycle_spun: restore.cycle_spun,
        colours: match restore.colours {
            config::Colours::Together => Colours::Together,
            config::Colours::Apart => Colours::Apart,
        },
        blocks: None,
    }
}

/// What a result is judged by: total variation with the measured lens, which leaves flat what is
/// flat.
pub fn reference_solution(rig: &Rig) -> TotalVariation {
    let at_one_grey_level = VARIATION_STRENGTH_FACTOR * strength(rig).at_one_grey_level;
    TotalVariation { steps: VARIATION_STEPS, strength: Strength { at_one_grey_level } }
}

/// `hybrid` with the parameters of `rig`.
pub fn hybrid(rig: &Rig) -> Hybrid {
    let digital = digital(rig);
    Hybrid {
        digital,
        correction_steps: CORRECTION_STEPS,
        captures_max: 1 + rig.restore.corrections_max as u32,
        defect_threshold: DEFECT_THRESHOLD,
        defect_floor: DEFECT_FLOOR,
        carefulness: CAREFULNESS,
        refine: rig.restore.refine_lens,
    }
}

/// `hybrid` with block matching for the prior of its corrections, with the parameters of `rig`.
pub fn block_matching(rig: &Rig) -> Hybrid {
    let hybrid = hybrid(rig);
    Hybrid {
        digital: Digital {
            blocks: Some(Blocks { rounds: BLOCK_ROUNDS, missed: [0.0; 3] }),
            ..hybrid.digital
        },
        ..hybrid
    }
}

fn strength(rig: &Rig) -> Strength {
    Strength { at_one_grey_level: rig.restore.shrinkage_at_one_grey_level }
}

/// The patches of backward convolution on `rig`.
pub(super) fn patches(rig: &Rig) -> PatchShape {
    PatchShape { patch_px: rig.paper.patch_px, margin_px: rig.paper.margin_px }
}
