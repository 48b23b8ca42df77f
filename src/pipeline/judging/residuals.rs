//! Residuals of a photo under the lens model, channel by channel.

use std::borrow::Cow;

use rayon::prelude::*;

use super::distance::lightness;
use super::evidence::{Evidence, Residuals};
use super::fine_colour::FineColour;
use super::grain::Grain;
use super::limits::{DATA_SHARE_MIN, FILLED_IN};
use crate::deconvolution::data_term::{MISSING, SATURATED, residual_in_place, rms_over_data};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::method::Solution;
use crate::frame::{Channel, Frame, Plane, Work, once};
use crate::pipeline::Pipeline;
use crate::pipeline::stages::{Prepared, Solved};

impl Pipeline {
    /// Evidence about `solved` by itself, without a reference solution.
    pub fn evidence(&self, photo: &Prepared<'_>, solved: &Solved) -> Evidence {
        let photo_seen = lightness(&photo.photo, photo.observation.channels);
        let result = lightness(&solved.picture, photo.observation.channels);
        Evidence {
            channels: self.residuals(photo, &self.predicted(photo, solved)),
            grain: Grain::of(&result, &photo_seen),
            fine_colour: FineColour::of(&solved.picture, photo.observation.channels),
        }
    }

    /// The prediction K̂L of what was `solved` for `photo`.
    pub(in crate::pipeline) fn predicted<'a>(
        &self,
        photo: &Prepared<'_>,
        solved: &'a Solved,
    ) -> Cow<'a, Frame<Work>> {
        let Solution { picture, prediction, .. } = &solved.solution;
        match prediction {
            Some(prediction) => Cow::Borrowed(prediction),
            None => Cow::Owned(
                self.lens_of(photo).model.seen(photo.observation.channels.list(), picture),
            ),
        }
    }

    /// Residuals of `photo` in each of its channels, `seen` being the candidate through the lens.
    pub(in crate::pipeline) fn residuals(
        &self,
        photo: &Prepared<'_>,
        seen: &Frame<Work>,
    ) -> Vec<Residuals> {
        let observation = &photo.observation;
        let expected = observation.sampling.expected_data(seen);
        let data = expected.as_ref().unwrap_or(&observation.light);
        // Computed before the channels run in parallel, or each would compute them.
        self.untouched(photo);
        self.model_error.shares(&self.lens.model, observation.rect);
        let residuals = |&c: &Channel| {
            let noise = observation.data_noise(c);
            let explained = Explained { seen: seen.plane(c), data: data.plane(c), noise };
            self.channel_residuals(photo, c, &explained)
        };
        photo.observation.channels.list().par_iter().map(residuals).collect()
    }

    /// Residuals of one channel of `photo`.
    pub(super) fn channel_residuals(
        &self,
        photo: &Prepared<'_>,
        c: Channel,
        &Explained { seen, data, noise }: &Explained<'_>,
    ) -> Residuals {
        let valid = valid_pixels(photo, &self.lens_of(photo).model, c);
        let count = valid.data().iter().filter(|&&t| t != MISSING).count();
        let minus = |data: &Plane| {
            let mut residual = seen.clone();
            residual_in_place(&mut residual, data, &valid);
            residual
        };
        let filled_in = photo.observation.sampling.interpolated().map_or(0.0, |mosaic| {
            let mut filled = mosaic.filled(c, seen);
            residual_in_place(&mut filled, seen, &valid);
            FILLED_IN * rms_over_data(&filled, &valid)
        });
        let placed = photo.observation.light.plane(c);
        let mean = |of: &Plane| (sum_over(of, &valid) / count.max(1) as f64) as f32;
        let light = mean(placed);
        let untouched = self.untouched(photo)[c.index()];
        // A channel with too few valid pixels is no evidence.
        let counts = count as f64 >= DATA_SHARE_MIN * photo.observation.rect.size.area() as f64;
        let if_it_counts = |value: f32| if counts { value } else { 0.0 };
        Residuals {
            model: if_it_counts(rms_over_data(&minus(data), &valid)),
            untouched,
            photo_noise: noise.hypot(filled_in),
            model_error: self.model_error.shares(&self.lens.model, photo.observation.rect)
                [c.index()]
                * untouched,
            light: if_it_counts(light),
            excess_light: if_it_counts(mean(&minus(placed))),
            contrast: rms_over_data(&placed.map(|v: f32| v - light), &valid),
        }
    }

    /// RMS of K̂B − B, grey levels, in each channel of the untouched `photo`; computed once.
    fn untouched(&self, photo: &Prepared<'_>) -> [f32; 3] {
        *once(&photo.untouched, || {
            let (observation, lens) = (&photo.observation, &self.lens_of(photo).model);
            let channels = observation.channels.list();
            let seen = lens.seen(channels, &observation.light);
            let expected = observation.sampling.expected_data(&seen);
            let data = expected.as_ref().unwrap_or(&observation.light);
            let residual = |&c: &Channel| {
                let valid = valid_pixels(photo, lens, c);
                let mut seen = seen.plane(c).clone();
                residual_in_place(&mut seen, data.plane(c), &valid);
                rms_over_data(&seen, &valid)
            };
            let found: Vec<f32> = channels.par_iter().map(residual).collect();
            let mut residuals = [0.0; 3];
            channels.iter().zip(found).for_each(|(c, found)| residuals[c.index()] = found);
            residuals
        })
    }
}

/// One channel of a candidate, and its data.
pub(super) struct Explained<'a> {
    /// The candidate through the lens.
    pub(super) seen: &'a Plane,
    /// The photo; if it is a JPEG, as decoded with this candidate.
    pub(super) data: &'a Plane,
    /// Noise of the data, grey levels.
    pub(super) noise: f32,
}

/// Valid pixels of a channel of `photo`: those to which `lens` brings no light from saturated
/// pixels, whose excess is unknown. If saturated pixels are everywhere, as in clipped noise or
/// lights at night, the reach is halved until enough pixels remain.
pub(in crate::pipeline) fn valid_pixels(
    photo: &Prepared<'_>,
    lens: &LensModel,
    c: Channel,
) -> Plane<u8> {
    let trust = photo.observation.trust.plane(c);
    let mut reach = lens.functions().support_px / 2;
    loop {
        let valid = away_from_saturated(trust, reach);
        let count = valid.data().iter().filter(|&&t| t != MISSING).count();
        if reach == 0 || count as f64 >= DATA_SHARE_MIN * photo.observation.rect.size.area() as f64
        {
            return valid;
        }
        reach /= 2;
    }
}

fn sum_over(plane: &Plane, valid: &Plane<u8>) -> f64 {
    let values = plane.data().iter().zip(valid.data()).filter(|&(_, &t)| t != MISSING);
    values.map(|(&v, _)| f64::from(v)).sum()
}

/// `trust` with the pixels within `reach` of a saturated one marked missing.
fn away_from_saturated(trust: &Plane<u8>, reach: usize) -> Plane<u8> {
    let mut valid = trust.clone();
    let near = |at: usize, length: usize| at.saturating_sub(reach)..(at + reach + 1).min(length);
    let width = trust.width();
    for y in 0..trust.height() {
        // Runs of saturated pixels, each widened by the reach.
        let mut from = 0;
        for run in trust.row(y).chunk_by(|a, b| (*a == SATURATED) == (*b == SATURATED)) {
            let columns = from..from + run.len();
            from = columns.end;
            if run[0] != SATURATED {
                continue;
            }
            let columns = near(columns.start, width).start..near(columns.end - 1, width).end;
            for y in near(y, trust.height()) {
                valid.row_mut(y)[columns.clone()].fill(MISSING);
            }
        }
    }
    valid
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::data_term::TRUSTED;
    use crate::frame::Size;

    #[test]
    fn pixels_near_a_saturated_one_are_not_valid() {
        let size = Size::new(19, 17);
        let saturated = [(4, 3), (5, 3), (18, 0), (0, 16), (9, 11)];
        let trust = Plane::from_fn(size, |x, y| match (x, y) {
            at if saturated.contains(&at) => SATURATED,
            _ => TRUSTED,
        });
        for reach in [0, 2, 30] {
            let valid = away_from_saturated(&trust, reach);
            for (x, y) in (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y))) {
                let near =
                    |&(sx, sy): &(usize, usize)| x.abs_diff(sx) <= reach && y.abs_diff(sy) <= reach;
                let is_valid = valid.at(x, y) == TRUSTED;
                assert_eq!(is_valid, !saturated.iter().any(near), "({x}, {y}) by {reach}");
            }
        }
    }
}
