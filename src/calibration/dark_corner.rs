//! Dark corner and black level: smooth surfaces fitted to flat captures; dividing by a smooth
//! surface or subtracting it adds no noise.

use super::surface::{Domain, Sample, Surface, SurfaceError};
use crate::frame::{Plane, Rect};

/// Side of the cell averaged to one sample, pixels.
const CELL_PX: usize = 8;
/// Knot intervals. Vignetting has even powers of the field; six by five intervals follow cos⁴ and a
/// clipped pupil. Measured, see tests/tables/constants.md.
const INTERVALS: (usize, usize) = (6, 5);
/// Penalty on bending; small, as cells have little noise (guess).
const BENDING: f64 = 1e-3;

/// Fits a smooth surface to `flat` (sensor pixels) over `domain` in Work coordinates; sensor pixel
/// `origin` is Work (0, 0). Cells outside the domain or within `rim_px` of its border are omitted.
///
/// # Errors
/// When the flat has too few cells within the domain.
pub fn smooth(
    flat: &Plane,
    origin: (usize, usize),
    domain: Domain,
    rim_px: usize,
) -> Result<Surface, SurfaceError> {
    let cell = CELL_PX.min(flat.width() / 8).min(flat.height() / 8).max(1);
    let middle = (cell as f64 - 1.0) / 2.0;
    let samples = (0..flat.height() / cell)
        .flat_map(|j| (0..flat.width() / cell).map(move |i| (i * cell, j * cell)))
        .filter_map(|(x, y)| {
            let work = (x as f64 + middle - origin.0 as f64, y as f64 + middle - origin.1 as f64);
            // The whole cell, not only its middle, must be clear of the rim.
            let rim = if rim_px > 0 { rim_px as f64 + middle } else { 0.0 };
            let inside = (domain.left + rim..=domain.right - rim).contains(&work.0)
                && (domain.top + rim..=domain.bottom - rim).contains(&work.1);
            let mean = || {
                let sum: f64 = (y..y + cell)
                    .map(|v| flat.row(v)[x..x + cell].iter().map(|&c| f64::from(c)).sum::<f64>())
                    .sum();
                sum / (cell * cell) as f64
            };
            inside.then(|| Sample { x: work.0, y: work.1, value: mean() })
        });
    Surface::fit(domain, INTERVALS.0, INTERVALS.1, samples, BENDING)
}

/// `surface` divided by its mean over the photo (Work 0..width × 0..height), and that mean.
pub fn normalised(surface: &Surface, photo: Rect) -> (Surface, f64) {
    let mut row = vec![0.0f32; photo.size.width];
    let mut sum = 0.0;
    for y in 0..photo.size.height {
        surface.row((photo.y + y) as f64, photo.x as f64, 1.0, &mut row);
        sum += row.iter().map(|&v| f64::from(v)).sum::<f64>();
    }
    let mean = sum / photo.size.area() as f64;
    (surface.scaled(1.0 / mean), mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn vignetting_is_fitted_to_a_thousandth_despite_noise() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
        let bell = Normal::new(0.0, 4.0).unwrap();
        let cos4 = |x: f64, y: f64| {
            let squared = ((x - 127.5).powi(2) + (y - 95.5).powi(2)) / 300.0f64.powi(2);
            (1.0 + squared).powi(-2)
        };
        let flat = Plane::from_fn(Size::new(288, 224), |x, y| {
            (500.0 * cos4(x as f64 - 16.0, y as f64 - 16.0) + bell.sample(&mut random)) as f32
        });
        let domain = Domain { left: -8.0, top: -8.0, right: 263.0, bottom: 199.0 };
        let photo = Rect { x: 0, y: 0, size: Size::new(256, 192) };
        let (surface, mean) = normalised(&smooth(&flat, (16, 16), domain, 0).unwrap(), photo);
        let mut squared = 0.0;
        for y in 0..192 {
            for x in 0..256 {
                let wanted = 500.0 * cos4(f64::from(x), f64::from(y)) / mean;
                squared += (surface.at(f64::from(x), f64::from(y)) / wanted - 1.0).powi(2);
            }
        }
        let rms = (squared / (256.0 * 192.0)).sqrt();
        println!("dark corner {rms:.5} RMS");
        assert!(rms < 0.001, "{rms}");
    }
}
