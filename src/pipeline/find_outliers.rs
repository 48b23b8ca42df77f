//! Local search for outliers, in windows as wide as the blur.
//!
//! A window is judged as a whole photo is: by the residual of a first solve over its floor, which
//! noise and the lens model's error leave, times that residual over the untouched photo's. Outliers
//! are masked as missing data, and the photo is solved again.

use super::Pipeline;
use super::judging::limits::{FOREIGN_REST, INFORMATIVE, OUTLIERS, OUTLIERS_MOST, OutlierLimits};
use super::judging::{Residuals, valid_pixels};
use super::outliers::{Outliers, connected};
use super::stages::{Prepared, Solved};
use crate::deconvolution::data_term::{MISSING, NOISE_MIN, residual_in_place};
use crate::deconvolution::smoothing::{fill, mean_around};
use crate::frame::{Channel, Frame, Plane, Size, Work};

/// Local errors on the canvas: RMS over windows, the largest among the channels.
struct LocalErrors {
    /// Residual over its floor, times residual over the untouched photo's.
    unexplained: Plane,
    /// The untouched photo's residual over noise.
    of_lens: Plane,
}

impl Pipeline {
    /// `photo` with the outliers masked that a first result `solved` shows. `None` without any,
    /// with so many that the photo is foreign, or if `solved` does not explain the rest.
    pub(super) fn without_outliers<'a>(
        &self,
        photo: &Prepared<'a>,
        solved: &Solved,
    ) -> Option<Prepared<'a>> {
        let rect = photo.observation.rect;
        let seen = self.predicted(photo, solved);
        let LocalErrors { unexplained, of_lens } = self.local_errors(photo, &seen);
        let unexplained = unexplained.crop(rect);
        let informative = of_lens.crop(rect).map(|value: f32| value > INFORMATIVE);
        let reach = self.lens_of(photo).model.functions().support_px / 2;
        // The strictest limits first: some of the less clear places are errors of the lens model.
        OUTLIERS.iter().find_map(|limits| {
            let found = outliers(&unexplained, limits);
            let everywhere = Plane::filled(rect.size, true);
            let shares = [&everywhere, &informative].map(|area| share_within(&found, area));
            if shares[0] == 0.0 || shares.iter().any(|&share| share > OUTLIERS_MOST) {
                return None;
            }
            let rest = self.masked(photo, &widened(&found, reach));
            let residuals = self.residuals(&rest, &seen);
            let is_explained = |of: &Residuals| f64::from(of.product()) <= FOREIGN_REST;
            residuals.iter().all(is_explained).then_some(rest)
        })
    }

    /// `photo` with the pixels that are set in `mask` (photo-sized) marked missing and filled in.
    fn masked<'a>(&self, photo: &Prepared<'a>, mask: &Plane<bool>) -> Prepared<'a> {
        let rect = photo.observation.rect;
        let mut rest = photo.unjudged();
        for c in Channel::ALL {
            let trust = rest.observation.trust.plane_mut(c);
            for y in 0..rect.size.height {
                let row = &mut trust.row_mut(rect.y + y)[rect.x..];
                let masked = row.iter_mut().zip(mask.row(y)).filter(|(_, masked)| **masked);
                masked.for_each(|(trust, _)| *trust = MISSING);
            }
            fill(rest.observation.light.plane_mut(c), mask, rect);
        }
        rest.outliers = Some(Outliers::of(mask));
        rest
    }

    fn local_errors(&self, photo: &Prepared<'_>, seen: &Frame<Work>) -> LocalErrors {
        let (observation, lens) = (&photo.observation, &self.lens_of(photo).model);
        let reach = lens.functions().support_px / 4;
        let untouched = lens.seen(observation.channels.list(), &observation.light);
        let expected = |seen: &Frame<Work>| observation.sampling.expected_data(seen);
        let expected = [expected(seen), expected(&untouched)];
        let [data, untouched_data] =
            expected.each_ref().map(|data| data.as_ref().unwrap_or(&observation.light));
        let shares = self.model_error.shares(&self.lens.model, observation.rect);
        let size = observation.size();
        let mut errors =
            LocalErrors { unexplained: Plane::zeros(size), of_lens: Plane::zeros(size) };
        for &c in observation.channels.list() {
            let valid = valid_pixels(photo, lens, c);
            let power = |seen: &Plane, data: &Plane| {
                let mut residual = seen.clone();
                residual_in_place(&mut residual, data, &valid);
                mean_around(&residual.map(|v: f32| v * v), reach)
            };
            let unexplained = power(seen.plane(c), data.plane(c));
            let of_lens = power(untouched.plane(c), untouched_data.plane(c));
            let known = mean_around(&valid.map(|t: u8| f32::from(u8::from(t != MISSING))), reach);
            let noise = observation.data_noise(c).max(NOISE_MIN).powi(2);
            let (light, dark) = (observation.light.plane(c), observation.dark_light[c.index()]);
            let mean = light.mean() as f32;
            // σ² ∝ L + L₀; constant where L₀ is infinite.
            let at_light = |light: f32| match dark.is_finite() {
                true => (light.max(0.0) + dark) / (mean + dark),
                false => 1.0,
            };
            let share = shares[c.index()].powi(2);
            for i in 0..size.area() {
                let (left, of_lens) = (unexplained.data()[i], of_lens.data()[i]);
                let noise = noise * known.data()[i] * at_light(light.data()[i]);
                if noise > 0.0 {
                    let over_floor = left / (noise + share * of_lens);
                    let product = (over_floor * left / (noise + of_lens)).sqrt();
                    let LocalErrors { unexplained, of_lens: by_lens } = &mut errors;
                    let (worst, lens) =
                        (&mut unexplained.data_mut()[i], &mut by_lens.data_mut()[i]);
                    *worst = worst.max(product);
                    *lens = lens.max((of_lens / noise).sqrt());
                }
            }
        }
        errors
    }
}

/// Mask of the connected places of a photo that are `unexplained` according to `limits`.
fn outliers(unexplained: &Plane, limits: &OutlierLimits) -> Plane<bool> {
    let mut found = Plane::filled(unexplained.size(), false);
    for area in connected(&unexplained.map(|value: f32| value > limits.of_any)) {
        if area.iter().any(|&(x, y)| unexplained.at(x, y) > limits.of_clearest) {
            area.iter().for_each(|&(x, y)| found.set(x, y, true));
        }
    }
    found
}

/// Share of the pixels of `area` that are set in `mask`.
fn share_within(mask: &Plane<bool>, area: &Plane<bool>) -> f64 {
    let inside = mask.data().iter().zip(area.data()).filter(|&(_, &inside)| inside);
    let of_mask = inside.clone().filter(|&(&is_set, _)| is_set).count();
    of_mask as f64 / inside.count().max(1) as f64
}

/// Mask of the pixels within `reach` of one that is set in `is`.
fn widened(is: &Plane<bool>, reach: usize) -> Plane<bool> {
    let Size { width, height } = is.size();
    let near = |at: usize, length: usize| at.saturating_sub(reach)..(at + reach + 1).min(length);
    let rows = Plane::from_fn(is.size(), |x, y| near(x, width).any(|x| is.at(x, y)));
    Plane::from_fn(is.size(), |x, y| near(y, height).any(|y| rows.at(x, y)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Rect;
    use crate::pipeline::outliers::areas;

    /// Two places above the lower limit; only the first has a pixel above the upper one.
    fn places() -> Plane {
        Plane::from_fn(Size::new(30, 20), |x, y| match (x, y) {
            (6, 4) => 2.0 * OUTLIERS[0].of_clearest,
            (4..=8, 3..=5) | (20..=25, 10..=12) => 1.1 * OUTLIERS[0].of_any,
            _ => 0.5,
        })
    }

    #[test]
    fn a_place_is_an_outlier_by_its_clearest_pixel() {
        let found = outliers(&places(), &OUTLIERS[0]);
        let clear = Rect { x: 4, y: 3, size: Size::new(5, 3) };
        assert_eq!(areas(&found.map(|is: bool| f32::from(u8::from(is)))), [clear]);
        let wide = areas(&widened(&found, 2).map(|is: bool| f32::from(u8::from(is))));
        assert_eq!(wide, [Rect { x: 2, y: 1, size: Size::new(9, 7) }]);
    }
}
