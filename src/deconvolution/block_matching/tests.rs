//! The filter against its reference implementation, and its properties.

mod plain;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::*;
use crate::deconvolution::lens_model::LensFunctions;
use crate::deconvolution::quality::psnr;
use crate::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use crate::frame::{Channel, Plane, Size};

const SEARCH: Search = Search { step_px: 3, reach_px: 12, group_max: 16, difference_max: 2500.0 };

/// Woven cloth: repeated detail in every block.
fn cloth(size: Size) -> Plane {
    Plane::from_fn(size, |x, y| {
        let thread = if (x / 2 + y / 3).is_multiple_of(2) { 30.0 } else { -30.0 };
        120.0 + thread + 40.0 * (x as f32 / 37.0).sin() + 15.0 * ((x * 5 + y * 3) % 7) as f32 / 7.0
    })
}

fn noisy(picture: &Plane, deviation: f32, seed: u64) -> Plane {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    picture.map(|v: f32| {
        let noise: f32 = StandardNormal.sample(&mut random);
        // Sums of squares of whole numbers are exact, so that both implementations choose the same
        // blocks.
        (v + deviation * noise).round()
    })
}

/// Noise after deconvolving a lens whose blur along x doubles from left to right.
fn coloured() -> BlockNoise<'static> {
    let bell = |wide: f32| -> Vec<f32> {
        let taps: Vec<f32> = (0..121)
            .map(|t| {
                let (x, y) = ((t % 11) as f32 - 5.0, (t / 11) as f32 - 5.0);
                (-x * x / (2.0 * wide * wide) - y * y / 2.0).exp()
            })
            .collect();
        let total: f32 = taps.iter().sum();
        taps.iter().map(|t| t / total).collect()
    };
    let taps = [bell(1.0), bell(2.0)].concat();
    let functions = LensFunctions {
        rows: 1,
        columns: 2,
        support_px: 11,
        taps: [taps.clone(), taps.clone(), taps],
    };
    BlockNoise::deconvolved(&Passed::of(&functions, Channel::Green), 4.0, 100.0)
}

#[test]
fn the_filter_matches_the_reference() {
    let size = Size::new(46, 37);
    let (like, seen) = (noisy(&cloth(size), 3.0, 1), noisy(&cloth(size), 9.0, 2));
    for offset in [0, 2] {
        for noise in [BlockNoise::white(81.0), coloured()] {
            let fast = filter(&Groups::find(&like, SEARCH, offset), &seen, &like, &noise);
            let plain = plain::filter(&like, SEARCH, offset, (&seen, &like), &noise);
            let apart = fast.data().iter().zip(plain.data()).map(|(a, b)| (a - b).abs());
            let worst = apart.fold(0.0, f32::max);
            assert!(worst < 1e-3, "{worst}");
        }
    }
}

#[test]
fn texture_is_cleaned_better_than_by_soft_shrinkage() {
    let size = Size::new(96, 80);
    let (truth, deviation) = (cloth(size), 12.0);
    let seen = noisy(&truth, deviation, 5);
    let shrunk = |&threshold: &f32| {
        let (mut plane, shrinkage) = (seen.clone(), Shrinkage::new(size, 3));
        shrinkage.shrink_everywhere(
            &mut plane,
            &[threshold],
            None,
            0,
            &mut ShrinkageScratch::default(),
        );
        plane
    };
    let all = [2.0, 4.0, 6.0, 9.0, 12.0, 18.0].iter().map(shrunk);
    let soft = all.max_by(|a, b| psnr(a, &truth).total_cmp(&psnr(b, &truth))).unwrap();
    let noise = BlockNoise::white(deviation * deviation);
    let first = filter(&Groups::find(&soft, SEARCH, 0), &seen, &soft, &noise);
    let second = filter(&Groups::find(&first, SEARCH, 0), &seen, &first, &noise);
    let found = [&seen, &soft, &first, &second].map(|picture| psnr(picture, &truth));
    assert!(found[2] > found[1] + 1.0, "{found:?}");
    assert!(found[3] > found[2], "{found:?}");
}

#[test]
fn flat_and_small_planes_are_unchanged() {
    for size in [Size::new(8, 8), Size::new(9, 30), Size::new(50, 41)] {
        let flat = Plane::filled(size, 77.0);
        let kept = filter(&Groups::find(&flat, SEARCH, 1), &flat, &flat, &BlockNoise::white(1.0));
        assert!(kept.data().iter().all(|v| (v - 77.0).abs() < 0.01), "{size}");
    }
    for size in [Size::new(7, 30), Size::new(30, 7), Size::new(1, 1), Size::new(0, 0)] {
        let small = noisy(&Plane::filled(size, 50.0), 20.0, 3);
        let kept =
            filter(&Groups::find(&small, SEARCH, 0), &small, &small, &BlockNoise::white(1.0));
        assert_eq!(kept, small);
    }
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let seen = noisy(&cloth(Size::new(90, 120)), 10.0, 8);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            filter(&Groups::find(&seen, SEARCH, 0), &seen, &seen, &BlockNoise::white(100.0))
        })
    };
    assert_eq!(with(1), with(3));
}
