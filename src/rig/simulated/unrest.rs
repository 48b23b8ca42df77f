//! Changes from capture to capture: displacement and brightness of the panel.

use rand_distr::{Distribution, StandardNormal};

use super::sensor::{Stream, random};
use crate::config::Unrest;

/// Share of its wander by which the panel returns per capture. Guess: thermal motion is periodic.
const PULL: f64 = 0.05;

/// Two standard normal numbers for exposure `number`, from part `part` of the stream.
fn normals(seed: u64, number: u64, part: u64) -> [f64; 2] {
    let mut random = random(seed, Stream::Unrest, number, part);
    std::array::from_fn(|_| StandardNormal.sample(&mut random))
}

/// Wander of the panel in exposure `number`, given `before_px` of the previous one.
pub(super) fn wander(unrest: &Unrest, before_px: [f64; 2], seed: u64, number: u64) -> [f64; 2] {
    if unrest.wander_px == 0.0 {
        return before_px;
    }
    let step = normals(seed, number, 0);
    [0, 1].map(|n| before_px[n] * (1.0 - PULL) + unrest.wander_px * step[n])
}

/// Displacement of the panel in exposure `number`, at time `now_s` of the rig's clock.
pub(super) fn moved(
    unrest: &Unrest,
    wandered_px: [f64; 2],
    now_s: f64,
    seed: u64,
    number: u64,
) -> [f64; 2] {
    let shaken = if unrest.vibration_px == 0.0 { [0.0; 2] } else { normals(seed, number, 1) };
    let hours = now_s / 3600.0;
    [0, 1].map(|n| {
        wandered_px[n] + unrest.vibration_px * shaken[n] + unrest.drift_px_per_h[n] * hours
    })
}

/// Whether the panel's light varies.
pub(super) fn is_unsteady(unrest: &Unrest) -> bool {
    unrest.flicker_share != 0.0 || unrest.drift_share_per_h != 0.0
}

/// Light of the panel in exposure `number`, relative to its initial value.
pub(super) fn light_share(unrest: &Unrest, now_s: f64, seed: u64, number: u64) -> f32 {
    if !is_unsteady(unrest) {
        return 1.0;
    }
    let flicker = unrest.flicker_share * normals(seed, number, 2)[0];
    (1.0 + flicker + unrest.drift_share_per_h * now_s / 3600.0) as f32
}
