//! Reference implementation of the filter in double precision, for tests.

use super::super::filter::{LEAST, window};
use super::super::noise::BlockNoise;
use super::super::search::{Search, floor_power_of_two, grid};
use super::super::transform::{SIDE, basis};
use crate::frame::Plane;

type Cube = Vec<f64>;
const AREA: usize = SIDE * SIDE;

pub(super) fn filter(
    like: &Plane,
    search: Search,
    offset: usize,
    (noisy, guide): (&Plane, &Plane),
    noise: &BlockNoise<'_>,
) -> Plane {
    let size = noisy.size();
    let (mut sums, mut weights) = (vec![0.0; size.area()], vec![0.0; size.area()]);
    let window = window();
    for &y in &grid(size.height, search.step_px, offset) {
        for &x in &grid(size.width, search.step_px, offset) {
            let members = members(like, search, x, y);
            let mut cube = coefficients(noisy, &members);
            let (variances, factor) = noise.at(x, y, size);
            let variance = |k: usize| {
                let (v, u) = (k % AREA / SIDE, k % SIDE);
                f64::from(variances[u * SIDE + v]) * f64::from(factor)
            };
            let mut remaining = 0.0;
            let signals = coefficients(guide, &members);
            for (k, value) in cube.iter_mut().enumerate() {
                let share = signals[k].powi(2) / (signals[k].powi(2) + variance(k));
                *value *= share;
                remaining += share * share * variance(k);
            }
            let remaining = remaining.max(f64::from(LEAST));
            let pixels = synthesise(cube, members.len());
            for (block, &(u, v)) in pixels.chunks_exact(AREA).zip(&members) {
                for k in 0..AREA {
                    let at = (v + k / SIDE) * size.width + u + k % SIDE;
                    sums[at] += f64::from(window[k]) / remaining * block[k];
                    weights[at] += f64::from(window[k]) / remaining;
                }
            }
        }
    }
    Plane::from_fn(size, |x, y| {
        let at = y * size.width + x;
        if weights[at] > 0.0 { (sums[at] / weights[at]) as f32 } else { noisy.at(x, y) }
    })
}

/// The reference block, then the most similar blocks; equally similar ones in raster order.
fn members(like: &Plane, search: Search, x: usize, y: usize) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for v in 0..=like.height() - SIDE {
        for u in 0..=like.width() - SIDE {
            if u.abs_diff(x).max(v.abs_diff(y)) <= search.reach_px && (u, v) != (x, y) {
                let of = |k: usize| {
                    like.at(u + k % SIDE, v + k / SIDE) - like.at(x + k % SIDE, y + k / SIDE)
                };
                let difference: f64 = (0..AREA).map(|k| f64::from(of(k)).powi(2)).sum();
                if difference <= f64::from(search.difference_max) * AREA as f64 {
                    found.push((difference, (u, v)));
                }
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut members = vec![(x, y)];
    members.extend(found.into_iter().map(|(_, place)| place));
    members.truncate(floor_power_of_two(members.len().min(search.group_max)));
    members.truncate(floor_power_of_two(search.group_max));
    members
}

fn coefficients(picture: &Plane, members: &[(usize, usize)]) -> Cube {
    let mut cube = Cube::new();
    for &(x, y) in members {
        for k in 0..AREA {
            let (v, u) = (k / SIDE, k % SIDE);
            let at = |n: usize| f64::from(picture.at(x + n % SIDE, y + n / SIDE));
            cube.push((0..AREA).map(|n| basis(v, n / SIDE) * basis(u, n % SIDE) * at(n)).sum());
        }
    }
    along(cube, members.len(), false)
}

fn synthesise(cube: Cube, members: usize) -> Cube {
    let cube = along(cube, members, true);
    let mut pixels = Cube::new();
    for block in cube.chunks_exact(AREA) {
        for n in 0..AREA {
            let sum = |k: usize| basis(k / SIDE, n / SIDE) * basis(k % SIDE, n % SIDE) * block[k];
            pixels.push((0..AREA).map(sum).sum());
        }
    }
    pixels
}

/// The Haar transform along the group, or its transpose; the order of its rows does not matter.
fn along(cube: Cube, members: usize, transpose: bool) -> Cube {
    let matrix = haar_matrix(members);
    let mut out = vec![0.0; cube.len()];
    for i in 0..members {
        for j in 0..members {
            let weight = if transpose { matrix[j][i] } else { matrix[i][j] };
            for k in 0..AREA {
                out[i * AREA + k] += weight * cube[j * AREA + k];
            }
        }
    }
    out
}

fn haar_matrix(n: usize) -> Vec<Vec<f64>> {
    if n == 1 {
        return vec![vec![1.0]];
    }
    let half = haar_matrix(n / 2);
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for row in &half {
        rows.push(row.iter().flat_map(|w| [w * 0.5f64.sqrt(); 2]).collect());
    }
    for i in 0..n / 2 {
        let mut row = vec![0.0; n];
        (row[2 * i], row[2 * i + 1]) = (0.5f64.sqrt(), -0.5f64.sqrt());
        rows.push(row);
    }
    rows
}
