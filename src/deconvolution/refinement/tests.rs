//! A lens that was changed since it was measured is found again from one capture of a picture, and
//! one that was not is left.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::*;
use crate::frame::Size;

const PHOTO: Rect = Rect { x: 8, y: 8, size: Size::new(240, 176) };

/// Bells a little wider from the left to the right, moved by `aside` pixels in the right one.
fn functions(narrow_px: f32, wide_px: f32, aside: f32) -> LensFunctions {
    let bell = |deviation_px: f32, aside: f32| {
        let light = |t: i32| {
            let (x, y) = ((t % 17 - 8) as f32 - aside, (t / 17 - 8) as f32);
            (-(x * x + y * y) / (2.0 * deviation_px * deviation_px)).exp()
        };
        let taps: Vec<f32> = (0..17 * 17).map(light).collect();
        let sum: f32 = taps.iter().sum();
        taps.into_iter().map(move |tap| tap / sum)
    };
    let taps: Vec<f32> = bell(narrow_px, 0.0).chain(bell(wide_px, aside)).collect();
    LensFunctions { rows: 1, columns: 2, support_px: 17, taps: [taps.clone(), taps.clone(), taps] }
}

fn model(functions: &LensFunctions) -> LensModel {
    LensModel::new(PHOTO.size, PHOTO.x, functions).unwrap()
}

/// Something with edges of many sizes.
fn picture(seed: u64, canvas: Size) -> Frame<Work> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let discs: Vec<[f32; 4]> = (0..200)
        .map(|_| {
            let mut number = || rand::RngExt::random::<f32>(&mut random);
            let size = number();
            [number() * 256.0, number() * 192.0, 2.0 + 40.0 * size * size * size, 250.0 * number()]
        })
        .collect();
    let plane = Plane::from_fn(canvas, |x, y| {
        let covers = |d: &&[f32; 4]| (x as f32 - d[0]).hypot(y as f32 - d[1]) < d[2];
        discs.iter().rev().find(covers).map_or(90.0, |d| d[3])
    });
    Frame::from_fn(|_| plane.clone())
}

/// What is seen of `shown` through `lens`, with noise.
fn seen(lens: &LensModel, shown: &Frame<Work>, noise: f32, seed: u64) -> Seen {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let light = Frame::from_fn(|c| {
        let mut plane = Plane::zeros(lens.canvas());
        lens.forward(c, shown.plane(c), &mut plane);
        plane.map(|v: f32| {
            let deviation: f32 = StandardNormal.sample(&mut random);
            v + noise * deviation
        })
    });
    Seen { light, trusted: Frame::filled(lens.canvas(), TRUSTED) }
}

fn norms(model: &LensModel) -> [LevelNorms; 3] {
    Channel::ALL.map(|c| LevelNorms::measure(model, c, 3, 12, 1))
}

/// What one capture makes of the lens `measured` when it really is `lens`.
fn refined(measured: &LensModel, lens: &LensModel) -> Option<(RefinedLens, LensModel)> {
    let (shown, trust) = (picture(1, lens.canvas()), Frame::filled(lens.canvas(), TRUSTED));
    let level_norms = norms(measured);
    let channels = &[Channel::Green];
    let measured = Measured {
        photo: PHOTO,
        channels,
        trust: &trust,
        model: measured,
        level_norms: &level_norms,
        capture_noise: [1.0; 3],
    };
    let seen = seen(lens, &shown, 1.0, 2);
    let unexplained = seen.unexplained(&measured.model.seen(channels, &shown), channels);
    measured.refine(&shown, &seen, &unexplained)
}

/// RMS of what `model` gets wrong of another picture through `lens`.
fn wrong(model: &LensModel, lens: &LensModel) -> f64 {
    let shown = picture(7, lens.canvas());
    let mut difference = seen(lens, &shown, 0.0, 0).light.plane(Channel::Green).clone();
    let mut predicted = Plane::zeros(lens.canvas());
    model.forward(Channel::Green, shown.plane(Channel::Green), &mut predicted);
    difference.add_scaled(-1.0, &predicted);
    difference.crop(PHOTO).rms()
}

#[test]
fn a_lens_that_was_changed_is_found_and_serves_another_picture() {
    let (then, now) = (model(&functions(1.5, 2.5, 0.0)), model(&functions(1.9, 2.0, 0.6)));
    let (_, refined) = refined(&then, &now).expect("a change that stands out");
    let (before, after) = (wrong(&then, &now), wrong(&refined, &now));
    assert!(after < 0.3 * before, "{before:.2} before, {after:.2} after");
}

#[test]
fn one_function_becomes_as_many_as_are_called_for() {
    let now = model(&functions(1.5, 2.5, 0.0));
    let then = model(&functions(1.5, 2.5, 0.0).mean());
    let (_, refined) = refined(&then, &now).expect("a change that stands out");
    assert!(refined.functions().columns > 1);
    let (before, after) = (wrong(&then, &now), wrong(&refined, &now));
    assert!(after < 0.5 * before, "{before:.2} before, {after:.2} after");
}

#[test]
fn a_lens_that_was_not_changed_is_left_alone() {
    let lens = model(&functions(1.5, 2.5, 0.0));
    assert!(refined(&lens, &lens).is_none());
}

#[test]
fn the_refined_model_s_adjoint_is_exact_and_its_steps_are_safe() {
    let (then, now) = (model(&functions(2.5, 2.5, 0.0)), model(&functions(1.5, 1.2, 0.5)));
    let (found, refined) = refined(&then, &now).expect("a change that stands out");
    let canvas = refined.canvas();
    let (x, y) = (picture(3, canvas), picture(4, canvas));
    let (x, y) = (x.plane(Channel::Green), y.plane(Channel::Green));
    let (mut kx, mut kty) = (Plane::zeros(canvas), Plane::zeros(canvas));
    refined.forward(Channel::Green, x, &mut kx);
    refined.adjoint(Channel::Green, y, &mut kty);
    assert!((kx.dot(y) / x.dot(&kty) - 1.0).abs() < 1e-5);
    // As measured over the whole field, and sharper lenses want shorter steps in fine levels.
    let whole = &norms(&refined)[Channel::Green.index()];
    let used = &found.level_norms[Channel::Green.index()];
    for level in 0..=3 {
        assert!(used.at(level) > 0.97 * whole.at(level), "level {level}: {used:?} {whole:?}");
    }
    assert!(used.at(0) > 1.5 * norms(&then)[Channel::Green.index()].at(0));
}

#[test]
fn a_knocked_panel_is_no_other_lens() {
    let lens = functions(1.5, 2.5, 0.0);
    let (then, now) = (model(&lens), model(&displacement::shifted(&lens, (0.8, -0.5))));
    let (found, refined) = refined(&then, &now).expect("a change that stands out");
    let registered = model(&found.functions);
    let (captures, photos) = (wrong(&refined, &now), wrong(&registered, &then));
    let between = wrong(&then, &now);
    assert!(
        captures < 0.3 * between && photos < 0.3 * between,
        "{captures:.2} {photos:.2} of {between:.2}"
    );
}
