//! The expected code of light with a camera's noise.
//!
//! A JPEG's quantisation steps are so long that codes of noisy light are averaged before they are
//! rounded. In the dark the mean code is not the code of the mean: noise below black is clipped,
//! and the curve bends most there. The expected code is ē(l) = ∫ enc(max(l + σ(l) z, 0)) φ(z) dz.

use crate::frame::{at_step, step_of};

/// Intervals between the samples of ē over light, spaced as squares: dense in the dark.
const PLACES: usize = 4096;
/// Intervals between the samples of the inverse of ē over codes.
const CODES: usize = 2048;
/// Largest code, and full scale of light.
const TOP: f32 = 255.0;
/// Range of the integral on either side, noise σ.
const REACH: i32 = 4;
/// Samples of the integral for each σ.
const PARTS: i32 = 20;
/// Samples to either side over which the slope is taken.
const BESIDE: usize = 16;

/// Expected code ē, 0..255, as a function of light 0..255, and its inverse.
#[derive(Debug, Clone)]
pub(super) struct CodeCurve {
    /// ē at each sample.
    codes: Vec<f32>,
    /// σ of the code at each sample.
    deviations: Vec<f32>,
    /// Light of each sampled code, extrapolated beyond black and full scale.
    light: Vec<f32>,
}

impl CodeCurve {
    /// Creates the curve of a camera whose 256 codes decode to `light` (rising) and whose noise σ
    /// at a light is `sigma`, both in grey levels; `None` for another number of codes.
    pub(super) fn new(light: &[f32], sigma: &dyn Fn(f32) -> f32) -> Option<CodeCurve> {
        if light.len() != TOP as usize + 1 {
            return None;
        }
        let plain: Vec<f32> = (0..=PLACES).map(|place| step_of(light, light_at(place))).collect();
        let weights: Vec<(f32, f32)> = (-REACH * PARTS..=REACH * PARTS)
            .map(|n| n as f32 / PARTS as f32)
            .map(|z| (z, (-0.5 * z * z).exp()))
            .collect();
        let total: f32 = weights.iter().map(|(_, weight)| weight).sum();
        let (mut codes, mut deviations) = (Vec::new(), Vec::new());
        for place in 0..=PLACES {
            let (light, mut highest) = (light_at(place), 0.0f32);
            let noise = sigma(light);
            let seen = |z: f32| at_step(&plain, place_of(light + noise * z));
            let mean = weights.iter().map(|&(z, weight)| weight * seen(z)).sum::<f32>() / total;
            let square =
                weights.iter().map(|&(z, weight)| weight * (seen(z) - mean).powi(2)).sum::<f32>();
            highest = highest.max(codes.last().copied().unwrap_or(0.0));
            codes.push(mean.max(highest));
            deviations.push((square / total).sqrt());
        }
        let mut curve = CodeCurve { codes, deviations, light: Vec::new() };
        curve.light = (0..=CODES).map(|n| curve.invert(TOP * n as f32 / CODES as f32)).collect();
        Some(curve)
    }

    /// The light whose expected code is `code`, extrapolated along the slope beyond the ends.
    fn invert(&self, code: f32) -> f32 {
        let [first, last] = [self.codes[0], self.codes[PLACES]];
        if code < first {
            return (code - first) / self.slope(0.0);
        }
        if code >= last {
            return TOP + (code - last) / self.slope(TOP);
        }
        let above = self.codes.partition_point(|&v| v <= code).clamp(1, PLACES);
        let (low, high) = (self.codes[above - 1], self.codes[above]);
        let share = ((code - low) / (high - low).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        light_at(above - 1) + share * (light_at(above) - light_at(above - 1))
    }

    /// Expected code ē of `light`, within 0..255.
    #[inline(always)]
    pub(super) fn encode(&self, light: f32) -> f32 {
        at_step(&self.codes, place_of(light))
    }

    /// The light of `code`: the inverse of [`CodeCurve::encode`].
    #[inline(always)]
    pub(super) fn decode(&self, code: f32) -> f32 {
        at_step(&self.light, code.clamp(0.0, TOP) * (CODES as f32 / TOP))
    }

    /// σ of the code of `light`.
    pub(super) fn deviation(&self, light: f32) -> f32 {
        at_step(&self.deviations, place_of(light))
    }

    /// Slope ē′ at `light`, codes per grey level.
    pub(super) fn slope(&self, light: f32) -> f32 {
        let place = place_of(light) as usize;
        let (low, high) = (place.saturating_sub(BESIDE), (place + BESIDE).min(PLACES));
        // Where the curve is flat a code determines no light; the slope is at least a code per
        // thousand grey levels.
        ((self.codes[high] - self.codes[low]) / (light_at(high) - light_at(low))).max(1e-3)
    }
}

fn light_at(place: usize) -> f32 {
    TOP * (place as f32 / PLACES as f32).powi(2)
}

/// Index of the sample at `light`, with its fraction.
#[inline(always)]
fn place_of(light: f32) -> f32 {
    (light.clamp(0.0, TOP) / TOP).sqrt() * PLACES as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Light as the square of the code.
    fn squares() -> Vec<f32> {
        (0..256).map(|code| (code as f32).powi(2) / TOP).collect()
    }

    #[test]
    fn expected_codes_are_the_mean_of_noisy_codes() {
        let curve = CodeCurve::new(&squares(), &|light: f32| 0.8 + 0.01 * light).unwrap();
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(6);
        for light in [0.0f32, 0.3, 2.0, 20.0, 150.0] {
            let sigma = 0.8 + 0.01 * light;
            let codes: Vec<f64> = (0..100_000)
                .map(|_| {
                    let noise: f32 = StandardNormal.sample(&mut random);
                    f64::from(((light + sigma * noise).max(0.0) * TOP).sqrt())
                })
                .collect();
            let mean = codes.iter().sum::<f64>() / codes.len() as f64;
            let square = codes.iter().map(|code| (code - mean).powi(2)).sum::<f64>();
            let deviation = (square / codes.len() as f64).sqrt();
            assert!((f64::from(curve.encode(light)) - mean).abs() < 0.1, "{light}: {mean}");
            assert!((f64::from(curve.deviation(light)) / deviation - 1.0).abs() < 0.03, "{light}");
            assert!((curve.decode(curve.encode(light)) - light).abs() < 0.05, "{light}");
        }
        assert!(curve.decode(0.0) < -0.2, "black is the code of light below the noise");
    }

    #[test]
    fn without_noise_expected_codes_are_the_curve() {
        let light = squares();
        let curve = CodeCurve::new(&light, &|_| 0.0).unwrap();
        for (code, &light) in light.iter().enumerate() {
            assert!((curve.encode(light) - code as f32).abs() < 0.02, "{code}");
            assert!((curve.decode(code as f32) - light).abs() < 0.02, "{code}");
        }
        assert!(CodeCurve::new(&light[1..], &|_| 0.0).is_none());
    }
}
