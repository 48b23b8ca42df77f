//! The lens model against golden arrays of an independent program and against its definition.

mod plain;

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::*;
use crate::frame::{Mosaic, Rect, read_npy_f32};
use plain::Plain;

impl LensModel {
    /// ‖K‖² of one channel, the largest eigenvalue of KᵀK, approached from below by `iterations` of
    /// the power method, which starts from random numbers of `seed`.
    pub(crate) fn norm_squared(&self, channel: Channel, iterations: usize, seed: u64) -> f32 {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut x = Plane::from_fn(self.canvas, |_, _| random.random::<f32>());
        let mut seen = Plane::zeros(self.canvas);
        let mut largest = 0.0;
        for _ in 0..iterations {
            let length = x.dot(&x).sqrt();
            if length == 0.0 {
                return 0.0;
            }
            x.data_mut().iter_mut().for_each(|v| *v = (f64::from(*v) / length) as f32);
            self.forward(channel, &x, &mut seen);
            largest = seen.dot(&seen);
            self.adjoint(channel, &seen, &mut x);
        }
        largest as f32
    }
}

/// A golden plane of `tests/golden`.
fn golden(name: &str) -> Plane {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name).with_extension("npy");
    let (shape, values) = read_npy_f32(&path).unwrap();
    Plane::from_vec(Size::new(shape[1], shape[0]), values).unwrap()
}

fn golden_functions() -> LensFunctions {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/psf_grid.npy");
    let (shape, values) = read_npy_f32(&path).unwrap();
    let [rows, columns, 3, k, _] = shape[..] else { panic!("{shape:?}") };
    let taps =
        |c: usize| values.chunks_exact(k * k).skip(c).step_by(3).flatten().copied().collect();
    LensFunctions { rows, columns, support_px: k, taps: [0, 1, 2].map(taps) }
}

fn golden_model() -> LensModel {
    LensModel::new(Size::new(128, 96), 0, &golden_functions()).unwrap()
}

fn random_plane(size: Size, seed: u64) -> Plane {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    Plane::from_fn(size, |_, _| random.random::<f32>() - 0.3)
}

/// Random functions with no symmetry that could hide a transposition.
fn random_functions(rows: usize, columns: usize, k: usize, seed: u64) -> LensFunctions {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let one =
        |_| (0..rows * columns * k * k).map(|_| random.random::<f32>() / (k * k) as f32).collect();
    LensFunctions { rows, columns, support_px: k, taps: [0, 1, 2].map(one) }
}

fn largest_difference(a: &Plane, b: &Plane) -> f32 {
    a.data().iter().zip(b.data()).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

/// A model's photo size, margin and functions.
struct ModelShape {
    photo: Size,
    margin: usize,
    functions: LensFunctions,
}

fn model_shapes() -> Vec<ModelShape> {
    let shape = |width, height, margin, functions| ModelShape {
        photo: Size::new(width, height),
        margin,
        functions,
    };
    vec![
        shape(40, 30, 0, random_functions(1, 1, 7, 1)),
        shape(40, 30, 5, random_functions(2, 3, 9, 2)),
        shape(37, 29, 3, random_functions(3, 4, 5, 3)),
        shape(50, 41, 0, random_functions(1, 5, 11, 4)),
        shape(9, 8, 2, random_functions(2, 2, 15, 5)),
        shape(64, 48, 4, random_functions(4, 1, 1, 6)),
        shape(20, 20, 1, random_functions(20, 20, 3, 7)),
    ]
}

#[test]
fn forward_and_adjoint_agree_with_the_golden_arrays() {
    let model = golden_model();
    let mut out = Plane::zeros(model.canvas());
    for (input, wanted, tolerance) in
        [("operator_x", "operator_k_x", 2e-4), ("operator_rand_x", "operator_k_rand_x", 1e-6)]
    {
        model.forward(Channel::Green, &golden(input), &mut out);
        assert!(largest_difference(&out, &golden(wanted)) < tolerance, "{wanted}");
    }
    for (input, wanted, tolerance) in
        [("operator_x", "operator_kt_x", 2e-4), ("operator_rand_y", "operator_kt_rand_y", 1e-6)]
    {
        model.adjoint(Channel::Green, &golden(input), &mut out);
        assert!(largest_difference(&out, &golden(wanted)) < tolerance, "{wanted}");
    }
}

#[test]
fn the_norm_is_the_golden_one() {
    let found = golden_model().norm_squared(Channel::Green, 40, 1);
    assert!((found - 0.995_243).abs() < 1e-3, "{found}");
}

#[test]
fn adjoint_passes_the_dot_test() {
    for ModelShape { photo, margin, functions } in model_shapes() {
        let model = LensModel::new(photo, margin, &functions).unwrap();
        let (x, y) = (random_plane(model.canvas(), 1), random_plane(model.canvas(), 2));
        let (mut kx, mut kty) = (x.clone(), x.clone());
        for channel in Channel::ALL {
            model.forward(channel, &x, &mut kx);
            model.adjoint(channel, &y, &mut kty);
            let scale = kx.dot(&kx).sqrt() * y.dot(&y).sqrt();
            assert!((kx.dot(&y) - x.dot(&kty)).abs() < 1e-5 * scale, "{photo} {channel:?}");
        }
    }
}

#[test]
fn correlate_is_the_adjoint_of_taps_to_picture() {
    for ModelShape { photo, margin, functions } in model_shapes() {
        let model = LensModel::new(photo, margin, &functions).unwrap();
        let (x, residual) = (random_plane(model.canvas(), 3), random_plane(model.canvas(), 4));
        let mut kx = x.clone();
        model.forward(Channel::Blue, &x, &mut kx);
        let gradient = model.correlate(&x, &residual);
        let taps = &functions.taps[2];
        assert_eq!(gradient.len(), taps.len());
        let along: f64 =
            gradient.iter().zip(taps).map(|(&g, &t)| f64::from(g) * f64::from(t)).sum();
        let scale = kx.dot(&kx).sqrt() * residual.dot(&residual).sqrt();
        assert!((along - kx.dot(&residual)).abs() < 1e-5 * scale, "{photo}");
    }
}

/// K as an explicit matrix, entry by entry from the definition, for a canvas of few pixels.
#[test]
fn forward_is_the_matrix_of_the_definition() {
    let functions = random_functions(2, 3, 3, 9);
    let (photo, margin) = (Size::new(9, 6), 1);
    let model = LensModel::new(photo, margin, &functions).unwrap();
    let canvas = model.canvas();
    let weight = |n: usize, count: usize, length: usize, pixel: usize| {
        let place = ((pixel as f64 - 1.0 + 0.5) * count as f64 / length as f64 - 0.5)
            .clamp(0.0, count as f64 - 1.0);
        (1.0 - (place - n as f64).abs()).max(0.0)
    };
    for y in 0..canvas.height {
        for x in 0..canvas.width {
            let mut point = Plane::zeros(canvas);
            point.set(x, y, 1.0);
            let mut seen = Plane::zeros(canvas);
            model.forward(Channel::Red, &point, &mut seen);
            for j in 0..canvas.height {
                for i in 0..canvas.width {
                    let (u, v) = (i as isize - x as isize + 1, j as isize - y as isize + 1);
                    let mut wanted = 0.0;
                    if (0..3).contains(&u) && (0..3).contains(&v) {
                        for n in 0..6 {
                            let w = weight(n / 3, 2, 6, y) * weight(n % 3, 3, 9, x);
                            let tap = functions.function(Channel::Red, n / 3, n % 3)
                                [(3 * v + u) as usize];
                            wanted += w * f64::from(tap);
                        }
                    }
                    assert!((f64::from(seen.at(i, j)) - wanted).abs() < 1e-6);
                }
            }
        }
    }
}

#[test]
fn invalid_functions_are_refused() {
    let mut functions = random_functions(2, 2, 3, 1);
    functions.taps[1].pop();
    let refused = LensModel::new(Size::new(8, 8), 0, &functions).unwrap_err();
    assert_eq!(refused.to_string(), "the lens model has 35 taps in green; its grid needs 36");
    let even = random_functions(2, 2, 4, 1);
    let refused = even.check().unwrap_err().to_string();
    assert_eq!(refused, "the lens model has functions 4 px wide; the width must be odd");
    let mut model = LensModel::new(Size::new(8, 8), 0, &random_functions(1, 1, 3, 1)).unwrap();
    assert!(model.set_taps(Channel::Red, &[f32::NAN; 9]).is_err());
    assert!(model.functions().taps[0].iter().all(|t| t.is_finite()));
}

#[test]
fn the_operators_match_the_reference() {
    for ModelShape { photo, margin, functions } in model_shapes() {
        let model = LensModel::new(photo, margin, &functions).unwrap();
        let along_x = Interpolation::new(photo.width, margin, functions.columns);
        let along_y = Interpolation::new(photo.height, margin, functions.rows);
        let plain = Plain { functions: &functions, along_x: &along_x, along_y: &along_y };
        let (x, y) = (random_plane(model.canvas(), 5), random_plane(model.canvas(), 6));
        let mut found = x.clone();
        for channel in Channel::ALL {
            model.forward(channel, &x, &mut found);
            assert!(largest_difference(&found, &plain.forward(channel, &x)) < 1e-5, "{photo}");
            model.adjoint(channel, &y, &mut found);
            assert!(largest_difference(&found, &plain.adjoint(channel, &y)) < 1e-5, "{photo}");
        }
        let (fast, slow) = (model.correlate(&x, &y), plain.correlate(&x, &y));
        let far = fast.iter().zip(&slow).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(far < 1e-4, "{photo}: {far}");
    }
}

#[test]
fn grids_whose_number_of_taps_overflows_are_refused() {
    let functions = LensFunctions {
        rows: 1 << 32,
        columns: 1 << 32,
        support_px: 1,
        taps: [vec![], vec![], vec![]],
    };
    let refused = functions.check().unwrap_err().to_string();
    assert!(refused.contains("0 taps in red"), "{refused}");
}

/// A Gaussian lens, the same everywhere, on a 2×2 grid of functions, so that seams would show.
fn gaussian_model(sigma_px: f32) -> LensModel {
    let one: Vec<f32> = (0..25 * 25)
        .map(|t| {
            let (x, y) = ((t % 25) as f32 - 12.0, (t / 25) as f32 - 12.0);
            (-(x * x + y * y) / (2.0 * sigma_px * sigma_px)).exp()
        })
        .collect();
    let total: f32 = one.iter().sum();
    let one: Vec<f32> = one.iter().map(|t| t / total).collect();
    let taps = one.repeat(4);
    let taps = [taps.clone(), taps.clone(), taps];
    LensModel::new(
        Size::new(120, 100),
        0,
        &LensFunctions { rows: 2, columns: 2, support_px: 25, taps },
    )
    .unwrap()
}

/// `plane` at the sites of `channel`, each weighted by the pixels that it stands for.
fn at_sites(plane: &Plane, mosaic: Option<Mosaic>, channel: Channel) -> Plane {
    let Some(mosaic) = mosaic else { return plane.clone() };
    let weight = Mosaic::pixels_a_site(channel);
    Plane::from_fn(plane.size(), |x, y| {
        if mosaic.colour_at(x, y) == channel { weight * plane.at(x, y) } else { 0.0 }
    })
}

#[test]
fn the_local_inverse_solves_its_normal_equations() {
    let model = gaussian_model(1.2);
    let size = model.canvas();
    let everywhere = Channel::ALL.map(|c| (c, None));
    let sites = Mosaic::ALL.into_iter().flat_map(|m| Channel::ALL.map(|c| (c, Some(m))));
    for (channel, mosaic) in everywhere.into_iter().chain(sites) {
        for epsilon in [0.03f32, 0.3] {
            let inverse =
                model.local_inverse(channel, epsilon, Density::of(channel, mosaic.is_some()));
            let data = at_sites(&random_plane(size, 5), mosaic, channel);
            let [mut found, mut seen, mut left, mut right] = [(); 4].map(|()| Plane::zeros(size));
            model.invert(&inverse, &data, &mut found);
            // (KᵀMK + ε) x = KᵀM y, away from the border, where light is lost.
            model.forward(channel, &found, &mut seen);
            model.adjoint(channel, &at_sites(&seen, mosaic, channel), &mut left);
            left.add_scaled(epsilon, &found);
            model.adjoint(channel, &data, &mut right);
            let middle = Rect { x: 24, y: 24, size: Size::new(72, 52) };
            let (mut off, wanted) = (left.crop(middle), right.crop(middle));
            off.add_scaled(-1.0, &wanted);
            let share = off.rms() / wanted.rms();
            assert!(share < 0.01, "{channel:?} {mosaic:?} ε {epsilon}: {share}");
        }
    }
}

#[test]
fn a_step_by_the_local_inverse_descends_in_every_density() {
    let model = golden_model();
    let size = model.canvas();
    for (channel, mosaic) in
        Channel::ALL.into_iter().flat_map(|c| [(c, None), (c, Some(Mosaic::Rggb))])
    {
        let data = at_sites(&random_plane(size, 6), mosaic, channel);
        for epsilon in [1e-3, 0.03, 1.0] {
            let inverse =
                model.local_inverse(channel, epsilon, Density::of(channel, mosaic.is_some()));
            let [mut picture, mut seen] = [(); 2].map(|()| Plane::zeros(size));
            model.invert(&inverse, &data, &mut picture);
            model.forward(channel, &picture, &mut seen);
            let mut residual = at_sites(&seen, mosaic, channel);
            residual.add_scaled(-1.0, &data);
            assert!(residual.rms() < data.rms(), "{channel:?} {mosaic:?} {epsilon}");
        }
    }
}

#[test]
fn released_spectra_are_computed_again() {
    let mut model = golden_model();
    let x = random_plane(model.canvas(), 5);
    let seen = |model: &LensModel| {
        let mut seen = Plane::zeros(model.canvas());
        model.forward(Channel::Red, &x, &mut seen);
        seen
    };
    let before = seen(&model);
    model.release_spectra(Channel::Red);
    assert_eq!(seen(&model), before);
    // A copy keeps its own spectra when the taps change.
    let copy = model.clone();
    let halved: Vec<f32> = model.functions().taps[0].iter().map(|tap| 0.5 * tap).collect();
    model.set_taps(Channel::Red, &halved).unwrap();
    assert_eq!(seen(&copy), before);
    assert!((seen(&model).rms() / before.rms() - 0.5).abs() < 1e-5);
}
