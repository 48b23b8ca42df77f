//! Panel response of one channel: a table code ↦ light, and its exact inverse.

use serde::{Deserialize, Serialize};

use crate::frame::{at_step, step_of};

/// Why a table is not a response curve.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct CurveError(String);

impl CurveError {
    /// The error for light that does not increase from `code` (light `from`) to the next (`to`).
    pub(super) fn not_rising(code: usize, from: f32, to: f32) -> CurveError {
        CurveError(format!(
            "light does not increase from code {code} to the next ({from} to {to}); a panel's \
             response must rise"
        ))
    }
}

/// Strictly increasing light (0..255, black subtracted) of the 256 codes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f32>", into = "Vec<f32>")]
pub struct ResponseCurve {
    light: Vec<f32>,
}

impl TryFrom<Vec<f32>> for ResponseCurve {
    type Error = CurveError;

    fn try_from(light: Vec<f32>) -> Result<Self, CurveError> {
        if light.len() != 256 {
            let found = format!("a response curve of {} entries; 256 are allowed", light.len());
            return Err(CurveError(found));
        }
        for (code, pair) in light.windows(2).enumerate() {
            // Negated so that NaN fails too.
            let rises = pair[1] > pair[0];
            if !rises || !pair[1].is_finite() {
                return Err(CurveError::not_rising(code, pair[0], pair[1]));
            }
        }
        Ok(ResponseCurve { light })
    }
}

impl From<ResponseCurve> for Vec<f32> {
    fn from(curve: ResponseCurve) -> Self {
        curve.light
    }
}

impl ResponseCurve {
    /// The curve of a panel whose light equals its code.
    pub fn linear() -> ResponseCurve {
        ResponseCurve { light: (0..256).map(|c| c as f32).collect() }
    }

    /// Light of each code, 256 entries.
    pub fn table(&self) -> &[f32] {
        &self.light
    }

    /// Light of `code`.
    pub fn light(&self, code: u8) -> f32 {
        self.light[usize::from(code)]
    }

    /// The fractional code (0.0..=255.0) of `light`, clamped to the ends: the exact inverse of
    /// linear interpolation.
    pub fn code(&self, light: f32) -> f32 {
        step_of(&self.light, light)
    }
}

/// [`ResponseCurve::code`] for many values, by a table uniform in the square root of light, which
/// spaces codes about evenly. Accurate to a fiftieth of a code, without branches.
#[derive(Debug, Clone)]
pub struct Inverse {
    /// Fractional code at each step of √light.
    codes: Vec<f32>,
    last: f32,
}

/// Steps of the table, about sixteen per code.
const STEPS: usize = 4096;

impl Inverse {
    /// The inverse of `curve`.
    pub fn new(curve: &ResponseCurve) -> Inverse {
        let last = curve.light[255].max(f32::MIN_POSITIVE);
        let code = |n: usize| {
            let root = n as f32 / STEPS as f32;
            curve.code(last * root * root)
        };
        Inverse { codes: (0..=STEPS).map(code).collect(), last }
    }

    /// Replaces each light in `values` by its fractional code; NaN becomes code 0.
    pub fn apply(&self, values: &mut [f32]) {
        let per_light = 1.0 / self.last;
        for value in values {
            // `max` comes first: it turns NaN into zero.
            let place = (value.max(0.0) * per_light).min(1.0).sqrt() * STEPS as f32;
            *value = at_step(&self.codes, place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_inverts_light() {
        let table: Vec<f32> =
            (0..256).map(|c| 255.0 * (c as f32 / 255.0).powf(2.2) + 0.01 * c as f32).collect();
        let curve = ResponseCurve::try_from(table).unwrap();
        for code in 0..=255u8 {
            assert!((curve.code(curve.light(code)) - f32::from(code)).abs() < 1e-4);
        }
        assert_eq!(curve.code(-3.0), 0.0);
        assert_eq!(curve.code(1e9), 255.0);
        let half = (curve.light(99) + curve.light(100)) / 2.0;
        assert!((curve.code(half) - 99.5).abs() < 1e-3);
    }

    #[test]
    fn the_fast_inverse_equals_the_exact_one() {
        for power in [1.0f32, 1.8, 2.4] {
            let table: Vec<f32> = (0..256)
                .map(|c| 255.0 * (c as f32 / 255.0).powf(power) + 0.002 * c as f32)
                .collect();
            let curve = ResponseCurve::try_from(table).unwrap();
            let mut values: Vec<f32> = (-200..52_200).map(|n| n as f32 * 0.005).collect();
            let plain: Vec<f32> = values.iter().map(|&v| curve.code(v)).collect();
            Inverse::new(&curve).apply(&mut values);
            for (fast, plain) in values.iter().zip(&plain) {
                assert!((fast - plain).abs() < 0.02, "{fast} {plain}");
            }
            let mut odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
            Inverse::new(&curve).apply(&mut odd);
            assert_eq!(odd, [0.0, 255.0, 0.0]);
        }
    }

    #[test]
    fn a_flat_or_broken_table_is_refused() {
        let mut table: Vec<f32> = (0..256).map(|c| c as f32).collect();
        table[7] = table[6];
        let refused = ResponseCurve::try_from(table.clone()).unwrap_err().to_string();
        assert!(refused.contains("from code 6 to the next (6 to 6)"), "{refused}");
        table[7] = f32::NAN;
        assert!(ResponseCurve::try_from(table).is_err());
        let refused = ResponseCurve::try_from(vec![0.0; 3]).unwrap_err().to_string();
        assert_eq!(refused, "a response curve of 3 entries; 256 are allowed");
    }
}
