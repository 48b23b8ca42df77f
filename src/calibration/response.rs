//! A response curve through the readings of gradations: smooth, rising, from 0 to 255.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::curve::{Curve, CurveError};
use super::surface::{basis, place};

/// Knot intervals over the codes. Sixteen follow a gamma curve with a toe within 0.02 of 255 (guess, and
/// tested below).
const INTERVALS: usize = 16;
/// Penalty on the squared second differences, relative to one reading per coefficient (guess).
const BENDING: f64 = 1e-3;
/// Least rise from one code to the next, so that there is an inverse even where a panel crushes its blacks.
const RISE_MIN: f32 = 1e-3;

/// The curve nearest to `readings` of (code, counts, in any unit), scaled to 0 at code 0 and 255 at code
/// 255.
///
/// # Errors
/// When the readings do not rise from code 0 to code 255.
pub fn fit(readings: impl IntoIterator<Item = (u8, f64)>) -> Result<Curve, CurveError> {
    let unknowns = INTERVALS + 3;
    let mut matrix = DMatrix::<f64>::zeros(unknowns, unknowns);
    let mut side = DVector::<f64>::zeros(unknowns);
    let mut count = 0usize;
    for (code, value) in readings {
        let (segment, t, _) = place(f64::from(code), 0.0, 255.0, INTERVALS);
        let weights = basis(t);
        for (p, a) in weights.iter().enumerate() {
            side[segment + p] += a * value;
            for (q, b) in weights.iter().enumerate() {
                matrix[(segment + p, segment + q)] += a * b;
            }
        }
        count += 1;
    }
    let weight = BENDING * count as f64 / unknowns as f64 + 1e-12;
    for n in 0..unknowns - 2 {
        for (p, a) in [(n, 1.0), (n + 1, -2.0), (n + 2, 1.0)] {
            for (q, b) in [(n, 1.0), (n + 1, -2.0), (n + 2, 1.0)] {
                matrix[(p, q)] += weight * a * b;
            }
        }
    }
    let flat = CurveError::NotRising { code: 0, from: 0.0, to: 0.0 };
    let coefficients = Cholesky::new(matrix).ok_or(flat)?.solve(&side);
    let at = |code: f64| {
        let (segment, t, _) = place(code, 0.0, 255.0, INTERVALS);
        basis(t).iter().enumerate().map(|(k, b)| b * coefficients[segment + k]).sum::<f64>()
    };
    let (first, last) = (at(0.0), at(255.0));
    // Written so that a NaN fails too.
    let rises = last > first;
    if !rises {
        return Err(CurveError::NotRising { code: 0, from: first as f32, to: last as f32 });
    }
    let mut table: Vec<f32> =
        (0..256).map(|c| (255.0 * (at(f64::from(c)) - first) / (last - first)) as f32).collect();
    for code in 1..256 {
        table[code] = table[code].max(table[code - 1] + RISE_MIN);
    }
    Curve::try_from(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gamma_curve_with_a_toe_is_followed() {
        let truth = |c: f64| 255.0 * (0.98 * (c / 255.0).powf(2.2) + 0.02 * c / 255.0);
        // Errors of up to 0.2 of 255, as blocks in glare have.
        let wrong = |n: u64| (n * 2_654_435_761 % 1000) as f64 / 2500.0 - 0.2;
        let readings = (0..3 * 52u64).map(|n| {
            let code = (n % 52 * 5) as u8;
            (code, 3.0 * (truth(f64::from(code)) + wrong(n)) + 12.0)
        });
        let curve = fit(readings).unwrap();
        for code in 0..=255u8 {
            let error = f64::from(curve.light(code)) - truth(f64::from(code));
            assert!(error.abs() < 0.15, "code {code}: {error}");
        }
    }

    #[test]
    fn a_panel_that_does_not_answer_has_no_curve() {
        assert!(fit((0..=255).map(|c| (c, 7.0))).is_err());
        assert!(fit((0..=255).map(|c| (c, -f64::from(c)))).is_err());
        assert!(fit(std::iter::empty()).is_err());
    }
}
