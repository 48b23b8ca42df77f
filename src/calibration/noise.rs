//! Noise of one capture against the level of light, from repeated captures.

use serde::{Deserialize, Serialize};

use crate::frame::Plane;

/// Variance = `at_black` + `per_level` · light: read noise and shot noise of one channel of one
/// capture, in light (0..255), as an average over the field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Variance without light, squared grey levels.
    pub at_black: f32,
    /// Variance added by each grey level.
    pub per_level: f32,
}

impl Noise {
    /// Standard deviation at `light`, grey levels.
    pub fn sigma(&self, light: f32) -> f32 {
        (self.at_black + self.per_level * light).max(0.0).sqrt()
    }
}

/// The noise of two captures of the same picture (`first`, `second`: light, mixing undone), from
/// pixels with `trusted` = 1, by a line through the variance in 32 bins of light. `None` without
/// enough pixels.
pub fn fit(first: &Plane, second: &Plane, trusted: &Plane<u8>) -> Option<Noise> {
    const BINS: usize = 32;
    let mut bins = [(0.0f64, 0.0f64, 0.0f64); BINS];
    for ((&a, &b), &good) in first.data().iter().zip(second.data()).zip(trusted.data()) {
        let light = f64::from(a + b) / 2.0;
        if good == 0 || !(-32.0..288.0).contains(&light) {
            continue;
        }
        let bin = &mut bins[((light + 32.0) / 320.0 * BINS as f64) as usize % BINS];
        let difference = f64::from(a - b);
        *bin = (bin.0 + 1.0, bin.1 + light, bin.2 + difference * difference / 2.0);
    }
    // Weighted line: the variance of a variance from n pixels is 2·variance²/n.
    let (mut n, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (count, light, squared) in bins {
        // Thirty pixels tell a variance to a quarter; less is not worth a place in the line.
        if count < 30.0 || squared <= 0.0 {
            continue;
        }
        let (x, y) = (light / count, squared / count);
        let weight = count / (2.0 * y * y);
        (n, sx, sy) = (n + weight, sx + weight * x, sy + weight * y);
        (sxx, sxy) = (sxx + weight * x * x, sxy + weight * x * y);
    }
    if n <= 0.0 {
        // Captures that agree to the last bit have no noise of their own; too few pixels say
        // nothing.
        let told = bins.iter().any(|bin| bin.0 >= 30.0);
        return told.then_some(Noise { at_black: 0.0, per_level: 0.0 });
    }
    let spread = sxx - sx * sx / n;
    let slope = if spread > 1e-9 * sxx { ((sxy - sx * sy / n) / spread).max(0.0) } else { 0.0 };
    let at_black = ((sy - slope * sx) / n).max(0.0);
    Some(Noise { at_black: at_black as f32, per_level: slope as f32 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn read_and_shot_noise_are_told_apart() {
        let size = Size::new(256, 256);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
        let mut capture = || {
            Plane::from_fn(size, |x, _| {
                let bell: f32 = StandardNormal.sample(&mut random);
                x as f32 + (0.3 + 0.006 * x as f32).sqrt() * bell
            })
        };
        let (first, second) = (capture(), capture());
        let noise = fit(&first, &second, &Plane::filled(size, 1)).unwrap();
        assert!((noise.at_black - 0.3).abs() < 0.03, "{noise:?}");
        assert!((noise.per_level - 0.006).abs() < 0.0004, "{noise:?}");
        assert!(fit(&first, &second, &Plane::filled(size, 0)).is_none());
    }
}
