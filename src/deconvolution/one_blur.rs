//! Whether a photo's colours have one blur or the lens's.
//!
//! A simple lens blurs blue otherwise than green, other cameras and resampling blur both alike. A
//! scene's blue lies locally along a line in its green, so blue is predicted twice:
//!
//! ```text
//! g′ = g + (K_B − K_G) (K_Gᵀ K_G + ε)⁻¹ K_Gᵀ g     green with the blur of blue
//! p  = a x + b,  x = g′ or x = g                    a, b: local regression of blue on x
//! ```
//!
//! With the powers P of p less the data in a tile, smoothed, the measure is the mean over the tiles
//! with details of (P(g′) − P(g)) / (P(g′) + P(g) + noise), in standard errors. Red shows little,
//! since lenses are focused between red and green.

use super::colour_axis::width_px;
use super::data_term::{NOISE_MIN, TRUSTED};
use super::focus::standard_errors;
use super::lens_model::{Density, LensModel};
use super::observation::Observation;
use super::smoothing::blur;
use crate::frame::{Channel, Channels, Plane, Rect};

/// ε. Guess: frequencies of which the lens passes less than a tenth stay as they are.
const EPSILON: f32 = 0.01;
/// σ of the window of the regression, in widths of the equal blur. Set on the limits, of 0.8 to
/// 1.7.
const REACH: f32 = 0.8;
/// σ of the smoothing of residuals, likewise; of 0 to 0.6.
const SMOOTHED: f32 = 0.3;
/// Columns and rows of tiles. Guess.
pub(super) const TILES: (usize, usize) = (16, 12);
/// Tiles with details below which a photo shows nothing. Guess.
pub(super) const TILES_MIN: usize = 8;
/// Power that the better prediction may leave of blue's details, as a share, where blue follows
/// green. Of 0.25, 0.1 and 0.05; with 0.25 photos of a retina, whose blue does not, are refused.
const FOLLOWED: f32 = 0.05;
/// Noise power that residuals have of themselves, smoothed, over the photo's. Guess.
const NOISE_SHARE: f32 = 0.25;

/// Standard errors by which one blur for blue and green explains `photo`, taken through `model`,
/// better than the lens's functions do; negative where these do. `None` for grey photos, for data
/// without [fine colours](super::observation::Sampling::has_fine_colours), and where too little of
/// the photo has details.
///
/// # Panics
/// When the observation does not have the model's canvas.
pub fn errors_for_one_blur(model: &LensModel, photo: &Observation) -> Option<f64> {
    let sampling = &photo.sampling;
    if photo.channels == Channels::Green || !sampling.has_fine_colours() {
        return None;
    }
    let green = photo.light.plane(Channel::Green);
    let width_px = width_px(model.functions());
    let lens = blue_residual(photo, &blurred_as_blue(model, green), width_px);
    let one_blur = blue_residual(photo, green, width_px);
    let blue_details = details_of(photo.light.plane(Channel::Blue), width_px);
    let noise = NOISE_SHARE * photo.noise[Channel::Blue.index()].powi(2);
    let trust = [Channel::Green, Channel::Blue].map(|c| photo.trust.plane(c));
    let gain = |tile: Rect| {
        let (mut powers, mut difference, mut details, mut count) = ([0.0f32; 2], 0.0, 0.0, 0);
        for y in tile.rows() {
            for x in tile.columns().filter(|&x| trust.iter().all(|of| of.at(x, y) == TRUSTED)) {
                powers[0] += lens.at(x, y).powi(2);
                powers[1] += one_blur.at(x, y).powi(2);
                difference += (lens.at(x, y) - one_blur.at(x, y)).powi(2);
                details += blue_details.at(x, y).powi(2);
                count += 1;
            }
        }
        let noise = count as f32 * noise;
        let all = powers[0] + powers[1] + noise;
        // A flat tile shows nothing but noise, which the lens's inverse amplifies; and where blue
        // does not follow green, neither prediction means anything.
        let is_along_line = powers[0].min(powers[1]) < FOLLOWED * details;
        let shows = difference > noise && is_along_line;
        shows.then(|| f64::from((powers[0] - powers[1]) / all))
    };
    let gains: Vec<f64> = photo.rect.parts(TILES.0, TILES.1).filter_map(gain).collect();
    (gains.len() >= TILES_MIN).then(|| standard_errors(&gains))
}

/// `green` with the blur of blue in place of its own.
fn blurred_as_blue(model: &LensModel, green: &Plane) -> Plane {
    let through = |channel: Channel, light: &Plane| {
        let mut seen = Plane::zeros(light.size());
        model.forward(channel, light, &mut seen);
        seen
    };
    let mut residual = through(Channel::Green, green);
    residual.update(green, |v, g| *v = g - *v);
    let inverse = model.local_inverse(Channel::Green, EPSILON, Density::Full);
    let mut sharp = Plane::zeros(green.size());
    model.invert(&inverse, &residual, &mut sharp);
    sharp.add_scaled(1.0, green);
    let mut as_blue = through(Channel::Blue, &sharp);
    let own = through(Channel::Green, &sharp);
    let changes = green.data().iter().zip(own.data());
    as_blue.data_mut().iter_mut().zip(changes).for_each(|(v, (g, own))| *v += g - own);
    as_blue
}

/// Blue's smoothed residual, its prediction being a line in `green`.
fn blue_residual(photo: &Observation, green: &Plane, width_px: f32) -> Plane {
    let blue = photo.light.plane(Channel::Blue);
    let noise = photo.noise[Channel::Green.index()].max(NOISE_MIN);
    let mut residual = along_line(blue, green, REACH * width_px, noise * noise);
    residual.add_scaled(-1.0, blue);
    blur(&residual, SMOOTHED * width_px)
}

/// Details of `plane`, smoothed as residuals are.
fn details_of(plane: &Plane, width_px: f32) -> Plane {
    let mut details = blur(plane, REACH * width_px);
    details.update(plane, |v, of| *v = of - *v);
    blur(&details, SMOOTHED * width_px)
}

/// `of` by local regression on `on`, which has noise of the power `noise`, in windows of σ `reach`
/// pixels.
fn along_line(of: &Plane, on: &Plane, reach: f32, noise: f32) -> Plane {
    let local = |a: &Plane, b: &Plane| {
        let mut product = a.clone();
        product.multiply(b);
        blur(&product, reach)
    };
    let (mean_of, mean_on) = (blur(of, reach), blur(on, reach));
    let (mut slope, variance) = (local(of, on), local(on, on));
    let mut offset = mean_of.clone();
    for (n, slope) in slope.data_mut().iter_mut().enumerate() {
        let (of, on) = (mean_of.data()[n], mean_on.data()[n]);
        *slope = (*slope - of * on) / ((variance.data()[n] - on * on).max(0.0) + noise);
        offset.data_mut()[n] -= *slope * on;
    }
    let (slope, mut line) = (blur(&slope, reach), blur(&offset, reach));
    let terms = slope.data().iter().zip(on.data());
    line.data_mut().iter_mut().zip(terms).for_each(|(v, (a, x))| *v = (*v + a * x).max(0.0));
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::example_lens::{gaussians, photo};

    fn lens(sigmas: [f32; 3]) -> LensModel {
        crate::deconvolution::example_lens::lens(&gaussians(sigmas))
    }

    #[test]
    fn the_lens_predicts_its_own_photos_and_one_blur_those_of_others() {
        let own = lens([1.4, 1.2, 2.0]);
        let errors = |of: &LensModel| errors_for_one_blur(&own, &photo(of, 3, Channels::Colour));
        let for_own = errors(&own).unwrap();
        assert!(for_own < -10.0, "{for_own}");
        for sigma in [0.5, 1.2, 2.0] {
            let for_other = errors(&lens([sigma; 3])).unwrap();
            assert!(for_other > 10.0, "{sigma} px: {for_other}");
        }
    }

    #[test]
    fn a_lens_with_one_blur_and_a_grey_photo_show_nothing() {
        let alike = lens([1.5; 3]);
        let lens = lens([1.4, 1.2, 2.0]);
        for (model, channels) in [(&alike, Channels::Colour), (&lens, Channels::Green)] {
            assert_eq!(errors_for_one_blur(model, &photo(model, 3, channels)), None);
        }
    }
}
