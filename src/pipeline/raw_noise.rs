//! Plausibility of the noise that a raw file states, by comparison with the sensor's own.

use std::ops::RangeInclusive;

use crate::calibration::Noise;
use crate::deconvolution::focus::NOISE_MAX;
use crate::frame::{FULL_SCALE, RawSites};

/// Minimum noise power with which a raw photo is restored, as a share of one exposure's: averaging
/// exposures does not reduce the lens model's error. Measured with 4 and 16 exposures of two scenes
/// on two rigs: with 0.75 SSIM and PSNR rise; with 0.5 one of them loses PSNR.
pub const AVERAGED_MIN: f32 = 0.75;

/// Noise power that a file may plausibly state, as a share of one exposure's. A lower one would be
/// the mean of more exposures than anybody takes.
const PLAUSIBLE_POWER: RangeInclusive<f32> = 1.0 / (NOISE_MAX * NOISE_MAX)..=NOISE_MAX * NOISE_MAX;

/// Stated noise power, as a share of one exposure's, below which the report notes that not all
/// averaging is used: two exposures or more. A single one's stated and measured power differ by
/// less.
const NOTED_BELOW: f32 = 0.6;

/// `raw`, without the noise that its file states if that is implausible for a sensor with the noise
/// `own` in one exposure, and a note for the report. Stated noise is preferred because it allows
/// for averaged exposures and the gain.
pub(super) fn plausible_noise(raw: RawSites, own: &[Noise; 3]) -> (RawSites, Option<String>) {
    let Some(stated) = raw.noise else { return (raw, None) };
    let share = |n: usize| power_share(stated[n], &own[n]);
    if (0..3).all(|n| PLAUSIBLE_POWER.contains(&share(n))) {
        let note = format!(
            "the file states {:.2} of one exposure's noise; {:.2} is used, because averaging does \
             not reduce the lens model's error",
            share(1).sqrt(),
            AVERAGED_MIN.sqrt()
        );
        return (raw, (share(1) < NOTED_BELOW).then_some(note));
    }
    let note = format!(
        "the file states {:.2} times the noise of this rig's sensor, which is not plausible: the \
         photo is restored by the sensor's",
        share(1).sqrt()
    );
    (RawSites { noise: None, ..raw }, Some(note))
}

/// The `stated` noise power (without light, per level) as a share of `own`, at mid grey.
fn power_share([at_black, per_level]: [f32; 2], own: &Noise) -> f32 {
    let middle = FULL_SCALE / 2.0;
    (Noise { at_black, per_level }.sigma(middle) / own.sigma(middle)).powi(2)
}
