//! Expected value of a coefficient that a JPEG determines to within half a step.

/// Distance of an interval's end from the mean beyond which its tail is negligible, σ.
const FAR: f32 = 8.0;
/// Width below which an interval is treated as a point, σ.
const NARROW: f32 = 0.05;

/// Mean of a normal variable of mean 0 and σ `spread`, truncated to `offset` ± `half`.
#[inline(always)]
pub(super) fn truncated_mean(offset: f32, half: f32, spread: f32) -> f32 {
    let distance = offset.abs();
    let (near, far) = ((distance - half) / spread, (distance + half) / spread);
    if near < -FAR {
        return 0.0;
    }
    let mean = if near > FAR {
        near + 1.0 / near
    } else if far - near < NARROW {
        distance / spread
    } else {
        let (far_ratio, fallen) = (mills(far), (-0.5 * (far - near) * (far + near)).exp());
        if near >= 0.0 {
            (1.0 - fallen) / (mills(near) - fallen * far_ratio)
        } else {
            // 1/√2π, the density's height.
            let density = 0.398_942_3 * (-0.5 * near * near).exp();
            density * (1.0 - fallen) / (1.0 - density * (fallen * far_ratio + mills(-near)))
        }
    };
    (spread * mean).copysign(offset)
}

/// (1 − Φ(x))/φ(x) for x ≥ 0: Abramowitz & Stegun 1964, the polynomial 26.2.17 and, where that is
/// small itself, the continued fraction 26.2.14.
#[inline(always)]
fn mills(x: f32) -> f32 {
    if x > 3.0 {
        return 1.0 / (x + 1.0 / (x + 2.0 / (x + 3.0 / (x + 4.0 / (x + 5.0 / x)))));
    }
    let t = 1.0 / (1.0 + 0.231_641_9 * x);
    t * (0.319_381_53
        + t * (-0.356_563_78 + t * (1.781_477_9 + t * (-1.821_255_9 + t * 1.330_274_4))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The truncated mean, by a sum over the interval.
    fn summed(offset: f64, half: f64, spread: f64) -> f64 {
        let (count, from) = (20_000, offset - half);
        let at = |n: usize| from + 2.0 * half * (n as f64 + 0.5) / count as f64;
        // Relative to the least exponent, so that not all weights vanish.
        let least = (0..count).map(|n| (at(n) / spread).powi(2)).fold(f64::INFINITY, f64::min);
        let weight = |x: f64| (-0.5 * ((x / spread).powi(2) - least)).exp();
        let total: f64 = (0..count).map(|n| weight(at(n))).sum();
        (0..count).map(|n| at(n) * weight(at(n))).sum::<f64>() / total
    }

    #[test]
    fn the_truncated_mean_is_that_of_a_sum_over_the_interval() {
        for spread in [0.3f32, 1.0, 4.0] {
            for half in [0.5f32, 1.0, 5.0, 20.0] {
                for offset in [-60.0f32, -9.0, -3.0, -0.4, 0.0, 0.2, 1.0, 5.0, 14.0, 40.0] {
                    let found = f64::from(truncated_mean(offset, half, spread));
                    let want = summed(offset.into(), half.into(), spread.into());
                    let most = 0.004 * f64::from(spread) + 0.003 * want.abs();
                    assert!(
                        (found - want).abs() < most,
                        "{offset} ± {half}, {spread}: {found} for {want}"
                    );
                }
            }
        }
    }
}
