//! Texture that the prior has drawn away, found in what a picture leaves of its photo.
//!
//! Of a texture hardly stronger than the noise no rule over the photo says whether it may be shrunk
//! as noise is. After some steps the residual does: where the prior was right it is noise, and
//! means over cells of four by four pixels differ by no more than noise explains. Where a texture
//! was drawn away its blurred image is left, and they do. There the finest details are shrunk less
//! from then on. What is left has other reasons beside strong details, where steps are still to
//! come, and where it is more than such a texture can leave: then the lens is not the one that was
//! measured.

use super::{BLOCK_PX, DetailMask, NoisyPlane, cells, halved, noise_ratios};
use crate::deconvolution::data_term::{NOISE_MIN, TRUSTED};
use crate::frame::Plane;

/// Variance of cells of the residual over the noise's from which on a texture was drawn away; in
/// the surroundings of a block noise alone has 1 ± 0.2. Set with the others here on ten scenes
/// through two lenses (`tests/tables/README.md`).
const DRAWN_AWAY: f32 = 1.1;
/// The same past which all that is shrunk more than usual was too much,
const ALL_DRAWN_AWAY: f32 = 1.5;
/// from which on it begins to be more than a faint texture leaves,
const TOO_MUCH: f32 = 1.8;
/// and past which it is no texture.
const NO_TEXTURE: f32 = 2.5;
/// Variance of the photo over its noise's up to which a texture is faint,
const FAINT: f32 = 300.0;
/// and past which none is.
const STRONG: f32 = 1000.0;

impl DetailMask {
    /// The same with the thresholds of level l, 0 the finest, down to `least[l]` of themselves
    /// where a texture of the photo of `planes` was drawn away, of which a picture has `left` so
    /// much in each, grey levels; planes and residuals in one order.
    ///
    /// # Panics
    /// When planes differ in size, which is a bug of the caller.
    #[must_use]
    pub fn spared(&self, planes: &[NoisyPlane<'_>], left: &[Plane], least: &[f32]) -> DetailMask {
        let mut structure: Plane = Plane::zeros(self.activity.size());
        for (plane, left) in planes.iter().zip(left) {
            let [mut count, mut sum] = [(); 2].map(|()| Plane::zeros(structure.size()));
            for y in 0..left.height() {
                let (counts, sums) = (count.row_mut(y / BLOCK_PX), sum.row_mut(y / BLOCK_PX));
                for (x, (v, &t)) in left.row(y).iter().zip(plane.trust.row(y)).enumerate() {
                    if t == TRUSTED {
                        counts[x / BLOCK_PX] += 1.0;
                        sums[x / BLOCK_PX] += v;
                    }
                }
            }
            let (cells, ratios) = (cells(&count, &sum), noise_ratios(plane));
            let of_cells = structure.data_mut().iter_mut().zip(cells.data()).zip(ratios.data());
            for ((most, cell), ratio) in of_cells {
                *most = most.max(cell / (ratio * plane.noise.max(NOISE_MIN)).powi(2));
            }
        }
        let mut activity = self.activity.clone();
        let mut spared = self.clone();
        for (level, (factors, least)) in spared.factors.iter_mut().zip(least).enumerate() {
            if level > 0 {
                (structure, activity) = (halved(&structure), halved(&activity));
            }
            let places = structure.data().iter().zip(activity.data());
            for (factor, (&structure, &activity)) in factors.data_mut().iter_mut().zip(places) {
                let share = between(structure, DRAWN_AWAY, ALL_DRAWN_AWAY)
                    * (1.0 - between(structure, TOO_MUCH, NO_TEXTURE))
                    * (1.0 - between(activity, FAINT, STRONG));
                *factor *= 1.0 - share * (1.0 - least);
            }
        }
        spared
    }
}

/// 0 below `from`, 1 past `to`, and in between the share of the way.
fn between(value: f32, from: f32, to: f32) -> f32 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
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

    /// Mean share of thresholds that is left in the left and the right half where the photo has
    /// waves of `height` and the picture leaves `left` of them.
    fn shares(height: f32, left: f32) -> [f32; 2] {
        let mut photo = noise(7);
        photo.add_scaled(1.0, &waves(height));
        photo.data_mut().iter_mut().for_each(|v| *v += 100.0);
        let trust = Plane::filled(SIZE, TRUSTED);
        let plane =
            NoisyPlane { light: &photo, trust: &trust, noise: 1.0, dark_light: f32::INFINITY };
        let mask = DetailMask::of(&[plane], 3, false);
        let mut residual = noise(8);
        residual.add_scaled(1.0, &waves(left));
        let spared = mask.spared(&[plane], &[residual], &[0.4, 0.5]);
        assert_eq!(mask.factors(2).unwrap().data(), spared.factors(2).unwrap().data());
        let (before, after) = (mask.factors(0).unwrap(), spared.factors(0).unwrap());
        [10..30, 50..70].map(|columns: std::ops::Range<usize>| {
            let rows = 10..50;
            let places = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
            let of: Vec<f32> = places.map(|(x, y)| after.at(x, y) / before.at(x, y)).collect();
            of.iter().sum::<f32>() / of.len() as f32
        })
    }

    #[test]
    fn thresholds_fall_where_a_faint_texture_is_left_and_only_there() {
        let [calm, texture] = shares(3.0, 0.5);
        assert!(calm > 0.9 && texture < 0.75, "{calm} {texture}");
    }

    #[test]
    fn what_leaves_noise_alone_is_shrunk_as_before() {
        let [calm, texture] = shares(3.0, 0.0);
        assert!(calm > 0.9 && texture > 0.9, "{calm} {texture}");
    }

    #[test]
    fn what_leaves_more_than_a_faint_texture_can_is_none() {
        let [_, texture] = shares(9.0, 6.0);
        assert!(texture > 0.95, "{texture}");
    }

    #[test]
    fn beside_strong_details_the_residual_has_other_reasons() {
        let [_, texture] = shares(100.0, 1.5);
        assert!(texture > 0.999, "{texture}");
    }
}
