//! The patch grid of backward convolution: patches, their four parity classes, and flips.
//!
//! The paper splits the picture "into four images to make sure the adjacent patches do not appear
//! in the same image" (§2.2, step 1). Beyond the paper:
//!
//! * patches start at the photo's upper left corner; the last column and row are cut to what
//!   remains and flip about their own centre;
//! * the margin sewn around a patch ("including the extended margin caused by aberrations", step
//!   4) is at most half a patch, so that the margins of two patches in one display never claim the
//!   same pixel;
//! * a margin reaches beyond the photo as far as the canvas does (the *guard*): light that a
//!   border patch throws out of the frame comes back when it is flipped.

use crate::frame::{Plane, Rect, Size};

/// Patch size and sewing margin, in pixels of the Work grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PatchShape {
    /// Width and height of a patch; the paper uses 80 at 1024×768.
    pub patch_px: usize,
    /// Pixels of blur sewn around each patch; clipped to half a patch.
    pub margin_px: usize,
}

/// The patches of one photo on its canvas.
#[derive(Debug, Clone)]
pub struct PatchGrid {
    canvas: Size,
    margin_px: usize,
    patches: Vec<(Rect, usize)>,
}

/// Number of pictures that together display each patch once.
pub const PARITY_CLASSES: usize = 4;

impl PatchGrid {
    /// The grid over `photo`, a rectangle inside a canvas of the given size.
    pub fn new(canvas: Size, photo: Rect, shape: PatchShape) -> Self {
        let step = shape.patch_px.max(1);
        let mut patches = Vec::new();
        for (row, y) in (0..photo.size.height).step_by(step).enumerate() {
            for (column, x) in (0..photo.size.width).step_by(step).enumerate() {
                let size =
                    Size::new(step.min(photo.size.width - x), step.min(photo.size.height - y));
                patches.push((
                    Rect { x: photo.x + x, y: photo.y + y, size },
                    2 * (row % 2) + column % 2,
                ));
            }
        }
        PatchGrid { canvas, margin_px: shape.margin_px.min(step / 2), patches }
    }

    /// The patches of one parity class, 0..[`PARITY_CLASSES`].
    pub fn class(&self, parity: usize) -> impl Iterator<Item = Rect> + '_ {
        self.patches.iter().filter(move |(_, class)| *class == parity).map(|(rect, _)| *rect)
    }

    /// Steps 1 and 2: the picture of one parity class, each patch flipped about its centre,
    /// black elsewhere.
    pub fn flipped_class(&self, picture: &Plane, parity: usize) -> Plane {
        let mut shown = Plane::zeros(self.canvas);
        for patch in self.class(parity) {
            for y in 0..patch.size.height {
                let from = &picture.row(patch.y + patch.size.height - 1 - y)[patch.x..]
                    [..patch.size.width];
                let to = &mut shown.row_mut(patch.y + y)[patch.x..][..patch.size.width];
                for (t, &f) in to.iter_mut().zip(from.iter().rev()) {
                    *t = f;
                }
            }
        }
        shown
    }

    /// Steps 4 and 5: adds the seen patches of one parity class, with their margins flipped back
    /// about the same centres, to `sewn`.
    pub fn sew_class(&self, seen: &Plane, parity: usize, sewn: &mut Plane) {
        let margin = self.margin_px as isize;
        let (width, height) = (self.canvas.width as isize, self.canvas.height as isize);
        for patch in self.class(parity) {
            let (x0, y0) = (patch.x as isize, patch.y as isize);
            let (x1, y1) = (x0 + patch.size.width as isize, y0 + patch.size.height as isize);
            // A column x of the seen patch belongs at x0 + x1 − 1 − x; both must lie on the canvas.
            let columns = range_and_mirror(x0, x1, margin, width);
            let rows = range_and_mirror(y0, y1, margin, height);
            for y in rows {
                let from = seen.row(y as usize);
                let to = sewn.row_mut((y0 + y1 - 1 - y) as usize);
                for x in columns.clone() {
                    to[(x0 + x1 - 1 - x) as usize] += from[x as usize];
                }
            }
        }
    }
}

/// The positions of `from − margin .. to + margin` that lie in `0..end` together with their mirror
/// images about the centre of `from..to`.
fn range_and_mirror(from: isize, to: isize, margin: isize, end: isize) -> std::ops::Range<isize> {
    let low = (from - margin).max(0).max(from + to - end);
    let high = (to + margin).min(end).min(from + to);
    low..high.max(low)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(size: Size) -> Rect {
        Rect { x: 0, y: 0, size }
    }

    #[test]
    fn every_pixel_is_in_one_patch_and_neighbours_differ_in_class() {
        let size = Size::new(50, 37);
        let grid = PatchGrid::new(size, whole(size), PatchShape { patch_px: 16, margin_px: 8 });
        let mut covered = Plane::<u8>::zeros(size);
        let mut class = Plane::<u8>::filled(size, 9);
        for parity in 0..PARITY_CLASSES {
            for patch in grid.class(parity) {
                for y in patch.y..patch.y + patch.size.height {
                    for x in patch.x..patch.x + patch.size.width {
                        covered.set(x, y, covered.at(x, y) + 1);
                        class.set(x, y, parity as u8);
                    }
                }
            }
        }
        assert!(covered.data().iter().all(|&n| n == 1));
        for y in 0..37 {
            for x in 16..50 {
                assert!(class.at(x, y) != class.at(x - 16, y));
            }
        }
    }

    #[test]
    fn flipping_and_sewing_without_blur_is_the_identity() {
        let size = Size::new(45, 33);
        let picture = Plane::from_fn(size, |x, y| (3 * x + 7 * y) as f32 + 0.5);
        let grid = PatchGrid::new(size, whole(size), PatchShape { patch_px: 20, margin_px: 0 });
        let mut sewn = Plane::zeros(size);
        for parity in 0..PARITY_CLASSES {
            grid.sew_class(&grid.flipped_class(&picture, parity), parity, &mut sewn);
        }
        assert_eq!(sewn, picture);
    }

    #[test]
    fn a_margin_is_cut_where_its_mirror_image_leaves_the_canvas() {
        assert_eq!(range_and_mirror(0, 10, 4, 30), 0..10);
        assert_eq!(range_and_mirror(10, 20, 4, 30), 6..24);
        assert_eq!(range_and_mirror(20, 30, 4, 30), 20..30);
        assert_eq!(range_and_mirror(2, 12, 4, 30), 0..14);
    }
}
