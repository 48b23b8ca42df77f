//! Shrinkage for a prior with heavier tails than |v|: details of photographs are distributed as
//! exp(−|v|^p) with p of 0.5 to 0.8 (Krishnan & Fergus 2009, "Fast image deconvolution using
//! hyper-Laplacian priors").
//!
//! With p = 2/3 the minimiser of ½(x − v)² + λ|x|^p is 0 up to |v| = 2(2λ/3)^¾, and beyond the
//! larger root of x = |v| − λp·x^(p−1). λ is such that details up to the threshold vanish, as in
//! soft thresholding; what is larger is drawn the less, the larger it is.

use crate::frame::Plane;

/// Rounds of x ← |v| − λp·x^(p−1) from |v|. At the threshold, where it converges slowest, the tenth
/// changes x by less than 2 %.
const ROUNDS: usize = 10;

/// Draws all of `band` by `threshold`.
pub(super) fn draw(band: &mut Plane, threshold: f32) {
    if threshold > 0.0 {
        band.data_mut().iter_mut().for_each(|value| *value = drawn(*value, threshold));
    }
}

fn drawn(value: f32, threshold: f32) -> f32 {
    let size = value.abs();
    if size <= threshold {
        return 0.0;
    }
    // λp with λ = 3/2·(t/2)^(4/3).
    let half = 0.5 * threshold;
    let pull = half * half.cbrt();
    let mut x = size;
    for _ in 0..ROUNDS {
        x = size - pull / x.cbrt();
    }
    x.copysign(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The minimiser among many.
    fn searched(value: f64, threshold: f64) -> f64 {
        let lambda = 1.5 * (threshold / 2.0).powf(4.0 / 3.0);
        let cost = |x: f64| 0.5 * (x - value).powi(2) + lambda * x.abs().powf(2.0 / 3.0);
        let places = (0..=20_000).map(|n| f64::from(n) * 1e-3);
        places.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or_default()
    }

    #[test]
    fn it_is_the_minimiser() {
        for value in [0.5, 1.9, 2.2, 3.0, 5.0, 12.0] {
            let (found, wanted) = (f64::from(drawn(value, 2.0)), searched(f64::from(value), 2.0));
            assert!((found - wanted).abs() < 0.02, "{value}: {found}, searched {wanted}");
            assert!(drawn(-value, 2.0) == -drawn(value, 2.0));
        }
    }

    #[test]
    fn large_details_are_drawn_less_than_small_ones() {
        let lost = |value: f32| value - drawn(value, 2.0);
        assert!(lost(3.0) > lost(6.0) && lost(6.0) > lost(50.0) && lost(50.0) < 0.5);
    }
}
