//! Correction of counts by a response pattern, after which all sites respond alike.

use rayon::prelude::*;

use super::response_pattern::{BAD, ResponsePattern, STEP};
use crate::frame::{Channel, Frame, Mosaic, Plane, Rect, Size, Work};

/// Search range for good sites around a bad one; larger clusters stay unpatched.
const REACH_PX: usize = 6;

/// The sites of the canvas.
#[derive(Debug, Clone)]
pub struct SiteGains {
    mosaic: Option<Mosaic>,
    planes: Vec<Plane<i8>>,
    /// Correction factor for each deviation of a site's response, indexed by its steps as a byte.
    gains: [f32; 256],
}

impl SiteGains {
    /// Prepares `pattern` for a `canvas` with `mosaic`; `None` if the pattern was not measured or
    /// is that of another canvas or another kind of sensor.
    pub fn new(
        pattern: &ResponsePattern,
        canvas: Size,
        mosaic: Option<Mosaic>,
    ) -> Option<SiteGains> {
        let wanted = if mosaic.is_some() { 1 } else { 3 };
        let planes: Option<Vec<Plane<i8>>> =
            pattern.planes().iter().map(|steps| Plane::from_vec(canvas, steps.clone())).collect();
        let planes = planes.filter(|planes| planes.len() == wanted)?;
        let gains = std::array::from_fn(|byte| match byte as u8 as i8 {
            BAD => f32::NAN,
            steps => 1.0 / (1.0 + STEP * f32::from(steps)),
        });
        Some(SiteGains { mosaic, planes, gains })
    }

    /// Colour filters over the canvas.
    pub fn mosaic(&self) -> Option<Mosaic> {
        self.mosaic
    }

    /// Whether `channel`'s site at (`x`, `y`) of the canvas is bad.
    pub fn is_bad(&self, channel: Channel, x: usize, y: usize) -> bool {
        self.steps(channel).at(x, y) == BAD
    }

    /// Whether a picture developed from these sites contains a bad site's light at (`x`, `y`) of
    /// the canvas, directly or by demosaicing.
    pub fn reaches(&self, channel: Channel, x: usize, y: usize) -> bool {
        if self.mosaic.is_none() {
            return self.is_bad(channel, x, y);
        }
        let plane = &self.planes[0];
        let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        near(y, plane.height()).any(|v| plane.row(v)[near(x, plane.width())].contains(&BAD))
    }

    /// Deviations of `channel`'s responses from 1 over the part `place` of the canvas, 0 at bad
    /// sites; between the channel's sites they are interpolated as in demosaicing.
    pub fn deviations(&self, channel: Channel, place: Rect) -> Plane {
        let steps = self.steps(channel);
        let of = |steps: i8| if steps == BAD { 0.0 } else { STEP * f32::from(steps) };
        let sites = Plane::from_fn(place.size, |x, y| of(steps.at(place.x + x, place.y + y)));
        match self.mosaic {
            Some(mosaic) => mosaic.from_place(place.x, place.y).filled(channel, &sites),
            None => sites,
        }
    }

    /// Response of `channel`'s site at (`x`, `y`) of the canvas; `None` if bad.
    pub fn response(&self, channel: Channel, x: usize, y: usize) -> Option<f32> {
        let steps = self.steps(channel).at(x, y);
        (steps != BAD).then(|| 1.0 + STEP * f32::from(steps))
    }

    fn steps(&self, channel: Channel) -> &Plane<i8> {
        let n = if self.mosaic.is_some() { 0 } else { channel.index() };
        &self.planes[n]
    }

    /// Corrects the part `place` of the canvas, whose sites have the values `row_of`(channel, row):
    /// divides by the responses, patches bad sites with their neighbours' mean, and interpolates a
    /// mosaic.
    pub fn evened(
        &self,
        place: Rect,
        row_of: impl Fn(Channel, usize) -> Vec<f32> + Sync,
    ) -> Frame<Work> {
        let Some(mosaic) = self.mosaic.map(|mosaic| mosaic.from_place(place.x, place.y)) else {
            return Frame::from_fn(|c| self.alike(place, self.steps(c), 1, |y| row_of(c, y)));
        };
        let sites = |y: usize| {
            let [mut sites, odd] = [0, 1].map(|x| row_of(mosaic.colour_at(x, y), y));
            sites.iter_mut().zip(odd).skip(1).step_by(2).for_each(|(site, odd)| *site = odd);
            sites
        };
        // Sites of one colour are two apart.
        mosaic.interpolated(&self.alike(place, &self.planes[0], 2, sites))
    }

    /// Divides the values of one plane, given row by row, by the responses; bad sites get the mean
    /// of the nearest good ones on a grid of spacing `apart`.
    fn alike(
        &self,
        place: Rect,
        steps: &Plane<i8>,
        apart: usize,
        row_of: impl Fn(usize) -> Vec<f32> + Sync,
    ) -> Plane {
        let mut plane = Plane::zeros(place.size);
        let Size { width, height } = place.size;
        let rows = plane.data_mut().par_chunks_mut(width.max(1)).enumerate();
        rows.for_each(|(y, row)| {
            let steps = &steps.row(place.y + y)[place.x..][..width];
            for ((value, seen), &steps) in row.iter_mut().zip(row_of(y)).zip(steps) {
                *value = seen * self.gains[usize::from(steps as u8)];
            }
        });
        let is_bad = |&(x, y): &(usize, usize)| steps.at(place.x + x, place.y + y) == BAD;
        let sites = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let bad: Vec<(usize, usize)> = sites.filter(is_bad).collect();
        let patches: Vec<f32> = bad.iter().map(|&(x, y)| patch(&plane, x, y, apart)).collect();
        bad.into_iter().zip(patches).for_each(|((x, y), patch)| plane.set(x, y, patch));
        plane
    }
}

/// Mean of the good values in the smallest square around (`x`, `y`) that has any; 0 if none has.
fn patch(plane: &Plane, x: usize, y: usize, apart: usize) -> f32 {
    for reach in (apart..=REACH_PX).step_by(apart) {
        let near = |at: usize, end: usize| {
            (at.saturating_sub(reach)..(at + reach + 1).min(end))
                .filter(move |&v| v.abs_diff(at).is_multiple_of(apart))
        };
        let around = near(y, plane.height())
            .flat_map(|v| near(x, plane.width()).map(move |u| plane.at(u, v)));
        let (mut sum, mut count) = (0.0f32, 0.0f32);
        around.filter(|v| !v.is_nan()).for_each(|v| (sum, count) = (sum + v, count + 1.0));
        if count > 0.0 {
            return sum / count;
        }
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::response_pattern::EvenlyLit;
    use crate::deconvolution::panel_beat::ColumnWave;

    const CANVAS: Size = Size::new(40, 30);

    /// A pattern with one hot site, and one dead site at the border.
    fn gains(mosaic: Option<Mosaic>) -> SiteGains {
        let ratio = Plane::from_fn(CANVAS, |x, y| match (x, y) {
            (0, 7) => 0.0,
            _ => 1.0 + 0.01 * ((x * 7 + y * 13) % 5) as f32 - 0.02,
        });
        let dark = Plane::from_fn(CANVAS, |x, y| if (x, y) == (21, 12) { 40.0 } else { 0.0 });
        let all = |plane: &Plane| Frame::from_fn(|_| plane.clone());
        let (ratio, dark, share) = (all(&ratio), all(&dark), all(&Plane::filled(CANVAS, 1.0)));
        let seen = EvenlyLit {
            wave: &ColumnWave::of(&Plane::zeros(CANVAS)),
            ratio: &ratio,
            share: &share,
            dark: &dark,
            mosaic,
            rim_px: 0,
        };
        SiteGains::new(&ResponsePattern::fit(&seen).unwrap(), CANVAS, mosaic).unwrap()
    }

    #[test]
    fn uneven_sites_are_evened_in_any_part_of_the_canvas() {
        for mosaic in [None, Some(Mosaic::Gbrg), Some(Mosaic::Rggb)] {
            let gains = gains(mosaic);
            for (x, y) in [(21, 12), (0, 7)] {
                assert!(Channel::ALL.iter().all(|&c| gains.is_bad(c, x, y)));
                assert_eq!(gains.reaches(Channel::Red, x + 1, y + 1), mosaic.is_some());
            }
            let places = [(0, 0, 40, 30), (3, 4, 20, 21), (21, 12, 2, 2)];
            for (x, y, width, height) in places {
                let place = Rect { x, y, size: Size::new(width, height) };
                let even = gains.evened(place, |c, v| {
                    let response = |u| gains.response(c, x + u, y + v);
                    (0..width).map(|u| response(u).map_or(999.0, |gain| 80.0 * gain)).collect()
                });
                let off = |v: &f32| (v - 80.0).abs() > 1e-3;
                // Among 2×2 sites, a bad one has no neighbour of its colour to be replaced by.
                if width > 2 || mosaic.is_none() {
                    assert!(!even.planes().iter().any(|p| p.data().iter().any(off)), "{place:?}");
                }
            }
        }
    }

    #[test]
    fn a_pattern_of_another_sensor_or_canvas_is_refused() {
        assert!(SiteGains::new(&ResponsePattern::default(), CANVAS, None).is_none());
        let ratio = Frame::filled(CANVAS, 1.0);
        let dark = Frame::zeros(CANVAS);
        let mosaic = Some(Mosaic::Rggb);
        let seen = EvenlyLit {
            wave: &ColumnWave::of(&Plane::zeros(CANVAS)),
            ratio: &ratio,
            share: &ratio,
            dark: &dark,
            mosaic,
            rim_px: 0,
        };
        let pattern = ResponsePattern::fit(&seen).unwrap();
        assert!(SiteGains::new(&pattern, CANVAS, None).is_none());
        assert!(SiteGains::new(&pattern, Size::new(30, 30), mosaic).is_none());
    }
}
