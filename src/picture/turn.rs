//! Turning a picture upright: the eight EXIF orientations, applied to planes.

use crate::frame::{Plane, Size};

/// How stored pixels must be turned to stand upright (EXIF 2.3 tag 0x0112).
pub use image::metadata::Orientation;

/// Width and height after turning.
pub(super) fn turned_size(size: Size, orientation: Orientation) -> Size {
    if swaps(orientation) { Size::new(size.height, size.width) } else { size }
}

/// Whether turning swaps width and height.
pub(super) fn swaps(orientation: Orientation) -> bool {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    matches!(orientation, Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH)
}

pub(super) fn turn<T: Copy + Default>(plane: &Plane<T>, orientation: Orientation) -> Plane<T> {
    let place = stored_place(plane.size(), orientation);
    Plane::from_fn(turned_size(plane.size(), orientation), |x, y| {
        let (x, y) = place(x, y);
        plane.at(x, y)
    })
}

/// A map from column and row in the upright picture to those in the stored one, of `size`.
fn stored_place(size: Size, orientation: Orientation) -> impl Fn(usize, usize) -> (usize, usize) {
    let (right, bottom) = (size.width.wrapping_sub(1), size.height.wrapping_sub(1));
    // The places of row 0 and column 0 by EXIF's table.
    move |x, y| match orientation {
        Orientation::NoTransforms => (x, y),
        Orientation::FlipHorizontal => (right - x, y),
        Orientation::Rotate180 => (right - x, bottom - y),
        Orientation::FlipVertical => (x, bottom - y),
        Orientation::Rotate90FlipH => (y, x),
        Orientation::Rotate90 => (y, bottom - x),
        Orientation::Rotate270FlipH => (right - y, bottom - x),
        Orientation::Rotate270 => (right - y, x),
    }
}

/// A map from column and row in a stored picture of `size` to those in the upright one.
pub(super) fn upright_place(
    size: Size,
    orientation: Orientation,
) -> impl Fn(usize, usize) -> (usize, usize) {
    // Every orientation is its own inverse, except for the quarter turns.
    let back = match orientation {
        Orientation::Rotate90 => Orientation::Rotate270,
        Orientation::Rotate270 => Orientation::Rotate90,
        other => other,
    };
    stored_place(turned_size(size, orientation), back)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_eight_agree_with_the_image_crate() {
        let size = Size::new(5, 3);
        let plane = Plane::from_fn(size, |x, y| (10 * y + x) as u8);
        for tag in 1..=8 {
            let orientation = Orientation::from_exif(tag).unwrap();
            let grey = image::GrayImage::from_raw(5, 3, plane.data().to_vec()).unwrap();
            let mut witness = image::DynamicImage::ImageLuma8(grey);
            witness.apply_orientation(orientation);
            let turned = turn(&plane, orientation);
            assert_eq!(turned.data(), witness.as_bytes(), "orientation {tag}");
            assert_eq!(turned.width(), witness.width() as usize);
        }
    }
}
