//! Effects of real rigs, one at a time and in growing strengths. All but focus and unrest are
//! present at calibration. The values of `truthful.toml`, with their sources, are among the
//! strengths.
//!
//! Slow drift is left out: at a restoration it is a knock and a change of gain, both of them swept.

use relens::config::{RigFile, SensorCurve, Uneven, Unrest};
use relens::frame::Mosaic;

use crate::change::{Swept, To, lens, simulation, swept};

/// The effects; the first strength of each is an ideal rig's.
pub(crate) static TRUTHS: [Swept; 11] = [
    swept("filters; photo raw", "times the noise", NOISY, To::File(filters)),
    swept(
        "filters; photo developed",
        "times the noise",
        NOISY,
        To::FileAndPhoto(filters, |taking, _| taking.developed = true),
    ),
    swept(
        "uneven panel",
        "% less at corners",
        |_| [0.0, 5.0, 10.0, 20.0, 30.0],
        To::File(|rig, percent| uneven(rig, percent / 100.0)),
    ),
    // The lens stays focused on the panel, at 4 m.
    swept("scene nearer", "m", |_| [4.0, 3.8, 3.6, 3.2, 2.5], SCENE_AT),
    swept("scene farther", "m", |_| [4.0, 4.4, 5.0, 8.0, 16.0], SCENE_AT),
    swept(
        "wander and vibration",
        "px a capture",
        |_| [0.0, 0.03, 0.1, 0.3, 1.0],
        To::Captures(|witness, _, px| {
            let vibration_px = VIBRATION * px;
            witness.set_unrest(Unrest { wander_px: px, vibration_px, ..Unrest::default() });
        }),
    ),
    swept(
        "flicker",
        "%",
        |_| [0.0, 0.3, 1.0, 3.0, 10.0],
        To::Captures(|witness, _, percent| {
            let flicker_share = percent / 100.0;
            witness.set_unrest(Unrest { flicker_share, ..Unrest::default() });
        }),
    ),
    swept(
        "uneven response",
        "% a site",
        |_| [0.0, 0.5, 1.0, 2.0, 4.0],
        To::File(|rig, percent| {
            simulation(rig, |simulation| simulation.sensor.gain_deviation = percent / 100.0);
        }),
    ),
    swept(
        "hot pixels",
        "in 10,000",
        |_| [0.0, 2.0, 10.0, 50.0, 200.0],
        To::File(|rig, count| {
            simulation(rig, |simulation| {
                simulation.sensor.hot_pixel_share = count / 10_000.0;
                simulation.sensor.hot_pixel_levels = HOT_LEVELS;
            });
        }),
    ),
    swept(
        "camera's gamma",
        "exponent",
        |_| [1.0, 0.98, 0.95, 0.9, 0.8],
        To::File(|rig, gamma| bend(rig, SensorCurve { gamma, ..SensorCurve::default() })),
    ),
    swept(
        "camera's knee",
        "of the slope",
        |_| [1.0, 0.7, 0.5, 0.3, 0.1],
        To::File(|rig, knee_slope| {
            bend(rig, SensorCurve { knee_slope, knee_share: KNEE_SHARE, gamma: 1.0 });
        }),
    ),
];

/// Vibration over wander, as in `truthful.toml`.
const VIBRATION: f64 = 0.05 / 0.03;
/// Light of hot pixels, grey levels, as in `truthful.toml`.
const HOT_LEVELS: f64 = 20.0;
/// Start of the knee, as in `truthful.toml`.
const KNEE_SHARE: f64 = 0.85;
/// Corner tint, and loss and leakage at 10°, over the panel's corner loss, as in `truthful.toml`.
const UNEVEN: [f64; 3] = [0.02 / 0.15, 0.02 / 0.15, 0.0005 / 0.15];
/// Strengths of the noise behind filters; the first is a sensor without filters.
const NOISY: fn(&RigFile) -> [f64; 5] = |_| [0.0, 1.0, 2.0, 3.0, 4.0];

const SCENE_AT: To =
    To::Camera(|rig, metres| lens(rig, |lens| lens.scene_distance_mm = Some(1000.0 * metres)));

/// Filters over the sensor's sites, with `times` the filed noise.
fn filters(rig: &mut RigFile, times: f64) {
    simulation(rig, |simulation| {
        let sensor = &mut simulation.sensor;
        sensor.mosaic = Some(Mosaic::Rggb);
        sensor.read_noise_levels *= times;
        // Shot noise grows as the root of the full well falls.
        sensor.full_well_electrons /= times * times;
    });
}

/// A panel whose corners lack `loss` of its light.
fn uneven(rig: &mut RigFile, loss: f64) {
    let [corner_tint, loss_at_10_deg, leakage_at_10_deg] = UNEVEN.map(|share| loss * share);
    simulation(rig, |simulation| {
        simulation.display.uneven =
            Uneven { corner_loss: loss, corner_tint, loss_at_10_deg, leakage_at_10_deg };
    });
}

/// Bends the camera's response, and has calibration measure it.
fn bend(rig: &mut RigFile, curve: SensorCurve) {
    rig.calibration.linearity = true;
    simulation(rig, |simulation| simulation.sensor.curve = curve);
}
