//! The focus of a photo's colours against each other.
//!
//! The lens is measured in the panel's narrow light, at the panel's distance. Through a lens with
//! longitudinal chromatic aberration, a scene somewhat nearer or farther, or of broader light, has
//! in each channel a blur between those measured for neighbouring channels, or just beyond them:
//!
//! ```text
//! H′_R = H_R + s (H_G − H_R)    H′_G = H_G + min(s, 0) (H_G − H_R)    H′_B = H_B + t (H_G − H_B)
//! ```
//!
//! A change of focus moves red and green by the same dioptres, hence one s for both. Green, the
//! sharpest, is not extrapolated to a sharper one, which would amplify noise.
//!
//! Of one scene x, y_R = H_R x and y_G = H_G x agree once each is blurred by the other's function.
//! Where a scene's red lies locally along a line in its green, H_G y_R = a H_R y_G + b, with a and
//! b of the place; s minimises the residual of this regression, and t that of blue on green.

use std::f32::consts::PI;

use rayon::prelude::*;

use super::colour_axis::width_px;
use super::data_term::SATURATED;
use super::lens_model::{LensFunctions, LensModel};
use super::level_norms::LevelNorms;
use super::observation::{DataKind, Observation};
use super::one_blur::{TILES, TILES_MIN};
use super::smoothing::{blur, halve, mean_around};
use crate::frame::{Channel, Channels, Frame, Plane, Rect, Size, Work};

/// σ of the window of the regression, in widths of the equal blur: of 0.5, 1 and 2 that with the
/// least scatter (`lab focus`, tests/tables/README.md).
const REACH: f32 = 1.0;
/// Residual of the regression, as a share of the details' power, up to which a place's channels lie
/// along a line. Guess.
const ALONG_LINE: f32 = 0.1;
/// Power of details over that of noise below which a place shows nothing. Guess.
const DETAILS: f32 = 4.0;
/// Gauss–Newton steps; the residual is nearly linear in a share.
const STEPS: usize = 3;
/// σ of shares before a photo is seen: 5 % of distance, or broad light, change them by 0.1 to 0.2
/// (`simulated.toml`).
const EXPECTED: f32 = 0.15;
/// Error of a share for each RMS of the residual in units of the change by a share of 1, as colours
/// along no line cause it: the scatter over nine scenes of `truthful.toml`.
const OFF_LINE: f32 = 0.1;
/// Largest share: beyond, the channels show different things.
const SHARE_MAX: f32 = 0.5;

/// Shares between the functions of neighbouring channels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColourFocus {
    /// s, of red and green.
    pub red_green: f32,
    /// t, of blue.
    pub blue: f32,
}

impl ColourFocus {
    /// Estimates the shares of `photo`, taken through `model`; `line_up` undoes the lateral
    /// chromatic aberration of light on the canvas. `None` for grey photos, for JPEGs, and where
    /// too little of the photo has details.
    ///
    /// # Panics
    /// When the photo does not have the model's canvas.
    pub fn of(
        model: &LensModel,
        photo: &Observation,
        line_up: impl FnOnce(&Frame<Work>) -> Frame<Work>,
    ) -> Option<ColourFocus> {
        // The coding of a JPEG's colours would pass for blur.
        if photo.channels == Channels::Green || photo.sampling.kind() == DataKind::Jpeg {
            return None;
        }
        let light = match photo.sampling.mosaic() {
            Some(mosaic) => {
                line_up(&Frame::from_fn(|c| mosaic.interpolated_finely(c, photo.light.plane(c))))
            }
            None => line_up(&photo.light),
        };
        let [red, green, blue] = Channel::ALL;
        let through = |lens: Channel, of: Channel| {
            let mut seen = Plane::zeros(light.size());
            model.forward(lens, light.plane(of), &mut seen);
            // Blurred twice, nothing finer than the coarser pixels remains.
            halve(&seen)
        };
        let places = ColourPlaces::of(photo, model.functions());
        let green_by_green = through(green, green);
        let share = |of: Plane, on: Plane| {
            let change = difference(&green_by_green, &on);
            ChannelPair { of, on, change }.share(&places)
        };
        let red_green = share(through(green, red), through(red, green));
        let beyond = red_green.unwrap_or(0.0).min(0.0);
        let mut blue_by_green = through(green, blue);
        if beyond < 0.0 {
            let change = difference(&blue_by_green, &through(red, blue));
            blue_by_green.add_scaled(beyond, &change);
        }
        let toward_green = share(blue_by_green, through(blue, green));
        log::debug!("focus of the colours: shares of {red_green:.3?} and {toward_green:.3?}");
        (red_green.is_some() || toward_green.is_some()).then(|| ColourFocus {
            red_green: red_green.unwrap_or(0.0),
            blue: toward_green.unwrap_or(0.0),
        })
    }

    /// The functions of a photo, where those measured are `measured`.
    pub fn functions(self, measured: &LensFunctions) -> LensFunctions {
        let [red, green, blue] = measured.taps.each_ref();
        let moved = |own: &[f32], other: &[f32], share: f32| {
            let taps = own.iter().zip(other);
            taps.map(|(own, other)| own + share * (other - own)).collect()
        };
        let taps = [
            moved(red, green, self.red_green),
            moved(green, red, self.green_toward_red()),
            moved(blue, green, self.blue),
        ];
        LensFunctions { taps, ..*measured }
    }

    /// Bounds on ‖K‖² of [`ColourFocus::functions`], from those of the measured ones.
    pub fn norms_squared(self, measured: &[f32; 3]) -> [f32; 3] {
        self.bounds(measured, |a, b| a.max(*b), |norm, factor| norm * factor.powi(2))
    }

    /// The same for the norms of wavelet levels.
    pub fn level_norms(self, measured: &[LevelNorms; 3]) -> [LevelNorms; 3] {
        self.bounds(measured, LevelNorms::or_larger, LevelNorms::scaled)
    }

    /// The larger of two norms for functions between them, since norms are convex; for those beyond
    /// their own, its extrapolation.
    fn bounds<T: Clone>(
        self,
        [red, green, blue]: &[T; 3],
        larger: impl Fn(&T, &T) -> T,
        scaled: impl Fn(&T, f32) -> T,
    ) -> [T; 3] {
        let moved = |own: &T, other: &T, share: f32| match share {
            0.0 => own.clone(),
            between if between > 0.0 => larger(own, other),
            beyond => scaled(own, 1.0 - beyond),
        };
        [
            moved(red, green, self.red_green),
            moved(green, red, self.green_toward_red()),
            moved(blue, green, self.blue),
        ]
    }

    fn green_toward_red(self) -> f32 {
        (-self.red_green).max(0.0)
    }
}

/// Where a photo shows the focus of its colours, at half its resolution.
struct ColourPlaces {
    /// The photo without the border that light from outside reaches.
    rect: Rect,
    /// Positive where saturated data reach; `None` without any.
    saturated: Option<Plane>,
    /// σ of windows, pixels.
    reach_px: f32,
    /// Noise power of a channel blurred twice.
    noise: f32,
}

impl ColourPlaces {
    fn of(photo: &Observation, functions: &LensFunctions) -> ColourPlaces {
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
        }
    }

    /// The place of each pixel that shows something, with its tile.
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

/// Two channels, each blurred by the other's function: `of` lies along lines in `on`, if that is
/// changed by the right share of `change`.
struct ChannelPair {
    of: Plane,
    on: Plane,
    change: Plane,
}

/// Sums of one tile.
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
    /// The likeliest share; `None` where too little shows it, or it is implausible.
    fn share(&self, places: &ColourPlaces) -> Option<f32> {
        let (mut share, mut error) = (0.0, f32::INFINITY);
        for _ in 0..STEPS {
            let mut tiles = self.tiles(places, share);
            tiles.retain(|tile| tile.changes > 0.0);
            if tiles.len() < TILES_MIN {
                return None;
            }
            let step = median_step(&mut tiles);
            share += step;
            let changes: f32 = tiles.iter().map(|tile| tile.changes).sum();
            let residuals: f32 = tiles.iter().map(|tile| tile.residuals).sum();
            let scatter = |tile: &TileSums| (tile.products - step * tile.changes).powi(2);
            let standard = tiles.iter().map(scatter).sum::<f32>().sqrt() / changes;
            error = standard.hypot(OFF_LINE * (residuals / changes).sqrt());
        }
        let likeliest = share / (1.0 + (error / EXPECTED).powi(2));
        (share.abs() <= SHARE_MAX).then_some(likeliest)
    }

    /// The sums of all tiles at `share`, relative to the details' power of each place.
    fn tiles(&self, places: &ColourPlaces, share: f32) -> Vec<TileSums> {
        let mut on = self.on.clone();
        on.add_scaled(share, &self.change);
        let local = Local::of([&self.of, &on, &self.change], places.reach_px);
        let mut tiles = vec![TileSums::default(); TILES.0 * TILES.1];
        for (x, y, tile) in places.each() {
            let n = y * on.width() + x;
            let LineMoments { of, on, of_on, change_on } = local.moments(n);
            let is_along_line =
                of_on > 0.0 && of - of_on * of_on / on.max(f32::MIN_POSITIVE) < ALONG_LINE * of;
            if of.min(on) < DETAILS * places.noise || !is_along_line {
                continue;
            }
            let [of_here, on_here, change_here] = local.details(n);
            let slope = of_on / on;
            let residual = of_here - slope * on_here;
            // The slope follows the change.
            let change = slope * (change_here - change_on / on * on_here);
            let sums = &mut tiles[tile];
            sums.products += residual * change / of;
            sums.changes += change * change / of;
            sums.residuals += residual * residual / of;
        }
        tiles
    }
}

/// Three planes `of`, `on` and `change`, their means and mean products in windows.
struct Local<'a> {
    planes: [&'a Plane; 3],
    means: Vec<Plane>,
    products: Vec<Plane>,
}

/// Variances and covariances in a window.
struct LineMoments {
    of: f32,
    on: f32,
    of_on: f32,
    change_on: f32,
}

impl<'a> Local<'a> {
    /// Means in Gaussian windows of σ `reach_px`.
    fn of(planes: [&'a Plane; 3], reach_px: f32) -> Local<'a> {
        let product = |&[a, b]: &[usize; 2]| {
            let mut product = planes[a].clone();
            product.data_mut().iter_mut().zip(planes[b].data()).for_each(|(v, b)| *v *= b);
            blur(&product, reach_px)
        };
        let (means, products) = rayon::join(
            || planes.par_iter().map(|plane| blur(plane, reach_px)).collect(),
            || [[0, 0], [1, 1], [0, 1], [2, 1]].par_iter().map(product).collect(),
        );
        Local { planes, means, products }
    }

    fn moments(&self, n: usize) -> LineMoments {
        let [of, on, change] = [0, 1, 2].map(|k: usize| self.means[k].data()[n]);
        let product = |k: usize| self.products[k].data()[n];
        LineMoments {
            of: product(0) - of * of,
            on: product(1) - on * on,
            of_on: product(2) - of * on,
            change_on: product(3) - change * on,
        }
    }

    /// The planes less their means.
    fn details(&self, n: usize) -> [f32; 3] {
        [0, 1, 2].map(|k: usize| self.planes[k].data()[n] - self.means[k].data()[n])
    }
}

/// The median of the tiles' own steps, weighted by their changes: a stamp in one corner does not
/// count.
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

fn difference(a: &Plane, b: &Plane) -> Plane {
    let mut difference = a.clone();
    difference.add_scaled(-1.0, b);
    difference
}

#[cfg(test)]
mod tests;
