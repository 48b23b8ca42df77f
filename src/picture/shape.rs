//! The aspect ratio of photos.

use super::turn::swaps;
use super::{Flaw, Orientation};
use crate::frame::{PhotoGrid, Size};

/// Whether two sizes have the same aspect ratio, up to the rounding of a side to whole pixels.
pub(super) fn same_shape(found: Size, allowed: Size) -> bool {
    let (fw, fh) = (found.width as i128, found.height as i128);
    let (aw, ah) = (allowed.width as i128, allowed.height as i128);
    // At `found`'s width, the height of the same shape is fw·ah/aw; half a pixel is rounding.
    2 * (fw * ah - fh * aw).abs() <= aw.max(ah)
}

fn fits(found: Size, grid: PhotoGrid) -> bool {
    found == grid.sensor || same_shape(found, grid.photo.size) || is_part(found, grid)
}

/// Whether a developed photo of the size `found` may be one of the rig's photos cut in width or in
/// height, as cameras cut to 3:2, 16:9 and squares. The sensor's pattern then shows which part.
pub(super) fn is_part(found: Size, grid: PhotoGrid) -> bool {
    let (Some(square), Size { width, height }) = (grid.pattern_px, grid.photo.size) else {
        return false;
    };
    let is_whole = found.width == width || found.height == height;
    let is_within = found.width <= width && found.height <= height;
    let has_squares = found.width.is_multiple_of(square) && found.height.is_multiple_of(square);
    is_whole && is_within && has_squares && !same_shape(found, grid.photo.size)
}

/// Whether a developed photo of the size `found`, stored in `orientation`, was stored upright in
/// portrait. Its camera was then turned one way or the other; the sensor's pattern shows which.
pub(super) fn is_upright(found: Size, orientation: Orientation, grid: PhotoGrid) -> bool {
    let on_side = Size::new(found.height, found.width);
    let is_stored_so = orientation == Orientation::NoTransforms && !fits(found, grid);
    grid.pattern_px.is_some() && is_stored_so && fits(on_side, grid)
}

/// Checks that a developed photo of the size `found`, stored in `orientation`, fits `grid`.
pub(super) fn check(found: Size, orientation: Orientation, grid: PhotoGrid) -> Result<(), Flaw> {
    if fits(found, grid) || is_upright(found, orientation, grid) {
        return Ok(());
    }
    let allowed = grid.photo.size;
    let held = match same_shape(Size::new(found.height, found.width), allowed) {
        true if swaps(orientation) => " stored on its side",
        true => " in portrait, without a record of which way the camera was turned",
        false => "",
    };
    Err(Flaw::Shape { found, held, allowed })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_is_the_same_up_to_rounding() {
        let rig = Size::new(1024, 768);
        for same in
            [Size::new(1024, 768), Size::new(4000, 3000), Size::new(641, 481), Size::new(333, 250)]
        {
            assert!(same_shape(same, rig), "{same}");
        }
        for other in [
            Size::new(768, 1024),
            Size::new(1024, 766),
            Size::new(4000, 2250),
            Size::new(1024, 1024),
        ] {
            assert!(!same_shape(other, rig), "{other}");
        }
    }
}
