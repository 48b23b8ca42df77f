//! What a calibration says about the photo itself: how the camera bent its light, its dark corner,
//! and its colour fringes.

use rayon::prelude::*;

use super::correction::Layout;
use super::surface::Surface;
use super::{Calibration, CameraCurve};
use crate::frame::resample::{Outside, warp};
use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};

/// Share of light below which a corner is too dark to be worth dividing by; what is darker is left
/// dark.
const DARKEST: f32 = 0.05;
/// Rows between which displacements are interpolated: they vary by hundredths of a pixel over that.
const COARSE_PX: usize = 16;

/// Rows of a picture lined up at a time, one band a task.
const BAND_ROWS: usize = 32;

/// The photo's side of a calibration, made ready.
#[derive(Debug, Clone)]
pub struct PhotoSide {
    curve: CameraCurve,
    /// Counts over black that a developed photo's white stands for, as shown on the panel.
    white: f32,
    /// Share of light that arrives, over the photo.
    dark_corner: [Surface; 3],
    /// Where red (first) and blue (second) have what green has at a canvas place.
    fringes: [Fringe; 2],
}

impl PhotoSide {
    /// The photo's side of `calibration` on a rig of `layout`.
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

    /// Light of which a photo has `bent`; `None` where the camera is straight. Its white, which
    /// stays white, is `white` counts over black, else what a camera's developing takes for it.
    pub fn straightened(&self, white: Option<f32>) -> Option<impl Fn(f32) -> f32 + Sync + '_> {
        let counts = white.unwrap_or(self.white);
        let scale = FULL_SCALE / self.curve.over_black(counts);
        let straight = move |bent: f32| scale * self.curve.over_black(bent * (counts / FULL_SCALE));
        (!self.curve.is_straight()).then_some(straight)
    }

    /// Divides the dark corner of the flats out of `photo` (photo-sized), as the light path does
    /// with captures: for photos of what stands before darkness, as the panel does.
    pub fn undo_dark_corner(&self, photo: &mut Frame<Work>) {
        self.scale_by_corner(photo, |v, share| v / share);
    }

    /// Puts the dark corner into `light` (photo-sized), as a photo has it.
    pub fn put_dark_corner(&self, light: &mut Frame<Work>) {
        self.scale_by_corner(light, |v, share| v * share);
    }

    /// Each value of `photo` changed by the share of light that arrives there against the middle.
    fn scale_by_corner(&self, photo: &mut Frame<Work>, change: impl Fn(f32, f32) -> f32 + Sync) {
        for c in Channel::ALL {
            let (surface, plane) = (&self.dark_corner[c.index()], photo.plane_mut(c));
            let (width, height) = (plane.width(), plane.height());
            // The calibration's surface has mean 1 over the photo; a photo is exposed for its
            // middle, which must keep its light.
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

    /// `picture` (canvas-sized) with red and blue brought to where green is: lateral colour, which
    /// the paper's loop leaves in.
    #[must_use]
    pub fn line_up_colours(&self, picture: &Frame<Work>) -> Frame<Work> {
        let mut lined_up = picture.clone();
        let [red, _, blue] = lined_up.planes_mut();
        self.fringes[0].undo(picture.plane(Channel::Red), red);
        self.fringes[1].undo(picture.plane(Channel::Blue), blue);
        lined_up
    }
}

/// Displacements of one channel against green, at every [`COARSE_PX`]-th canvas pixel; bilinear
/// between: splines twice a pixel are slow, and the displacement is smooth.
#[derive(Debug, Clone)]
struct Fringe {
    columns: usize,
    /// Columns and rows, in canvas pixels, row by row.
    displacements: Vec<(f32, f32)>,
}

impl Fringe {
    /// Where `channel` has what green has: through the panel point that green sees there.
    fn new(calibration: &Calibration, layout: &Layout, channel: Channel) -> Fringe {
        let (canvas, margin) = (layout.canvas(), layout.margin_px as f64);
        let green = &calibration.geometry[Channel::Green.index()].work_to_panel;
        let back = &calibration.geometry[channel.index()].panel_to_work;
        let displacement = |x: usize, y: usize| {
            let (work_x, work_y) = (x as f64 - margin, y as f64 - margin);
            let (panel_x, panel_y) = green.at(work_x, work_y);
            let (there_x, there_y) = back.at(panel_x, panel_y);
            ((there_x - work_x) as f32, (there_y - work_y) as f32)
        };
        // One more on each side than needed: the last pixels have neighbours on both sides.
        let (columns, rows) =
            (canvas.width.div_ceil(COARSE_PX) + 1, canvas.height.div_ceil(COARSE_PX) + 1);
        let place = |k: usize| displacement((k % columns) * COARSE_PX, (k / columns) * COARSE_PX);
        Fringe { columns, displacements: (0..rows * columns).map(place).collect() }
    }

    /// Where row `y` of the canvas is found, column by column: columns into `to_x`, rows into
    /// `to_y`.
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

    /// `lined_up` = `plane` (both canvas-sized) as it would be without this fringe.
    fn undo(&self, plane: &Plane, lined_up: &mut Plane) {
        let width = plane.width();
        let bands = lined_up.data_mut().par_chunks_mut(BAND_ROWS * width.max(1));
        bands.enumerate().for_each(|(band, rows)| {
            let size = Size::new(width, rows.len() / width);
            let (mut map_x, mut map_y, mut out) =
                (Plane::zeros(size), Plane::zeros(size), Plane::zeros(size));
            for y in 0..size.height {
                self.row(band * BAND_ROWS + y, map_x.row_mut(y), map_y.row_mut(y));
            }
            warp(plane, &map_x, &map_y, Outside::Edge, &mut out);
            rows.copy_from_slice(out.data());
        });
    }
}
