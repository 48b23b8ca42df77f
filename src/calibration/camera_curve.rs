//! How a camera's counts bend: the straight counts that each stands for.
//!
//! The same light exposed for longer brings more counts in a known ratio. Straight counts G(y) over
//! black are a line broken at even steps of y; for readings y at t times the exposure under a light
//! ℓ that is not known, G(y) = t·ℓ is linear in both. Least squares with a price on every change of
//! slope, by its size and not its square, gives both: a sensor's curve has a knee and is calm
//! elsewhere (least absolute deviations by reweighted least squares, Holland and Welsch 1977).
//! Counts at full scale keep their value.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Steps of the broken line. A knee within one of them is known to within a thousandth of full
/// scale.
const STEPS: usize = 32;
/// Price of a change of slope by 1, against readings that are off by a share of themselves.
/// Measured on drawn cameras with 0.2 % of flicker: less follows it, more rounds off a knee.
const PRICE: f64 = 1e-4;
/// Changes of slope below this are priced by their square.
const SLOPE_LEAST: f64 = 3e-3;
/// Times the weights are set anew.
const ROUNDS: usize = 8;
/// Below this share of full scale readings are not exact by their own share. Guess.
const DARK_SHARE: f64 = 0.1;

/// Counts over black that one light brought at several exposures.
#[derive(Debug, Clone)]
pub struct Exposures {
    /// Multiples of the exposure, and the counts over black.
    pub readings: Vec<(f64, f64)>,
}

/// The straight counts over black that a camera's counts over black stand for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CameraCurve {
    /// Mean counts of black.
    black: f32,
    /// Counts over black at the last step.
    full: f32,
    /// Straight counts over black at even steps from 0 to `full`; none where counts are straight.
    straight: Vec<f32>,
}

impl CameraCurve {
    /// Of a camera whose counts are straight.
    pub fn straight() -> CameraCurve {
        CameraCurve { black: 0.0, full: 1.0, straight: Vec::new() }
    }

    /// The curve of a camera with so many counts of `black`, and `full` ones over black at the
    /// most, that explains `lights`; `None` where no rising curve does.
    pub fn fit(lights: &[Exposures], black: f64, full: f64) -> Option<CameraCurve> {
        let mut straight = Vec::new();
        let mut slopes = [1.0; STEPS - 1];
        for _ in 0..ROUNDS {
            let line = broken_line(lights, full, &slopes.map(|s| PRICE / (s + SLOPE_LEAST)))?;
            for (change, at) in slopes.iter_mut().zip(line.windows(3)) {
                *change = (STEPS as f64 * (at[0] - 2.0 * at[1] + at[2])).abs();
            }
            straight = line.iter().map(|&v| (v * full) as f32).collect();
        }
        let curve = CameraCurve { black: black as f32, full: full as f32, straight };
        curve.check().is_ok().then_some(curve)
    }

    /// Whether it is as a curve must be, rising and with numbers only; what was found else.
    pub fn check(&self) -> Result<(), String> {
        let rises = |pair: &[f32]| pair[1] > pair[0] && pair[1].is_finite();
        let sound = self.black.is_finite() && self.full.is_finite() && self.full > 0.0;
        let length = self.straight.is_empty() || self.straight.len() == STEPS + 1;
        if sound && length && self.straight.windows(2).all(rises) {
            return Ok(());
        }
        Err(format!("a camera's curve of {:?}; rising numbers are allowed", self.straight))
    }

    /// Whether it changes nothing.
    pub fn is_straight(&self) -> bool {
        self.straight.is_empty()
    }

    /// The straight counts of `over` counts over black. Below black and above full scale the first
    /// and the last step go on.
    pub fn over_black(&self, over: f32) -> f32 {
        if self.straight.is_empty() {
            return over;
        }
        let place = over / self.full * STEPS as f32;
        let step = (place.max(0.0) as usize).min(STEPS - 1);
        let (below, above) = (self.straight[step], self.straight[step + 1]);
        below + (above - below) * (place - step as f32)
    }

    /// The counts over black that stand for `straight` ones: the inverse.
    pub fn bent(&self, straight: f32) -> f32 {
        if self.straight.is_empty() {
            return straight;
        }
        let above = self.straight.partition_point(|&s| s <= straight).clamp(1, STEPS);
        let (low, high) = (self.straight[above - 1], self.straight[above]);
        ((above - 1) as f32 + (straight - low) / (high - low)) * self.full / STEPS as f32
    }

    /// A straight count, black and all, for `count`.
    pub fn count(&self, count: f32) -> f32 {
        self.black + self.over_black(count - self.black)
    }

    /// How far the curve is from straight, as a share of full scale.
    pub fn bend(&self) -> f32 {
        let of = |(n, &s): (usize, &f32)| (s / self.full - n as f32 / STEPS as f32).abs();
        self.straight.iter().enumerate().map(of).fold(0.0, f32::max)
    }
}

/// Shares of full scale at each step, from 0 to 1, by least squares; a change of slope at each
/// inner step is weighed by `prices`. `None` where `lights` do not say.
fn broken_line(lights: &[Exposures], full: f64, prices: &[f64]) -> Option<Vec<f64>> {
    let unknowns = STEPS - 1 + lights.len();
    let (mut normal, mut side) =
        (DMatrix::<f64>::zeros(unknowns, unknowns), DVector::<f64>::zeros(unknowns));
    // Step 0 is nought, and the last is one: what it weighs goes to the right-hand side.
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
        // A light that flickers is wrong by a share of itself, and black a little, too.
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
    for (n, price) in (1..STEPS).zip(prices) {
        add([(n - 1, steps), (n, -2.0 * steps), (n + 1, steps)], *price);
    }
    let found = normal.cholesky()?.solve(&side);
    let inner = found.iter().take(STEPS - 1).copied();
    Some(std::iter::once(0.0).chain(inner).chain([1.0]).collect())
}

#[cfg(test)]
mod tests;
