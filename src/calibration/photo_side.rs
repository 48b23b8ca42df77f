//! What a calibration says about the photo itself: its dark corner, and its colour fringes.

use super::Calibration;
use super::correction::Layout;
use crate::frame::resample::{Outside, warp};
use crate::frame::{Channel, Frame, Plane, Work};

/// Share of light below which a corner is too dark to be worth dividing by; what is darker is left dark.
const DARKEST: f32 = 0.05;
/// Rows between which displacements are interpolated: they vary by hundredths of a pixel over that.
const COARSE_PX: usize = 16;

/// The photo's side of a calibration, made ready.
#[derive(Debug, Clone)]
pub struct PhotoSide {
    /// One over the share of light that arrives, photo-sized.
    gain: [Plane; 3],
    /// Where red (first) and blue (second) have what green has at a canvas place, in canvas pixels.
    fringes: [(Plane, Plane); 2],
}

impl PhotoSide {
    /// The photo's side of `calibration` on a rig of `layout`.
    pub fn new(calibration: &Calibration, layout: &Layout) -> PhotoSide {
        let gain = Channel::ALL.map(|c| {
            let surface = &calibration.dark_corner[c.index()];
            let mut plane = Plane::zeros(layout.photo);
            for y in 0..layout.photo.height {
                surface.row(y as f64, 0.0, 1.0, plane.row_mut(y));
            }
            // The calibration's surface has mean 1 over the photo; a photo is exposed for its middle, which
            // must keep its light.
            let middle = surface.at(layout.photo.width as f64 / 2.0, layout.photo.height as f64 / 2.0) as f32;
            plane.map(|share: f32| middle / share.max(DARKEST * middle))
        });
        let fringes = [Channel::Red, Channel::Blue].map(|c| fringe(calibration, layout, c));
        PhotoSide { gain, fringes }
    }

    /// Divides the dark corner out of `photo` (photo-sized), as the light path does with captures.
    pub fn undo_dark_corner(&self, photo: &mut Frame<Work>) {
        for c in Channel::ALL {
            let gain = self.gain[c.index()].data();
            photo.plane_mut(c).data_mut().iter_mut().zip(gain).for_each(|(v, g)| *v *= g);
        }
    }

    /// `picture` (canvas-sized) with red and blue brought to where green is: lateral colour, which the
    /// paper's loop leaves in.
    #[must_use]
    pub fn line_up_colours(&self, picture: &Frame<Work>) -> Frame<Work> {
        let mut lined_up = picture.clone();
        let [red, _, blue] = lined_up.planes_mut();
        let [of_red, of_blue] = &self.fringes;
        let line_up = |c: Channel, (x, y): &(Plane, Plane), plane: &mut Plane| {
            warp(picture.plane(c), x, y, Outside::Edge, plane);
        };
        rayon::join(|| line_up(Channel::Red, of_red, red), || line_up(Channel::Blue, of_blue, blue));
        lined_up
    }
}

/// Where `channel` has what green has: through the panel point that green sees there.
fn fringe(calibration: &Calibration, layout: &Layout, channel: Channel) -> (Plane, Plane) {
    let canvas = layout.canvas();
    let margin = layout.margin_px as f64;
    let green = &calibration.geometry[Channel::Green.index()].work_to_panel;
    let back = &calibration.geometry[channel.index()].panel_to_work;
    let displacement = |x: usize, y: usize| {
        let (work_x, work_y) = (x as f64 - margin, y as f64 - margin);
        let (panel_x, panel_y) = green.at(work_x, work_y);
        let (there_x, there_y) = back.at(panel_x, panel_y);
        ((there_x - work_x) as f32, (there_y - work_y) as f32)
    };
    // Splines twice a pixel are slow and the displacement is smooth: coarse places, bilinear between.
    let (columns, rows) = (canvas.width.div_ceil(COARSE_PX) + 1, canvas.height.div_ceil(COARSE_PX) + 1);
    let coarse: Vec<(f32, f32)> = (0..rows * columns)
        .map(|k| displacement((k % columns) * COARSE_PX, (k / columns) * COARSE_PX))
        .collect();
    let between = |x: usize, y: usize, part: fn(&(f32, f32)) -> f32| {
        let (i, j) = (x / COARSE_PX, y / COARSE_PX);
        let (u, v) = ((x % COARSE_PX) as f32 / COARSE_PX as f32, (y % COARSE_PX) as f32 / COARSE_PX as f32);
        let at = |i: usize, j: usize| part(&coarse[j.min(rows - 1) * columns + i.min(columns - 1)]);
        let above = at(i, j) * (1.0 - u) + at(i + 1, j) * u;
        let below = at(i, j + 1) * (1.0 - u) + at(i + 1, j + 1) * u;
        above * (1.0 - v) + below * v
    };
    let map_x = Plane::from_fn(canvas, |x, y| x as f32 + between(x, y, |d| d.0));
    let map_y = Plane::from_fn(canvas, |x, y| y as f32 + between(x, y, |d| d.1));
    (map_x, map_y)
}
