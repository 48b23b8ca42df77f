//! What can be known of a result whose photo is a lossy WebP: brightness is stated in steps, and
//! only what lies beyond them speaks.

use rayon::prelude::*;

use super::Pipeline;
use super::evidence::{DATA_SHARE_MIN, FILLED_IN, known_of, sum};
use super::prepare::median;
use super::stages::{Prepared, Residuals};
use crate::deconvolution::data_term::MISSING;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::rounded::Rounded;
use crate::frame::{Channel, Frame, Plane, Rect, Work};

/// Of a lossy WebP, whose own photograph through the lens lies beyond its steps by no more than
/// this share of half a step, nothing can be told. Set on a dark and a calm photo: from quality 75
/// and 30 down their results gained .012 SSIM at most, their colours got worse, and a sharp photo
/// would pass.
const CODED_AWAY: f32 = 0.07;

impl Pipeline {
    /// Whether `photo` was coded so coarsely that what the lens does lies within its steps.
    pub(super) fn is_coded_away(&self, photo: &Prepared<'_>) -> bool {
        photo.rounded.as_ref().is_some_and(|rounded| {
            let lens = self.lens_of(photo);
            let seen = lens.seen(photo.channels.list(), &photo.placed);
            let left = self.beyond_steps(photo, rounded, lens, &seen);
            left.untouched <= CODED_AWAY * rounded.half_step()
        })
    }

    /// What `lens` leaves unexplained of the brightness of a lossy WebP, in codes, where the
    /// candidate is `seen` so through it.
    pub(super) fn beyond_steps(
        &self,
        photo: &Prepared<'_>,
        rounded: &Rounded,
        lens: &LensModel,
        seen: &Frame<Work>,
    ) -> Residuals {
        let channels = photo.channels.list();
        let trusts: Vec<Plane<u8>> =
            channels.par_iter().map(|&c| known_of(photo, lens, c)).collect();
        let Rect { x: left, y: top, size } = photo.rect;
        let known =
            |x: usize, y: usize| trusts.iter().all(|trust| trust.at(left + x, top + y) != MISSING);
        let pixels = (0..size.area()).filter(|n| known(n % size.width, n / size.width)).count();
        let untouched = lens.seen(channels, &photo.placed);
        let brightness = rounded.brightness(seen);
        let filled_in = photo.filled_in.map_or(0.0, |mosaic| {
            let filled = Frame::from_fn(|c| mosaic.filled(c, seen.plane(c)));
            let missed = rounded.brightness(&filled);
            FILLED_IN * apart(&missed, &brightness)
        });
        let light = Channel::ALL.map(|c| median(photo.photo.plane(c)));
        let of_camera = Channel::ALL.map(|c| self.noise[c.index()].sigma(light[c.index()]));
        let sum_of = |of: &Frame<Work>| -> f64 {
            channels.iter().zip(&trusts).map(|(&c, trust)| sum(of.plane(c), trust)).sum()
        };
        let (made, placed) = (sum_of(seen), sum_of(&photo.placed));
        let (made, placed) = (made / pixels.max(1) as f64, placed / pixels.max(1) as f64);
        let has_a_say = pixels as f64 >= DATA_SHARE_MIN * size.area() as f64;
        Residuals {
            model: if has_a_say { rounded.beyond(&brightness, &known) } else { 0.0 },
            untouched: rounded.beyond(&rounded.brightness(&untouched), &known),
            photo_noise: rounded.noise_beyond(rounded.spread(light, of_camera).hypot(filled_in)),
            // Limits are shares of steps, which hide it.
            model_error: 0.0,
            light: if has_a_say { placed as f32 } else { 0.0 },
            excess_light: if has_a_say { (made - placed) as f32 } else { 0.0 },
            // In codes as all of it, and not asked.
            contrast: f32::INFINITY,
        }
    }
}

/// RMS difference of two planes.
fn apart(a: &Plane, b: &Plane) -> f32 {
    let mut difference = a.clone();
    difference.add_scaled(-1.0, b);
    (difference.dot(&difference) / difference.size().area() as f64).sqrt() as f32
}
