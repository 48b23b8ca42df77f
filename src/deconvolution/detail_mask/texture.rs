//! Faint texture that shrinkage has removed, found in the residual of the photo.
//!
//! Where a picture explains the photo, the residual is white noise, and means over cells of 4×4
//! pixels vary no more than noise does. Where shrinkage removed a texture, its blurred image
//! remains in the residual, and they vary more; the thresholds of the finest levels are lowered
//! there. Residuals beside strong details have other causes while the iteration has not converged,
//! and residuals larger than a faint texture's mean that the lens model is wrong: both are
//! excluded.

use super::{DetailMask, NoisyPlane, block_sums, cell_variances, halve_by_max, noise_ratios};
use crate::deconvolution::data_term::{NOISE_MIN, TRUSTED};
use crate::frame::Plane;

// All six were set together on ten scenes through two lenses (`tests/tables/constants.md`).

/// Cell variance of the residual over noise variance above which thresholds are lowered; noise
/// alone has 1 ± 0.2.
const DRAWN_AWAY: f32 = 1.1;
/// Cell variance over noise variance from which on thresholds are lowered fully.
const ALL_DRAWN_AWAY: f32 = 1.5;
/// Cell variance over noise variance, beyond that of a faint texture, above which the lowering
/// fades.
const TOO_MUCH: f32 = 1.8;
/// Cell variance over noise variance from which on thresholds are not lowered.
const NO_TEXTURE: f32 = 2.5;
/// Ratio of the photo's local variance to its noise variance up to which a texture is faint.
const FAINT: f32 = 300.0;
/// Ratio of the photo's local variance to its noise variance from which the residual has other
/// causes than a removed texture.
const STRONG: f32 = 1000.0;

impl DetailMask {
    /// The mask with the thresholds of level l, 0 the finest, lowered to as little as `least[l]` of
    /// themselves where a texture of the photo of `planes` was removed, given the `residuals` of
    /// its channels in grey levels.
    ///
    /// # Panics
    /// When planes differ in size.
    #[must_use]
    pub fn protect_texture(
        &self,
        planes: &[NoisyPlane<'_>],
        residuals: &[Plane],
        least: &[f32],
    ) -> DetailMask {
        let mut structure: Plane = Plane::zeros(self.activity.size());
        for (plane, residual) in planes.iter().zip(residuals) {
            let valid = |x: usize, y: usize| plane.trust.at(x, y) == TRUSTED;
            let [count, sum] =
                block_sums(residual.size(), |x, y| valid(x, y).then(|| [1.0, residual.at(x, y)]));
            let (cells, ratios) = (cell_variances(&count, &sum), noise_ratios(plane));
            let of_cells = structure.data_mut().iter_mut().zip(cells.data()).zip(ratios.data());
            for ((most, cell), ratio) in of_cells {
                *most = most.max(cell / (ratio * plane.noise.max(NOISE_MIN)).powi(2));
            }
        }
        let mut activity = self.activity.clone();
        let mut mask = self.clone();
        for (level, (factors, least)) in mask.factors.iter_mut().zip(least).enumerate() {
            if level > 0 {
                (structure, activity) = (halve_by_max(&structure), halve_by_max(&activity));
            }
            let places = structure.data().iter().zip(activity.data());
            for (factor, (&structure, &activity)) in factors.data_mut().iter_mut().zip(places) {
                let share = ramp(structure, DRAWN_AWAY, ALL_DRAWN_AWAY)
                    * (1.0 - ramp(structure, TOO_MUCH, NO_TEXTURE))
                    * (1.0 - ramp(activity, FAINT, STRONG));
                *factor *= 1.0 - share * (1.0 - least);
            }
        }
        mask
    }
}

/// A linear ramp, 0 below `from` and 1 above `to`.
fn ramp(value: f32, from: f32, to: f32) -> f32 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::data_term::TRUSTED;
    use crate::frame::Size;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const SIZE: Size = Size::new(160, 120);

    fn noise(seed: u64) -> Plane {
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed);
        Plane::from_fn(SIZE, |_, _| StandardNormal.sample(&mut random))
    }

    /// A texture of waves eight pixels long, in the right half.
    fn waves(height: f32) -> Plane {
        Plane::from_fn(SIZE, |x, y| match x < SIZE.width / 2 {
            true => 0.0,
            false => height * (x as f32 * 0.8).sin() * (y as f32 * 0.75).cos(),
        })
    }

    /// Mean factors of the thresholds in the left and the right half, if the photo has waves of
    /// `height` and the residual waves of `remaining`.
    fn shares(height: f32, remaining: f32) -> [f32; 2] {
        let mut photo = noise(7);
        photo.add_scaled(1.0, &waves(height));
        photo.data_mut().iter_mut().for_each(|v| *v += 100.0);
        let trust = Plane::filled(SIZE, TRUSTED);
        let plane =
            NoisyPlane { light: &photo, trust: &trust, noise: 1.0, dark_light: f32::INFINITY };
        let mask = DetailMask::of(&[plane], 3, false);
        let mut residual = noise(8);
        residual.add_scaled(1.0, &waves(remaining));
        let protected = mask.protect_texture(&[plane], &[residual], &[0.4, 0.5]);
        assert_eq!(mask.factors(2).unwrap().data(), protected.factors(2).unwrap().data());
        let (before, after) = (mask.factors(0).unwrap(), protected.factors(0).unwrap());
        [10..30, 50..70].map(|columns: std::ops::Range<usize>| {
            let rows = 10..50;
            let places = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            let of: Vec<f32> = places.map(|(x, y)| after.at(x, y) / before.at(x, y)).collect();
            of.iter().sum::<f32>() / of.len() as f32
        })
    }

    #[test]
    fn thresholds_fall_where_a_faint_texture_remains_and_only_there() {
        let [calm, texture] = shares(3.0, 0.5);
        assert!(calm > 0.9 && texture < 0.75, "{calm} {texture}");
    }

    #[test]
    fn a_residual_of_noise_keeps_the_thresholds() {
        let [calm, texture] = shares(3.0, 0.0);
        assert!(calm > 0.9 && texture > 0.9, "{calm} {texture}");
    }

    #[test]
    fn a_residual_larger_than_a_faint_texture_keeps_the_thresholds() {
        let [_, texture] = shares(9.0, 6.0);
        assert!(texture > 0.95, "{texture}");
    }

    #[test]
    fn a_residual_beside_strong_details_keeps_the_thresholds() {
        let [_, texture] = shares(100.0, 1.5);
        assert!(texture > 0.999, "{texture}");
    }
}
