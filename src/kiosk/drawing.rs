//! Drawing on a sheet of panel codes.

use super::lettering;
use crate::frame::resample::resize;
use crate::frame::{Channel, Codes, FULL_SCALE, Frame, Size, Work};

/// A colour in panel codes: red, green, blue.
pub(super) type PanelColour = [u8; 3];

pub(super) struct Sheet {
    pub(super) codes: Codes,
}

impl Sheet {
    pub(super) fn new(size: Size, ground: PanelColour) -> Sheet {
        Sheet { codes: Frame::from_fn(|c| crate::frame::Plane::filled(size, ground[c.index()])) }
    }

    /// Blends `share` (0..1) of `colour` into a pixel; pixels outside the sheet are ignored.
    pub(super) fn blend(&mut self, x: i32, y: i32, colour: PanelColour, share: f32) {
        let size = self.codes.size();
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x >= size.width || y >= size.height {
            return;
        }
        for c in Channel::ALL {
            let plane = self.codes.plane_mut(c);
            let under = f32::from(plane.at(x, y));
            let over = under + (f32::from(colour[c.index()]) - under) * share;
            plane.set(x, y, over.round() as u8);
        }
    }

    /// Fills the part of a box that `inside` accepts, at (x, y) relative to its upper left corner.
    pub(super) fn shape(
        &mut self,
        (left, top): (i32, i32),
        (width, height): (i32, i32),
        colour: PanelColour,
        inside: impl Fn(f32, f32) -> bool,
    ) {
        for y in 0..height {
            for x in 0..width {
                // Four samples a pixel smooth the edges.
                let hits = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)];
                let hits =
                    hits.iter().filter(|(dx, dy)| inside(x as f32 + dx, y as f32 + dy)).count();
                if hits > 0 {
                    self.blend(left + x, top + y, colour, hits as f32 / 4.0);
                }
            }
        }
    }

    pub(super) fn rectangle(&mut self, at: (i32, i32), size: (i32, i32), colour: PanelColour) {
        self.shape(at, size, colour, |_, _| true);
    }

    /// Draws one line of text with its upper left corner at `at`.
    pub(super) fn line(&mut self, text: &str, at: (f32, f32), height_px: f32, colour: PanelColour) {
        lettering::set(text, at, height_px, &mut |x, y, share| self.blend(x, y, colour, share));
    }

    /// Draws `picture` (linear light 0..255) centred in a box, as large as fits; returns its place.
    pub(super) fn picture(
        &mut self,
        picture: &Frame<Work>,
        (left, top): (i32, i32),
        (width, height): (i32, i32),
    ) -> (i32, i32) {
        let size = picture.size();
        let scale = (width as f32 / size.width as f32).min(height as f32 / size.height as f32);
        let drawn = ((size.width as f32 * scale) as i32, (size.height as f32 * scale) as i32);
        let place = (left + (width - drawn.0) / 2, top + (height - drawn.1) / 2);
        let [wide, high] = [drawn.0, drawn.1].map(|px| usize::try_from(px).unwrap_or(0));
        if wide == 0 || high == 0 {
            return place;
        }
        let shown = Channel::ALL.map(|c| resize(picture.plane(c), Size::new(wide, high)));
        for y in 0..high {
            for x in 0..wide {
                let colour = [0, 1, 2].map(|c| code(shown[c].at(x, y)));
                self.blend(place.0 + x as i32, place.1 + y as i32, colour, 1.0);
            }
        }
        place
    }
}

/// The code of `light` on a display of gamma 2.2; screens are for eyes, not for the camera.
fn code(light: f32) -> u8 {
    let share = (light / FULL_SCALE).clamp(0.0, 1.0);
    (255.0 * share.powf(1.0 / 2.2)).round() as u8
}
