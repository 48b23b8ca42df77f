//! Hot pixels that no calibration knows: pixels brighter than any point of a scene through the
//! lens.
//!
//! The excess of a pixel is its value minus the median of the eight nearest of its colour. The
//! image of a point, the sharpest that a lens makes, has excess in several pixels; a hot pixel has
//! it alone. The isolation of a pixel is the ratio of its excess to the second-largest magnitude of
//! those around it. A pixel is hot if it is far more isolated than the image of a point.

use rayon::prelude::*;

use super::lens_model::LensFunctions;
use crate::frame::{Channel, Plane, Rect, Size};

/// Isolation of a hot pixel less that of the image of a point. Set on photographs without hot
/// pixels (`truthful.toml`, `simulated.toml`): at 2, six stars of the galaxies and ten sites of the
/// chart are taken for hot ones, at 3 one site of the rocket.
const MARGIN: f32 = 3.0;
/// Noise σ by which the excess of a hot pixel is higher at least. Guess.
const NOISES: f32 = 5.0;
/// Rank of the median of eight, from 0.
const MEDIAN: usize = 4;

/// A pixel that no scene explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HotPixel {
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Median of the nearest pixels of its colour.
    pub surroundings: f32,
}

/// Limits on isolation over a lens's field, one for each lens function.
pub struct IsolationLimits {
    grid: Size,
    field: Rect,
    limits: Vec<f32>,
}

impl IsolationLimits {
    /// The limits for `channel` behind the lens `functions`, which are spread over the `field`, if
    /// pixels of one colour are `apart` from each other.
    pub fn new(functions: &LensFunctions, field: Rect, channel: Channel, apart: usize) -> Self {
        let side = functions.support_px;
        let limit = |taps: &[f32]| {
            let border = 3 * apart;
            let inner = |at: usize| at.checked_sub(border).filter(|&at| at < side);
            let wide = side + 2 * border;
            let image = Plane::from_fn(Size::new(wide, wide), |x, y| {
                inner(x).zip(inner(y)).map_or(0.0, |(x, y)| taps[y * side + x])
            });
            let (mut most, mut limit) = (0.0f32, f32::INFINITY);
            for (x, y) in (0..wide * wide).map(|at| (at % wide, at / wide)) {
                // Taps are hardly negative, so no excess is higher than the value itself.
                if image.at(x, y) > most && excess(&image, x, y, apart) > most {
                    most = excess(&image, x, y, apart);
                    limit = MARGIN + most / around(&image, x, y, apart);
                }
            }
            limit
        };
        let limits = functions.taps[channel.index()].chunks_exact(side * side).map(limit).collect();
        IsolationLimits { grid: Size::new(functions.columns, functions.rows), field, limits }
    }

    /// The limit at (`x`, `y`) of the canvas: that of the nearest function.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        let nearest = |at: usize, first: usize, side: usize, count: usize| {
            (at.saturating_sub(first) * count / side).min(count - 1)
        };
        let Rect { x: left, y: top, size } = self.field;
        let column = nearest(x, left, size.width, self.grid.width);
        self.limits[nearest(y, top, size.height, self.grid.height) * self.grid.width + column]
    }
}

/// The hot pixels of `plane`, except at its border, if pixels of one colour are `apart` from each
/// other. `limit` (column, row) is that of [`IsolationLimits`]; `noise` (column, row, light) is σ
/// in the plane's units.
pub fn hot_pixels(
    plane: &Plane,
    apart: usize,
    limit: impl Fn(usize, usize) -> f32 + Sync,
    noise: impl Fn(usize, usize, f32) -> f32 + Sync,
) -> Vec<HotPixel> {
    let inner = |end: usize| 2 * apart..end.saturating_sub(2 * apart);
    let rows = inner(plane.height()).into_par_iter().flat_map_iter(|y| {
        let (limit, noise) = (&limit, &noise);
        inner(plane.width()).filter_map(move |x| {
            let here = plane.at(x, y);
            // Most pixels end here. Noise is lowest in the dark.
            let least = here - NOISES * noise(x, y, 0.0);
            let near = beside(x, y, apart).into_iter();
            let dimmer = near.filter(|&(u, v)| plane.at(u, v) < least);
            if dimmer.count() <= MEDIAN {
                return None;
            }
            let own = excess(plane, x, y, apart);
            let surroundings = here - own;
            let rest = own - NOISES * noise(x, y, surroundings);
            let is_hot = rest > 0.0 && rest > limit(x, y) * around(plane, x, y, apart);
            is_hot.then_some(HotPixel { x, y, surroundings })
        })
    });
    rows.collect()
}

/// Value of the pixel (`x`, `y`) minus the median of the eight at distance `apart`; zero where one
/// of them is beyond the border.
fn excess(plane: &Plane, x: usize, y: usize, apart: usize) -> f32 {
    let inner = |at: usize, end: usize| at >= apart && at + apart < end;
    if !inner(x, plane.width()) || !inner(y, plane.height()) {
        return 0.0;
    }
    let mut values = beside(x, y, apart).map(|(u, v)| plane.at(u, v));
    values.sort_unstable_by(f32::total_cmp);
    plane.at(x, y) - values[MEDIAN]
}

/// Second-largest magnitude of the excess of the eight pixels at distance 1 from (`x`, `y`) and of
/// the eight at distance 2; one of them may be hot, too.
fn around(plane: &Plane, x: usize, y: usize, apart: usize) -> f32 {
    let (mut largest, mut second) = (0.0f32, 0.0f32);
    for (u, v) in beside(x, y, 1).into_iter().chain(beside(x, y, 2)) {
        let magnitude = excess(plane, u, v, apart).abs();
        second = second.max(magnitude.min(largest));
        largest = largest.max(magnitude);
    }
    second
}

/// The eight places (column, row) at distance `apart` from (`x`, `y`).
fn beside(x: usize, y: usize, apart: usize) -> [(usize, usize); 8] {
    let columns = [x - apart, x, x + apart];
    let [above, here, below] = [y - apart, y, y + apart].map(|y| columns.map(|x| (x, y)));
    [above[0], above[1], above[2], here[0], here[2], below[0], below[1], below[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::example_lens::gaussians;
    use crate::deconvolution::lens_model::LensModel;
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};

    const PHOTO: Size = Size::new(96, 80);
    const NOISE: f32 = 0.5;

    /// Dim noise-like texture with bright points, through a lens, with noise.
    fn photo() -> (LensFunctions, Plane) {
        let functions = gaussians([1.2; 3]);
        let lens = LensModel::new(PHOTO, 0, &functions).unwrap();
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(4);
        let scene = Plane::from_fn(PHOTO, |_, _| match random.random_range(0..200) {
            0 => 2000.0,
            n => 20.0 + n as f32 / 4.0,
        });
        let mut photo = Plane::zeros(PHOTO);
        lens.forward(Channel::Green, &scene, &mut photo);
        let noisy = photo.map(|v: f32| {
            let noise: f32 = StandardNormal.sample(&mut random);
            v + NOISE * noise
        });
        (functions, noisy)
    }

    fn found(functions: &LensFunctions, photo: &Plane, apart: usize) -> Vec<(usize, usize)> {
        let field = Rect { x: 0, y: 0, size: PHOTO };
        let limits = IsolationLimits::new(functions, field, Channel::Green, apart);
        let hot = hot_pixels(photo, apart, |x, y| limits.at(x, y), |_, _, _| NOISE);
        hot.iter().map(|hot| (hot.x, hot.y)).collect()
    }

    #[test]
    fn points_of_a_scene_are_not_hot_and_single_pixels_are() {
        let (functions, mut photo) = photo();
        for apart in [1, 2] {
            assert_eq!(found(&functions, &photo, apart), []);
        }
        // Two of them side by side.
        let hot = [(30, 20), (60, 41), (61, 41), (17, 66)];
        hot.iter().for_each(|&(x, y)| photo.set(x, y, photo.at(x, y) + 150.0));
        for apart in [1, 2] {
            assert_eq!(found(&functions, &photo, apart), [hot[0], hot[1], hot[2], hot[3]]);
        }
    }

    #[test]
    fn planes_too_small_to_compare_have_none() {
        let limits = |_: usize, _: usize| 0.0;
        for size in [Size::new(0, 0), Size::new(1, 9), Size::new(4, 3)] {
            assert_eq!(hot_pixels(&Plane::filled(size, 9.0), 2, limits, |_, _, _| 0.0), []);
        }
    }
}
