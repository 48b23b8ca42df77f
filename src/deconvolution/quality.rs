//! Full-reference image quality: SSIM and PSNR.
//!
//! SSIM after Wang, Bovik, Sheikh and Simoncelli ("Image quality assessment", 2004): 11×11 Gaussian
//! window of σ 1.5, population covariance, K₁ 0.01, K₂ 0.03, full scale 255, mean over all places
//! where the whole window lies in the picture. The golden values are scikit-image's with
//! `gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=255`.

use crate::frame::{FULL_SCALE, Plane};

/// Pixels from the middle of the window to its border.
const RADIUS: usize = 5;
const WINDOW: usize = 2 * RADIUS + 1;

/// Stabilising constants (K₁ · 255)² of the means and (K₂ · 255)² of the variances.
const STABLE_MEAN: f32 = (0.01 * FULL_SCALE) * (0.01 * FULL_SCALE);
const STABLE_SPREAD: f32 = (0.03 * FULL_SCALE) * (0.03 * FULL_SCALE);

/// Offset subtracted before squares are taken, so that differences of squares lose less in single
/// precision.
const MIDDLE: f32 = FULL_SCALE / 2.0;

/// Mean structural similarity of two planes in 0..255, at most 1; NaN when they are smaller than
/// the 11×11 window.
///
/// # Panics
/// When the planes differ in size, which is a bug of the caller.
pub fn ssim(a: &Plane, b: &Plane) -> f64 {
    assert!(a.size() == b.size(), "two planes to compare have one size");
    let width = a.width();
    if width < WINDOW || a.height() < WINDOW {
        return f64::NAN;
    }
    let weights = window();
    // Window sums down the columns, of a, b, a², b² and ab.
    let mut columns = [(); 5].map(|()| vec![0.0f32; width]);
    let mut sums = [(); 5].map(|()| vec![0.0f32; width - 2 * RADIUS]);
    let mut row = vec![0.0f32; width - 2 * RADIUS];
    let (mut total, mut places) = (0.0, 0usize);
    for y in 0..=a.height() - WINDOW {
        columns.iter_mut().for_each(|c| c.fill(0.0));
        let [ca, cb, caa, cbb, cab] = &mut columns;
        for (v, &weight) in weights.iter().enumerate() {
            let (from_a, from_b) = (a.row(y + v), b.row(y + v));
            for i in 0..width {
                let (p, q) = (from_a[i] - MIDDLE, from_b[i] - MIDDLE);
                let (wp, wq) = (weight * p, weight * q);
                ca[i] += wp;
                cb[i] += wq;
                caa[i] += wp * p;
                cbb[i] += wq * q;
                cab[i] += wp * q;
            }
        }
        for (sum, column) in sums.iter_mut().zip(&columns) {
            sum.fill(0.0);
            for (u, &weight) in weights.iter().enumerate() {
                for (s, c) in sum.iter_mut().zip(&column[u..]) {
                    *s += weight * c;
                }
            }
        }
        let [sa, sb, saa, sbb, sab] = &sums;
        for i in 0..row.len() {
            let (mean_a, mean_b) = (sa[i] + MIDDLE, sb[i] + MIDDLE);
            let var_a = saa[i] - sa[i] * sa[i];
            let var_b = sbb[i] - sb[i] * sb[i];
            let together = sab[i] - sa[i] * sb[i];
            let above = (2.0 * mean_a * mean_b + STABLE_MEAN) * (2.0 * together + STABLE_SPREAD);
            let below =
                (mean_a * mean_a + mean_b * mean_b + STABLE_MEAN) * (var_a + var_b + STABLE_SPREAD);
            row[i] = above / below;
        }
        total += row.iter().map(|&v| f64::from(v)).sum::<f64>();
        places += row.len();
    }
    total / places as f64
}

/// Peak signal-to-noise ratio in dB for a full scale of 255; infinite for equal planes.
///
/// # Panics
/// When the planes differ in size, which is a bug of the caller.
pub fn psnr(a: &Plane, b: &Plane) -> f64 {
    assert!(a.size() == b.size(), "two planes to compare have one size");
    let squares: f64 = a.data().iter().zip(b.data()).map(|(&x, &y)| f64::from(x - y).powi(2)).sum();
    let mean = squares / a.size().area() as f64;
    10.0 * (f64::from(FULL_SCALE).powi(2) / mean).log10()
}

/// Weights of the window along one side, summing to 1.
fn window() -> [f32; WINDOW] {
    let bell: [f64; WINDOW] = std::array::from_fn(|i| {
        let from_middle = i as f64 - RADIUS as f64;
        (-from_middle * from_middle / (2.0 * 1.5 * 1.5)).exp()
    });
    let total: f64 = bell.iter().sum();
    bell.map(|v| (v / total) as f32)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::frame::{Size, read_npy_f32};

    fn golden(name: &str) -> Plane {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
        let (shape, values) = read_npy_f32(&path).unwrap();
        Plane::from_vec(Size::new(shape[1], shape[0]), values).unwrap()
    }

    #[test]
    fn values_match_scikit_image() {
        let (x, blurred, noisy) =
            (golden("ssim_x.npy"), golden("ssim_b.npy"), golden("ssim_noisy.npy"));
        assert!((ssim(&x, &blurred) - 0.757_939_514_642_543_8).abs() < 1e-5);
        assert!((ssim(&x, &noisy) - 0.906_146_526_494_478_6).abs() < 1e-5);
        assert!((psnr(&x, &blurred) - 22.704_966_357_348_102).abs() < 1e-4);
    }

    #[test]
    fn equal_planes_have_similarity_one_and_small_ones_nan() {
        let x = golden("ssim_x.npy");
        assert!((ssim(&x, &x) - 1.0).abs() < 1e-6);
        assert!(psnr(&x, &x).is_infinite());
        let small = Plane::filled(Size::new(10, 40), 3.0);
        assert!(ssim(&small, &small).is_nan());
    }
}
