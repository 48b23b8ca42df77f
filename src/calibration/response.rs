//! Fit of a response curve to readings of gradations: smooth, increasing, from 0 to 255.

use nalgebra::{Cholesky, DMatrix, DVector, SMatrix, SVector};

use super::cross_channel::BlockReading;
use super::curve::{CurveError, ResponseCurve};
use super::surface::{KnotPosition, add_squared, basis, place, second_difference};

/// Knot intervals over the codes. Given readings with errors of up to 0.2 of 255, they follow a
/// gamma curve with a toe to 0.15 (tested below).
const INTERVALS: usize = 16;
/// Penalty on the squared second differences, relative to one reading per coefficient (guess).
const BENDING: f64 = 1e-3;
/// Least increase from one code to the next; ensures an inverse even if a panel crushes blacks.
const RISE_MIN: f32 = 1e-3;

/// Fits the curve to `readings` of (code, counts in any unit), scaled to 0 at code 0 and 255 at
/// code 255.
///
/// # Errors
/// When the readings do not increase from code 0 to code 255.
pub fn fit(readings: impl IntoIterator<Item = (u8, f64)>) -> Result<ResponseCurve, CurveError> {
    let unknowns = INTERVALS + 3;
    let mut matrix = DMatrix::<f64>::zeros(unknowns, unknowns);
    let mut side = DVector::<f64>::zeros(unknowns);
    let mut count = 0usize;
    for (code, value) in readings {
        let KnotPosition { segment, t, .. } = place(f64::from(code), 0.0, 255.0, INTERVALS);
        let weights = basis(t);
        let terms: [_; 4] = std::array::from_fn(|k| (segment + k, weights[k]));
        terms.iter().for_each(|(p, weight)| side[*p] += weight * value);
        add_squared(&mut matrix, &terms, 1.0);
        count += 1;
    }
    let weight = BENDING * count as f64 / unknowns as f64 + 1e-12;
    for n in 0..unknowns - 2 {
        add_squared(&mut matrix, &second_difference(n, 1), weight);
    }
    let flat = || CurveError::not_rising(0, 0.0, 0.0);
    let coefficients = Cholesky::new(matrix).ok_or_else(flat)?.solve(&side);
    let at = |code: f64| {
        let KnotPosition { segment, t, .. } = place(code, 0.0, 255.0, INTERVALS);
        basis(t).iter().enumerate().map(|(k, b)| b * coefficients[segment + k]).sum::<f64>()
    };
    let (first, last) = (at(0.0), at(255.0));
    // Negated so that NaN fails too.
    let rises = last > first;
    if !rises {
        return Err(CurveError::not_rising(0, first as f32, last as f32));
    }
    let mut table: Vec<f32> =
        (0..256).map(|c| (255.0 * (at(f64::from(c)) - first) / (last - first)) as f32).collect();
    for code in 1..256 {
        table[code] = table[code].max(table[code - 1] + RISE_MIN);
    }
    ResponseCurve::try_from(table)
}

/// Rounds of [`among_neighbours`]; each removes most of the remaining error.
const NEIGHBOUR_ROUNDS: usize = 3;

/// Fits the curve of `channel` to readings of shuffled blocks without the light that blur and glare
/// add from neighbouring blocks. Counts are regressed on the block's own light, the neighbours'
/// light, and both times the squared field, as a lens blurs its corners more; all but the own
/// light's term are subtracted. Shuffling alone would only turn the neighbours' light into noise.
///
/// # Errors
/// When the readings do not increase from code 0 to code 255.
pub fn among_neighbours(
    channel: usize,
    readings: &[BlockReading],
) -> Result<ResponseCurve, CurveError> {
    let mut curve = fit(readings.iter().map(|r| (r.code, r.counts[channel])))?;
    for _ in 0..NEIGHBOUR_ROUNDS {
        let terms = |r: &BlockReading| {
            let own = f64::from(curve.light(r.code));
            let count = r.around.len().max(1) as f64;
            let around = r.around.iter().map(|&c| f64::from(curve.light(c))).sum::<f64>() / count;
            SVector::<f64, 5>::from([1.0, own, around, r.field * own, r.field * around])
        };
        let mut matrix = SMatrix::<f64, 5, 5>::zeros();
        let mut side = SVector::<f64, 5>::zeros();
        for r in readings {
            let terms = terms(r);
            matrix += terms * terms.transpose();
            side += r.counts[channel] * terms;
        }
        let Some(factor) = matrix.cholesky() else { break };
        let mut spread = factor.solve(&side);
        (spread[0], spread[1]) = (0.0, 0.0);
        let cleared: Vec<(u8, f64)> =
            readings.iter().map(|r| (r.code, r.counts[channel] - spread.dot(&terms(r)))).collect();
        curve = fit(cleared)?;
    }
    Ok(curve)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn light_from_neighbouring_blocks_is_removed() {
        let truth = |c: u8| 255.0 * (f64::from(c) / 255.0).powf(2.2);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
        let readings: Vec<BlockReading> = (0..800u64)
            .map(|n| {
                let mut code = || random.random::<u8>() / 5 * 5;
                let around: Vec<u8> = (0..8).map(|_| code()).collect();
                let light = around.iter().map(|&c| truth(c)).sum::<f64>() / 8.0;
                let field = (n % 29) as f64 / 28.0;
                let share = 0.02 + 0.06 * field;
                let own = code();
                let counts = 3.0 * ((1.0 - share) * truth(own) + share * light);
                BlockReading { code: own, around, field, counts: [counts; 3] }
            })
            .collect();
        let worst = |curve: &ResponseCurve| {
            (0..=255u8).map(|c| (f64::from(curve.light(c)) - truth(c)).abs()).fold(0.0, f64::max)
        };
        let plain = fit(readings.iter().map(|r| (r.code, r.counts[0]))).unwrap();
        let cleared = among_neighbours(0, &readings).unwrap();
        println!("worst {:.3} before, {:.3} after", worst(&plain), worst(&cleared));
        // Half the allowed error of a calibration.
        assert!(worst(&cleared) < 0.25 && worst(&cleared) < worst(&plain) / 4.0);
    }

    #[test]
    fn a_gamma_curve_with_a_toe_is_fitted() {
        let truth = |c: f64| 255.0 * (0.98 * (c / 255.0).powf(2.2) + 0.02 * c / 255.0);
        // Errors of up to 0.2 of 255 grey levels, as glare causes them.
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
    fn a_panel_that_does_not_respond_has_no_curve() {
        assert!(fit((0..=255).map(|c| (c, 7.0))).is_err());
        assert!(fit((0..=255).map(|c| (c, -f64::from(c)))).is_err());
        assert!(fit(std::iter::empty()).is_err());
    }
}
