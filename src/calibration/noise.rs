//! Noise of one capture as a function of light, from repeated captures.

use serde::{Deserialize, Serialize};

use crate::frame::{Plane, Rect};

/// Variance = `at_black` + `per_level` · light: read and shot noise of one channel of one capture,
/// in light (0..255), averaged over the field.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Variance without light, squared grey levels.
    pub at_black: f32,
    /// Variance per grey level.
    pub per_level: f32,
}

impl Noise {
    /// Standard deviation at `light`, grey levels.
    pub fn sigma(&self, light: f32) -> f32 {
        (self.at_black + self.per_level * light).max(0.0).sqrt()
    }

    /// The noise with `black` times the variance without light, `light` times that per grey level.
    pub fn times(&self, [black, light]: [f32; 2]) -> Noise {
        Noise { at_black: black * self.at_black, per_level: light * self.per_level }
    }

    /// Light whose shot noise equals the read noise, grey levels; infinite if noise does not depend
    /// on light.
    pub fn dark_light(&self) -> f32 {
        if self.per_level > 0.0 { self.at_black / self.per_level } else { f32::INFINITY }
    }
}

/// Fits the noise to two captures of one picture (`first`, `second`: unmixed light), from pixels
/// with `trusted` = 1 in `flat` areas, by a line through the variance in 32 bins of light. `None`
/// without enough pixels.
///
/// Drift of the panel changes edges, and its flicker a whole area; neither is noise. Hence only
/// flat areas count, and the mean difference of each area is removed.
pub fn fit(first: &Plane, second: &Plane, trusted: &Plane<u8>, flat: &[Rect]) -> Option<Noise> {
    const BINS: usize = 32;
    let mut bins = [(0.0f64, 0.0f64, 0.0f64); BINS];
    for place in flat {
        let mut pairs = Vec::with_capacity(place.size.area());
        for y in place.rows().filter(|&y| y < first.height()) {
            for x in place.columns().filter(|&x| x < first.width()) {
                let (a, b) = (f64::from(first.at(x, y)), f64::from(second.at(x, y)));
                if trusted.at(x, y) != 0 && (-32.0..288.0).contains(&((a + b) / 2.0)) {
                    pairs.push(((a + b) / 2.0, a - b));
                }
            }
        }
        if pairs.len() < 2 {
            continue;
        }
        let count = pairs.len() as f64;
        let light = pairs.iter().map(|(light, _)| light).sum::<f64>();
        let mean = pairs.iter().map(|(_, difference)| difference).sum::<f64>() / count;
        let squares = pairs.iter().map(|(_, difference)| (difference - mean).powi(2)).sum::<f64>();
        let bin = &mut bins[((light / count + 32.0) / 320.0 * BINS as f64) as usize % BINS];
        // The mean takes one degree of freedom.
        let variance = squares / (2.0 * (count - 1.0));
        *bin = (bin.0 + count, bin.1 + light, bin.2 + count * variance);
    }
    // Weighted line: the variance of a variance from n pixels is 2·variance²/n.
    let (mut n, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (count, light, squared) in bins {
        // Thirty pixels determine a variance to a quarter.
        if count < 30.0 || squared <= 0.0 {
            continue;
        }
        let (x, y) = (light / count, squared / count);
        let weight = count / (2.0 * y * y);
        (n, sx, sy) = (n + weight, sx + weight * x, sy + weight * y);
        (sxx, sxy) = (sxx + weight * x * x, sxy + weight * x * y);
    }
    if n <= 0.0 {
        // Identical captures have no noise; too few pixels give no estimate.
        let is_measured = bins.iter().any(|bin| bin.0 >= 30.0);
        return is_measured.then_some(Noise { at_black: 0.0, per_level: 0.0 });
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

    /// Two captures of columns of light with known noise, and the areas between the columns' edges.
    /// The second is brighter by the share `brighter` and, if `moved`, half a pixel to the side.
    fn captures(brighter: f32, moved: bool) -> ([Plane; 2], Vec<Rect>) {
        let size = Size::new(256, 256);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(11);
        let mut capture = |times: f32, moved: bool| {
            Plane::from_fn(size, |x, _| {
                let bell: f32 = StandardNormal.sample(&mut random);
                let step = |x: usize| (x / 16 * 16) as f32;
                let to = if moved { 0.5 * (step(x) + step(x + 1)) } else { step(x) };
                times * to + (0.3 + 0.006 * to).sqrt() * bell
            })
        };
        let pair = [capture(1.0, false), capture(1.0 + brighter, moved)];
        let places = (0..16).flat_map(|column| (0..16).map(move |row| (16 * column, 16 * row)));
        let place = |(x, y): (usize, usize)| Rect { x: x + 2, y, size: Size::new(12, 16) };
        (pair, places.map(place).collect())
    }

    #[test]
    fn read_and_shot_noise_are_separated() {
        for (brighter, moved) in [(0.0, false), (0.006, true)] {
            let ([first, second], flat) = captures(brighter, moved);
            let noise = fit(&first, &second, &Plane::filled(first.size(), 1), &flat).unwrap();
            assert!((noise.at_black - 0.3).abs() < 0.03, "{noise:?}");
            assert!((noise.per_level - 0.006).abs() < 0.0004, "{noise:?}");
            assert!(fit(&first, &second, &Plane::filled(first.size(), 0), &flat).is_none());
        }
    }
}
