//! Smooth functions of two variables: tensor-product cubic B-splines, fitted by least squares with
//! a penalty on bending. Used for geometry, dark corner and black level.
//!
//! Knots are uniform; the penalty is the sum of squared second differences of the coefficients
//! (P-splines, Eilers and Marx, Statistical Science 11, 1996), which leaves planes unchanged.
//! Beyond its domain a surface continues along its tangent, so that an extrapolated map stays
//! bounded.

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A rectangle of real coordinates, edges included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Domain {
    /// Smallest x.
    pub left: f64,
    /// Smallest y.
    pub top: f64,
    /// Largest x; more than `left`.
    pub right: f64,
    /// Largest y; more than `top`.
    pub bottom: f64,
}

/// One sample of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Horizontal coordinate.
    pub x: f64,
    /// Vertical coordinate.
    pub y: f64,
    /// Value at that point.
    pub value: f64,
}

/// Minimum number of samples: three by three determine bending in both directions.
const SAMPLES_MIN: usize = 9;

/// Why a surface could not be fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SurfaceError {
    /// Too few samples for any smooth surface; holds their number.
    #[error("{0} samples for a smooth surface; at least {SAMPLES_MIN} are needed")]
    TooFewSamples(usize),
    /// The samples, whose number is given, do not determine the surface (all on a line, or not
    /// finite).
    #[error("{0} samples do not determine a smooth surface: they lie on a line or are not numbers")]
    Undetermined(usize),
}

/// A smooth function of two variables.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Surface {
    domain: Domain,
    columns: usize,
    rows: usize,
    /// (columns + 3) × (rows + 3), row-major.
    coefficients: Vec<f64>,
}

impl Surface {
    /// Fits a surface on `columns` × `rows` knot intervals over `domain` by minimising the squared
    /// misfits plus `bending` × squared second differences, relative to one sample per coefficient.
    ///
    /// # Errors
    /// When the samples are too few (below [`SAMPLES_MIN`]) or do not determine a surface.
    pub fn fit(
        domain: Domain,
        columns: usize,
        rows: usize,
        samples: impl IntoIterator<Item = Sample>,
        bending: f64,
    ) -> Result<Surface, SurfaceError> {
        let (columns, rows) = (columns.max(1), rows.max(1));
        let (w, h) = (columns + 3, rows + 3);
        let (mut matrix, mut right) = (DMatrix::zeros(w * h, w * h), DVector::zeros(w * h));
        let mut count = 0;
        for Sample { x, y, value } in samples {
            let across = place(x, domain.left, domain.right, columns);
            let down = place(y, domain.top, domain.bottom, rows);
            let (bx, by) = (basis(across.t), basis(down.t));
            let terms: [(usize, f64); 16] = std::array::from_fn(|n| {
                let unknown = (down.segment + n / 4) * w + across.segment + n % 4;
                (unknown, by[n / 4] * bx[n % 4])
            });
            terms.iter().for_each(|(p, weight)| right[*p] += weight * value);
            add_squared(&mut matrix, &terms, 1.0);
            count += 1;
        }
        if count < SAMPLES_MIN {
            return Err(SurfaceError::TooFewSamples(count));
        }
        let weight = bending * count as f64 / (w * h) as f64;
        for n in 0..w * h {
            let (inner_x, inner_y) = (n % w + 1 < w, n / w + 1 < h);
            if n % w + 2 < w {
                add_squared(&mut matrix, &second_difference(n, 1), weight);
            }
            if n / w + 2 < h {
                add_squared(&mut matrix, &second_difference(n, w), weight);
            }
            if inner_x && inner_y {
                // The mixed derivative counts twice in the bending energy.
                let mixed = [(n, 1.0), (n + 1, -1.0), (n + w, -1.0), (n + w + 1, 1.0)];
                add_squared(&mut matrix, &mixed, 2.0 * weight);
            }
        }
        let undetermined = SurfaceError::Undetermined(count);
        let coefficients = Cholesky::new(matrix).ok_or(undetermined)?.solve(&right);
        if coefficients.iter().any(|c| !c.is_finite()) {
            return Err(undetermined);
        }
        Ok(Surface { domain, columns, rows, coefficients: coefficients.data.into() })
    }

    /// The constant surface `value`.
    pub fn constant(domain: Domain, value: f64) -> Surface {
        Surface { domain, columns: 1, rows: 1, coefficients: vec![value; 16] }
    }

    /// The plane `origin` + `per_x`·x + `per_y`·y.
    pub fn plane(domain: Domain, origin: f64, per_x: f64, per_y: f64) -> Surface {
        let (dx, dy) = (domain.right - domain.left, domain.bottom - domain.top);
        // A cubic B-spline reproduces a plane from its values at the Greville points.
        let coefficients = (0..16)
            .map(|n| {
                let x = domain.left + dx * ((n % 4) as f64 - 1.0);
                let y = domain.top + dy * ((n / 4) as f64 - 1.0);
                origin + per_x * x + per_y * y
            })
            .collect();
        Surface { domain, columns: 1, rows: 1, coefficients }
    }

    /// The surface × `factor`.
    pub fn scaled(&self, factor: f64) -> Surface {
        Surface {
            coefficients: self.coefficients.iter().map(|c| c * factor).collect(),
            ..self.clone()
        }
    }

    /// The rectangle the surface was fitted on.
    pub fn domain(&self) -> Domain {
        self.domain
    }

    /// Whether the parts are consistent; checks data read from flash.
    pub fn is_whole(&self) -> bool {
        let d = self.domain;
        // Beyond any device's coordinates and any fit's intervals.
        let on_a_device = |at: f64| at.abs() <= f64::from(1 << 16);
        [d.left, d.top, d.right, d.bottom].into_iter().all(on_a_device)
            && (1..=1 << 10).contains(&self.columns)
            && (1..=1 << 10).contains(&self.rows)
            && d.right > d.left
            && d.bottom > d.top
            && self.coefficients.len() == (self.columns + 3) * (self.rows + 3)
            && self.coefficients.iter().all(|c| c.is_finite())
    }

    /// The value at (`x`, `y`).
    pub fn at(&self, x: f64, y: f64) -> f64 {
        let curve = self.along(y);
        let KnotPosition { segment, t, beyond } =
            place(x, self.domain.left, self.domain.right, self.columns);
        let c = &curve[segment..segment + 4];
        let (b, d) = (basis(t), slope(t));
        let value: f64 = (0..4).map(|k| b[k] * c[k]).sum();
        let tangent: f64 = (0..4).map(|k| d[k] * c[k]).sum();
        value + beyond * tangent
    }

    /// The values at (`x_first` + n·`x_step`, `y`) for each n of `out`.
    pub fn row(&self, y: f64, x_first: f64, x_step: f64, out: &mut [f32]) {
        let curve = self.along(y);
        let width = (self.domain.right - self.domain.left) / self.columns as f64;
        let cubics: Vec<[f32; 4]> = (0..self.columns).map(|s| cubic(&curve[s..s + 4])).collect();
        let mut n = 0;
        while n < out.len() {
            let x = x_first + x_step * n as f64;
            let KnotPosition { segment, t, beyond } =
                place(x, self.domain.left, self.domain.right, self.columns);
            // Number of following points on the same cubic or tangent.
            let remaining = if beyond < 0.0 {
                (self.domain.left - x) / x_step
            } else if beyond > 0.0 {
                out.len() as f64
            } else {
                (self.domain.left + width * (segment + 1) as f64 - x) / x_step
            };
            let count = (remaining.ceil().max(1.0) as usize).min(out.len() - n);
            let part = &mut out[n..n + count];
            let dt = (x_step / width) as f32;
            if beyond == 0.0 {
                let [a, b, c, d] = cubics[segment];
                let start = t as f32;
                for (k, v) in part.iter_mut().enumerate() {
                    let t = start + dt * k as f32;
                    *v = a + t * (b + t * (c + t * d));
                }
            } else {
                let [a, b, c, d] = cubics[segment].map(f64::from);
                let tangent = b + t * (2.0 * c + t * 3.0 * d);
                let value = a + t * (b + t * (c + t * d)) + beyond * tangent;
                for (k, v) in part.iter_mut().enumerate() {
                    *v = (value + tangent * x_step / width * k as f64) as f32;
                }
            }
            n += count;
        }
    }

    /// The coefficients of the curve x ↦ surface(x, `y`).
    fn along(&self, y: f64) -> Vec<f64> {
        let KnotPosition { segment, t, beyond } =
            place(y, self.domain.top, self.domain.bottom, self.rows);
        let (b, d) = (basis(t), slope(t));
        let width = self.columns + 3;
        (0..width)
            .map(|i| {
                (0..4)
                    .map(|k| (b[k] + beyond * d[k]) * self.coefficients[(segment + k) * width + i])
                    .sum()
            })
            .collect()
    }
}

pub(super) struct KnotPosition {
    /// Index of the interval.
    pub(super) segment: usize,
    /// Position in the interval, 0..1.
    pub(super) t: f64,
    /// Intervals beyond the ends; 0 inside.
    pub(super) beyond: f64,
}

/// The position of `at` among the knots of `intervals` from `first` to `last`.
pub(super) fn place(at: f64, first: f64, last: f64, intervals: usize) -> KnotPosition {
    let u = (at - first) / (last - first) * intervals as f64;
    let inside = u.clamp(0.0, intervals as f64);
    let segment = (inside as usize).min(intervals - 1);
    KnotPosition { segment, t: inside - segment as f64, beyond: u - inside }
}

/// The four non-zero uniform cubic B-splines at `t` in 0..1.
pub(super) fn basis(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        s * s * s / 6.0,
        (4.0 + t * t * (3.0 * t - 6.0)) / 6.0,
        (4.0 + s * s * (3.0 * s - 6.0)) / 6.0,
        t * t * t / 6.0,
    ]
}

/// Derivatives of [`basis`].
fn slope(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [-s * s / 2.0, t * (3.0 * t - 4.0) / 2.0, -s * (3.0 * s - 4.0) / 2.0, t * t / 2.0]
}

/// The segment's polynomial coefficients: a + b·t + c·t² + d·t³.
fn cubic(c: &[f64]) -> [f32; 4] {
    [
        ((c[0] + 4.0 * c[1] + c[2]) / 6.0) as f32,
        ((c[2] - c[0]) / 2.0) as f32,
        ((c[0] - 2.0 * c[1] + c[2]) / 2.0) as f32,
        ((c[3] - c[0] + 3.0 * (c[1] - c[2])) / 6.0) as f32,
    ]
}

/// Adds `weight` times the square of a sum of `terms`, each an unknown and its factor, to the
/// `matrix` of normal equations.
pub(super) fn add_squared(matrix: &mut DMatrix<f64>, terms: &[(usize, f64)], weight: f64) {
    for &(p, a) in terms {
        for &(q, b) in terms {
            matrix[(p, q)] += weight * a * b;
        }
    }
}

/// The second difference of three unknowns from the `n`-th, `apart` from each other.
pub(super) fn second_difference(n: usize, apart: usize) -> [(usize, f64); 3] {
    [(n, 1.0), (n + apart, -2.0), (n + 2 * apart, 1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOMAIN: Domain = Domain { left: -20.0, top: -10.0, right: 120.0, bottom: 90.0 };

    fn bump(x: f64, y: f64) -> f64 {
        3.0 + 0.2 * x - 0.1 * y + 2e-5 * (x - 50.0).powi(3) + 4e-4 * (x - 50.0) * (y - 40.0)
    }

    fn grid(step: f64) -> Vec<Sample> {
        let mut samples = Vec::new();
        let mut y = DOMAIN.top;
        while y <= DOMAIN.bottom {
            let mut x = DOMAIN.left;
            while x <= DOMAIN.right {
                samples.push(Sample { x, y, value: bump(x, y) });
                x += step;
            }
            y += step;
        }
        samples
    }

    #[test]
    fn a_cubic_is_reproduced_between_the_samples() {
        let s = Surface::fit(DOMAIN, 6, 5, grid(7.0), 1e-9).unwrap();
        for &(x, y) in &[(0.0, 0.0), (33.3, 71.2), (-20.0, 90.0), (119.0, -9.5)] {
            assert!((s.at(x, y) - bump(x, y)).abs() < 1e-4, "{} {}", s.at(x, y), bump(x, y));
        }
    }

    #[test]
    fn a_row_equals_the_surface_inside_and_beyond_the_domain() {
        let s = Surface::fit(DOMAIN, 6, 5, grid(7.0), 1e-9).unwrap();
        for y in [-30.0, 17.0, 95.0] {
            let mut row = vec![0.0f32; 400];
            s.row(y, -60.25, 0.61, &mut row);
            for (n, &v) in row.iter().enumerate() {
                let wanted = s.at(-60.25 + 0.61 * n as f64, y);
                assert!(
                    (f64::from(v) - wanted).abs() < 2e-5 * (1.0 + wanted.abs()),
                    "{n}: {v} {wanted}"
                );
            }
        }
    }

    #[test]
    fn a_plane_extends_beyond_the_domain() {
        let s = Surface::plane(DOMAIN, 1.5, 0.25, -2.0);
        for &(x, y) in &[(0.0, 0.0), (200.0, -50.0), (-70.0, 300.0)] {
            assert!((s.at(x, y) - (1.5 + 0.25 * x - 2.0 * y)).abs() < 1e-9);
        }
    }

    #[test]
    fn a_surface_with_implausible_numbers_is_not_whole() {
        let whole = Surface::plane(DOMAIN, 1.5, 0.25, -2.0);
        assert!(whole.is_whole());
        let far = Domain { right: f64::INFINITY, ..DOMAIN };
        assert!(!Surface { domain: far, ..whole.clone() }.is_whole());
        assert!(!Surface { columns: usize::MAX, ..whole.clone() }.is_whole());
        assert!(!Surface { columns: usize::MAX - 2, rows: 13, ..whole }.is_whole());
    }

    #[test]
    fn few_samples_are_refused() {
        let few = grid(7.0).into_iter().take(4);
        assert_eq!(Surface::fit(DOMAIN, 2, 2, few, 1e-3), Err(SurfaceError::TooFewSamples(4)));
    }
}
