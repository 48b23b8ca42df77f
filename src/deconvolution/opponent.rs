//! Opponent colours: brightness and two colour differences, an orthonormal transform of R, G, B.
//!
//! Most edges of a scene are edges of brightness: sparse along that axis, nearly zero along the
//! other two, so a sparsity prior pays for them once instead of three times. Dabov et al. (2007,
//! "Color image denoising via sparse 3D collaborative filtering") use the same axes.

use rayon::prelude::*;

use crate::frame::{Plane, STRETCH};

/// Replaces R, G, B by (R+G+B)/√3, (R−B)/√2, (R−2G+B)/√6.
///
/// # Panics
/// When the planes differ in size, which is a bug of the caller.
pub fn to_opponent(planes: &mut [Plane; 3]) {
    let [sum, two, six] = weights();
    map_pixels(planes, |[r, g, b]| [sum * (r + g + b), two * (r - b), six * (r - 2.0 * g + b)]);
}

/// Inverse of [`to_opponent`], which is its transpose.
///
/// # Panics
/// When the planes differ in size, which is a bug of the caller.
pub fn from_opponent(planes: &mut [Plane; 3]) {
    let [sum, two, six] = weights();
    map_pixels(planes, |[y, u, v]| {
        [sum * y + two * u + six * v, sum * y - 2.0 * six * v, sum * y - two * u + six * v]
    });
}

fn weights() -> [f32; 3] {
    [3.0f32, 2.0, 6.0].map(|n| 1.0 / n.sqrt())
}

fn map_pixels(planes: &mut [Plane; 3], to: impl Fn([f32; 3]) -> [f32; 3] + Sync) {
    assert!(planes.iter().all(|p| p.size() == planes[0].size()), "planes of one size");
    let [a, b, c] = planes;
    let pixels = (a.data_mut(), b.data_mut(), c.data_mut()).into_par_iter();
    pixels.with_min_len(STRETCH).for_each(|(a, b, c)| [*a, *b, *c] = to([*a, *b, *c]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    #[test]
    fn grey_has_no_colour_difference_and_the_transform_inverts() {
        let plane =
            |k: usize| Plane::from_fn(Size::new(5, 3), |x, y| (x * 7 + y * 3 + k * x * y) as f32);
        let mut grey = [plane(1), plane(1), plane(1)];
        to_opponent(&mut grey);
        assert!(grey[1].rms() < 1e-4 && grey[2].rms() < 1e-4);
        let colour = [plane(0), plane(1), plane(5)];
        let mut changed = colour.clone();
        to_opponent(&mut changed);
        let power = |planes: &[Plane; 3]| planes.iter().map(|p| p.dot(p)).sum::<f64>();
        assert!((power(&changed) / power(&colour) - 1.0).abs() < 1e-5);
        from_opponent(&mut changed);
        for (a, b) in changed.iter().zip(&colour) {
            assert!(a.data().iter().zip(b.data()).all(|(a, b)| (a - b).abs() < 1e-4));
        }
    }
}
