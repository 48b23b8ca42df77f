//! A calibration put to work: a Work picture to panel codes, and sensor counts back to Work.
//!
//! Shown: warp to the panel per channel, response curve undone, diffused to 8 bits. Seen: black
//! subtracted, sites made alike, mixing undone, dark corner divided out. Captures are cropped and
//! never resampled, for Work *is* the camera's own pixel grid. Outside the canvas the panel goes on
//! with the canvas's border pixels.

mod perfect_lens;

use std::sync::OnceLock;

use rayon::prelude::*;

use super::curve::Inverse;
use super::dither::Diffusion;
use super::surface::{Domain, Surface};
use super::{Calibration, CameraCurve, Geometry, SiteGains};
use crate::config;
use crate::frame::resample::{Outside, warp};
use crate::frame::{Channel, Codes, Counts, Frame, Mosaic, Plane, Rect, Size, Work, once};
use crate::remedy::{Remediable, Remedy};

/// Sizes of the devices and where the photo lies on the sensor; from the rig file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Panel pixels.
    pub panel: Size,
    /// Camera pixels.
    pub sensor: Size,
    /// The photo's grid.
    pub photo: Size,
    /// Sensor column of the photo's first.
    pub photo_x_px: usize,
    /// Sensor row of the photo's first.
    pub photo_y_px: usize,
    /// Canvas around the photo on every side.
    pub margin_px: usize,
    /// Counts at and above which a pixel is saturated.
    pub saturated: u16,
    /// The colours of the sensor's sites, where it has colour filters.
    pub mosaic: Option<Mosaic>,
}

impl Layout {
    /// The sizes in a rig file.
    pub fn of(rig: &config::RigFile) -> Layout {
        Layout {
            panel: rig.panel.size(),
            sensor: rig.camera.size(),
            photo: rig.photo.size(),
            photo_x_px: rig.camera.photo_x_px,
            photo_y_px: rig.camera.photo_y_px,
            margin_px: rig.canvas.margin_px,
            saturated: rig.camera.count_max(),
            mosaic: rig.mosaic(),
        }
    }

    /// The colours of the canvas's pixels.
    pub fn canvas_mosaic(&self) -> Option<Mosaic> {
        // Less the margin is as well as more of it: a mosaic repeats by two.
        let (x, y) = (self.photo_x_px + self.margin_px, self.photo_y_px + self.margin_px);
        self.mosaic.map(|mosaic| mosaic.from_place(x, y))
    }

    /// The photo and its margins.
    pub fn canvas(&self) -> Size {
        Size::new(self.photo.width + 2 * self.margin_px, self.photo.height + 2 * self.margin_px)
    }

    /// `surface` at the canvas's pixels.
    pub fn on_canvas(&self, surface: &Surface) -> Plane {
        let margin = self.margin_px as f64;
        let mut plane = Plane::zeros(self.canvas());
        for y in 0..plane.height() {
            surface.row(y as f64 - margin, -margin, 1.0, plane.row_mut(y));
        }
        plane
    }

    /// The canvas in Work coordinates, centres of its outermost pixels.
    pub fn domain(&self) -> Domain {
        let margin = self.margin_px as f64;
        Domain {
            left: -margin,
            top: -margin,
            right: self.photo.width as f64 - 1.0 + margin,
            bottom: self.photo.height as f64 - 1.0 + margin,
        }
    }
}

/// Why a calibration cannot be put to work.
#[derive(Debug, thiserror::Error)]
pub enum CorrectionError {
    /// It belongs to another photo or canvas.
    #[error(
        "the calibration is for a photo of {found} with a margin of {found_margin_px} px; the rig \
         file says {allowed} and {allowed_margin_px} px"
    )]
    Sizes {
        /// Photo calibrated for.
        found: Size,
        /// Margin calibrated for.
        found_margin_px: usize,
        /// Photo of the rig file.
        allowed: Size,
        /// Margin of the rig file.
        allowed_margin_px: usize,
    },
    /// The channels cannot be told apart.
    #[error("the calibration's mixing of the channels cannot be undone: {found:?}")]
    Mixing {
        /// C as found.
        found: [[f32; 3]; 3],
    },
}

impl Remediable for CorrectionError {
    fn remedy(&self) -> Remedy {
        Remedy::Recalibrate
    }
}

/// What one capture says, in Work.
#[derive(Debug, Clone)]
pub struct Corrected {
    /// Light, 0..255, canvas-sized; 0 where the sensor does not reach.
    pub light: Frame<Work>,
    /// 1 where all three channels have a sensor value below saturation, else 0. Behind colour
    /// filters each channel is known at its own sites.
    pub trusted: Frame<Work, u8>,
}

/// The way from Work to the panel and from the sensor back, made ready.
#[derive(Debug, Clone)]
pub struct Correction {
    layout: Layout,
    geometry: [Geometry; 3],
    inverse: [Inverse; 3],
    unmix: [[f32; 3]; 3],
    /// The straight count of each count, where the camera bends them.
    straight: Option<Vec<f32>>,
    /// Straight counts with a black panel, canvas-sized.
    black: [Plane; 3],
    /// Light per unmixed count, canvas-sized: 1 / (counts per level · dark corner).
    gain: [Plane; 3],
    /// The panel's column that each channel sees, canvas-sized; made when it is first asked for.
    columns: OnceLock<Frame<Work>>,
    /// How the sensor's sites differ, where it was measured.
    sites: Option<SiteGains>,
}

/// Rows of the panel made at a time: one band a task, errors diffused within it.
const BAND_ROWS: usize = 40;
/// Panel pixels beyond the canvas that are still warped; farther out the last code goes on. Wider
/// than any blur that can be worked with.
const FRINGE_PX: f64 = 64.0;
/// Border pixels added to a canvas before it is warped, so that the sixteen taps never leave it.
const PAD_PX: usize = 4;

impl Correction {
    /// `calibration` made ready for devices of `layout`.
    ///
    /// # Errors
    /// When the calibration is for other sizes, or its mixing cannot be undone.
    pub fn new(calibration: &Calibration, layout: Layout) -> Result<Correction, CorrectionError> {
        if (calibration.photo, calibration.margin_px) != (layout.photo, layout.margin_px) {
            return Err(CorrectionError::Sizes {
                found: calibration.photo,
                found_margin_px: calibration.margin_px,
                allowed: layout.photo,
                allowed_margin_px: layout.margin_px,
            });
        }
        let found = calibration.cross_channel.c;
        let unmix = calibration.cross_channel.inverse().ok_or(CorrectionError::Mixing { found })?;
        let canvas = layout.canvas();
        let on_canvas = |surface: &Surface| layout.on_canvas(surface);
        let gain = |c: Channel| {
            let counts_per_level = calibration.counts_per_level[c.index()];
            on_canvas(&calibration.dark_corner[c.index()])
                .map(|d| 1.0 / (counts_per_level * d.max(LEAST_LIGHT)))
        };
        Ok(Correction {
            layout,
            geometry: calibration.geometry.clone(),
            inverse: Channel::ALL.map(|c| Inverse::new(&calibration.curves[c.index()])),
            unmix,
            straight: straight_counts(&calibration.camera_curve),
            black: Channel::ALL.map(|c| on_canvas(&calibration.black[c.index()])),
            gain: Channel::ALL.map(gain),
            columns: OnceLock::new(),
            sites: SiteGains::new(&calibration.pattern, canvas, layout.canvas_mosaic()),
        })
    }

    /// The panel's column, in its pixels, that each channel sees at each of the canvas's pixels.
    pub fn panel_columns(&self) -> &Frame<Work> {
        let of = |c: Channel| self.layout.on_canvas(&self.geometry[c.index()].work_to_panel.x);
        once(&self.columns, || Frame::from_fn(of))
    }

    /// How the sensor's sites differ, on the canvas; `None` where it was not measured.
    pub fn sites(&self) -> Option<&SiteGains> {
        self.sites.as_ref()
    }

    /// The same, for which what lies between a channel's sites is as good as they are: where means
    /// over several pixels are looked at.
    #[must_use]
    pub fn between_sites(&self) -> Correction {
        Correction { layout: Layout { mosaic: None, ..self.layout }, ..self.clone() }
    }

    /// The sizes it was made for.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The codes that put `picture` (light, 0..255, canvas-sized) on the panel.
    ///
    /// # Panics
    /// When the picture has not the canvas's size, which is a bug of the caller.
    pub fn show(&self, picture: &Frame<Work>) -> Codes {
        self.show_by(picture, |channel| channel)
    }

    /// The codes that put a `scene` (light, 0..255, canvas-sized) on the panel as an object is in
    /// the world: its colours lie on each other there, and the lens pulls them apart. Green is seen
    /// where the scene has it.
    ///
    /// # Panics
    /// When the scene has not the canvas's size, which is a bug of the caller.
    pub fn show_scene(&self, scene: &Frame<Work>) -> Codes {
        self.show_by(scene, |_| Channel::Green)
    }

    /// The codes of `picture`, each channel at the places of the channel that `place` gives.
    fn show_by(&self, picture: &Frame<Work>, place: impl Fn(Channel) -> Channel + Sync) -> Codes {
        assert!(picture.size() == self.layout.canvas(), "what is shown has the canvas's size");
        let made: Vec<Plane<u8>> = Channel::ALL
            .par_iter()
            .map(|&c| self.show_plane(c, place(c), picture.plane(c)))
            .collect();
        let mut made = made.into_iter();
        Frame::from_fn(|_| made.next().unwrap_or_else(|| Plane::zeros(self.layout.panel)))
    }

    /// The part of the panel that shows a canvas at the places of `place`, and a little around it.
    fn shown_part(&self, place: Channel) -> Rect {
        let panel = self.layout.panel;
        let seen = self.geometry[place.index()].panel_to_work.x.domain();
        let first = |at: f64, limit: usize| ((at - FRINGE_PX).max(0.0) as usize).min(limit - 1);
        let past = |at: f64, limit: usize| ((at + FRINGE_PX).max(0.0) as usize + 1).min(limit);
        let (x, y) = (first(seen.left, panel.width), first(seen.top, panel.height));
        let right = past(seen.right, panel.width).max(x + 1);
        let bottom = past(seen.bottom, panel.height).max(y + 1);
        Rect { x, y, size: Size::new(right - x, bottom - y) }
    }

    /// The light of the panel's pixels `part`, which show the canvas `padded` at the places of
    /// `place`.
    fn panel_light(&self, place: Channel, padded: &Plane, part: Rect) -> Plane {
        let map = &self.geometry[place.index()].panel_to_work;
        let offset = (self.layout.margin_px + PAD_PX) as f32;
        // Places where all sixteen taps lie in the padded plane, so that the border pixels go on
        // outside.
        let limit = |side: usize| (side - PAD_PX) as f32 - 0.5;
        let (x_max, y_max) = (limit(padded.width()), limit(padded.height()));
        let least = PAD_PX as f32 - 1.5;
        let (mut map_x, mut map_y) = (Plane::zeros(part.size), Plane::zeros(part.size));
        for y in 0..part.size.height {
            let panel_y = (part.y + y) as f64;
            map.x.row(panel_y, part.x as f64, 1.0, map_x.row_mut(y));
            map.y.row(panel_y, part.x as f64, 1.0, map_y.row_mut(y));
        }
        map_x.data_mut().iter_mut().for_each(|v| *v = (*v + offset).max(least).min(x_max));
        map_y.data_mut().iter_mut().for_each(|v| *v = (*v + offset).max(least).min(y_max));
        let mut light = Plane::zeros(part.size);
        warp(padded, &map_x, &map_y, Outside::Edge, &mut light);
        light
    }

    fn show_plane(&self, channel: Channel, place: Channel, picture: &Plane) -> Plane<u8> {
        let panel = self.layout.panel;
        let padded = padded(picture);
        let shown = self.shown_part(place);
        let Rect { x: left, y: top, .. } = shown;
        let (right, bottom) = (left + shown.size.width, top + shown.size.height);
        let mut codes = Plane::zeros(panel);
        let rows = &mut codes.data_mut()[top * panel.width..bottom * panel.width];
        rows.par_chunks_mut(BAND_ROWS * panel.width).enumerate().for_each(|(band, rows)| {
            let size = Size::new(right - left, rows.len() / panel.width);
            let part = Rect { x: left, y: top + band * BAND_ROWS, size };
            let mut light = self.panel_light(place, &padded, part);
            self.inverse[channel.index()].apply(light.data_mut());
            let mut diffusion = Diffusion::new(size.width);
            for (y, row) in rows.chunks_mut(panel.width).enumerate() {
                diffusion.row(light.row(y), &mut row[left..right]);
                let (before, after) = (row[left], row[right - 1]);
                row[..left].fill(before);
                row[right..].fill(after);
            }
        });
        let (above, below) = (codes.row(top).to_vec(), codes.row(bottom - 1).to_vec());
        (0..top).for_each(|y| codes.row_mut(y).copy_from_slice(&above));
        (bottom..panel.height).for_each(|y| codes.row_mut(y).copy_from_slice(&below));
        codes
    }

    /// The light that `counts` (sensor-sized) mean, on the canvas.
    ///
    /// # Panics
    /// When the counts have not the sensor's size, which is a bug of the caller.
    pub fn see(&self, counts: &Counts) -> Corrected {
        assert!(counts.size() == self.layout.sensor, "counts have the sensor's size");
        let canvas = self.layout.canvas();
        let mut light = Frame::<Work>::zeros(canvas);
        let mut good = Plane::<u8>::zeros(canvas);
        let width = canvas.width;
        let even = self.sites.as_ref().and_then(|sites| self.evened(sites, counts));
        let [red, green, blue] = light.planes_mut();
        let mut rows: Vec<_> = red
            .data_mut()
            .chunks_mut(width)
            .zip(green.data_mut().chunks_mut(width))
            .zip(blue.data_mut().chunks_mut(width))
            .zip(good.data_mut().chunks_mut(width))
            .enumerate()
            .collect();
        rows.par_iter_mut().with_min_len(32).for_each(|(y, (((red, green), blue), good))| {
            let light = [&mut **red, &mut **green, &mut **blue];
            self.see_row(counts, even.as_ref(), *y, light, good);
        });
        drop(rows);
        let mosaic = self.layout.canvas_mosaic();
        // Where means over several pixels are looked at, what a bad site was patched with is good.
        let sites = self.sites.as_ref().filter(|sites| sites.mosaic() == mosaic);
        let trusted = |c: Channel| match (mosaic, sites) {
            (None, None) => good.clone(),
            _ => Plane::from_fn(canvas, |x, y| {
                let own = mosaic.is_none_or(|mosaic| mosaic.colour_at(x, y) == c);
                let bad = own && sites.is_some_and(|sites| sites.is_bad(c, x, y));
                good.at(x, y) & u8::from(own && !bad)
            }),
        };
        Corrected { light, trusted: Frame::from_fn(trusted) }
    }

    /// Canvas columns or rows that lie on a sensor of so many, the photo's first being number
    /// `photo`: the first, and how many.
    fn reach(&self, photo: usize, of_canvas: usize, of_sensor: usize) -> (usize, usize) {
        let skip = self.layout.margin_px.saturating_sub(photo);
        let start = (photo + skip).saturating_sub(self.layout.margin_px);
        (skip, of_canvas.saturating_sub(skip).min(of_sensor.saturating_sub(start)))
    }

    /// Counts over black as alike sites would have given them, and the part of the canvas that they
    /// are of; `None` where it is empty.
    fn evened(&self, sites: &SiteGains, counts: &Counts) -> Option<(Rect, Frame<Work>)> {
        let (layout, canvas) = (&self.layout, self.layout.canvas());
        let (x, width) = self.reach(layout.photo_x_px, canvas.width, layout.sensor.width);
        let (y, height) = self.reach(layout.photo_y_px, canvas.height, layout.sensor.height);
        if width == 0 || height == 0 {
            return None;
        }
        let place = Rect { x, y, size: Size::new(width, height) };
        let (left, top) =
            (layout.photo_x_px + x - layout.margin_px, layout.photo_y_px + y - layout.margin_px);
        let over = |c: Channel, column: usize, row: usize| {
            let count = counts.plane(c).at(left + column, top + row);
            self.count(count) - self.black[c.index()].at(x + column, y + row)
        };
        Some((place, sites.evened(place, over)))
    }

    fn see_row(
        &self,
        counts: &Counts,
        even: Option<&(Rect, Frame<Work>)>,
        y: usize,
        light: [&mut [f32]; 3],
        good: &mut [u8],
    ) {
        let layout = &self.layout;
        // The canvas's first pixel may lie outside the sensor.
        let Some(sensor_y) = (layout.photo_y_px + y)
            .checked_sub(layout.margin_px)
            .filter(|&v| v < layout.sensor.height)
        else {
            return;
        };
        let (skip, reach) =
            self.reach(layout.photo_x_px, layout.canvas().width, layout.sensor.width);
        let start = (layout.photo_x_px + skip).saturating_sub(layout.margin_px);
        let t = [0, 1, 2].map(|c| &counts.planes()[c].row(sensor_y)[start..start + reach]);
        let good = &mut good[skip..skip + reach];
        for (x, good) in good.iter_mut().enumerate() {
            *good = u8::from(t[0][x].max(t[1][x]).max(t[2][x]) < layout.saturated);
        }
        let light = light.map(|row| &mut row[skip..skip + reach]);
        if let Some((place, even)) = even {
            let e = [0, 1, 2].map(|c| &even.planes()[c].row(y - place.y)[..reach]);
            self.unmixed(y, skip, light, |x| [e[0][x], e[1][x], e[2][x]]);
            return;
        }
        let b = [0, 1, 2].map(|c| &self.black[c].row(y)[skip..skip + reach]);
        let over = |c: usize, x: usize| self.count(t[c][x]) - b[c][x];
        self.unmixed(y, skip, light, |x| [over(0, x), over(1, x), over(2, x)]);
    }

    /// The straight count of `count`.
    fn count(&self, count: u16) -> f32 {
        match &self.straight {
            Some(straight) => straight[usize::from(count)],
            None => f32::from(count),
        }
    }

    /// The light of row `y` of the canvas from its column `skip` on, of counts over black.
    fn unmixed(
        &self,
        y: usize,
        skip: usize,
        [red, green, blue]: [&mut [f32]; 3],
        over: impl Fn(usize) -> [f32; 3],
    ) {
        let reach = red.len();
        let g = [0, 1, 2].map(|c| &self.gain[c].row(y)[skip..skip + reach]);
        for x in 0..reach {
            let over = over(x);
            let own = |to: usize| {
                over[0] * self.unmix[0][to]
                    + over[1] * self.unmix[1][to]
                    + over[2] * self.unmix[2][to]
            };
            red[x] = own(0) * g[0][x];
            green[x] = own(1) * g[1][x];
            blue[x] = own(2) * g[2][x];
        }
    }
}

/// The straight count of every count that there can be; `None` where they are straight.
fn straight_counts(curve: &CameraCurve) -> Option<Vec<f32>> {
    let all = || (0..=u16::MAX).map(|count| curve.count(f32::from(count))).collect();
    (!curve.is_straight()).then(all)
}

/// Least share of light a dark corner is divided by: below a fiftieth there is no picture to
/// brighten.
const LEAST_LIGHT: f32 = 0.02;

/// `picture` with [`PAD_PX`] more pixels on every side, repeating its border.
fn padded(picture: &Plane) -> Plane {
    let size = picture.size();
    let mut out = Plane::zeros(Size::new(size.width + 2 * PAD_PX, size.height + 2 * PAD_PX));
    for y in 0..out.height() {
        let from = picture.row(y.saturating_sub(PAD_PX).min(size.height - 1));
        let row = out.row_mut(y);
        row[PAD_PX..PAD_PX + size.width].copy_from_slice(from);
        row[..PAD_PX].fill(from[0]);
        row[PAD_PX + size.width..].fill(from[size.width - 1]);
    }
    out
}

#[cfg(test)]
mod tests;
