//! What changes from one capture to the next: where the panel stands, to fractions of a pixel, and
//! how bright it is.

use rand_distr::{Distribution, StandardNormal};

use super::sensor::{Stream, random};
use crate::config::Unrest;

/// Share of its wander that a panel comes back a capture: what swings with the room's warmth
/// returns. Guess.
const PULL: f64 = 0.05;

/// Two normal numbers of exposure `number`, of stream part `part`.
fn normals(seed: u64, number: u64, part: u64) -> [f64; 2] {
    let mut random = random(seed, Stream::Unrest, number, part);
    std::array::from_fn(|_| StandardNormal.sample(&mut random))
}

/// Where the panel stands in exposure `number`, having wandered to `before_px`.
pub(super) fn wander(unrest: &Unrest, before_px: [f64; 2], seed: u64, number: u64) -> [f64; 2] {
    if unrest.wander_px == 0.0 {
        return before_px;
    }
    let step = normals(seed, number, 0);
    [0, 1].map(|n| before_px[n] * (1.0 - PULL) + unrest.wander_px * step[n])
}

/// How far from its place the panel is seen in exposure `number`, at `now_s` of the rig's clock.
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

/// Whether the panel's light changes from capture to capture.
pub(super) fn is_unsteady(unrest: &Unrest) -> bool {
    unrest.flicker_share != 0.0 || unrest.drift_share_per_h != 0.0
}

/// The panel's light in exposure `number`, relative to what it was at first.
pub(super) fn light_share(unrest: &Unrest, now_s: f64, seed: u64, number: u64) -> f32 {
    if !is_unsteady(unrest) {
        return 1.0;
    }
    let flicker = unrest.flicker_share * normals(seed, number, 2)[0];
    (1.0 + flicker + unrest.drift_share_per_h * now_s / 3600.0) as f32
}
