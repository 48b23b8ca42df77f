//! Plain form of the term, written as in the module's documentation: sums over pixels in f64,
//! without rows or units.

use std::f64::consts::PI;

use super::super::{Stated, curve::CodeCurve};
use crate::frame::{Channel, CodedComponent, Frame, Plane, Work};

const M: [[f64; 3]; 3] =
    [[0.299, 0.587, 0.114], [-0.168_736, -0.331_264, 0.5], [0.5, -0.418_688, -0.081_312]];
const BACK: [[f64; 3]; 3] = [[1.0, 0.0, 1.402], [1.0, -0.344_136, -0.714_136], [1.0, 1.772, 0.0]];

/// The cosine `D[u][x]`.
fn cosine(u: usize, x: usize) -> f64 {
    let length = if u == 0 { 0.5f64.sqrt() } else { 1.0 };
    0.5 * length * ((2 * x + 1) as f64 * u as f64 * PI / 16.0).cos()
}

/// Sum over a block of `weight` times `of`.
fn over_block(of: impl Fn(usize, usize) -> f64, weight: impl Fn(usize, usize) -> f64) -> f64 {
    (0..64).map(|k| weight(k % 8, k / 8) * of(k % 8, k / 8)).sum()
}

/// Component `n` of a picture at sample `at`: M applied to the mean of its `p.0` × `p.1` pixels.
fn sample(
    of: &dyn Fn(usize, usize, usize) -> f64,
    n: usize,
    at: (usize, usize),
    p: (usize, usize),
) -> f64 {
    let mut sum = 0.0;
    for (i, j) in (0..p.0 * p.1).map(|k| (k % p.0, k / p.0)) {
        for (c, weight) in M[n].iter().enumerate() {
            sum += weight * of(c, at.0 * p.0 + i, at.1 * p.1 + j) / (p.0 * p.1) as f64;
        }
    }
    sum
}

/// B̃ of a colour photo for `seen`, like [`super::super::JpegTerm::redecoded`]; `about` is the mean
/// light around each pixel.
pub(super) fn redecoded(stated: &Stated<'_>, about: &[Plane], seen: &Frame<Work>) -> Frame<Work> {
    let (rect, coding) = (stated.rect, stated.coding);
    let curves = Channel::ALL.map(|c| {
        let sigma = |light| (stated.noise_at)(c, light);
        CodeCurve::new(stated.lights[c.index()], &sigma).expect("256 codes")
    });
    let inside = |x: usize, y: usize| {
        (rect.x + x.min(rect.size.width - 1), rect.y + y.min(rect.size.height - 1))
    };
    let code = |c: usize, x: usize, y: usize| {
        let (x, y) = inside(x, y);
        f64::from(curves[c].encode(seen.planes()[c].at(x, y)))
    };
    let deviation = |c: usize, x: usize, y: usize| {
        let (x, y) = inside(x, y);
        f64::from(2.0 * curves[c].deviation(about[c].at(x, y)))
    };
    // Samples of Dᵀ δ D of each component.
    let of_component = |n: usize, component: &CodedComponent| {
        let p = (usize::from(component.pixels.0), usize::from(component.pixels.1));
        let size = crate::frame::Size::new(8 * component.blocks.width, 8 * component.blocks.height);
        let mut change = Plane::zeros(size);
        for (b, numbers) in component.coefficients.chunks_exact(64).enumerate() {
            let (x0, y0) = (b % component.blocks.width * 8, b / component.blocks.width * 8);
            let delta: Vec<f64> = (0..64)
                .map(|k| {
                    let (u, v) = (k % 8, k / 8);
                    let middle = if n == 0 { 128.0 } else { 0.0 };
                    let m = over_block(
                        |x, y| sample(&code, n, (x0 + x, y0 + y), p) - middle,
                        |x, y| cosine(u, x) * cosine(v, y),
                    );
                    let variance = |x: usize, y: usize| {
                        let pixels = (0..p.0 * p.1).map(|k| (k % p.0, k / p.0));
                        let of = pixels.map(|(i, j)| {
                            let at = ((x0 + x) * p.0 + i, (y0 + y) * p.1 + j);
                            (0..3)
                                .map(|c| (M[n][c] * deviation(c, at.0, at.1)).powi(2))
                                .sum::<f64>()
                        });
                        let narrowed = if n == 0 { 1.0 } else { 0.25 };
                        narrowed * of.sum::<f64>() / ((p.0 * p.1) as f64).powi(2)
                    };
                    let s =
                        over_block(variance, |x, y| (cosine(u, x) * cosine(v, y)).powi(2)).sqrt();
                    let q = f64::from(component.steps[k]);
                    expected(f64::from(numbers[k]) * q - m, q / 2.0, s.max(0.01))
                })
                .collect();
            for (x, y) in (0..64).map(|k| (k % 8, k / 8)) {
                let v = over_block(|u, v| delta[8 * v + u], |u, v| cosine(u, x) * cosine(v, y));
                change.set(x0 + x, y0 + y, v as f32);
            }
        }
        change
    };
    let changes: Vec<Plane> = coding
        .components
        .iter()
        .enumerate()
        .map(|(n, component)| of_component(n, component))
        .collect();
    let mut decoded = seen.clone();
    for (x, y) in (0..rect.size.area()).map(|n| (n % rect.size.width, n / rect.size.width)) {
        for c in 0..3 {
            let change: f64 = (coding.components.iter().zip(&changes).enumerate())
                .map(|(n, (component, change))| {
                    let p = component.pixels;
                    BACK[c][n] * f64::from(change.at(x / usize::from(p.0), y / usize::from(p.1)))
                })
                .sum();
            let e = code(c, x, y);
            let again = (e + change).clamp(0.0, 255.0) as f32;
            let light = curves[c].decode(e as f32) - curves[c].decode(again);
            let at = (rect.x + x, rect.y + y);
            decoded.planes_mut()[c].set(at.0, at.1, seen.planes()[c].at(at.0, at.1) - light);
        }
    }
    decoded
}

/// Mean of a normal variable of deviation `s` within `half` of `offset`, by a sum.
fn expected(offset: f64, half: f64, s: f64) -> f64 {
    let count = 400;
    let at = |n: usize| offset - half + 2.0 * half * (n as f64 + 0.5) / f64::from(count);
    let least = (offset.abs() - half).max(0.0);
    let weight = |x: f64| (-0.5 * (x * x - least * least) / (s * s)).exp();
    let total: f64 = (0..count as usize).map(|n| weight(at(n))).sum();
    (0..count as usize).map(|n| at(n) * weight(at(n))).sum::<f64>() / total
}
