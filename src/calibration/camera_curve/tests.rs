//! Synthetic cameras with a gamma and a knee under flickering light.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::*;

const BLACK: f64 = 64.0;
const FULL: f64 = 959.0;

/// Response of a camera to a share of full light: a gamma, and a smaller slope above a knee.
fn bent(share: f64, [gamma, knee, slope]: [f64; 3]) -> f64 {
    let share = share.powf(gamma);
    share - (share - knee).max(0.0) * (1.0 - slope)
}

/// Readings of a gradation in three channels at one, two and three times the exposure, with flicker
/// of up to `flicker` and without clipped readings.
fn exposed(camera: [f64; 3], flicker: f64, seed: u64) -> Vec<Exposures> {
    let mut lots = Xoshiro256PlusPlus::seed_from_u64(seed);
    let shaken = [1.0, 2.0, 3.0].map(|times| (times, 1.0 + flicker * lots.random_range(-1.0..1.0)));
    let mut lights = Vec::new();
    for channel in [0.8, 0.7, 0.63] {
        for n in 4..=40 {
            let light = channel * (f64::from(n) / 40.0).powf(2.2);
            let reading =
                |(times, shaken): (f64, f64)| (times, FULL * bent(light * times * shaken, camera));
            let readings = shaken.map(reading).into_iter().filter(|r| r.1 < 0.97 * FULL);
            lights.push(Exposures { readings: readings.collect() });
        }
    }
    lights
}

/// Largest error of the fitted curve, as a share of full scale, up to a scale factor.
fn error(curve: &CameraCurve, camera: [f64; 3]) -> f64 {
    let pairs: Vec<(f64, f64)> = (5..90)
        .map(|n| f64::from(n) / 100.0)
        .map(|light| {
            (light, f64::from(curve.over_black((FULL * bent(light, camera)) as f32)) / FULL)
        })
        .collect();
    let scale =
        pairs.iter().map(|p| p.0 * p.1).sum::<f64>() / pairs.iter().map(|p| p.1 * p.1).sum::<f64>();
    pairs.iter().map(|p| (p.0 - scale * p.1).abs()).fold(0.0, f64::max)
}

#[test]
fn a_gamma_and_a_knee_are_fitted_and_removed() {
    for camera in [[0.98, 0.85, 0.7], [0.95, 1.0, 1.0], [1.03, 0.7, 0.85], [1.0, 1.0, 1.0]] {
        let mut worst = 0.0f64;
        for seed in 0..20 {
            let curve = CameraCurve::fit(&exposed(camera, 0.003, seed), BLACK, FULL).unwrap();
            worst = worst.max(error(&curve, camera));
        }
        println!("{camera:?}: {worst:.5} unbent {:.5}", error(&CameraCurve::straight(), camera));
        assert!(worst < 0.003, "{camera:?} {worst}");
    }
}

#[test]
fn the_inverse_extends_beyond_the_ends() {
    let curve = CameraCurve::fit(&exposed([0.96, 0.8, 0.6], 0.0, 1), BLACK, FULL).unwrap();
    for over in [-20.0, 0.0, 3.0, 400.0, 958.0, 1000.0f32] {
        assert!((curve.bent(curve.over_black(over)) - over).abs() < 1e-2, "{over}");
    }
    assert!((curve.over_black(FULL as f32) - FULL as f32).abs() < 1e-3);
    assert!((curve.count(BLACK as f32) - BLACK as f32).abs() < 1e-3);
    assert!(curve.bend() > 0.01 && !curve.is_straight());
    let straight = CameraCurve::straight();
    assert_eq!([straight.over_black(7.0), straight.bent(7.0), straight.bend()], [7.0, 7.0, 0.0]);
}

#[test]
fn a_decreasing_curve_is_refused() {
    let falls = [Exposures { readings: vec![(1.0, 800.0), (2.0, 500.0), (3.0, 300.0)] }];
    assert_eq!(CameraCurve::fit(&falls, BLACK, FULL), None);
    let mut curve = CameraCurve::fit(&exposed([1.0; 3], 0.0, 1), BLACK, FULL).unwrap();
    assert!(curve.check().is_ok());
    curve.straight[3] = curve.straight[2];
    assert!(curve.check().unwrap_err().contains("increasing"));
}
