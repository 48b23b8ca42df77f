//! Symlets 8 against golden arrays of PyWavelets, its definition and its properties.

use std::path::Path;

use super::*;
use crate::frame::read_npy_f32;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

fn golden(name: &str) -> Plane {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name).with_extension("npy");
    let (shape, values) = read_npy_f32(&path).unwrap();
    Plane::from_vec(Size::new(shape[1], shape[0]), values).unwrap()
}

fn random_plane(size: Size, seed: u64) -> Plane {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    Plane::from_fn(size, |_, _| random.random::<f32>() - 0.5)
}

fn largest_difference(a: &Plane, b: &Plane) -> f32 {
    assert_eq!(a.size(), b.size());
    a.data().iter().zip(b.data()).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

/// One level along a line by the definition in the module's documentation, in double precision.
fn analyse_line(x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut x = x.to_vec();
    if x.len() % 2 == 1 {
        x.push(x[x.len() - 1]);
    }
    let n = x.len();
    let filter = |taps: [f64; 16]| {
        (0..n / 2)
            .map(|o| (0..16).map(|j| taps[j] * x[(2 * o + 8 + 16 * n - j) % n]).sum())
            .collect()
    };
    (filter(LOW), filter(high()))
}

/// One level of a plane by [`analyse_line`]: approximation, horizontal, vertical, diagonal.
fn analyse_level(plane: &Plane) -> [Plane; 4] {
    let half = Size::new(plane.width().div_ceil(2), plane.height().div_ceil(2));
    let rows: Vec<_> = (0..plane.height())
        .map(|y| analyse_line(&plane.row(y).iter().map(|&v| f64::from(v)).collect::<Vec<_>>()))
        .collect();
    let mut bands = [0; 4].map(|_| Plane::zeros(half));
    for x in 0..half.width {
        let low = analyse_line(&rows.iter().map(|row| row.0[x]).collect::<Vec<_>>());
        let high = analyse_line(&rows.iter().map(|row| row.1[x]).collect::<Vec<_>>());
        for (band, values) in bands.iter_mut().zip([low.0, low.1, high.0, high.1]) {
            for (y, &value) in values.iter().enumerate() {
                band.set(x, y, value as f32);
            }
        }
    }
    bands
}

#[test]
fn coefficients_match_pywavelets() {
    let x = golden("sym8_x");
    let transform = Sym8::new(x.size(), 2);
    let mut found = transform.zeros();
    transform.analyse(&x, &mut found, &mut Scratch::default());
    for (band, name) in [
        (&found.approximation, "sym8_a2"),
        (&found.details[0].horizontal, "sym8_h1"),
        (&found.details[0].vertical, "sym8_v1"),
        (&found.details[0].diagonal, "sym8_d1"),
        (&found.details[1].horizontal, "sym8_h2"),
        (&found.details[1].vertical, "sym8_v2"),
        (&found.details[1].diagonal, "sym8_d2"),
    ] {
        assert!(largest_difference(band, &golden(name)) < 1e-3, "{name}");
    }
    let mut back = Plane::zeros(x.size());
    transform.synthesise(&found, &mut back, &mut Scratch::default());
    assert!(largest_difference(&back, &x) < 1e-3);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn any_size_matches_the_definition_and_is_reconstructed(
        width in 1usize..70, height in 1usize..40, levels in 1usize..6, seed: u64,
        sx in 0usize..100, sy in 0usize..100,
    ) {
        let size = Size::new(width, height);
        let (transform, mut scratch) = (Sym8::new(size, levels), Scratch::default());
        let x = random_plane(size, seed);
        let (mut found, mut back) = (transform.zeros(), Plane::zeros(size));
        transform.analyse(&x, &mut found, &mut scratch);
        let mut approximation = x.clone();
        for details in &found.details {
            let [a, h, v, d] = analyse_level(&approximation);
            prop_assert!(largest_difference(&details.horizontal, &h) < 1e-5);
            prop_assert!(largest_difference(&details.vertical, &v) < 1e-5);
            prop_assert!(largest_difference(&details.diagonal, &d) < 1e-5);
            approximation = a;
        }
        prop_assert!(largest_difference(&found.approximation, &approximation) < 1e-4);
        transform.synthesise(&found, &mut back, &mut scratch);
        prop_assert!(largest_difference(&back, &x) < 1e-5);

        // Shifting the plane before the transform has the same effect as shifting within it.
        let turned = Plane::from_fn(size, |i, j| x.at((i + sx) % width, (j + sy) % height));
        let mut inside = transform.zeros();
        transform.analyse(&turned, &mut found, &mut scratch);
        transform.analyse_shifted(&x, (sx, sy), &mut inside, &mut scratch);
        prop_assert!(inside == found);
        transform.synthesise_shifted(&inside, (sx, sy), (&mut back, Put::Set), &mut scratch);
        prop_assert!(largest_difference(&back, &x) < 1e-5);
    }
}

#[test]
fn the_basis_is_orthonormal() {
    let size = Size::new(16, 8);
    let (transform, mut scratch) = (Sym8::new(size, 2), Scratch::default());
    let rows: Vec<Vec<f32>> = (0..size.area())
        .map(|pixel| {
            let mut point = Plane::zeros(size);
            point.data_mut()[pixel] = 1.0;
            let mut found = transform.zeros();
            transform.analyse(&point, &mut found, &mut scratch);
            let mut all = found.approximation.into_vec();
            for d in found.details {
                all.extend(
                    [d.horizontal, d.vertical, d.diagonal].into_iter().flat_map(Plane::into_vec),
                );
            }
            all
        })
        .collect();
    for (i, a) in rows.iter().enumerate() {
        assert_eq!(a.len(), size.area());
        for (j, b) in rows.iter().enumerate() {
            let product: f32 = a.iter().zip(b).map(|(x, y)| x * y).sum();
            assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-5, "{i} {j}");
        }
    }
}

#[test]
fn the_parallel_transform_is_the_same() {
    for size in [Size::new(517, 389), Size::new(640, 480)] {
        let (plane, shift) = (random_plane(size, 5), (5, 3));
        let mut made = [Sym8::new(size, 3), Sym8::new(size, 3).parallel()].map(|transform| {
            let (mut found, mut scratch) = (transform.zeros(), Scratch::default());
            transform.analyse_shifted(&plane, shift, &mut found, &mut scratch);
            let mut back = Plane::zeros(size);
            transform.synthesise_shifted(&found, shift, (&mut back, Put::Set), &mut scratch);
            (found, back)
        });
        let [(serial, back), (parallel, back_parallel)] = &mut made;
        assert!(serial == parallel && back == back_parallel, "{size}");
        assert!(largest_difference(back, &plane) < 1e-5);
    }
}
