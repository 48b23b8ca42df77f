//! The panel as seen by a perfect lens: the light of its pixels averaged over the footprint of each
//! sensor pixel.
//!
//! A candidate is shown by square panel pixels, interpolated from the Work grid, and a sensor pixel
//! averages their light over its own area. Both soften it, unlike a scene's photo, and a lens model
//! fitted to the candidate's values would absorb this softening and overshoot. So the lens is
//! measured against the light on the panel, and the detail that a candidate loses there is added to
//! its captures by computation ([`crate::light_path`]).

use rayon::prelude::*;

use super::{Correction, ShownLight};
use crate::calibration::geometric::Map;
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};

impl Correction {
    /// `picture` (light, 0..255, canvas-sized) in each of `channels` as a perfect lens sees it on
    /// the panel's square pixels; zero in the other channels. The panel is displaced by `at_px`
    /// sensor pixels to the right and down.
    ///
    /// # Panics
    /// When the picture's size is not the canvas's.
    pub fn by_perfect_lens(
        &self,
        channels: &[Channel],
        picture: &Frame<Work>,
        at_px: (f64, f64),
    ) -> Frame<Work> {
        assert!(picture.size() == self.layout.canvas(), "a shown picture has the canvas's size");
        let mut seen = Frame::zeros(picture.size());
        // Sequential, as each channel needs a panel-sized plane.
        for &c in channels {
            let part = self.shown_part();
            let panel = self.light_of(c, picture.plane(c), part);
            *seen.plane_mut(c) = self.footprints(c, &panel, part, at_px);
        }
        seen
    }

    /// Moves the light of `channel` out of `shown`, which frees it, and returns it as a perfect
    /// lens sees it, canvas-sized, 0..255.
    pub fn take_by_perfect_lens(&self, channel: Channel, shown: &mut ShownLight) -> Plane {
        let light = std::mem::take(&mut shown.light[channel.index()]);
        self.footprints(channel, &light, shown.part, (0.0, 0.0))
    }

    /// The `panel`'s light in its part `shown`, averaged over the footprints of the sensor's
    /// pixels.
    fn footprints(&self, c: Channel, panel: &Plane, shown: Rect, at_px: (f64, f64)) -> Plane {
        let mut seen = Plane::zeros(self.layout.canvas());
        let margin = self.layout.margin_px as f64;
        let (left, top) = (-margin - at_px.0, -margin - at_px.1);
        let map = &self.geometry.work_to_panel;
        let first = shown.x as f32 + self.layout.subpixels.offset_px(c) as f32;
        let half = self.half_a_pixel(map);
        let width = seen.width();
        seen.data_mut().par_chunks_mut(width).enumerate().for_each_init(
            || (vec![0.0; width], vec![0.0; width]),
            |(at_x, at_y), (y, row)| {
                map.x.row(y as f64 + top, left, 1.0, at_x);
                map.y.row(y as f64 + top, left, 1.0, at_y);
                for ((value, &x), &y) in row.iter_mut().zip(&*at_x).zip(&*at_y) {
                    *value = footprint(panel, [x - first, y - shown.y as f32], half);
                }
            },
        );
        seen
    }

    /// Half the side of a Work pixel in panel pixels, across and down, in the middle of the photo;
    /// distortion changes it by a few hundredths. Clamped to bounds that no panel reaches.
    fn half_a_pixel(&self, map: &Map) -> [f32; 2] {
        let Size { width, height } = self.layout.photo;
        let (x, y) = (width as f64 / 2.0, height as f64 / 2.0);
        let across = map.x.at(x + 0.5, y) - map.x.at(x - 0.5, y);
        let down = map.y.at(x, y + 0.5) - map.y.at(x, y - 0.5);
        [across, down].map(|whole| (whole.abs() / 2.0).clamp(1e-3, 16.0) as f32)
    }
}

/// Mean of `panel` over a rectangle around `centre` with half sides `half`, at most 16; pixel
/// centres are integers, and border pixels repeat.
fn footprint(panel: &Plane, centre: [f32; 2], half: [f32; 2]) -> f32 {
    let (columns, rows) = (Covered::of(centre[0], half[0]), Covered::of(centre[1], half[1]));
    let last = |side: usize| side as isize - 1;
    let inside = |at: isize, side: usize| at.clamp(0, last(side)) as usize;
    let (mut pixels, mut shares) = ([0; MOST], [0.0; MOST]);
    let count = (columns.last - columns.first + 1) as usize;
    for (n, column) in (columns.first..=columns.last).enumerate() {
        pixels[n] = inside(column, panel.width());
        shares[n] = columns.length_in(column);
    }
    let mut sum = 0.0;
    for row in rows.first..=rows.last {
        let line = panel.row(inside(row, panel.height()));
        let mut along = 0.0;
        for (&pixel, share) in pixels[..count].iter().zip(&shares) {
            along += share * line[pixel];
        }
        sum += rows.length_in(row) * along;
    }
    sum / (columns.length() * rows.length())
}

/// Maximum number of pixels under a footprint along one axis.
const MOST: usize = 34;

/// An interval along one axis, in coordinates in which pixel borders are integers.
struct Covered {
    from: f32,
    to: f32,
    /// The first and the last pixel in it.
    first: isize,
    last: isize,
}

impl Covered {
    /// The interval within `half` of `centre`, given in coordinates in which pixel centres are
    /// integers.
    fn of(centre: f32, half: f32) -> Covered {
        let (from, to) = (centre - half + 0.5, centre + half + 0.5);
        // The ceiling of the end is one more than the last pixel's number.
        let (first, last) = (floor(from), -floor(-to) - 1);
        Covered { from, to, first, last: last.max(first) }
    }

    fn length(&self) -> f32 {
        self.to - self.from
    }

    fn length_in(&self, n: isize) -> f32 {
        let n = n as f32;
        (self.to.min(n + 1.0) - self.from.max(n)).max(0.0)
    }
}

/// The largest integer up to `v`; `f32::floor` is a call to the library on default x86-64.
fn floor(v: f32) -> isize {
    let towards_zero = v as isize;
    towards_zero - isize::from(towards_zero as f32 > v)
}

#[cfg(test)]
mod tests {
    use super::super::tests::layout;
    use super::*;
    use crate::calibration::Geometry;
    use crate::calibration::example::calibration;
    use crate::frame::resample::sample;

    fn picture() -> Frame<Work> {
        let value = |x: usize, y: usize| ((37 * x + 91 * y + x * y) % 101) as f32;
        Frame::from_fn(|c| Plane::from_fn(layout().canvas(), |x, y| value(x + c.index(), y)))
    }

    #[test]
    fn coinciding_pixels_give_the_picture() {
        let mut calibration = calibration();
        calibration.geometry = Geometry::one_to_one(layout().domain(), 9.0, 11.0);
        let correction = Correction::new(&calibration, layout()).unwrap();
        let picture = picture();
        let seen = correction.by_perfect_lens(&Channel::ALL, &picture, (0.0, 0.0));
        for c in Channel::ALL {
            let pairs = seen.plane(c).data().iter().zip(picture.plane(c).data());
            let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 0.01, "{off}");
        }
    }

    #[test]
    fn a_displaced_panel_gives_the_picture_displaced() {
        let mut calibration = calibration();
        calibration.geometry = Geometry::one_to_one(layout().domain(), 9.0, 11.0);
        let correction = Correction::new(&calibration, layout()).unwrap();
        let picture = picture();
        let seen = correction.by_perfect_lens(&Channel::ALL, &picture, (2.0, -1.0));
        let (seen, still) = (seen.plane(Channel::Red), picture.plane(Channel::Red));
        for y in 1..still.height() - 1 {
            for x in 2..still.width() {
                let (found, wanted) = (seen.at(x, y), still.at(x - 2, y + 1));
                assert!((found - wanted).abs() < 0.01, "({x}, {y}): {found} for {wanted}");
            }
        }
    }

    #[test]
    fn square_pixels_are_averaged_over_square_footprints() {
        let correction = Correction::new(&calibration(), layout()).unwrap();
        let picture = picture();
        let seen = correction.by_perfect_lens(&[Channel::Blue], &picture, (0.0, 0.0));
        assert_eq!(seen.plane(Channel::Green).rms(), 0.0);
        let map = &calibration().geometry;
        let blue = picture.plane(Channel::Blue);
        // A panel pixel has, over its whole area, the picture's light at the pixel's centre.
        let light = |x: f64, y: f64| {
            let (x, y) = map.panel_to_work.at(x.round(), y.round());
            sample(blue, x as f32 + 4.0, y as f32 + 4.0)
        };
        const FINE: usize = 80;
        for (x, y) in [(12, 9), (20, 15), (23, 14), (31, 22)] {
            let mut sum = 0.0;
            for n in 0..FINE * FINE {
                let within = |n: usize| (n as f64 + 0.5) / FINE as f64 - 0.5;
                let (dx, dy) = (within(n % FINE), within(n / FINE));
                let (x, y) = map.work_to_panel.at(x as f64 - 4.0 + dx, y as f64 - 4.0 + dy);
                sum += light(x, y);
            }
            let (found, wanted) = (seen.plane(Channel::Blue).at(x, y), sum / (FINE * FINE) as f32);
            assert!((found - wanted).abs() < 0.5, "({x}, {y}): {found} for {wanted}");
        }
    }
}
