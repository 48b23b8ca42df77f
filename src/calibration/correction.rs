//! Application of a calibration: a Work picture to panel codes, and sensor counts to Work light.
//!
//! Shown pictures are warped to the panel per channel, mapped through the inverse response curve
//! and diffused to 8 bits. From captured counts black level, site differences, mixing and dark
//! corner are removed. Captures are cropped and never resampled, as Work is the camera's own pixel
//! grid. Beyond the canvas the panel repeats its border pixels.

mod perfect_lens;

use rayon::prelude::*;

use super::curve::Inverse;
use super::dither::Diffusion;
use super::surface::{Domain, Surface};
use super::{Calibration, Geometry, SiteGains};
use crate::config::{self, Subpixels};
use crate::deconvolution::forward_convolution::Seen;
use crate::deconvolution::panel_beat::ColumnWave;
use crate::frame::resample::warp;
use crate::frame::{Channel, Codes, Counts, Frame, Mosaic, Plane, Rect, Size, Work};
use crate::remedy::{Remediable, Remedy};

/// Sizes of the devices and position of the photo on the sensor, from the rig file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Size of the panel.
    pub panel: Size,
    /// Positions of the colours within a panel pixel.
    pub subpixels: Subpixels,
    /// Size of the sensor.
    pub sensor: Size,
    /// Size of the photo.
    pub photo: Size,
    /// Sensor column of the photo's first column.
    pub photo_x_px: usize,
    /// Sensor row of the photo's first row.
    pub photo_y_px: usize,
    /// Width of the canvas's margin around the photo, on every side.
    pub margin_px: usize,
    /// Counts at and above which a pixel is saturated.
    pub saturated: u16,
    /// Colour filters of the sensor, if any.
    pub mosaic: Option<Mosaic>,
}

impl Layout {
    /// The layout in a rig file.
    pub fn of(rig: &config::RigFile) -> Layout {
        Layout {
            panel: rig.panel.size(),
            subpixels: rig.panel.subpixels,
            sensor: rig.camera.size(),
            photo: rig.photo.size(),
            photo_x_px: rig.camera.photo_x_px,
            photo_y_px: rig.camera.photo_y_px,
            margin_px: rig.canvas.margin_px,
            saturated: rig.camera.count_max(),
            mosaic: rig.mosaic(),
        }
    }

    /// Colour filters over the canvas.
    pub fn canvas_mosaic(&self) -> Option<Mosaic> {
        let Rect { x, y, .. } = self.canvas_on_sensor();
        self.mosaic.map(|mosaic| mosaic.from_place(x, y))
    }

    /// The photo and its margins.
    pub fn canvas(&self) -> Size {
        Size::new(self.photo.width + 2 * self.margin_px, self.photo.height + 2 * self.margin_px)
    }

    /// Rectangle of the canvas on the sensor, inside which the rules of the rig file keep it.
    pub fn canvas_on_sensor(&self) -> Rect {
        let (x, y) = (self.photo_x_px - self.margin_px, self.photo_y_px - self.margin_px);
        Rect { x, y, size: self.canvas() }
    }

    /// The wave of the panel's columns on the canvas, mapped by `geometry`.
    pub fn column_wave(&self, geometry: &Geometry) -> ColumnWave {
        ColumnWave::of(&self.on_canvas(&geometry.work_to_panel.x))
    }

    /// `surface` at the canvas's pixels.
    pub fn on_canvas(&self, surface: &Surface) -> Plane {
        let mut plane = Plane::zeros(self.canvas());
        (0..plane.height()).for_each(|y| self.row_of(surface, y, plane.row_mut(y)));
        plane
    }

    fn row_of(&self, surface: &Surface, y: usize, row: &mut [f32]) {
        let margin = self.margin_px as f64;
        surface.row(y as f64 - margin, -margin, 1.0, row);
    }

    /// The canvas in Work coordinates, bounded by the centres of its outermost pixels.
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

/// Why a calibration cannot be applied.
#[derive(Debug, thiserror::Error)]
#[error("the calibration{0}")]
pub struct CorrectionError(String);

impl Remediable for CorrectionError {
    fn remedy(&self) -> Remedy {
        Remedy::Recalibrate
    }
}

/// Precomputed maps from Work to the panel and from the sensor to Work.
#[derive(Debug, Clone)]
pub struct Correction {
    layout: Layout,
    geometry: Geometry,
    inverse: [Inverse; 3],
    unmix: [[f32; 3]; 3],
    /// Linearised value of each count; `None` if the camera is linear.
    straight: Option<Vec<f32>>,
    /// Linear counts of a black panel.
    black: [Surface; 3],
    /// Relative illumination.
    dark_corner: [Surface; 3],
    /// Unmixed counts per unit of light (0..255) where the dark corner is 1.
    counts_per_level: [f32; 3],
    /// Response of the sensor's sites, if measured.
    sites: Option<SiteGains>,
}

/// Light of the panel pixels that show a picture.
#[derive(Debug, Clone)]
pub struct ShownLight {
    /// Rectangle of these pixels on the panel.
    part: Rect,
    light: [Plane; 3],
}

/// Panel rows per task; error diffusion starts afresh in each.
const BAND_ROWS: usize = 40;
/// Panel pixels around the canvas that are still warped; farther out the last code repeats. Wider
/// than any workable blur.
const FRINGE_PX: f64 = 64.0;
/// Border pixels added to a canvas before warping, so that the sixteen taps stay inside.
const PAD_PX: usize = 4;

impl Correction {
    /// Prepares `calibration` for devices of `layout`.
    ///
    /// # Errors
    /// When the calibration is for other sizes, or its mixing cannot be inverted.
    pub fn new(calibration: &Calibration, layout: Layout) -> Result<Correction, CorrectionError> {
        let (found, allowed) =
            ((calibration.photo, calibration.margin_px), (layout.photo, layout.margin_px));
        if found != allowed {
            return Err(CorrectionError(format!(
                " is for a photo of {} with a margin of {} px; the rig file has {} and {} px",
                found.0, found.1, allowed.0, allowed.1
            )));
        }
        let mixing = calibration.cross_channel.c;
        let unmix = calibration.cross_channel.inverse().ok_or_else(|| {
            CorrectionError(format!("'s mixing of channels cannot be inverted: {mixing:?}"))
        })?;
        let (canvas, curve) = (layout.canvas(), &calibration.camera_curve);
        Ok(Correction {
            layout,
            geometry: calibration.geometry.clone(),
            inverse: Channel::ALL.map(|c| Inverse::new(&calibration.curves[c.index()])),
            unmix,
            straight: (!curve.is_straight())
                .then(|| (0..=u16::MAX).map(|count| curve.count(f32::from(count))).collect()),
            black: calibration.black.clone(),
            dark_corner: calibration.dark_corner.clone(),
            counts_per_level: calibration.counts_per_level,
            sites: SiteGains::new(&calibration.pattern, canvas, layout.canvas_mosaic()),
        })
    }

    /// The wave of the panel's columns on the canvas.
    pub fn column_wave(&self) -> ColumnWave {
        self.layout.column_wave(&self.geometry)
    }

    /// Response of the sensor's sites on the canvas; `None` if not measured.
    pub fn sites(&self) -> Option<&SiteGains> {
        self.sites.as_ref()
    }

    /// The same correction with interpolated pixels counted as valid, for means over several
    /// pixels.
    #[must_use]
    pub fn between_sites(&self) -> Correction {
        Correction { layout: Layout { mosaic: None, ..self.layout }, ..self.clone() }
    }

    /// The layout for which the correction was prepared.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The codes that show `picture` (light, 0..255, canvas-sized) on the panel.
    ///
    /// # Panics
    /// When the picture's size is not the canvas's.
    pub fn show(&self, picture: &Frame<Work>) -> Codes {
        self.show_light(&self.light_on_panel(picture))
    }

    /// The light of the panel pixels that show `picture` (0..255, canvas-sized).
    ///
    /// # Panics
    /// When the picture's size is not the canvas's.
    pub fn light_on_panel(&self, picture: &Frame<Work>) -> ShownLight {
        assert!(picture.size() == self.layout.canvas(), "a shown picture has the canvas's size");
        let part = self.shown_part();
        ShownLight { part, light: Channel::each(|c| self.light_of(c, picture.plane(c), part)) }
    }

    /// The codes that make the panel show `light`.
    pub fn show_light(&self, light: &ShownLight) -> Codes {
        let ShownLight { part, light } = light;
        Frame::from_planes(Channel::each(|c| self.show_plane(c, &light[c.index()], *part)))
    }

    /// The part of the panel that shows a canvas, with a fringe.
    fn shown_part(&self) -> Rect {
        let panel = self.layout.panel;
        let seen = self.geometry.panel_to_work.x.domain();
        let first = |at: f64, limit: usize| ((at - FRINGE_PX).max(0.0) as usize).min(limit - 1);
        let past = |at: f64, limit: usize| ((at + FRINGE_PX).max(0.0) as usize + 1).min(limit);
        let (x, y) = (first(seen.left, panel.width), first(seen.top, panel.height));
        let right = past(seen.right, panel.width).max(x + 1);
        let bottom = past(seen.bottom, panel.height).max(y + 1);
        Rect { x, y, size: Size::new(right - x, bottom - y) }
    }

    /// The light of the panel pixels in `part`, which show the canvas `picture` in `channel`.
    fn light_of(&self, channel: Channel, picture: &Plane, part: Rect) -> Plane {
        let (map, padded) = (&self.geometry.panel_to_work, padded(picture));
        let left = part.x as f64 + self.layout.subpixels.offset_px(channel);
        let offset = (self.layout.margin_px + PAD_PX) as f32;
        // Limits that keep all sixteen taps in the padded plane, so that border pixels repeat.
        let least = PAD_PX as f32 - 1.5;
        let most = |side: usize| (side - PAD_PX) as f32 - 0.5;
        let mut panel = Plane::zeros(part.size);
        let bands = panel.data_mut().par_chunks_mut(BAND_ROWS * part.size.width).enumerate();
        bands.for_each(|(band, rows)| {
            let size = Size::new(part.size.width, rows.len() / part.size.width);
            let [mut map_x, mut map_y, mut light] = [(); 3].map(|()| Plane::zeros(size));
            for (along, most, places) in [
                (&map.x, most(padded.width()), &mut map_x),
                (&map.y, most(padded.height()), &mut map_y),
            ] {
                for y in 0..size.height {
                    let panel_y = (part.y + band * BAND_ROWS + y) as f64;
                    along.row(panel_y, left, 1.0, places.row_mut(y));
                }
                let placed = |v: &mut f32| *v = (*v + offset).max(least).min(most);
                places.data_mut().iter_mut().for_each(placed);
            }
            warp(&padded, &map_x, &map_y, &mut light);
            rows.copy_from_slice(light.data());
        });
        panel
    }

    fn show_plane(&self, channel: Channel, light: &Plane, shown: Rect) -> Plane<u8> {
        let panel = self.layout.panel;
        let Rect { x: left, y: top, .. } = shown;
        let (right, bottom) = (left + shown.size.width, top + shown.size.height);
        let mut codes = Plane::zeros(panel);
        let rows = &mut codes.data_mut()[top * panel.width..bottom * panel.width];
        rows.par_chunks_mut(BAND_ROWS * panel.width).enumerate().for_each(|(band, rows)| {
            let mut diffusion = Diffusion::new(shown.size.width);
            for (y, row) in rows.chunks_mut(panel.width).enumerate() {
                let mut codes = light.row(band * BAND_ROWS + y).to_vec();
                self.inverse[channel.index()].apply(&mut codes);
                diffusion.row(&codes, &mut row[left..right]);
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

    /// Converts `counts` (sensor-sized) to light on the canvas, 0..255. Pixels are trusted where
    /// all three channels are below saturation; behind colour filters, only at a channel's own
    /// sites.
    ///
    /// # Panics
    /// When the counts' size is not the sensor's.
    pub fn see(&self, counts: &Counts) -> Seen {
        assert!(counts.size() == self.layout.sensor, "counts have the sensor's size");
        let Rect { x: left, y: top, size: canvas } = self.layout.canvas_on_sensor();
        let over_black = |c: Channel, y: usize| {
            let mut row = vec![0.0; canvas.width];
            self.layout.row_of(&self.black[c.index()], y, &mut row);
            let counts = &counts.plane(c).row(top + y)[left..];
            row.iter_mut().zip(counts).for_each(|(v, &count)| *v = self.count(count) - *v);
            row
        };
        let over = match &self.sites {
            Some(sites) => sites.evened(Rect { x: 0, y: 0, size: canvas }, over_black),
            None => Frame::from_fn(|c| {
                let rows = (0..canvas.height).flat_map(|y| over_black(c, y));
                Plane::from_vec(canvas, rows.collect()).unwrap_or_default()
            }),
        };
        let light = self.unmixed(over);
        let is_good = |x: usize, y: usize| {
            let [r, g, b] = counts.planes().each_ref().map(|p| p.at(left + x, top + y));
            u8::from(r.max(g).max(b) < self.layout.saturated)
        };
        let good = Plane::from_fn(canvas, is_good);
        let mosaic = self.layout.canvas_mosaic();
        // After `between_sites`, for means over several pixels, patched bad sites are trusted.
        let sites = self.sites.as_ref().filter(|sites| sites.mosaic() == mosaic);
        let trusted = |c: Channel| match (mosaic, sites) {
            (None, None) => good.clone(),
            _ => Plane::from_fn(canvas, |x, y| {
                let own = mosaic.is_none_or(|mosaic| mosaic.colour_at(x, y) == c);
                let bad = own && sites.is_some_and(|sites| sites.is_bad(c, x, y));
                good.at(x, y) & u8::from(own && !bad)
            }),
        };
        Seen { light, trusted: Frame::from_fn(trusted) }
    }

    fn count(&self, count: u16) -> f32 {
        match &self.straight {
            Some(straight) => straight[usize::from(count)],
            None => f32::from(count),
        }
    }

    /// Converts counts `over` black to light: unmixes the channels and undoes the dark corner.
    fn unmixed(&self, mut over: Frame<Work>) -> Frame<Work> {
        let width = over.size().width;
        let [red, green, blue] = over.planes_mut().each_mut().map(|c| c.data_mut());
        let [red, green, blue] = [red, green, blue].map(|c| c.par_chunks_mut(width));
        let rows = (red, green, blue).into_par_iter().enumerate().with_min_len(32);
        rows.for_each(|(y, (red, green, blue))| {
            let gains = Channel::ALL.map(|c| self.gains(c, y, width));
            for (x, ((r, g), b)) in red.iter_mut().zip(green).zip(blue).enumerate() {
                let over = [*r, *g, *b];
                let own = |to: usize| {
                    over[0] * self.unmix[0][to]
                        + over[1] * self.unmix[1][to]
                        + over[2] * self.unmix[2][to]
                };
                let light = |c: usize| own(c) * gains[c][x];
                (*r, *g, *b) = (light(0), light(1), light(2));
            }
        });
        over
    }

    /// Light per unmixed count of `channel` in canvas row `y` of `width` pixels.
    fn gains(&self, channel: Channel, y: usize, width: usize) -> Vec<f32> {
        let mut row = vec![0.0; width];
        self.layout.row_of(&self.dark_corner[channel.index()], y, &mut row);
        let counts_per_level = self.counts_per_level[channel.index()];
        row.iter_mut().for_each(|d| *d = 1.0 / (counts_per_level * d.max(LEAST_LIGHT)));
        row
    }
}

/// Smallest dark-corner share used as a divisor; below it there is no usable picture.
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
