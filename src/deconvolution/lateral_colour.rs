//! Lateral chromatic aberration that remains in a picture: red and blue larger or smaller than
//! green.
//!
//! The lens's is measured in the panel's narrow light at the panel's distance. In a scene's broader
//! light, or at another distance, it is another one.

use super::colour_lines::{ChannelPair, ColourPlaces};
use super::lens_model::LensFunctions;
use super::observation::Observation;
use super::smoothing::{blur, halve};
use crate::frame::{Channel, Channels, Frame, Plane, Work};

/// σ of a blur, pixels, after which red and blue, solved less sharply, are like green. Guess.
const EQUAL_BLUR_PX: f32 = 1.0;
/// Displacement at the corner, pixels, that counts as a share of 1: one of 0.3 is expected, as
/// broad light makes it on `simulated.toml`, and more than one pixel is implausible.
const CORNER_PX: f32 = 2.0;

/// Outward displacements of red and blue from green at the corner of `picture`, pixels, in
/// proportion to the distance from the middle; 0 where the picture does not show it. `picture` is
/// that of `photo`, taken through a lens of `functions`, on the same canvas.
///
/// # Panics
/// When `picture` and `photo` differ in size.
pub fn lateral_colour_px(
    picture: &Frame<Work>,
    photo: &Observation,
    functions: &LensFunctions,
) -> [f32; 2] {
    if photo.channels == Channels::Green {
        return [0.0; 2];
    }
    let places = ColourPlaces::of(photo, functions);
    let seen = |c: Channel| halve(&blur(picture.plane(c), EQUAL_BLUR_PX));
    let green = seen(Channel::Green);
    let change = moved_outward(&green);
    let found = [Channel::Red, Channel::Blue].map(|c| {
        let share = ChannelPair { of: &seen(c), on: &green, change: &change }.share(&places);
        CORNER_PX * share.unwrap_or(0.0)
    });
    log::debug!("lateral colour beyond the measured one at the corner: {found:.2?} px");
    found
}

/// The change of `plane`, at half resolution, when it is enlarged by [`CORNER_PX`] at the corner.
fn moved_outward(plane: &Plane) -> Plane {
    let (width, height) = (plane.width(), plane.height());
    let [middle_x, middle_y] = [width, height].map(|side| (side as f32 - 1.0) / 2.0);
    let scale = CORNER_PX / 2.0 / middle_x.hypot(middle_y).max(1.0);
    Plane::from_fn(plane.size(), |x, y| {
        let across = plane.at((x + 1).min(width - 1), y) - plane.at(x.saturating_sub(1), y);
        let along = plane.at(x, (y + 1).min(height - 1)) - plane.at(x, y.saturating_sub(1));
        let [from_x, from_y] = [x as f32 - middle_x, y as f32 - middle_y];
        -scale * (from_x * across + from_y * along) / 2.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::example_lens::{gaussians, lens, photo};
    use crate::frame::resample::warp;

    /// `plane` enlarged by `corner_px` at its corner.
    fn enlarged(plane: &Plane, corner_px: f32) -> Plane {
        let (size, [x, y]) =
            (plane.size(), [plane.width(), plane.height()].map(|v| v as f32 - 1.0));
        let scale = 2.0 * corner_px / x.hypot(y);
        let from = |at: usize, side: f32| at as f32 - scale * (at as f32 - side / 2.0);
        let map_x = Plane::from_fn(size, |at, _| from(at, x));
        let map_y = Plane::from_fn(size, |_, at| from(at, y));
        let mut out = Plane::zeros(size);
        warp(plane, &map_x, &map_y, &mut out);
        out
    }

    #[test]
    fn displacements_are_found_to_a_tenth_of_a_pixel() {
        // Blue is blurred more, as the results of blue are.
        let functions = gaussians([1.3, 1.2, 1.6]);
        let seen = photo(&lens(&functions), 3, Channels::Colour);
        for corners in [[0.0, 0.0], [0.4, -0.3], [-0.2, 0.6]] {
            let [red, green, blue] = seen.light.planes();
            let picture = Frame::from_planes([
                enlarged(red, corners[0]),
                green.clone(),
                enlarged(blue, corners[1]),
            ]);
            let found = lateral_colour_px(&picture, &seen, &functions);
            let off = [0, 1].map(|n| (found[n] - corners[n]).abs());
            assert!(off.iter().all(|&px| px < 0.1), "{found:?} for {corners:?}");
        }
        let grey = photo(&lens(&functions), 3, Channels::Green);
        assert_eq!(lateral_colour_px(&grey.light, &grey, &functions), [0.0; 2]);
    }
}
