//! What a box can know of a result without knowing the scene.
//!
//! | evidence | what it shows |
//! |---|---|
//! | model residual over the photo's noise | a photo that no scene gives, or a changed rig |
//! | the same of the untouched photo | how much there was to gain, and whether noise hides it |
//! | distance from the reference solution, colours too | noise and ringing that the lens hides |
//! | grain of the flat parts, as it looks | the same, at the finest scale |
//! | colours that alternate finer than lightness | channels that another lens blurred otherwise |
//! | light more or less than the photo's | captures of a panel that is not as bright as it was |
//!
//! The *reference solution* is what total variation makes of the photo with the measured lens
//! ([`super::reference_solution`]): no capture goes into it, so nothing that happened to the rig
//! since it was measured can, and what is flat stays flat in it.

use std::borrow::Cow;
use std::sync::Arc;

use rayon::prelude::*;

use super::Pipeline;
use super::distance::lightness;
use super::fine_colour::FineColour;
use super::grain::Grain;
use super::stages::{Evidence, Prepared, Residuals, Solved};
use crate::deconvolution::data_term::{MISSING, SATURATED, residual_in_place, rms_over_data};
use crate::deconvolution::lens_model::LensModel;
use crate::frame::{Channel, Frame, Plane, Work, once};

/// A channel with less of its pixels away from saturated ones has no say. Guess.
const DATA_SHARE_MIN: f64 = 0.05;
/// What a camera fills in between its filters errs by so much of what means of the nearest sites
/// err by. Guess: by directions and by the other colours, cameras do twice as well.
const FILLED_IN: f32 = 0.5;

impl Pipeline {
    /// What can be known of what was `solved` for `photo`, by the lens as its captures say it is.
    pub(super) fn evidence(&self, photo: &Prepared<'_>, solved: &Solved) -> Evidence {
        let photo_seen = lightness(&photo.photo, photo.observation.channels);
        let result = lightness(&solved.picture, photo.observation.channels);
        let grain = Grain::of(&result, &photo_seen, &photo_seen);
        let cleared = Grain::of(&result, &photo_seen, &result);
        let fine_colour = FineColour::of(&solved.picture, photo.observation.channels);
        let seen = match &solved.solution.prediction {
            Some(predicted) => Cow::Borrowed(predicted),
            None => Cow::Owned(
                solved.lens.seen(photo.observation.channels.list(), &solved.solution.picture),
            ),
        };
        let channels = self.residuals(photo, &solved.lens, &seen);
        Evidence { channels, grain, cleared, fine_colour }
    }

    /// What `lens` leaves unexplained of `photo`, channel by channel, where the candidate is `seen`
    /// so through it.
    pub(super) fn residuals(
        &self,
        photo: &Prepared<'_>,
        lens: &LensModel,
        seen: &Frame<Work>,
    ) -> Vec<Residuals> {
        let observation = &photo.observation;
        let expected = observation.sampling.expected_data(seen);
        let data = expected.as_ref().unwrap_or(&observation.light);
        // Before the channels part: each would make them.
        let untouched = self.untouched(photo, lens);
        let missed = self.model_error.shares(&self.model, photo.observation.rect);
        let of = |&c: &Channel| {
            let n = c.index();
            let noise = observation.data_noise(c);
            let (seen, data) = (seen.plane(c), data.plane(c));
            let (untouched, missed) = (untouched[n], missed[n]);
            left_of(photo, lens, c, &InOneChannel { seen, data, noise, untouched, missed })
        };
        photo.observation.channels.list().par_iter().map(of).collect()
    }

    /// What `lens` leaves unexplained of one channel of `photo`, where the candidate is `seen` so
    /// through it.
    pub(super) fn residuals_of(
        &self,
        photo: &Prepared<'_>,
        lens: &LensModel,
        c: Channel,
        seen: &Plane,
    ) -> Residuals {
        let (data, noise) = (photo.observation.light.plane(c), photo.observation.noise[c.index()]);
        let untouched = self.untouched(photo, lens)[c.index()];
        let missed = self.model_error.shares(&self.model, photo.observation.rect)[c.index()];
        left_of(photo, lens, c, &InOneChannel { seen, data, noise, untouched, missed })
    }

    /// RMS of what `lens` leaves of the untouched `photo`, K̂B − B, grey levels in each channel
    /// that it has. Of the measured lens it is computed once.
    fn untouched(&self, photo: &Prepared<'_>, lens: &LensModel) -> [f32; 3] {
        let found = || {
            let channels = photo.observation.channels.list();
            let seen = lens.seen(channels, &photo.observation.light);
            let expected = photo.observation.sampling.expected_data(&seen);
            let data = expected.as_ref().unwrap_or(&photo.observation.light);
            let left_of = |&c: &Channel| {
                let trust = known_of(photo, lens, c);
                let mut seen = seen.plane(c).clone();
                residual_in_place(&mut seen, data.plane(c), &trust);
                rms_over_data(&seen, &trust)
            };
            let found: Vec<f32> = channels.par_iter().map(left_of).collect();
            let mut left = [0.0; 3];
            channels.iter().zip(found).for_each(|(c, found)| left[c.index()] = found);
            left
        };
        match std::ptr::eq(lens, Arc::as_ptr(self.lens_of(photo))) {
            true => *once(&photo.untouched, found),
            false => found(),
        }
    }
}

/// What `lens` leaves unexplained of one channel of `photo` by a candidate.
fn left_of(
    photo: &Prepared<'_>,
    lens: &LensModel,
    c: Channel,
    &InOneChannel { seen, data, noise, untouched, missed }: &InOneChannel<'_>,
) -> Residuals {
    let trust = known_of(photo, lens, c);
    let known = trust.data().iter().filter(|&&t| t != MISSING).count();
    let left = |mut seen: Plane, data: &Plane| {
        residual_in_place(&mut seen, data, &trust);
        seen
    };
    let filled_in = photo.observation.sampling.interpolated().map_or(0.0, |mosaic| {
        FILLED_IN * rms_over_data(&left(mosaic.filled(c, seen), seen), &trust)
    });
    let placed = photo.observation.light.plane(c);
    let mean = |of: &Plane| (sum(of, &trust) / known.max(1) as f64) as f32;
    let (light, excess_light) = (mean(placed), mean(&left(seen.clone(), placed)));
    let has_a_say = known as f64 >= DATA_SHARE_MIN * photo.observation.rect.size.area() as f64;
    let model = rms_over_data(&left(seen.clone(), data), &trust);
    Residuals {
        model: if has_a_say { model } else { 0.0 },
        untouched,
        photo_noise: noise.hypot(filled_in),
        model_error: missed * untouched,
        light: if has_a_say { light } else { 0.0 },
        excess_light: if has_a_say { excess_light } else { 0.0 },
        contrast: rms_over_data(&placed.map(|v: f32| v - light), &trust),
    }
}

/// What is known of a candidate in one channel.
struct InOneChannel<'a> {
    /// How it is seen through the lens.
    seen: &'a Plane,
    /// What the photo is for it.
    data: &'a Plane,
    /// The noise of that, grey levels.
    noise: f32,
    /// What the lens leaves of the photo itself, [`Pipeline::untouched`], grey levels.
    untouched: f32,
    /// The share that the lens model is known to miss of what the lens changes.
    missed: f32,
}

/// Where a channel of `photo` tells of a candidate through `lens`: not where light from beyond
/// saturated pixels falls. Where they lie everywhere, as clipped noise and a night's lights do, as
/// far from them as leaves the channel a say.
fn known_of(photo: &Prepared<'_>, lens: &LensModel, c: Channel) -> Plane<u8> {
    let trust = photo.observation.trust.plane(c);
    let mut reach = lens.functions().support_px / 2;
    loop {
        let known = away_from_saturated(trust, reach);
        let count = known.data().iter().filter(|&&t| t != MISSING).count();
        if reach == 0 || count as f64 >= DATA_SHARE_MIN * photo.observation.rect.size.area() as f64
        {
            return known;
        }
        reach /= 2;
    }
}

/// The same of `data` in place of the photo, where the rest is `known`.
pub(super) fn residuals_on(
    photo: &Prepared<'_>,
    lens: &LensModel,
    c: Channel,
    (seen, data): (&Plane, &Plane),
    known: Residuals,
) -> Residuals {
    let trust = known_of(photo, lens, c);
    let mut seen = seen.clone();
    residual_in_place(&mut seen, data, &trust);
    Residuals { model: rms_over_data(&seen, &trust), ..known }
}

/// Sum of `plane` where something is known.
fn sum(plane: &Plane, trust: &Plane<u8>) -> f64 {
    let known = plane.data().iter().zip(trust.data()).filter(|&(_, &t)| t != MISSING);
    known.map(|(&v, _)| f64::from(v)).sum()
}

/// `trust` with nothing known within `reach` pixels of a saturated one: light from beyond full
/// scale falls there.
fn away_from_saturated(trust: &Plane<u8>, reach: usize) -> Plane<u8> {
    let mut known = trust.clone();
    let near = |at: usize, length: usize| at.saturating_sub(reach)..(at + reach + 1).min(length);
    let width = trust.width();
    for y in 0..trust.height() {
        // Runs of saturated pixels, each widened by its reach.
        let mut from = 0;
        for run in trust.row(y).chunk_by(|a, b| (*a == SATURATED) == (*b == SATURATED)) {
            let columns = from..from + run.len();
            from = columns.end;
            if run[0] != SATURATED {
                continue;
            }
            let columns = near(columns.start, width).start..near(columns.end - 1, width).end;
            for y in near(y, trust.height()) {
                known.row_mut(y)[columns.clone()].fill(MISSING);
            }
        }
    }
    known
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::data_term::TRUSTED;
    use crate::frame::Size;

    #[test]
    fn what_is_near_a_saturated_pixel_is_not_known() {
        let size = Size::new(19, 17);
        let saturated = [(4, 3), (5, 3), (18, 0), (0, 16), (9, 11)];
        let trust = Plane::from_fn(size, |x, y| match (x, y) {
            at if saturated.contains(&at) => SATURATED,
            _ => TRUSTED,
        });
        for reach in [0, 2, 30] {
            let known = away_from_saturated(&trust, reach);
            for (x, y) in (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y))) {
                let near =
                    |&(sx, sy): &(usize, usize)| x.abs_diff(sx) <= reach && y.abs_diff(sy) <= reach;
                let is_known = known.at(x, y) == TRUSTED;
                assert_eq!(is_known, !saturated.iter().any(near), "({x}, {y}) by {reach}");
            }
        }
    }
}
