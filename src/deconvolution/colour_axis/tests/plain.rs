//! Reference implementation of the shrinkage along colour axes, for tests.

use crate::deconvolution::colour_axis::AxisWeights;
use crate::frame::{Plane, Size};

/// The mean about (x, y) of a periodic plane, with weights (1 2 1)/4 along both axes.
fn about(power: &Plane, x: usize, y: usize) -> f32 {
    let Size { width, height } = power.size();
    let mut sum = 0.0;
    for (dy, v) in [(height - 1, 1.0), (0, 2.0), (1, 1.0)] {
        for (dx, w) in [(width - 1, 1.0), (0, 2.0), (1, 1.0)] {
            sum += v * w * power.at((x + dx) % width, (y + dy) % height) / 16.0;
        }
    }
    sum
}

/// Details y·u + r after shrinkage, where y = Σ αud / Σ αu², r = d − y·u and t = `factor` / Σ αu²:
/// y shrinks by its weight times t over the root of its mean power, and r by κ times its own weight
/// times t over the root of its own.
pub(super) fn shrunk(
    d: &[Plane; 3],
    u: &[Plane; 3],
    strictness: &Plane,
    (weights, passed): (AxisWeights, [f32; 3]),
    factor: impl Fn(usize, usize) -> f32,
) -> [Plane; 3] {
    let size = d[0].size();
    let total =
        Plane::from_fn(size, |i, j| (0..3).map(|c| passed[c] * u[c].at(i, j).powi(2)).sum::<f32>());
    let y = Plane::from_fn(size, |i, j| {
        (0..3).map(|c| passed[c] * u[c].at(i, j) * d[c].at(i, j)).sum::<f32>() / total.at(i, j)
    });
    let r =
        [0, 1, 2].map(|c| Plane::from_fn(size, |i, j| d[c].at(i, j) - y.at(i, j) * u[c].at(i, j)));
    let along = y.map(|v: f32| v * v);
    let off = Plane::from_fn(size, |i, j| r.iter().map(|r| r.at(i, j).powi(2)).sum::<f32>());
    let kept = |power: &Plane, t: f32, i: usize, j: usize| {
        (1.0 - t / about(power, i, j).max(f32::MIN_POSITIVE).sqrt()).max(0.0)
    };
    [0, 1, 2].map(|c| {
        Plane::from_fn(size, |i, j| {
            let t = factor(i, j) / total.at(i, j);
            kept(&along, weights.along * t, i, j) * y.at(i, j) * u[c].at(i, j)
                + kept(&off, strictness.at(i, j) * weights.off * t, i, j) * r[c].at(i, j)
        })
    })
}
