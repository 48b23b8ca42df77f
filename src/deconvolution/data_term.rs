//! The data term of Eq. 2 with missing and clipped data: weight classes of pixels, residuals, and
//! the noise of a photo.

use rayon::prelude::*;

use crate::frame::{Plane, Rect, STRETCH, Size};

/// No data: outside the photo, between sites, a dead pixel.
pub const MISSING: u8 = 0;
/// The value is the sensor's.
pub const TRUSTED: u8 = 1;
/// The value is a lower bound: the pixel was full.
pub const SATURATED: u8 = 2;

/// Least noise σ of any photo or capture, grey levels: rounding to 8 bits, 1/√12.
pub const NOISE_MIN: f32 = 0.29;

/// Replaces the prediction K L by the residual K L − B: zero where data are missing, and where a
/// saturated pixel is predicted at least as bright as its bound.
pub fn residual_in_place(predicted: &mut Plane, photo: &Plane, trust: &Plane<u8>) {
    let pixels = (predicted.data_mut(), photo.data(), trust.data()).into_par_iter();
    pixels.with_min_len(STRETCH).for_each(|(p, b, &t)| {
        let difference = *p - b;
        *p = match t {
            TRUSTED => difference,
            SATURATED => difference.min(0.0),
            _ => 0.0,
        };
    });
}

/// Root mean square of a residual over the pixels that carry data; 0 when none does.
pub fn rms_over_data(residual: &Plane, trust: &Plane<u8>) -> f32 {
    let count = trust.data().iter().filter(|&&t| t != MISSING).count();
    if count == 0 {
        return 0.0;
    }
    (residual.dot(residual) / count as f64).sqrt() as f32
}

/// `inner` placed at `photo` on a canvas, with its edge pixels repeated outside, as a guess that
/// the scene continues. For a black surround use [`place`].
pub fn place_with_edges(inner: &Plane, canvas: Size, photo: Rect) -> Plane {
    Plane::from_fn(canvas, |x, y| {
        let column = x.saturating_sub(photo.x).min(photo.size.width - 1);
        let row = y.saturating_sub(photo.y).min(photo.size.height - 1);
        inner.at(column, row)
    })
}

/// `inner` placed at `photo` on a canvas filled with `outside`.
pub fn place<T: Copy + Default>(
    inner: &Plane<T>,
    canvas: Size,
    photo: Rect,
    outside: T,
) -> Plane<T> {
    let mut plane = Plane::filled(canvas, outside);
    for y in 0..photo.size.height {
        plane.row_mut(photo.y + y)[photo.x..][..photo.size.width].copy_from_slice(inner.row(y));
    }
    plane
}

/// The canvas of a photo of size `photo` with `margin_px` on every side, and the photo's rectangle
/// on it.
pub fn canvas_of(photo: Size, margin_px: usize) -> (Size, Rect) {
    let canvas = Size::new(photo.width + 2 * margin_px, photo.height + 2 * margin_px);
    (canvas, Rect { x: margin_px, y: margin_px, size: photo })
}

/// Noise σ of `photo`, in its own units: the median absolute diagonal second difference, scaled for
/// Gaussian noise. A lens's blur leaves nothing else at that scale.
///
/// Source: the difference operator of Immerkær (1996), blind to image structure, with the median of
/// Donoho & Johnstone (1994) in place of the mean, so that a few real edges have no influence.
pub fn noise_of(photo: &Plane) -> f32 {
    let (width, height) = (photo.width(), photo.height());
    if width < 3 || height < 3 {
        return 0.0;
    }
    let mut differences: Vec<f32> = Vec::with_capacity((width - 2) * (height - 2));
    for y in 1..height - 1 {
        let (above, here, below) = (photo.row(y - 1), photo.row(y), photo.row(y + 1));
        for x in 1..width - 1 {
            let mask = above[x - 1] + above[x + 1] + below[x - 1] + below[x + 1]
                - 2.0 * (above[x] + below[x] + here[x - 1] + here[x + 1])
                + 4.0 * here[x];
            differences.push(mask.abs());
        }
    }
    // The mask's weights have norm √36 = 6; 0.6745 is the median of |N(0,1)|.
    let middle = differences.len() / 2;
    *differences.select_nth_unstable_by(middle, f32::total_cmp).1 / (6.0 * 0.674_5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn missing_pixels_have_no_residual_and_saturated_ones_only_a_lower_bound() {
        let size = Size::new(4, 1);
        let predicted = Plane::from_vec(size, vec![10.0, 300.0, 200.0, 5.0]).unwrap();
        let photo = Plane::from_vec(size, vec![4.0, 255.0, 255.0, 9.0]).unwrap();
        let trust = Plane::from_vec(size, vec![TRUSTED, SATURATED, SATURATED, MISSING]).unwrap();
        let mut out = predicted;
        residual_in_place(&mut out, &photo, &trust);
        assert_eq!(out.data(), &[6.0, 0.0, -55.0, 0.0]);
        assert!((rms_over_data(&out, &trust) - ((36.0f32 + 3025.0) / 3.0).sqrt()).abs() < 1e-3);
    }

    #[test]
    fn the_noise_of_a_smooth_noisy_picture_is_estimated() {
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(5);
        let noisy = Plane::from_fn(Size::new(200, 150), |x, y| {
            let noise: f32 = StandardNormal.sample(&mut random);
            100.0 + 40.0 * ((x as f32) / 23.0).sin() + 0.2 * y as f32 + 1.7 * noise
        });
        assert!((noise_of(&noisy) - 1.7).abs() < 0.08, "{}", noise_of(&noisy));
    }

    #[test]
    fn edges_are_repeated_outside_the_photo() {
        let inner = Plane::from_vec(Size::new(2, 1), vec![1.0, 2.0]).unwrap();
        let (canvas, photo) = canvas_of(inner.size(), 1);
        let placed = place_with_edges(&inner, canvas, photo);
        assert_eq!(placed.row(0), &[1.0, 1.0, 2.0, 2.0]);
        assert_eq!(placed.row(2), &[1.0, 1.0, 2.0, 2.0]);
    }
}
