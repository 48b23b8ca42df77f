//! Colour axes and projection, and the shrinkage against its reference implementation.

mod plain;

use super::*;
use crate::deconvolution::example_lens::gaussians;
use crate::frame::{Channel, Size};

/// Absolute cosine between two directions.
fn cosine(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [a, b] = [axis::unit(a), axis::unit(b)];
    (0..3).map(|c| a[c] * b[c]).sum::<f32>().abs()
}

/// Covariance of colours with variance `along` in the direction of `line` and `off` across it.
fn covariance(line: [f32; 3], along: f32, off: f32) -> [f32; 6] {
    let u = axis::unit(line);
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
        .map(|(a, b)| (along - off) * u[a] * u[b] + if a == b { off } else { 0.0 })
}

#[test]
fn the_axis_of_a_line_is_the_line() {
    for line in [[1.0, 0.2, -0.7], [0.1, 0.9, 0.3], [-0.5, 0.5, 0.1]] {
        let axis = LocalAxis::of([90.0, 80.0, 100.0], covariance(line, 4000.0, 0.0), 0.5);
        assert!(cosine(axis.direction, line) > 0.999, "{line:?}: {axis:?}");
        assert!(axis.strictness > 8.0 && axis.line > 0.98, "{axis:?}");
    }
}

#[test]
fn colours_without_a_line_have_the_axis_of_grey_and_the_least_strictness() {
    let axis = LocalAxis::of([90.0, 80.0, 100.0], covariance([1.0, 0.5, 0.2], 300.0, 290.0), 1.0);
    assert!(cosine(axis.direction, [1.0; 3]) > 0.99, "{axis:?}");
    assert_eq!(axis.strictness, 2.0);
    assert!(axis.line < 0.05, "{axis:?}");
}

#[test]
fn a_flat_place_has_the_axis_of_its_colour() {
    let mean = [200.0, 90.0, 40.0];
    let axis = LocalAxis::of(mean, [0.0; 6], 1.0);
    assert!(cosine(axis.direction, mean.map(|v| v + 8.0)) > 0.999, "{axis:?}");
    assert!(axis.strictness <= 16.0 && axis.line > 0.9, "{axis:?}");
}

#[test]
fn the_axis_snaps_to_the_mean_s_direction_when_it_is_near() {
    let mean = [100.0, 100.0, 100.0];
    let near = LocalAxis::of(mean, covariance([1.0, 1.01, 0.99], 400.0, 0.0), 0.0);
    assert!(near.direction.iter().all(|v| (v - near.direction[0]).abs() < 1e-4), "{near:?}");
    let far = LocalAxis::of(mean, covariance([1.0, 1.2, 0.8], 400.0, 0.0), 0.0);
    assert!(cosine(far.direction, [1.0, 1.2, 0.8]) > 0.9999, "{far:?}");
}

#[test]
fn flat_black_and_white_have_a_unit_axis_of_grey() {
    for axis in [LocalAxis::of([0.0; 3], [0.0; 6], 0.0), LocalAxis::of([255.0; 3], [0.0; 6], 4.0)] {
        let length: f32 = axis.direction.iter().map(|v| v * v).sum();
        assert!((length - 1.0).abs() < 1e-5 && cosine(axis.direction, [1.0; 3]) > 0.9999);
        assert!((2.0..=16.0).contains(&axis.strictness), "{axis:?}");
    }
}

#[test]
fn the_width_of_the_equal_blur_is_that_of_convolved_gaussians() {
    let found = width_px(&gaussians([1.6, 1.0, 2.0]));
    let want = (1.6f32 * 1.6 + 1.0 + 4.0).sqrt();
    assert!((found / want - 1.0).abs() < 0.02, "{found} {want}");
}

/// A photo of a scene of two inks through a Gaussian lens of `sigmas`, and the lens.
fn photo_of(inks: [[f32; 3]; 2], sigmas: [f32; 3]) -> (Frame<Work>, LensModel) {
    let size = Size::new(96, 80);
    let model = LensModel::new(size, 0, &gaussians(sigmas)).unwrap();
    let inked = |x: usize, y: usize| (x / 11 + y / 7).is_multiple_of(2) as usize;
    let photo = Frame::from_fn(|c: Channel| {
        let scene = Plane::from_fn(size, |x, y| inks[inked(x, y)][c.index()]);
        let mut seen = Plane::zeros(size);
        model.forward(c, &scene, &mut seen);
        seen
    });
    (photo, model)
}

#[test]
fn the_axis_of_two_inks_is_their_difference_everywhere() {
    for inks in [
        [[10.0; 3], [240.0; 3]],
        [[20.0, 30.0, 140.0], [235.0, 205.0, 40.0]],
        [[190.0, 30.0, 30.0], [40.0, 170.0, 60.0]],
    ] {
        let (photo, model) = photo_of(inks, [1.6, 1.0, 2.0]);
        let axes = ColourAxes::of(&model, &photo, 0.5, 4);
        let line = [0, 1, 2].map(|c| inks[1][c] - inks[0][c]);
        assert_eq!(axes.levels.len(), 4);
        for (level, map) in axes.levels.iter().enumerate() {
            let size = map.line.size();
            let cell = 80 / size.height;
            let inner = |at: usize, end: usize| at * cell >= 20 && (at + 1) * cell <= end - 20;
            for (x, y) in (0..size.area()).map(|i| (i % size.width, i / size.width)) {
                if inner(x, 96) && inner(y, 80) {
                    let found = map.direction.each_ref().map(|plane| plane.at(x, y));
                    assert!(cosine(found, line) > 0.99, "{inks:?} level {level}: {found:?}");
                }
            }
        }
    }
}

/// A map of `size` cells with varying axes.
fn map(size: Size, details: usize) -> AxisMap {
    let axis_at = |x: usize, y: usize| {
        axis::unit([1.0 + (x % 3) as f32, 2.0 - (y % 4) as f32, 0.5 + ((x + y) % 5) as f32])
    };
    AxisMap {
        details,
        direction: [0, 1, 2].map(|c| Plane::from_fn(size, |x, y| axis_at(x, y)[c])),
        strictness: Plane::from_fn(size, |x, y| 2.0 + ((3 * x + y) % 7) as f32),
        line: Plane::from_fn(size, |x, y| ((x + 2 * y) % 3) as f32 / 2.0),
    }
}

fn details(size: Size) -> [Plane; 3] {
    [3usize, 5, 7].map(|k| {
        Plane::from_fn(size, |x, y| ((x * k + y * (k + 4) + x * y % 13) % 23) as f32 - 11.0)
    })
}

#[test]
fn shrinkage_matches_the_reference() {
    for (size, repeat) in [(Size::new(23, 17), 1), (Size::new(22, 16), 2), (Size::new(21, 15), 2)] {
        let cells = Size::new(size.width.div_ceil(repeat), size.height.div_ceil(repeat));
        let map = map(cells, repeat);
        let wide = |plane: &Plane| Plane::from_fn(size, |x, y| plane.at(x / repeat, y / repeat));
        let factors = Plane::from_fn(size, |x, y| 1.0 + ((x + y) % 3) as f32);
        let d = details(size);
        let u = map.direction.each_ref().map(wide);
        let passed = [0.3, 0.9, 0.1];
        let weights = AxisWeights { along: 1.5, off: 2.0 };
        let factor = |x: usize, y: usize| factors.at(x, y);
        let want = plain::shrunk(&d, &u, &wide(&map.strictness), (weights, passed), factor);
        let mut found = d.clone();
        shrinkage::shrink_band(found.each_mut(), &map, (weights, passed), Some(&factors));
        for (found, want) in found.iter().zip(&want) {
            let pairs = found.data().iter().zip(want.data());
            pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-4, "{a} {b}"));
        }
    }
}

#[test]
fn projection_keeps_details_along_the_axis_and_restores_a_lost_channel() {
    let size = Size::new(20, 12);
    let map = AxisMap { line: Plane::filled(size, 1.0), ..map(size, 1) };
    let along = map.direction.each_ref().map(|u| u.map(|v: f32| 7.0 * v));
    let mut found = along.clone();
    shrinkage::project(found.each_mut(), &map, [0.3, 0.9, 0.1]);
    for (found, want) in found.iter().zip(&along) {
        assert!(found.data().iter().zip(want.data()).all(|(a, b)| (a - b).abs() < 1e-4));
    }
    // The lens passes almost no blue; green, which it passes best, determines it.
    let mut blind = along.clone();
    blind[2] = Plane::zeros(size);
    shrinkage::project(blind.each_mut(), &map, [0.3, 0.9, 1e-4]);
    for (found, want) in blind.iter().zip(&along) {
        assert!(found.data().iter().zip(want.data()).all(|(a, b)| (a - b).abs() < 0.05));
    }
}

#[test]
fn without_shrinkage_every_shift_reconstructs_the_planes() {
    let size = Size::new(48, 32);
    let along = AlongAxes::new(size, 4);
    for shift in [(0, 0), (1, 0), (5, 11), (15, 8)] {
        let mut planes = details(size);
        along.at_shift(&mut planes, shift, &|_, _| {});
        for (found, want) in planes.iter().zip(&details(size)) {
            assert!(found.data().iter().zip(want.data()).all(|(a, b)| (a - b).abs() < 1e-3));
        }
    }
}

#[test]
fn a_shift_by_levels_is_a_shift_of_the_whole_transform() {
    use crate::deconvolution::wavelet::{Put, Scratch, Sym8};
    let size = Size::new(48, 32);
    let plane = details(size)[1].clone();
    for shift in [(0, 0), (1, 0), (5, 11), (15, 8)] {
        // Halves the second level only.
        let mut planes = [plane.clone(), plane.clone(), plane.clone()];
        AlongAxes::new(size, 4).at_shift(&mut planes, shift, &|level, bands| {
            bands.into_iter().for_each(|band| band.scale(if level == 1 { 0.5 } else { 1.0 }));
        });
        let (transform, mut scratch) = (Sym8::new(size, 4), Scratch::default());
        let (mut found, mut want) = (transform.zeros(), plane.clone());
        transform.analyse_shifted(&plane, shift, &mut found, &mut scratch);
        found.scale_levels(&[1.0, 0.5, 1.0, 1.0, 1.0]);
        transform.synthesise_shifted(&found, shift, (&mut want, Put::Set), &mut scratch);
        let pairs = planes[2].data().iter().zip(want.data());
        pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-3, "{shift:?}: {a} {b}"));
    }
}

#[test]
fn two_steps_cover_all_shifts_of_the_finest_levels() {
    let size = Size::new(48, 32);
    let soften = |_: usize, bands: [&mut Plane; 3]| {
        for band in bands {
            band.data_mut().iter_mut().for_each(|v| *v -= v.clamp(-1.0, 1.0));
        }
    };
    let mut along = AlongAxes::new(size, 2);
    let mut mean_of = |times: usize, go: &dyn Fn(&mut AlongAxes, &mut [Plane; 3], usize)| {
        let mut mean = Plane::zeros(size);
        for n in 0..times {
            let mut planes = details(size);
            go(&mut along, &mut planes, n);
            mean.add_scaled(1.0 / times as f32, &planes[1]);
        }
        mean
    };
    let all = mean_of(16, &|along, planes, n| along.at_shift(planes, (n % 4, n / 4), &soften));
    let spun = mean_of(2, &|along, planes, step| along.spun(planes, 6 + step, &soften));
    let alone = mean_of(1, &|along, planes, step| along.spun(planes, step, &soften));
    let furthest = |from: &Plane| {
        let pairs = from.data().iter().zip(all.data());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    assert!(furthest(&spun) < 1e-3, "{}", furthest(&spun));
    assert!(furthest(&alone) > 0.1, "the steps differ: {}", furthest(&alone));
}
