//! Regression of one channel on another along a scene's local colour lines.
//!
//! Where the local colours lie along a line, one channel is a linear function of the other,
//! y = a x + b, with local a and b. Both channels change with a global parameter f of the lens
//! functions, y = y₀ + f·y₁ and x = x₀ + f·x₁; f minimises the residual relative to the details of
//! y. Its error follows from the scatter over tiles.

use std::f32::consts::PI;

use rayon::prelude::*;

use super::colour_axis::width_px;
use super::data_term::SATURATED;
use super::lens_model::LensFunctions;
use super::observation::Observation;
use super::smoothing::{blur, halve, mean_around};
use crate::frame::{Channel, Plane, Rect, Size};

/// σ of the regression window, in widths of the equal blur: among 0.5, 1 and 2 the one with the
/// least scatter (`lab focus`).
const REACH: f32 = 1.0;
/// Maximum residual of the regression, as a share of the details' power, where channels count as
/// lying along a line. Guess.
const ALONG_LINE: f32 = 0.1;
/// Minimum ratio of detail power to noise power for a pixel to be used: at 4, noise makes dark
/// scenes look nearer by 0.1 (`simulated.toml`); at 160 some show too little.
const DETAILS: f32 = 40.0;
/// Columns and rows of tiles. Guess.
const TILES: (usize, usize) = (16, 12);
/// Minimum number of tiles with details for an estimate. Guess.
const TILES_MIN: usize = 8;
/// Maximum number of Gauss–Newton steps; the residual is nearly linear in the parameter.
const STEPS: usize = 3;
/// Step, in prior σ, after which another would not change a result.
const LAST_STEP: f32 = 0.1;
/// Error of a parameter due to colours that lie along no line, per ratio of the residual's RMS to
/// the RMS of the change by 1: the scatter over nine scenes of `truthful.toml`.
const OFF_LINE: f32 = 0.1;
/// Share by which errors grow if cameras have interpolated pixels through a lens one pixel wide:
/// developed photos then look nearer by up to 0.2 (`truthful.toml`).
const INTERPOLATED: f32 = 3.0;
/// Largest plausible parameter, in prior σ; beyond it the channels show different things.
const PRIORS_MAX: f32 = 4.5;

/// Pixels of a photo that the regression can use, at half its resolution.
pub(super) struct ColourPlaces {
    /// The photo without the border that light from outside reaches.
    rect: Rect,
    /// Positive within the blur's reach of saturated data; `None` if there are none.
    saturated: Option<Plane>,
    /// σ of the regression windows, pixels at half resolution.
    reach_px: f32,
    /// Noise power of a channel after the second blur, grey levels².
    noise: f32,
    /// Factor of the parameter's error because of pixels that the camera interpolated, at least 1.
    interpolation: f32,
}

impl ColourPlaces {
    /// Usable pixels of `photo`, taken through a lens with `functions`.
    pub(super) fn of(photo: &Observation, functions: &LensFunctions) -> ColourPlaces {
        let margin = functions.support_px / 2;
        let Rect { x, y, size } = photo.rect;
        let inner = |length: usize| length.saturating_sub(2 * margin) / 2;
        let is_saturated = |x: usize, y: usize| {
            Channel::ALL.iter().any(|&c| photo.trust.plane(c).at(x, y) == SATURATED)
        };
        let saturated: Plane =
            Plane::from_fn(photo.size(), |x, y| f32::from(u8::from(is_saturated(x, y))));
        let is_any = saturated.data().iter().any(|&v| v > 0.0);
        let width_px = width_px(functions);
        let power = |c: Channel| photo.noise[c.index()].powi(2) * photo.pixels_a_datum(c);
        let power = Channel::ALL.into_iter().map(power).fold(0.0, f32::max);
        ColourPlaces {
            rect: Rect {
                x: (x + margin) / 2,
                y: (y + margin) / 2,
                size: Size::new(inner(size.width), inner(size.height)),
            },
            saturated: is_any.then(|| mean_around(&halve(&saturated), margin / 2)),
            reach_px: REACH * width_px / 2.0,
            // White noise through a Gaussian of this σ keeps a power of 1/(4π σ²).
            noise: power / (4.0 * PI * width_px.powi(2)),
            interpolation: match photo.sampling.mosaic() {
                Some(_) => 1.0,
                None => 1.0 + INTERPOLATED / width_px.powi(2),
            },
        }
    }

    /// Each pixel (x, y) away from the border and from saturated data, with its tile.
    fn each(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        let Rect { x: left, y: top, size } = self.rect;
        let (columns, rows) = TILES;
        let inside = (0..size.height).flat_map(move |y| (0..size.width).map(move |x| (x, y)));
        inside.filter_map(move |(x, y)| {
            let tile = y * rows / size.height * columns + x * columns / size.width;
            let (x, y) = (left + x, top + y);
            let is_saturated = self.saturated.as_ref().is_some_and(|of| of.at(x, y) > 0.0);
            (!is_saturated).then_some((x, y, tile))
        })
    }
}

/// A channel at half resolution, which changes linearly with a parameter from its prior mean.
pub(super) struct Moving {
    pub(super) expected: Plane,
    pub(super) change: Plane,
}

impl Moving {
    fn at(&self, parameter: f32) -> Plane {
        let mut plane = self.expected.clone();
        plane.add_scaled(parameter, &self.change);
        plane
    }
}

/// Two channels: with the right parameter, `of` is locally a linear function of `on`.
pub(super) struct ChannelPair {
    pub(super) of: Moving,
    pub(super) on: Moving,
}

/// Sums over one tile.
#[derive(Clone, Copy, Default)]
struct TileSums {
    /// Products of residual and change.
    products: f32,
    /// Squares of the change.
    changes: f32,
    /// Squares of the residual.
    residuals: f32,
}

impl ChannelPair {
    /// Most probable difference of the parameter from its prior mean, given its prior σ; `None` if
    /// too few tiles have details or the parameter is implausible.
    pub(super) fn fit(&self, places: &ColourPlaces, prior: f32) -> Option<f32> {
        let (mut parameter, mut error) = (0.0, f32::INFINITY);
        for _ in 0..STEPS {
            let mut tiles = self.tiles(places, parameter);
            tiles.retain(|tile| tile.changes > 0.0);
            if tiles.len() < TILES_MIN {
                return None;
            }
            let step = median_step(&mut tiles);
            parameter += step;
            let changes: f32 = tiles.iter().map(|tile| tile.changes).sum();
            let residuals: f32 = tiles.iter().map(|tile| tile.residuals).sum();
            let scatter = |tile: &TileSums| (tile.products - step * tile.changes).powi(2);
            let standard = tiles.iter().map(scatter).sum::<f32>().sqrt() / changes;
            let off_line = OFF_LINE * (residuals / changes).sqrt();
            error = places.interpolation * standard.hypot(off_line);
            if step.abs() < LAST_STEP * prior {
                break;
            }
        }
        let likeliest = parameter / (1.0 + (error / prior).powi(2));
        (parameter.abs() <= PRIORS_MAX * prior).then_some(likeliest)
    }

    /// Sums of all tiles at `parameter`; each pixel is relative to its local power of details.
    fn tiles(&self, places: &ColourPlaces, parameter: f32) -> Vec<TileSums> {
        let [of, on] = [&self.of, &self.on].map(|channel| channel.at(parameter));
        let planes = [&of, &on, &self.of.change, &self.on.change];
        let local = Local::of(planes, places.reach_px);
        let mut tiles = vec![TileSums::default(); TILES.0 * TILES.1];
        for (x, y, tile) in places.each() {
            let n = y * on.width() + x;
            let LineMoments { of, on, of_on, changes_on, change_of } = local.moments(n);
            let is_along_line =
                of_on > 0.0 && of - of_on * of_on / on.max(f32::MIN_POSITIVE) < ALONG_LINE * of;
            if of.min(on) < DETAILS * places.noise || !is_along_line {
                continue;
            }
            let [of_here, on_here, changes_here @ ..] = local.details(n);
            let slope = of_on / on;
            let residual = of_here - slope * on_here;
            let change = |[of, on]: [f32; 2]| slope * on - of;
            // The fitted slope depends on the parameter, too.
            let change = change(changes_here) - change(changes_on) / on * on_here;
            // Blur shrinks all details; the residual counts relative to them.
            let change = change + change_of / of * residual;
            let sums = &mut tiles[tile];
            sums.products += residual * change / of;
            sums.changes += change * change / of;
            sums.residuals += residual * residual / of;
        }
        tiles
    }
}

/// Two channels and their changes, with their means and mean products in windows.
struct Local<'a> {
    planes: [&'a Plane; 4],
    means: Vec<Plane>,
    products: Vec<Plane>,
}

/// Variances and covariances in a window.
struct LineMoments {
    of: f32,
    on: f32,
    of_on: f32,
    changes_on: [f32; 2],
    change_of: f32,
}

impl<'a> Local<'a> {
    /// Means in Gaussian windows of σ `reach_px`.
    fn of(planes: [&'a Plane; 4], reach_px: f32) -> Local<'a> {
        let product = |&[a, b]: &[usize; 2]| {
            let mut product = planes[a].clone();
            product.multiply(planes[b]);
            blur(&product, reach_px)
        };
        let (means, products) = rayon::join(
            || planes.par_iter().map(|plane| blur(plane, reach_px)).collect(),
            || [[0, 0], [1, 1], [0, 1], [2, 1], [3, 1], [2, 0]].par_iter().map(product).collect(),
        );
        Local { planes, means, products }
    }

    fn moments(&self, n: usize) -> LineMoments {
        let means = [0, 1, 2, 3].map(|k: usize| self.means[k].data()[n]);
        let product = |k: usize| self.products[k].data()[n];
        let [of, on, of_change, on_change] = means;
        LineMoments {
            of: product(0) - of * of,
            on: product(1) - on * on,
            of_on: product(2) - of * on,
            changes_on: [product(3) - of_change * on, product(4) - on_change * on],
            change_of: product(5) - of_change * of,
        }
    }

    /// Deviations of the planes from their local means.
    fn details(&self, n: usize) -> [f32; 4] {
        [0, 1, 2, 3].map(|k: usize| self.planes[k].data()[n] - self.means[k].data()[n])
    }
}

/// Median of the tiles' own steps, weighted by their changes, so that a date stamp in one corner
/// has no influence.
fn median_step(tiles: &mut [TileSums]) -> f32 {
    let step = |tile: &TileSums| tile.products / tile.changes;
    tiles.sort_by(|a, b| step(a).total_cmp(&step(b)));
    let half = tiles.iter().map(|tile| tile.changes).sum::<f32>() / 2.0;
    let mut below = 0.0;
    let median = tiles.iter().find(|tile| {
        below += tile.changes;
        below >= half
    });
    median.map_or(0.0, step)
}
