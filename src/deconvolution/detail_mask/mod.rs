//! The detail mask of a photo: where it holds details, and where it is flat and holds noise alone.
//!
//! A deconvolution makes noise coarser and larger. Details are worth that; a wall or a night sky is
//! not. The lens blurs the finest details of a scene away, so the finest details of the photo are
//! noise, and the noise can be measured everywhere ([`super::data_term::noise_of`] measures it for
//! a whole photo). Where the variance of the surroundings is no larger than this noise explains,
//! the place is flat and its thresholds grow ([`DetailMask::factors`]). Texture as faint as the
//! noise hides from single pixels; means over cells of four by four see it, for the lens left it
//! coarse.

mod texture;

use rayon::prelude::*;

use super::data_term::{NOISE_MIN, TRUSTED};
use crate::frame::{Plane, Size};

/// Everything is counted in blocks of two by two pixels, as many as the finest level has details.
const BLOCK_PX: usize = 2;
/// Reach of the surroundings, blocks on either side: wider than a blur, so that no place beside an
/// edge counts as flat, and enough pixels to know a variance by 7 %.
const REACH: usize = 5;
/// Variance over noise variance below which a place is flat. Measured, see tests/tables/README.md.
const FLAT: f32 = 2.0;
/// Variance over noise variance above which a place has details. Measured likewise.
const DETAILED: f32 = 10.0;
/// The same two for cells against their neighbours: noise alone is 1 ± 0.2 there, and below 2.5
/// anywhere in 12 megapixels. Measured likewise.
const FLAT_CELLS: f32 = 2.5;
const DETAILED_CELLS: f32 = 3.5;
/// Cells of whose differences a place is judged, as a share of all in its surroundings: at a border
/// chance would decide.
const CELLS_LEAST: f32 = 0.5;
/// By how much thresholds grow where a place is flat; 6 and 12 differ by less than 0.001 SSIM on
/// any scene.
const GROWTH: f32 = 8.0;

/// A channel of a photo, and its noise.
#[derive(Debug, Clone, Copy)]
pub struct NoisyPlane<'a> {
    /// Its light, grey levels.
    pub light: &'a Plane,
    /// What each pixel is worth, see [`super::data_term`].
    pub trust: &'a Plane<u8>,
    /// Standard deviation of its noise at its mean light, grey levels.
    pub noise: f32,
    /// L₀, the light that adds as much noise as there is without light: at a light of L the noise
    /// goes with √(L + L₀). Infinite where it is the same everywhere.
    pub dark_light: f32,
}

/// How much the thresholds of each wavelet level grow, place by place.
#[derive(Debug, Clone)]
pub struct DetailMask {
    /// Finest level first; as large as the level's details.
    factors: Vec<Plane>,
    /// Variance of the surroundings of each block over the noise's, in the channel with most.
    activity: Plane,
    /// Variance of pixels over the noise's where it is largest; 0 where nothing is known.
    peak: f32,
}

impl DetailMask {
    /// The mask of a photo of `planes` for `levels` levels of details. The channel with most
    /// details decides for a place; where the light is such that there is more noise than at its
    /// mean, thresholds grow as it does. `raw` planes are known at a mosaic's sites.
    pub fn of(planes: &[NoisyPlane<'_>], levels: usize, raw: bool) -> DetailMask {
        let size = planes.first().map_or(Size::new(0, 0), |plane| blocks(plane.light.size()));
        let (activities, all_ratios): (Vec<Activity>, Vec<Plane>) = planes
            .par_iter()
            .map(|plane| {
                let ratios = noise_ratios(plane);
                (activity(plane, &ratios, raw), ratios)
            })
            .unzip();
        let mut ratios: Plane = Plane::zeros(size);
        all_ratios.iter().for_each(|of| ratios.add_scaled(1.0 / planes.len() as f32, of));
        let mut largest: Plane = Plane::zeros(size);
        let mut peak = 0.0f32;
        for Activity { pixels, cells } in &activities {
            for ((l, p), c) in largest.data_mut().iter_mut().zip(pixels.data()).zip(cells.data()) {
                *l = l.max(*p).max(*c);
            }
            peak = pixels.data().iter().copied().filter(|p| p.is_finite()).fold(peak, f32::max);
        }
        let activity = largest.clone();
        let mut factors = Vec::with_capacity(levels);
        for level in 0..levels {
            if level > 0 {
                (largest, ratios) = (halved(&largest), means_of_four(&ratios));
            }
            let mut of_level = largest.map(|activity: f32| {
                let flat = ((DETAILED - activity) / (DETAILED - FLAT)).clamp(0.0, 1.0);
                1.0 + GROWTH * flat * flat * (3.0 - 2.0 * flat)
            });
            of_level.data_mut().iter_mut().zip(ratios.data()).for_each(|(f, ratio)| *f *= ratio);
            factors.push(of_level);
        }
        DetailMask { factors, activity, peak }
    }

    /// Whether no pixels anywhere differ by more than noise. Cells have no say: of a photo whose
    /// noise is not told from its details they would say that there are some.
    pub fn is_flat(&self) -> bool {
        self.peak <= FLAT
    }

    /// Factors of the thresholds of `level`, 0 the finest.
    pub fn factors(&self, level: usize) -> Option<&Plane> {
        self.factors.get(level)
    }
}

fn blocks(size: Size) -> Size {
    Size::new(size.width.div_ceil(BLOCK_PX), size.height.div_ceil(BLOCK_PX))
}

/// Half as many pixels each way, each the largest of its four.
fn halved(plane: &Plane) -> Plane {
    let size = plane.size();
    Plane::from_fn(blocks(size), |x, y| {
        let (right, below) = ((2 * x + 1).min(size.width - 1), (2 * y + 1).min(size.height - 1));
        let upper = plane.at(2 * x, 2 * y).max(plane.at(right, 2 * y));
        upper.max(plane.at(2 * x, below)).max(plane.at(right, below))
    })
}

/// The mean of each four blocks.
fn means_of_four(plane: &Plane) -> Plane {
    let size = plane.size();
    Plane::from_fn(blocks(size), |x, y| {
        let (right, below) = ((2 * x + 1).min(size.width - 1), (2 * y + 1).min(size.height - 1));
        let upper = plane.at(2 * x, 2 * y) + plane.at(right, 2 * y);
        (upper + plane.at(2 * x, below) + plane.at(right, below)) / 4.0
    })
}

/// The noise in the surroundings of each block, against that at the mean light.
fn noise_ratios(plane: &NoisyPlane<'_>) -> Plane {
    let (size, blocks) = (plane.light.size(), blocks(plane.light.size()));
    if plane.dark_light.is_infinite() {
        return Plane::filled(blocks, 1.0);
    }
    let (mut light, mut count): (Plane, Plane) = (Plane::zeros(blocks), Plane::zeros(blocks));
    for y in 0..size.height {
        let (sums, pixels) = (light.row_mut(y / BLOCK_PX), count.row_mut(y / BLOCK_PX));
        for (x, value) in plane.light.row(y).iter().enumerate() {
            sums[x / BLOCK_PX] += value;
            pixels[x / BLOCK_PX] += 1.0;
        }
    }
    let [light, count] = [light, count].map(|plane| surroundings(&plane));
    let power = |light: f32| (light.max(0.0) + plane.dark_light).max(f32::MIN_POSITIVE);
    let at_mean = power(plane.light.mean() as f32);
    Plane::from_fn(blocks, |x, y| {
        let ratio = power(light.at(x, y) / count.at(x, y)) / at_mean;
        ratio.sqrt().clamp(RATIO_LEAST, RATIO_MOST)
    })
}

/// Noise differs over a photo by so much at the least and at the most. Guess: light of a tenth of
/// the mean and of sixteen times it.
const RATIO_LEAST: f32 = 0.3;
const RATIO_MOST: f32 = 4.0;

/// Variance of the surroundings of each block over the noise's there.
struct Activity {
    /// Of single pixels; infinite where nothing of them can be trusted.
    pixels: Plane,
    /// Of means over cells, on the same scale; below [`FLAT`] where too few are known.
    cells: Plane,
}

/// The activity of a plane whose noise is `ratios` of what it is at its mean light. Of a `raw`
/// plane the noise is told by sites of one phase, two pixels apart, where a scene has details, too:
/// it is believed up to [`MOST_POWER`].
fn activity(plane: &NoisyPlane<'_>, ratios: &Plane, raw: bool) -> Activity {
    let NoisyPlane { light: photo, trust, noise, .. } = *plane;
    let (apart, most) =
        if raw { (2, MOST_POWER * noise.max(NOISE_MIN).powi(2)) } else { (1, f32::INFINITY) };
    let (size, width) = (photo.size(), photo.width());
    let blocks = blocks(size);
    let mean = photo.mean() as f32;
    // Sums over the surroundings of: number of pixels, value, its square, and the square of its
    // finest details.
    let mut values: [Plane; 4] = std::array::from_fn(|_| Plane::zeros(blocks));
    for y in 0..size.height {
        let near = |y: usize| photo.row(y.min(size.height - 1));
        let (above, here, below) = (near(y.saturating_sub(apart)), photo.row(y), near(y + apart));
        let trusted = trust.row(y);
        let [count, sum, square, finest] = &mut values;
        let block = y / BLOCK_PX;
        let rows = (
            count.row_mut(block),
            sum.row_mut(block),
            square.row_mut(block),
            finest.row_mut(block),
        );
        for x in 0..width {
            if trusted[x] != TRUSTED {
                continue;
            }
            let (left, right) = (x.saturating_sub(apart), (x + apart).min(width - 1));
            let fine = above[left] + above[right] + below[left] + below[right]
                - 2.0 * (above[x] + below[x] + here[left] + here[right])
                + 4.0 * here[x];
            let value = here[x] - mean;
            let block = x / BLOCK_PX;
            rows.0[block] += 1.0;
            rows.1[block] += value;
            rows.2[block] += value * value;
            rows.3[block] += fine * fine / 36.0;
        }
    }
    let cells = cells(&values[0], &values[1]);
    let [count, sum, square, fine] = values.map(|plane| surroundings(&plane));
    let least = (LEAST_SHARE * noise).powi(2);
    let mean = |x: usize, y: usize| sum.at(x, y) / count.at(x, y).max(1.0);
    let slope =
        |lower: f32, upper: f32, apart: usize| (upper - lower) / (BLOCK_PX * apart.max(1)) as f32;
    let noise_at = |x: usize, y: usize| {
        let finest = fine.at(x, y) / count.at(x, y).max(1.0);
        let here = ratios.at(x, y).powi(2);
        finest.min(most * here).max(least * here).max(f32::MIN_POSITIVE)
    };
    let pixels = Plane::from_fn(blocks, |x, y| {
        let pixels = count.at(x, y);
        if pixels == 0.0 {
            return f32::INFINITY;
        }
        // Shading is no detail: the variance of a slope goes.
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

/// Cells' variances on the scale of pixels' ones.
const CELLS_AS_PIXELS: f32 = (DETAILED - FLAT) / (DETAILED_CELLS - FLAT_CELLS);

/// Variance of a pixel that would explain how much the means over cells of two by two blocks differ
/// from those of the four cells beside them, if pixels had nothing but noise; 0 where too few such
/// five are known. `count` and `sum` are the blocks' pixels and values.
fn cells(count: &Plane, sum: &Plane) -> Plane {
    let size = count.size();
    let four = |plane: &Plane, x: usize, y: usize| {
        plane.at(x, y) + plane.at(x + 1, y) + plane.at(x, y + 1) + plane.at(x + 1, y + 1)
    };
    let [mut squares, mut expected, mut known] = std::array::from_fn(|_| Plane::zeros(size));
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
            known.set(x, y, 1.0);
        }
    }
    let [squares, expected, known] = [squares, expected, known].map(|plane| surroundings(&plane));
    let least = CELLS_LEAST * (2 * REACH + 1).pow(2) as f32;
    Plane::from_fn(size, |x, y| match known.at(x, y) < least {
        true => 0.0,
        false => squares.at(x, y) / expected.at(x, y),
    })
}

/// Noise is at least this share of what the light lets expect.
const LEAST_SHARE: f32 = 0.5;
/// Noise power of a mosaic's sites is at most so much of what the light lets expect. Guess.
const MOST_POWER: f32 = 2.0;

/// Sums over squares of 2·[`REACH`] + 1 blocks.
fn surroundings(plane: &Plane) -> Plane {
    let size = plane.size();
    let along = |length: usize, at: &dyn Fn(usize) -> f32, out: &mut dyn FnMut(usize, f32)| {
        let mut sum: f64 = (0..REACH.min(length)).map(|i| f64::from(at(i))).sum();
        for i in 0..length {
            if i + REACH < length {
                sum += f64::from(at(i + REACH));
            }
            if i > REACH {
                sum -= f64::from(at(i - REACH - 1));
            }
            out(i, sum as f32);
        }
    };
    let mut rows = Plane::zeros(size);
    for y in 0..size.height {
        let (from, to) = (plane.row(y), rows.row_mut(y));
        along(size.width, &|x| from[x], &mut |x, sum| to[x] = sum);
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

    /// Factors of the finest level for a scene with one grey level of noise, more where it is
    /// brighter.
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
        // The surroundings of border places are half unseen, and a few places are flat only nearly,
        // by chance.
        assert!(wall.mean() > f64::from(1.0 + 0.98 * GROWTH), "{}", wall.mean());
    }

    #[test]
    fn details_are_left_alone_and_flat_places_begin_beyond_their_blur() {
        // As a lens would blur it.
        let dots = factors(|x, y| {
            let far = (x as f32 - 40.0).hypot(y as f32 - 60.0) / 3.0;
            90.0 + 50.0 * (-far * far / 2.0).exp()
        });
        assert_eq!(dots.at(20, 30), 1.0, "on it");
        assert_eq!(dots.at(23, 30), 1.0, "6 pixels beside it");
        assert!(dots.at(60, 30) > 1.0 + 0.9 * GROWTH, "80 pixels beside it");
    }

    #[test]
    fn a_texture_as_faint_as_the_noise_is_no_flat_place() {
        // Waves as long as a blur leaves them, in four directions, together as strong as the noise.
        let texture = factors(|x, y| {
            let (x, y) = (x as f32, y as f32);
            let waves = [(0.7, 0.2), (0.1, 0.8), (0.5, -0.6), (-0.3, 0.55)];
            let sum: f32 = waves.iter().map(|(along, down)| (along * x + down * y).sin()).sum();
            100.0 + sum / 2.0f32.sqrt()
        });
        assert!(texture.mean() < f64::from(1.0 + 0.2 * GROWTH), "{}", texture.mean());
    }

    #[test]
    fn thresholds_follow_the_light_as_its_noise_does() {
        let size = Size::new(320, 120);
        // A dark half, a bright half, and more of the dark; details everywhere.
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
    fn where_nothing_is_known_thresholds_stay() {
        let size = Size::new(64, 64);
        let (photo, trust) = (
            Plane::filled(size, 80.0),
            Plane::filled(size, crate::deconvolution::data_term::MISSING),
        );
        let mask = DetailMask::of(&[plane(&photo, &trust, 1.0)], 1, false);
        assert!(mask.factors(0).unwrap().data().iter().all(|&f| f == 1.0));
    }
}
