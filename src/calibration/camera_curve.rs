//! Linearisation of a camera's counts.
//!
//! The same light at different exposures gives counts in known ratios. The linear counts G(y) over
//! black are a piecewise linear function at even steps of y; for readings y at t times the exposure
//! of an unknown light ℓ, G(y) = t·ℓ is linear in G and ℓ. Least squares with an absolute penalty
//! on changes of slope gives both: a sensor's curve has a knee and is smooth elsewhere (least
//! absolute deviations by reweighted least squares, Holland and Welsch 1977). Counts at full scale
//! keep their value.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::frame::at_step;

/// Segments of the piecewise linear function; a knee within one is known to a thousandth of full
/// scale.
const STEPS: usize = 32;
/// Penalty on a change of slope by 1, relative to squared relative misfits. Measured on synthetic
/// cameras with 0.2 % of flicker: a smaller one follows the flicker, a larger one rounds off a
/// knee.
const PENALTY: f64 = 1e-4;
/// Changes of slope below this have a quadratic penalty.
const SLOPE_LEAST: f64 = 3e-3;
const ROUNDS: usize = 8;
/// Share of full scale below which a reading's error stops being proportional to it. Guess.
const DARK_SHARE: f64 = 0.1;

/// Counts over black of one light at several exposures.
#[derive(Debug, Clone)]
pub struct Exposures {
    /// Multiple of the exposure, and counts over black.
    pub readings: Vec<(f64, f64)>,
}

/// Map from a camera's counts over black to linear ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraCurve {
    black: f32,
    /// Counts over black at the last segment's end.
    full: f32,
    /// Linear counts over black at even steps from 0 to `full`; empty for a linear camera.
    straight: Vec<f32>,
}

impl CameraCurve {
    /// The curve of a linear camera.
    pub fn straight() -> CameraCurve {
        CameraCurve { black: 0.0, full: 1.0, straight: Vec::new() }
    }

    /// Fits a curve to `lights` of a camera with `black` counts and at most `full` over black;
    /// `None` if no increasing curve fits.
    pub fn fit(lights: &[Exposures], black: f64, full: f64) -> Option<CameraCurve> {
        let mut straight = Vec::new();
        let mut slopes = [1.0; STEPS - 1];
        for _ in 0..ROUNDS {
            let line = broken_line(lights, full, &slopes.map(|s| PENALTY / (s + SLOPE_LEAST)))?;
            for (change, at) in slopes.iter_mut().zip(line.windows(3)) {
                *change = (STEPS as f64 * (at[0] - 2.0 * at[1] + at[2])).abs();
            }
            straight = line.iter().map(|&v| (v * full) as f32).collect();
        }
        let curve = CameraCurve { black: black as f32, full: full as f32, straight };
        curve.check().is_ok().then_some(curve)
    }

    /// Checks that the curve is finite and increasing; the error shows the curve.
    pub fn check(&self) -> Result<(), String> {
        let rises = |pair: &[f32]| pair[1] > pair[0] && pair[1].is_finite();
        let sound = self.black.is_finite() && self.full.is_finite() && self.full > 0.0;
        let length = self.straight.is_empty() || self.straight.len() == STEPS + 1;
        if sound && length && self.straight.windows(2).all(rises) {
            return Ok(());
        }
        Err(format!("a camera curve of {:?}; increasing numbers are allowed", self.straight))
    }

    /// Whether the camera is linear.
    pub fn is_straight(&self) -> bool {
        self.straight.is_empty()
    }

    /// Linear counts over black for `over` counts over black. The first and the last segment extend
    /// beyond the ends.
    pub fn over_black(&self, over: f32) -> f32 {
        if self.straight.is_empty() {
            return over;
        }
        at_step(&self.straight, over / self.full * STEPS as f32)
    }

    /// The inverse of [`CameraCurve::over_black`].
    pub fn bent(&self, straight: f32) -> f32 {
        if self.straight.is_empty() {
            return straight;
        }
        let above = self.straight.partition_point(|&s| s <= straight).clamp(1, STEPS);
        let (low, high) = (self.straight[above - 1], self.straight[above]);
        ((above - 1) as f32 + (straight - low) / (high - low)) * self.full / STEPS as f32
    }

    /// Linear count for `count`; both include black.
    pub fn count(&self, count: f32) -> f32 {
        self.black + self.over_black(count - self.black)
    }

    /// Largest deviation from a straight line, as a share of full scale.
    pub fn bend(&self) -> f32 {
        let deviation = |(n, &s): (usize, &f32)| (s / self.full - n as f32 / STEPS as f32).abs();
        self.straight.iter().enumerate().map(deviation).fold(0.0, f32::max)
    }
}

/// Least-squares values at each step, from 0 to 1, with `penalties` on the change of slope at each
/// inner step; `None` if `lights` do not determine them.
fn broken_line(lights: &[Exposures], full: f64, penalties: &[f64]) -> Option<Vec<f64>> {
    let unknowns = STEPS - 1 + lights.len();
    let (mut normal, mut side) =
        (DMatrix::<f64>::zeros(unknowns, unknowns), DVector::<f64>::zeros(unknowns));
    // Steps 0 and `STEPS` are fixed at 0 and 1; their terms go to the right-hand side.
    let unknown = |n: usize| match n {
        1..STEPS => Some(n - 1),
        0 | STEPS => None,
        _ => Some(n - 2),
    };
    let mut add = |terms: [(usize, f64); 3], weight: f64| {
        let known: f64 = terms.iter().filter(|term| term.0 == STEPS).map(|term| term.1).sum();
        for (n, a) in terms {
            let Some(row) = unknown(n) else { continue };
            side[row] -= weight * a * known;
            for (m, b) in terms {
                if let Some(column) = unknown(m) {
                    normal[(row, column)] += weight * a * b;
                }
            }
        }
    };
    for (n, Exposures { readings }) in lights.iter().enumerate() {
        let sum: f64 = readings.iter().map(|&(times, count)| count / times).sum();
        let mean = sum / (full * readings.len().max(1) as f64);
        // Flicker is proportional to light; black has a small error of its own.
        let weight = 1.0 / (mean * mean + DARK_SHARE * DARK_SHARE);
        for &(times, count) in readings {
            let place = (count / full * STEPS as f64).clamp(0.0, STEPS as f64);
            let step = (place as usize).min(STEPS - 1);
            let share = place - step as f64;
            let light = (STEPS + 1 + n, -1.0);
            add([(step, (1.0 - share) / times), (step + 1, share / times), light], weight);
        }
    }
    let steps = STEPS as f64;
    for (n, penalty) in (1..STEPS).zip(penalties) {
        add([(n - 1, steps), (n, -2.0 * steps), (n + 1, steps)], *penalty);
    }
    let found = normal.cholesky()?.solve(&side);
    let inner = found.iter().take(STEPS - 1).copied();
    Some(std::iter::once(0.0).chain(inner).chain([1.0]).collect())
}

#[cfg(test)]
mod tests;
