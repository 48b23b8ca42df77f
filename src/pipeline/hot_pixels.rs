//! Hot pixels of a photo that the calibration does not know: they carry no data.

use std::borrow::Cow;

use super::Pipeline;
use super::setting::counted;
use super::stages::Prepared;
use crate::deconvolution::data_term::MISSING;
use crate::deconvolution::hot_pixels::{HotPixel, IsolationLimits, hot_pixels};
use crate::frame::{Channel, Frame, Plane, RawSites, Rect, Work};

impl Pipeline {
    /// Replaces the hot sites of `even`, a raw photo at `rect` of the canvas, by their
    /// surroundings, and returns them.
    pub(super) fn patch_hot_sites(
        &self,
        even: &mut Cow<'_, Frame<Work>>,
        raw: &RawSites,
        rect: Rect,
    ) -> Vec<HotPixel> {
        let colour = |x: usize, y: usize| raw.mosaic.colour_at(x, y);
        let own = self.noise_at(raw);
        let limits = Channel::ALL.map(|c| self.isolation_limits(c, 2));
        let mut sites = Plane::from_fn(even.size(), |x, y| even.plane(colour(x, y)).at(x, y));
        let limit = |x, y| limits[colour(x, y).index()].at(rect.x + x, rect.y + y);
        let noise = |x, y, light| own[colour(x, y).index()].sigma(light);
        let hot = hot_pixels(&sites, 2, limit, noise);
        if !hot.is_empty() {
            hot.iter().for_each(|hot| sites.set(hot.x, hot.y, hot.surroundings));
            *even = Cow::Owned(raw.mosaic.interpolated(&sites));
        }
        hot
    }

    /// Marks the hot pixels of a developed photo as missing, with those that its camera
    /// interpolated from them.
    pub(super) fn mark_hot_pixels(&self, photo: &mut Prepared<'_>) {
        let observation = &mut photo.observation;
        let Rect { x: left, y: top, .. } = observation.rect;
        let reach = usize::from(observation.sampling.interpolated().is_some());
        let mut count = 0;
        for &c in observation.channels.list() {
            let limits = self.isolation_limits(c, 1);
            let (mean, own) = (observation.noise[c.index()], &self.noise[c.index()]);
            let noise = |_, _, light: f32| mean.max(own.sigma(light));
            let light = observation.light.plane(c).crop(observation.rect);
            let hot = hot_pixels(&light, 1, |x, y| limits.at(left + x, top + y), noise);
            count += hot.len();
            let trust = observation.trust.plane_mut(c);
            for HotPixel { x, y, .. } in hot {
                // Hot pixels keep a distance from the border.
                for v in y - reach..=y + reach {
                    (x - reach..=x + reach).for_each(|u| trust.set(left + u, top + v, MISSING));
                }
            }
        }
        photo.notes.extend(hot_note(count));
    }

    fn isolation_limits(&self, channel: Channel, apart: usize) -> IsolationLimits {
        let lens = &self.lens.model;
        IsolationLimits::new(lens.functions(), lens.field(), channel, apart)
    }
}

/// Note on a photo with `count` hot pixels; none without any.
pub(super) fn hot_note(count: usize) -> Option<String> {
    (count > 0).then(|| {
        let hot = counted(count, "hot pixel");
        format!("restored without {hot}, brighter than any point of light through this lens")
    })
}
