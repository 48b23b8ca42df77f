//! The detail mask of a photo: where it has details, and where it is flat and holds noise alone.
//!
//! Deconvolution amplifies noise, which is acceptable in details but not on a wall or a night sky.
//! The lens removes the finest details of the scene, so the finest details of the photo are noise,
//! whose local variance is measured there ([`super::data_term::noise_of`] does so for a whole
//! photo). Where the local variance of pixels does not exceed that of the noise the place is flat,
//! and thresholds are raised ([`DetailMask::factors`]). Texture as faint as the noise shows in
//! means over cells of 4×4 pixels, though not in single pixels, because the lens has left only
//! coarse texture.

mod texture;

use rayon::prelude::*;

use super::data_term::{NOISE_MIN, TRUSTED};
use super::smoothing::{halve, of_each_four};
use crate::frame::{Plane, Size};

/// Side of a block, the unit of the mask: the size of a detail of the finest level.
const BLOCK_PX: usize = 2;
/// Blocks of the surroundings on either side: wider than a blur, so that places beside an edge are
/// not flat, and large enough for a variance within 7 %.
const REACH: usize = 5;
/// Ratio of local variance to noise variance below which a place is flat; measured
/// (tests/tables/constants.md).
const FLAT: f32 = 2.0;
/// Ratio of local variance to noise variance above which a place has details. Measured, ibid.
const DETAILED: f32 = 10.0;
/// Ratio of the variance of cells to that of the noise below which a place is flat. Noise alone
/// gives 1 ± 0.2, and at most 2.5 anywhere in 12 megapixels. Measured, ibid.
const FLAT_CELLS: f32 = 2.5;
/// Ratio of the variance of cells to that of the noise above which a place has details. Measured,
/// ibid.
const DETAILED_CELLS: f32 = 3.5;
/// Minimum share of valid cells in the surroundings for their variance to be used.
const CELLS_LEAST: f32 = 0.5;
/// Growth of thresholds where a place is flat; 6 and 12 differ by less than 0.001 SSIM on any
/// scene.
const GROWTH: f32 = 8.0;

/// One channel of a photo with its noise.
#[derive(Debug, Clone, Copy)]
pub struct NoisyPlane<'a> {
    /// Light, grey levels.
    pub light: &'a Plane,
    /// Validity of each pixel, see [`super::data_term`].
    pub trust: &'a Plane<u8>,
    /// Noise σ at the mean light, grey levels.
    pub noise: f32,
    /// L₀ of the noise law σ² ∝ L + L₀, grey levels; infinite where σ is constant.
    pub dark_light: f32,
}

/// Local factors on the thresholds of each wavelet level.
#[derive(Debug, Clone)]
pub struct DetailMask {
    /// Factors of each level at the size of its details, finest first.
    factors: Vec<Plane>,
    /// Ratio of local variance to noise variance in each block, maximum over the channels.
    activity: Plane,
}

/// Whether the pixels of `planes` nowhere vary by more than noise; `raw` as in [`DetailMask::of`].
/// Cells are ignored: without a noise estimate independent of details, some would always seem to
/// have details.
pub fn is_flat(planes: &[NoisyPlane<'_>], raw: bool) -> bool {
    let is_detailed = |ratio: &f32| ratio.is_finite() && *ratio > FLAT;
    planes.iter().all(|plane| {
        let Activity { pixels, .. } = activity(plane, &noise_ratios(plane), raw);
        !pixels.data().iter().any(is_detailed)
    })
}

impl DetailMask {
    /// The mask of a photo of `planes` for `levels` levels of details. The channel with the most
    /// details decides; thresholds scale with the local noise σ. In `raw` planes only the sites of
    /// a mosaic are valid pixels.
    pub fn of(planes: &[NoisyPlane<'_>], levels: usize, raw: bool) -> DetailMask {
        let size = planes.first().map_or(Size::default(), |plane| blocks(plane.light.size()));
        let (activities, all_ratios): (Vec<Activity>, Vec<Plane>) = planes
            .par_iter()
            .map(|plane| {
                let ratios = noise_ratios(plane);
                (activity(plane, &ratios, raw), ratios)
            })
            .unzip();
        let mut ratios: Plane = Plane::zeros(size);
        for of in &all_ratios {
            ratios.add_scaled(1.0 / planes.len() as f32, of);
        }
        let mut largest: Plane = Plane::zeros(size);
        for Activity { pixels, cells } in &activities {
            for plane in [pixels, cells] {
                largest.update(plane, |most, of| *most = most.max(of));
            }
        }
        let activity = largest.clone();
        let mut factors = Vec::with_capacity(levels);
        for level in 0..levels {
            if level > 0 {
                (largest, ratios) = (halve_by_max(&largest), halve(&ratios));
            }
            let mut of_level = largest.map(|activity: f32| {
                let flat = ((DETAILED - activity) / (DETAILED - FLAT)).clamp(0.0, 1.0);
                1.0 + GROWTH * flat * flat * (3.0 - 2.0 * flat)
            });
            of_level.multiply(&ratios);
            factors.push(of_level);
        }
        DetailMask { factors, activity }
    }

    /// Factors on the thresholds of `level`, 0 the finest.
    pub fn factors(&self, level: usize) -> Option<&Plane> {
        self.factors.get(level)
    }
}

fn blocks(size: Size) -> Size {
    Size::new(size.width.div_ceil(BLOCK_PX), size.height.div_ceil(BLOCK_PX))
}

/// The maximum of each 2×2 pixels.
fn halve_by_max(plane: &Plane) -> Plane {
    of_each_four(plane, |[a, b, c, d]| a.max(b).max(c).max(d))
}

/// Sums over blocks of the `values` at each pixel of a plane of `size`; pixels with `None` are
/// omitted.
fn block_sums<const N: usize>(
    size: Size,
    values: impl Fn(usize, usize) -> Option<[f32; N]>,
) -> [Plane; N] {
    let mut sums = [(); N].map(|()| Plane::zeros(blocks(size)));
    for y in 0..size.height {
        let mut rows = sums.each_mut().map(|plane| plane.row_mut(y / BLOCK_PX));
        for x in 0..size.width {
            let Some(values) = values(x, y) else { continue };
            rows.iter_mut().zip(values).for_each(|(row, value)| row[x / BLOCK_PX] += value);
        }
    }
    sums
}

/// Ratio of the noise σ in each block's surroundings to the noise σ at the mean light.
fn noise_ratios(plane: &NoisyPlane<'_>) -> Plane {
    let blocks = blocks(plane.light.size());
    if plane.dark_light.is_infinite() {
        return Plane::filled(blocks, 1.0);
    }
    let sums = block_sums(plane.light.size(), |x, y| Some([plane.light.at(x, y), 1.0]));
    let [light, count] = sums.map(|plane| surroundings(&plane));
    let power = |light: f32| (light.max(0.0) + plane.dark_light).max(f32::MIN_POSITIVE);
    let at_mean = power(plane.light.mean() as f32);
    Plane::from_fn(blocks, |x, y| {
        let ratio = power(light.at(x, y) / count.at(x, y)) / at_mean;
        ratio.sqrt().clamp(RATIO_LEAST, RATIO_MOST)
    })
}

/// Range of local noise ratios. Guess: a tenth of the mean light to sixteen times it.
const RATIO_LEAST: f32 = 0.3;
const RATIO_MOST: f32 = 4.0;

/// Ratio of local variance to noise variance in each block.
struct Activity {
    /// Ratio for single pixels; infinite without valid pixels.
    pixels: Plane,
    /// Ratio for means over cells, on the same scale; below [`FLAT`] with too few valid cells.
    cells: Plane,
}

/// Sums over the blocks of valid pixels of `plane`: their number, the values less the plane's mean,
/// the squares of these, and the squares of the finest details between pixels `apart` from each
/// other, normalised to the noise variance.
fn block_moments(plane: &NoisyPlane<'_>, apart: usize) -> [Plane; 4] {
    let NoisyPlane { light: photo, trust, .. } = *plane;
    let (size, mean) = (photo.size(), photo.mean() as f32);
    block_sums(size, |x, y| {
        if trust.at(x, y) != TRUSTED {
            return None;
        }
        let (left, right) = (x.saturating_sub(apart), (x + apart).min(size.width - 1));
        let (above, below) = (y.saturating_sub(apart), (y + apart).min(size.height - 1));
        let [above, here, below] = [above, y, below].map(|y| photo.row(y));
        let fine = above[left] + above[right] + below[left] + below[right]
            - 2.0 * (above[x] + below[x] + here[left] + here[right])
            + 4.0 * here[x];
        let value = here[x] - mean;
        Some([1.0, value, value * value, fine * fine / 36.0])
    })
}

/// The activity of a plane with local noise `ratios`. In a `raw` plane the finest details are
/// differences of sites two pixels apart, which contain details of the scene, so the noise variance
/// is limited to [`MOST_POWER`].
fn activity(plane: &NoisyPlane<'_>, ratios: &Plane, raw: bool) -> Activity {
    let noise = plane.noise;
    let (apart, most) =
        if raw { (2, MOST_POWER * noise.max(NOISE_MIN).powi(2)) } else { (1, f32::INFINITY) };
    let blocks = blocks(plane.light.size());
    let [count, sum, square, finest] = block_moments(plane, apart);
    let cells = cell_variances(&count, &sum);
    let [count, sum, square, finest] =
        [count, sum, square, finest].map(|plane| surroundings(&plane));
    let least = (LEAST_SHARE * noise).powi(2);
    let mean = |x: usize, y: usize| sum.at(x, y) / count.at(x, y).max(1.0);
    let slope =
        |lower: f32, upper: f32, apart: usize| (upper - lower) / (BLOCK_PX * apart.max(1)) as f32;
    let noise_at = |x: usize, y: usize| {
        let finest = finest.at(x, y) / count.at(x, y).max(1.0);
        let here = ratios.at(x, y).powi(2);
        finest.min(most * here).max(least * here).max(f32::MIN_POSITIVE)
    };
    let pixels = Plane::from_fn(blocks, |x, y| {
        let pixels = count.at(x, y);
        if pixels == 0.0 {
            return f32::INFINITY;
        }
        // The variance due to a slope is subtracted: shading is no detail.
        let (left, right) = (x.saturating_sub(REACH), (x + REACH).min(blocks.width - 1));
        let (above, below) = (y.saturating_sub(REACH), (y + REACH).min(blocks.height - 1));
        let along_x = slope(mean(left, y), mean(right, y), right - left);
        let along_y = slope(mean(x, above), mean(x, below), below - above);
        let side = (BLOCK_PX * (2 * REACH + 1)) as f32;
        let shading = (along_x * along_x + along_y * along_y) * (side * side - 1.0) / 12.0;
        let variance = square.at(x, y) / pixels - mean(x, y).powi(2) - shading;
        variance.max(0.0) / noise_at(x, y)
    });
    let cells = Plane::from_fn(blocks, |x, y| {
        FLAT + (cells.at(x, y) / noise_at(x, y) - FLAT_CELLS) * CELLS_AS_PIXELS
    });
    Activity { pixels, cells }
}

/// Factor that converts the ratio for cells to that for pixels.
const CELLS_AS_PIXELS: f32 = (DETAILED - FLAT) / (DETAILED_CELLS - FLAT_CELLS);

/// Local variance of cells of 2×2 blocks about their four neighbours, as the pixel variance of
/// white noise with the same effect; 0 where too few cells are valid.
fn cell_variances(count: &Plane, sum: &Plane) -> Plane {
    let size = count.size();
    let four = |plane: &Plane, x: usize, y: usize| {
        plane.at(x, y) + plane.at(x + 1, y) + plane.at(x, y + 1) + plane.at(x + 1, y + 1)
    };
    let [mut squares, mut expected, mut valid] = std::array::from_fn(|_| Plane::zeros(size));
    for y in 2..size.height.saturating_sub(3) {
        for x in 2..size.width.saturating_sub(3) {
            let beside = [(x - 2, y), (x + 2, y), (x, y - 2), (x, y + 2)];
            let pixels = beside.map(|(x, y)| four(count, x, y));
            let own = four(count, x, y);
            if own == 0.0 || pixels.contains(&0.0) {
                continue;
            }
            let mut difference = four(sum, x, y) / own;
            let mut noise = 1.0 / own;
            for ((x, y), pixels) in beside.into_iter().zip(pixels) {
                difference -= four(sum, x, y) / pixels / 4.0;
                noise += 1.0 / pixels / 16.0;
            }
            squares.set(x, y, difference * difference);
            expected.set(x, y, noise);
            valid.set(x, y, 1.0);
        }
    }
    let [squares, expected, valid] = [squares, expected, valid].map(|plane| surroundings(&plane));
    let least = CELLS_LEAST * (2 * REACH + 1).pow(2) as f32;
    Plane::from_fn(size, |x, y| match valid.at(x, y) < least {
        true => 0.0,
        false => squares.at(x, y) / expected.at(x, y),
    })
}

/// Minimum of the measured noise σ, relative to the noise law's.
const LEAST_SHARE: f32 = 0.5;
/// Maximum noise power measured at a mosaic's sites, relative to the noise law's. Guess.
const MOST_POWER: f32 = 2.0;

/// Sums over the surroundings, squares of 2·[`REACH`] + 1 blocks.
fn surroundings(plane: &Plane) -> Plane {
    let size = plane.size();
    let mut rows = Plane::zeros(size);
    for y in 0..size.height {
        let from = plane.row(y);
        let mut sum: f64 = from.iter().take(REACH).map(|&v| f64::from(v)).sum();
        for (x, to) in rows.row_mut(y).iter_mut().enumerate() {
            sum += from.get(x + REACH).map_or(0.0, |&v| f64::from(v));
            if x > REACH {
                sum -= f64::from(from[x - REACH - 1]);
            }
            *to = sum as f32;
        }
    }
    let mut sums = Plane::zeros(size);
    let mut running = vec![0.0f64; size.width];
    for y in 0..size.height + REACH {
        if y < size.height {
            running.iter_mut().zip(rows.row(y)).for_each(|(r, v)| *r += f64::from(*v));
        }
        if let Some(middle) = y.checked_sub(REACH) {
            if let Some(gone) = middle.checked_sub(REACH + 1) {
                running.iter_mut().zip(rows.row(gone)).for_each(|(r, v)| *r -= f64::from(*v));
            }
            sums.row_mut(middle).iter_mut().zip(&running).for_each(|(s, r)| *s = *r as f32);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn plane<'a>(light: &'a Plane, trust: &'a Plane<u8>, noise: f32) -> NoisyPlane<'a> {
        NoisyPlane { light, trust, noise, dark_light: f32::INFINITY }
    }

    /// Factors of the finest level for a scene with noise σ of √(light/100) grey levels.
    fn factors(scene: impl Fn(usize, usize) -> f32) -> Plane {
        let size = Size::new(160, 120);
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(3);
        let photo = Plane::from_fn(size, |x, y| {
            let noise: f32 = StandardNormal.sample(&mut random);
            scene(x, y) + noise * (scene(x, y) / 100.0).sqrt()
        });
        let trust = Plane::filled(size, TRUSTED);
        let mask = DetailMask::of(&[plane(&photo, &trust, 1.0)], 3, false);
        assert_eq!(mask.factors(2).unwrap().size(), Size::new(20, 15));
        assert!(mask.factors(3).is_none());
        mask.factors(0).unwrap().clone()
    }

    #[test]
    fn a_wall_is_flat_in_the_light_and_in_the_dark() {
        let wall = factors(|x, y| 60.0 + 0.4 * x as f32 + 0.1 * y as f32);
        // Some places are not quite flat, at the border or by chance.
        assert!(wall.mean() > f64::from(1.0 + 0.98 * GROWTH), "{}", wall.mean());
    }

    #[test]
    fn details_keep_their_thresholds_and_flat_places_begin_beyond_their_blur() {
        // A point of light, blurred by a lens.
        let dots = factors(|x, y| {
            let far = (x as f32 - 40.0).hypot(y as f32 - 60.0) / 3.0;
            90.0 + 50.0 * (-far * far / 2.0).exp()
        });
        assert_eq!(dots.at(20, 30), 1.0, "on it");
        assert_eq!(dots.at(23, 30), 1.0, "6 pixels beside it");
        assert!(dots.at(60, 30) > 1.0 + 0.9 * GROWTH, "80 pixels beside it");
    }

    #[test]
    fn a_texture_as_faint_as_the_noise_is_not_flat() {
        // Waves of a blurred texture in four directions, together as strong as the noise.
        let texture = factors(|x, y| {
            let (x, y) = (x as f32, y as f32);
            let waves = [(0.7, 0.2), (0.1, 0.8), (0.5, -0.6), (-0.3, 0.55)];
            let sum: f32 = waves.iter().map(|(along, down)| (along * x + down * y).sin()).sum();
            100.0 + sum / 2.0f32.sqrt()
        });
        assert!(texture.mean() < f64::from(1.0 + 0.2 * GROWTH), "{}", texture.mean());
    }

    #[test]
    fn thresholds_follow_the_noise_law() {
        let size = Size::new(320, 120);
        // A dark part and a smaller bright one, with details everywhere.
        let light = |x: usize| if x < 200 { 20.0 } else { 100.0 };
        let photo = Plane::from_fn(size, |x, y| light(x) * (1.0 + 0.5 * (0.6 * y as f32).sin()));
        let trust = Plane::filled(size, TRUSTED);
        let factors = |dark_light: f32, x: usize| {
            let plane = NoisyPlane { dark_light, ..plane(&photo, &trust, 0.1) };
            let mask = DetailMask::of(&[plane], 2, false);
            [0, 1].map(|level| mask.factors(level).unwrap().at(x >> level, 30 >> level))
        };
        let ratios = |of: f32| {
            let (dark, bright) = (factors(of, 40), factors(of, 130));
            [0, 1].map(|level| bright[level] / dark[level])
        };
        for ratio in ratios(0.0) {
            assert!((ratio - 5.0f32.sqrt()).abs() < 0.05, "{ratio}");
        }
        for ratio in ratios(80.0) {
            assert!((ratio - 1.8f32.sqrt()).abs() < 0.05, "{ratio}");
        }
        assert_eq!(ratios(f32::INFINITY), [1.0; 2]);
    }

    #[test]
    fn without_valid_pixels_thresholds_are_unchanged() {
        let size = Size::new(64, 64);
        let (photo, trust) = (
            Plane::filled(size, 80.0),
            Plane::filled(size, crate::deconvolution::data_term::MISSING),
        );
        let mask = DetailMask::of(&[plane(&photo, &trust, 1.0)], 1, false);
        assert!(mask.factors(0).unwrap().data().iter().all(|&f| f == 1.0));
    }

    #[test]
    fn a_shaded_wall_is_flat_and_a_faint_disc_is_not() {
        let noisy = |scene: fn(usize, usize) -> f32| {
            let size = Size::new(160, 120);
            let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(3);
            let photo = Plane::from_fn(size, |x, y| {
                let noise: f32 = StandardNormal.sample(&mut random);
                scene(x, y) + noise
            });
            (photo, Plane::filled(size, TRUSTED))
        };
        let (wall, trust) = noisy(|x, y| 90.0 + 0.05 * (x + y) as f32);
        assert!(is_flat(&[plane(&wall, &trust, 1.0)], false));
        let (disc, trust) =
            noisy(|x, y| if (x as f32 - 80.0).hypot(y as f32 - 60.0) < 20.0 { 94.0 } else { 90.0 });
        let both = [plane(&wall, &trust, 1.0), plane(&disc, &trust, 1.0)];
        assert!(!is_flat(&both, false));
    }
}
