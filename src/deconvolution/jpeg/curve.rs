//! What codes a camera gives of light, noise included.
//!
//! A JPEG's steps are so long that noise is averaged before it is rounded, and what is averaged are
//! codes. In the dark that is not the code of the average: noise below black is clipped, and the
//! curve bends most there. So light has the code to expect of it,
//! ē(l) = ∫ enc(max(l + σ(l) z, 0)) φ(z) dz.

/// Places at which codes of light are kept; they lie as squares, dense in the dark.
const PLACES: usize = 4096;
/// Places at which light of codes is kept.
const CODES: usize = 2048;
/// Largest code, and full scale of light.
const TOP: f32 = 255.0;
/// Standard deviations of noise that are summed over, on either side, in so many parts each.
const REACH: i32 = 4;
const PARTS: i32 = 20;
/// Places to either side over which the slope is taken.
const BESIDE: usize = 16;

/// Codes 0..255 of light 0..255.
#[derive(Debug, Clone)]
pub(super) struct CodeCurve {
    /// ē at each place.
    codes: Vec<f32>,
    /// Standard deviation of the code there.
    deviations: Vec<f32>,
    /// Light of each part of a code; beyond black and full scale as the curve goes there.
    light: Vec<f32>,
}

impl CodeCurve {
    /// The curve of a camera whose codes have the light `light`, which rises, and whose noise at a
    /// light is `sigma`, both grey levels; none if there are not 256 codes.
    pub(super) fn new(light: &[f32], sigma: &dyn Fn(f32) -> f32) -> Option<CodeCurve> {
        if light.len() != TOP as usize + 1 {
            return None;
        }
        let plain: Vec<f32> = (0..=PLACES).map(|place| code_of(light, light_at(place))).collect();
        let weights: Vec<(f32, f32)> = (-REACH * PARTS..=REACH * PARTS)
            .map(|n| n as f32 / PARTS as f32)
            .map(|z| (z, (-0.5 * z * z).exp()))
            .collect();
        let total: f32 = weights.iter().map(|(_, weight)| weight).sum();
        let (mut codes, mut deviations) = (Vec::new(), Vec::new());
        for place in 0..=PLACES {
            let (light, mut highest) = (light_at(place), 0.0f32);
            let noise = sigma(light);
            let seen = |z: f32| between(&plain, place_of(light + noise * z));
            let mean = weights.iter().map(|&(z, weight)| weight * seen(z)).sum::<f32>() / total;
            let square =
                weights.iter().map(|&(z, weight)| weight * (seen(z) - mean).powi(2)).sum::<f32>();
            highest = highest.max(codes.last().copied().unwrap_or(0.0));
            codes.push(mean.max(highest));
            deviations.push((square / total).sqrt());
        }
        let mut curve = CodeCurve { codes, deviations, light: Vec::new() };
        curve.light = (0..=CODES).map(|n| curve.undone(TOP * n as f32 / CODES as f32)).collect();
        Some(curve)
    }

    /// The light whose code to expect is `code`; beyond the ends along the slope there.
    fn undone(&self, code: f32) -> f32 {
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

    /// ē of `light`, within 0..255.
    #[inline(always)]
    pub(super) fn encode(&self, light: f32) -> f32 {
        between(&self.codes, place_of(light))
    }

    /// The light of `code`, of which [`CodeCurve::encode`] makes it again.
    #[inline(always)]
    pub(super) fn decode(&self, code: f32) -> f32 {
        between(&self.light, code.clamp(0.0, TOP) * (CODES as f32 / TOP))
    }

    /// Standard deviation of the code of `light`.
    pub(super) fn deviation(&self, light: f32) -> f32 {
        between(&self.deviations, place_of(light))
    }

    /// ē': codes a grey level of light at `light`.
    pub(super) fn slope(&self, light: f32) -> f32 {
        let place = place_of(light) as usize;
        let (low, high) = (place.saturating_sub(BESIDE), (place + BESIDE).min(PLACES));
        // Where the curve is flat, no light is known of a code; a thousand levels are as none.
        ((self.codes[high] - self.codes[low]) / (light_at(high) - light_at(low))).max(1e-3)
    }
}

/// The light at a place.
fn light_at(place: usize) -> f32 {
    TOP * (place as f32 / PLACES as f32).powi(2)
}

/// The place of `light`, fractions kept.
#[inline(always)]
fn place_of(light: f32) -> f32 {
    (light.clamp(0.0, TOP) / TOP).sqrt() * PLACES as f32
}

/// What `table` has at a place between its entries.
#[inline(always)]
fn between(table: &[f32], at: f32) -> f32 {
    let below = (at as usize).min(table.len() - 2);
    table[below] + (at - below as f32) * (table[below + 1] - table[below])
}

/// The code of `wanted`, fractions kept, by the `light` of codes.
fn code_of(light: &[f32], wanted: f32) -> f32 {
    let above = light.partition_point(|&v| v <= wanted);
    let (Some(below), Some(&high)) = (above.checked_sub(1), light.get(above)) else {
        return if above == 0 { 0.0 } else { TOP };
    };
    below as f32 + (wanted - light[below]) / (high - light[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Light goes as the square of the code.
    fn squares() -> Vec<f32> {
        (0..256).map(|code| (code as f32).powi(2) / TOP).collect()
    }

    #[test]
    fn codes_to_expect_are_the_mean_of_codes_with_noise() {
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
        assert!(curve.decode(0.0) < -0.2, "darker than noise makes black");
    }

    #[test]
    fn without_noise_codes_are_the_curves() {
        let light = squares();
        let curve = CodeCurve::new(&light, &|_| 0.0).unwrap();
        for (code, &light) in light.iter().enumerate() {
            assert!((curve.encode(light) - code as f32).abs() < 0.02, "{code}");
            assert!((curve.decode(code as f32) - light).abs() < 0.02, "{code}");
        }
        assert!(CodeCurve::new(&light[1..], &|_| 0.0).is_none());
    }
}
