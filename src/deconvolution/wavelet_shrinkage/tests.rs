//! Shrinkage against a golden array, explicit shifts, and the properties of spinning and clusters.

use std::path::Path;

use super::*;
use crate::frame::read_npy_f32;

fn golden(name: &str) -> Plane {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    let (shape, values) = read_npy_f32(&path).unwrap();
    Plane::from_vec(Size::new(shape[1], shape[0]), values).unwrap()
}

fn largest_difference(a: &Plane, b: &Plane) -> f32 {
    a.data().iter().zip(b.data()).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

fn rotated(plane: &Plane, (sx, sy): (usize, usize)) -> Plane {
    let Size { width, height } = plane.size();
    Plane::from_fn(plane.size(), |x, y| plane.at((x + sx) % width, (y + sy) % height))
}

#[test]
fn shrinkage_matches_the_golden_array() {
    let mut x = golden("sym8_x.npy");
    Shrinkage::new(x.size(), 2).shrink(&mut x, 1.2, (0, 0), &mut ShrinkageScratch::default());
    assert!(largest_difference(&x, &golden("sym8_soft1.2.npy")) < 1e-3);
}

#[test]
fn a_shift_is_rotating_shrinking_and_rotating_back() {
    let x = golden("sym8_x.npy");
    let shrinkage = Shrinkage::new(x.size(), 3);
    let mut scratch = ShrinkageScratch::default();
    let (mut inside, mut by_hand) = (x.clone(), rotated(&x, (5, 3)));
    shrinkage.shrink(&mut inside, 4.0, (5, 3), &mut scratch);
    shrinkage.shrink(&mut by_hand, 4.0, (0, 0), &mut scratch);
    let back = rotated(&by_hand, (x.width() - 5, x.height() - 3));
    assert!(largest_difference(&inside, &back) < 1e-4);
    assert!(largest_difference(&inside, &x) > 1.0);
}

#[test]
fn spinning_everywhere_is_the_mean_over_all_shifts() {
    let x = golden("sym8_x.npy");
    let plain = Shrinkage::new(x.size(), EVERYWHERE);
    for shrinkage in [plain.clone(), plain.in_clusters()] {
        let mut scratch = ShrinkageScratch::default();
        let mut spun = x.clone();
        shrinkage.shrink_everywhere(&mut spun, &[3.0, 2.0], None, 5, &mut scratch);
        let mut mean = Plane::zeros(x.size());
        for shift in 0..16 {
            let mut one = x.clone();
            shrinkage.shrink_levels(
                &mut one,
                &[3.0, 2.0],
                None,
                (shift % 4, shift / 4),
                &mut scratch,
            );
            mean.add_scaled(1.0 / 16.0, &one);
        }
        assert!(largest_difference(&spun, &mean) < 1e-3);
        // The result is therefore invariant to translation.
        let mut moved = rotated(&x, (1, 2));
        shrinkage.shrink_everywhere(&mut moved, &[3.0, 2.0], None, 5, &mut scratch);
        assert!(largest_difference(&rotated(&spun, (1, 2)), &moved) < 1e-3);
    }
}

#[test]
fn coarser_levels_shift_with_the_step() {
    let x = golden("sym8_x.npy");
    let (shrinkage, mut scratch) = (Shrinkage::new(x.size(), 4), ShrinkageScratch::default());
    let mut spun = [x.clone(), x];
    shrinkage.shrink_everywhere(&mut spun[0], &[2.0], None, 0, &mut scratch);
    shrinkage.shrink_everywhere(&mut spun[1], &[2.0], None, 1, &mut scratch);
    let apart = largest_difference(&spun[0], &spun[1]);
    assert!(apart > 0.01 && apart < 4.0, "{apart}");
}

#[test]
fn scratch_of_another_size_is_accepted() {
    let x = golden("sym8_x.npy");
    let mut scratch = ShrinkageScratch::default();
    let mut small = Plane::filled(Size::new(7, 5), 3.0);
    Shrinkage::new(small.size(), 4).shrink_everywhere(&mut small, &[1.0], None, 0, &mut scratch);
    assert!(small.data().iter().all(|&v| (v - 3.0).abs() < 1e-4));
    let (mut a, mut b) = (x.clone(), x);
    let shrinkage = Shrinkage::new(a.size(), 3);
    shrinkage.shrink(&mut a, 2.0, (0, 0), &mut scratch);
    shrinkage.shrink(&mut b, 2.0, (0, 0), &mut ShrinkageScratch::default());
    assert!(largest_difference(&a, &b) < 1e-5);
}

#[test]
fn an_isolated_coefficient_vanishes_and_a_cluster_of_the_same_size_remains() {
    let size = Size::new(64, 64);
    let shrinkage = Shrinkage::new(size, 1).in_clusters();
    let (transform, mut scratch) = (Sym8::new(size, 1), ShrinkageScratch::default());
    let made_of = |places: &[(usize, usize)]| {
        let mut found = transform.zeros();
        places.iter().for_each(|&(x, y)| found.details[0].horizontal.set(x, y, 4.0));
        let mut plane = Plane::zeros(size);
        transform.synthesise(&found, &mut plane, &mut Scratch::default());
        plane
    };
    let mut lone = made_of(&[(10, 10)]);
    shrinkage.shrink(&mut lone, 3.0, (0, 0), &mut scratch);
    assert!(lone.rms() < 1e-5, "{}", lone.rms());
    let line: Vec<_> = (5..25).map(|x| (x, 10)).chain((5..25).map(|x| (x, 11))).collect();
    let mut edge = made_of(&line);
    let before = edge.rms();
    shrinkage.shrink(&mut edge, 3.0, (0, 0), &mut scratch);
    assert!(edge.rms() > 0.1 * before, "{} of {before}", edge.rms());
}

#[test]
fn clusters_match_their_definition() {
    let band = golden("sym8_x.npy").map(|v: f32| v - 120.0);
    let mut found = band.clone();
    clusters::shrink(&mut found, 20.0, None, &mut Vec::new());
    let (width, height) = (band.width() as isize, band.height() as isize);
    for y in 0..height {
        for x in 0..width {
            let mut power = 0.0f64;
            for (dy, wy) in [(-1, 1.0), (0, 2.0), (1, 1.0)] {
                for (dx, wx) in [(-1, 1.0), (0, 2.0), (1, 1.0)] {
                    let (i, j) = ((x + dx).rem_euclid(width), (y + dy).rem_euclid(height));
                    power += wx * wy / 16.0 * f64::from(band.at(i as usize, j as usize)).powi(2);
                }
            }
            let value = f64::from(band.at(x as usize, y as usize));
            let expected = value * (1.0 - 20.0 / power.sqrt()).max(0.0);
            assert!(
                (f64::from(found.at(x as usize, y as usize)) - expected).abs() < 1e-3,
                "{x} {y}"
            );
        }
    }
}
