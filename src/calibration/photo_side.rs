//! The photo's part of a calibration: camera curve, dark corner and colour fringes.

use rayon::prelude::*;

use super::correction::Layout;
use super::surface::Surface;
use super::{Calibration, CameraCurve};
use crate::frame::resample::warp;
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};

/// Least dark-corner share divided by; darker parts stay dark.
const DARKEST: f32 = 0.05;
/// Spacing of the displacements' grid; they vary by hundredths of a pixel over it.
const COARSE_PX: usize = 16;

/// Rows of a picture per task.
const BAND_ROWS: usize = 32;

/// The photo's part of a calibration, prepared.
#[derive(Debug, Clone)]
pub struct PhotoSide {
    curve: CameraCurve,
    /// Counts over black of the panel's white, which a developed photo's white stands for.
    white: f32,
    /// Relative illumination over the photo.
    dark_corner: [Surface; 3],
    /// Displacements of red and blue against green.
    fringes: [Fringe; 2],
}

impl PhotoSide {
    /// Prepares `calibration` on a rig of `layout`.
    pub fn new(calibration: &Calibration, layout: &Layout) -> PhotoSide {
        let curve = calibration.camera_curve.clone();
        let white = FULL_SCALE * calibration.counts_per_level[Channel::Green.index()];
        PhotoSide {
            white: curve.bent(white),
            curve,
            dark_corner: calibration.dark_corner.clone(),
            fringes: [Channel::Red, Channel::Blue].map(|c| Fringe::new(calibration, layout, c)),
        }
    }

    /// The map from a photo's values to linear light; `None` for a linear camera. White stays white
    /// and is `white` counts over black, else that of a camera's development.
    pub fn straightened(&self, white: Option<f32>) -> Option<impl Fn(f32) -> f32 + Sync + '_> {
        let counts = white.unwrap_or(self.white);
        let scale = FULL_SCALE / self.curve.over_black(counts);
        let straight = move |bent: f32| scale * self.curve.over_black(bent * (counts / FULL_SCALE));
        (!self.curve.is_straight()).then_some(straight)
    }

    /// Divides `photo` (photo-sized) by the dark corner of the flats, as for captures: for photos
    /// of scenes in front of darkness, like the panel.
    pub fn undo_dark_corner(&self, photo: &mut Frame<Work>) {
        self.scale_by_corner(photo, |v, share| v / share);
    }

    /// Multiplies `light` (photo-sized) by the dark corner.
    pub fn put_dark_corner(&self, light: &mut Frame<Work>) {
        self.scale_by_corner(light, |v, share| v * share);
    }

    /// Applies `change` to each value of `photo` and its illumination relative to the middle.
    fn scale_by_corner(&self, photo: &mut Frame<Work>, change: impl Fn(f32, f32) -> f32 + Sync) {
        for c in Channel::ALL {
            let (surface, plane) = (&self.dark_corner[c.index()], photo.plane_mut(c));
            let (width, height) = (plane.width(), plane.height());
            // The surface has mean 1 over the photo; a photo's exposure refers to its middle, which
            // must keep its light.
            let middle = surface.at(width as f64 / 2.0, height as f64 / 2.0) as f32;
            plane
                .data_mut()
                .par_chunks_mut(width.max(1))
                .with_min_len(BAND_ROWS)
                .enumerate()
                .for_each_init(
                    || vec![0.0; width],
                    |shares, (y, row)| {
                        surface.row(y as f64, 0.0, 1.0, shares);
                        let darkest = DARKEST * middle;
                        row.iter_mut()
                            .zip(&*shares)
                            .for_each(|(v, share)| *v = change(*v, share.max(darkest) / middle));
                    },
                );
        }
    }

    /// Aligns red and blue of `picture` (canvas-sized) with green: removes lateral colour, which
    /// the paper's loop keeps. `corner_px` are outward displacements of red and blue beyond the
    /// measured ones, pixels at the canvas's corner, in proportion to the distance from the middle.
    #[must_use]
    pub fn line_up_colours(&self, picture: &Frame<Work>, corner_px: [f32; 2]) -> Frame<Work> {
        let mut lined_up = picture.clone();
        let [red, _, blue] = lined_up.planes_mut();
        self.fringes[0].undo(picture.plane(Channel::Red), corner_px[0], red);
        self.fringes[1].undo(picture.plane(Channel::Blue), corner_px[1], blue);
        lined_up
    }
}

/// Displacements of one channel against green on a grid of [`COARSE_PX`], interpolated bilinearly:
/// evaluating splines per pixel is slow.
#[derive(Debug, Clone)]
struct Fringe {
    columns: usize,
    /// Horizontal and vertical displacements, canvas pixels, row by row.
    displacements: Vec<(f32, f32)>,
}

impl Fringe {
    /// Computes the displacements of `channel` via the point of the panel that green sees. Its part
    /// of a panel pixel lies beside green's, which is no displacement by the lens.
    fn new(calibration: &Calibration, layout: &Layout, channel: Channel) -> Fringe {
        let (canvas, margin) = (layout.canvas(), layout.margin_px as f64);
        let green = &calibration.geometry[Channel::Green.index()].work_to_panel;
        let back = &calibration.geometry[channel.index()].panel_to_work;
        let offset_px = layout.subpixels.offset_px(channel);
        let displacement = |x: usize, y: usize| {
            let (work_x, work_y) = (x as f64 - margin, y as f64 - margin);
            let (panel_x, panel_y) = green.at(work_x, work_y);
            let (there_x, there_y) = back.at(panel_x - offset_px, panel_y);
            ((there_x - work_x) as f32, (there_y - work_y) as f32)
        };
        // One more than needed, so that the last pixels have neighbours on both sides.
        let (columns, rows) =
            (canvas.width.div_ceil(COARSE_PX) + 1, canvas.height.div_ceil(COARSE_PX) + 1);
        let place = |k: usize| displacement((k % columns) * COARSE_PX, (k / columns) * COARSE_PX);
        Fringe { columns, displacements: (0..rows * columns).map(place).collect() }
    }

    /// Source positions of canvas row `y`: columns into `to_x`, rows into `to_y`.
    fn row(&self, y: usize, to_x: &mut [f32], to_y: &mut [f32]) {
        let (j, v) = (y / COARSE_PX, (y % COARSE_PX) as f32 / COARSE_PX as f32);
        let (above, rest) = self.displacements[j * self.columns..].split_at(self.columns);
        let below = rest.get(..self.columns).unwrap_or(above);
        let mix = |a: f32, b: f32, share: f32| a * (1.0 - share) + b * share;
        let at = |i: usize| (mix(above[i].0, below[i].0, v), mix(above[i].1, below[i].1, v));
        for (x, (to_x, to_y)) in to_x.iter_mut().zip(to_y).enumerate() {
            let (i, u) = (x / COARSE_PX, (x % COARSE_PX) as f32 / COARSE_PX as f32);
            let (left, right) = (at(i), at((i + 1).min(self.columns - 1)));
            (*to_x, *to_y) =
                (x as f32 + mix(left.0, right.0, u), y as f32 + mix(left.1, right.1, u));
        }
    }

    /// Writes `plane` without the fringe, and without a magnification of `corner_px` at the corner,
    /// into `lined_up`, both canvas-sized.
    fn undo(&self, plane: &Plane, corner_px: f32, lined_up: &mut Plane) {
        let width = plane.width();
        let [middle_x, middle_y] = [width, plane.height()].map(|side| (side as f32 - 1.0) / 2.0);
        let enlarged = corner_px / middle_x.hypot(middle_y).max(1.0);
        let bands = lined_up.data_mut().par_chunks_mut(BAND_ROWS * width.max(1));
        bands.enumerate().for_each(|(band, rows)| {
            let size = Size::new(width, rows.len() / width);
            let (mut map_x, mut map_y, mut out) =
                (Plane::zeros(size), Plane::zeros(size), Plane::zeros(size));
            for y in 0..size.height {
                let row = band * BAND_ROWS + y;
                self.row(row, map_x.row_mut(y), map_y.row_mut(y));
                map_y.row_mut(y).iter_mut().for_each(|v| *v += enlarged * (row as f32 - middle_y));
                for (x, v) in map_x.row_mut(y).iter_mut().enumerate() {
                    *v += enlarged * (x as f32 - middle_x);
                }
            }
            warp(plane, &map_x, &map_y, &mut out);
            rows.copy_from_slice(out.data());
        });
    }
}
