//! Recovery of the functions with and without noise.

use super::*;
use crate::patterns::pseudo_random;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

const GRID: FunctionGrid =
    FunctionGrid { photo: Size::new(96, 72), margin_px: 4, columns: 3, rows: 2, support_px: 7 };

/// Functions that widen and move over the field.
fn truth() -> LensFunctions {
    let mut functions = GRID.unblurred();
    for n in 0..6 {
        let (wide, dx) = (0.8 + 0.1 * n as f32, 0.1 * (n % 3) as f32 - 0.1);
        let bell = |t: usize| {
            let (x, y) = ((t % 7) as f32 - 3.0 - dx, (t / 7) as f32 - 3.0);
            (-(x * x + y * y) / (2.0 * wide * wide)).exp()
        };
        let sum: f32 = (0..49).map(bell).sum();
        for t in 0..49 {
            functions.taps[1][n * 49 + t] = bell(t) / sum;
        }
    }
    functions
}

fn shots(functions: &LensFunctions, noise: f32) -> Vec<Shot> {
    let model = LensModel::new(GRID.photo, GRID.margin_px, functions).unwrap();
    let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
    (0..4)
        .map(|n| {
            let shown = pseudo_random(GRID.canvas(), 10 + n).map(|v| 80.0 * v);
            let mut seen = Plane::zeros(GRID.canvas());
            model.forward(Channel::Green, &shown, &mut seen);
            let seen = seen.map(|v| {
                let bell: f32 = StandardNormal.sample(&mut random);
                v + noise * bell
            });
            Shot { shown, seen }
        })
        .collect()
}

#[test]
fn the_functions_are_recovered_without_noise() {
    let functions = truth();
    let mut fit = FunctionFit::new(GRID, &Plane::filled(GRID.canvas(), 1)).unwrap();
    let taps = fit.taps(Channel::Green, &shots(&functions, 0.0), 10).unwrap();
    let worst = taps.iter().zip(&functions.taps[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // The ridge term leaves an error below a thousandth.
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn prediction_and_centroids_are_accurate_despite_noise() {
    let functions = truth();
    let canvas = GRID.canvas();
    let mut trusted = Plane::filled(canvas, 1u8);
    (20..30).for_each(|x| trusted.set(x, 40, 0));
    let mut shots = shots(&functions, 1.0);
    shots[0].seen.set(25, 40, 1e6); // a pixel that is not trusted must not matter
    let mut fit = FunctionFit::new(GRID, &trusted).unwrap();
    let mut found = functions.clone();
    found.taps[1] = fit.taps(Channel::Green, &shots, 8).unwrap();
    normalise(&mut found);
    for n in 0..6 {
        let (truth, _) = moments(&functions.taps[1][n * 49..][..49], 7);
        let (centre, _) = moments(&found.taps[1][n * 49..][..49], 7);
        assert!((truth.0 - centre.0).hypot(truth.1 - centre.1) < 0.03, "{truth:?} {centre:?}");
    }
    let held_out = pseudo_random(canvas, 99).map(|v| 80.0 * v);
    let predict = |functions: &LensFunctions| {
        let mut seen = Plane::zeros(canvas);
        let model = LensModel::new(GRID.photo, GRID.margin_px, functions).unwrap();
        model.forward(Channel::Green, &held_out, &mut seen);
        seen
    };
    let rms = misfit(&predict(&found), &predict(&functions), &trusted, GRID.margin_px);
    println!("held-out misfit {rms}");
    assert!(rms < 0.5, "{rms}");
}

#[test]
fn a_function_without_trusted_pixels_is_refused() {
    let mut trusted = Plane::filled(GRID.canvas(), 1u8);
    for y in 0..58 {
        for x in 0..52 {
            trusted.set(x, y, 0);
        }
    }
    assert!(matches!(FunctionFit::new(GRID, &trusted), Err(LensBlurError::NotSeen { .. })));
}

#[test]
fn the_dominant_picture_has_the_largest_norm() {
    let model = LensModel::new(GRID.photo, GRID.margin_px, &truth()).unwrap();
    let (norm, picture) = dominant(&model, Channel::Green, 30);
    assert!((norm - model.norm_squared(Channel::Green, 60, 1)).abs() < 2e-3);
    assert!((picture.dot(&picture) - 1.0).abs() < 1e-4);
}
