//! The coarsest pixels that lose nothing of what a lens passes.

use std::f64::consts::TAU;

use super::Calibration;

/// Transfer below which noise drowns what a lens passes. Guess between two Gaussian blurs binned by
/// 2: one of 1.5 pixels (0.06 at the binned grid's limit, 15 % of the gain in dB lost) and one of 3
/// pixels (0.00001, 2 % lost).
const NOTHING: f64 = 0.02;

/// Largest binning of the camera's own pixels.
const MOST: usize = 8;

impl Calibration {
    /// The largest factor by which pixels that are `binned` already can be binned further, such
    /// that all functions of all channels pass next to nothing beyond the frequency limit of the
    /// new grid.
    pub fn binning_without_loss(&self, binned: usize) -> usize {
        let factors = [8, 4, 2].into_iter().filter(|factor| factor * binned <= MOST);
        let mut lossless = factors.filter(|&factor| self.transfer(0.5 / factor as f64) < NOTHING);
        lossless.next().unwrap_or(1)
    }

    /// The largest transfer of any function at `frequency`, in cycles per pixel, across or down.
    fn transfer(&self, frequency: f64) -> f64 {
        let side = self.functions.support_px;
        let functions = self.functions.taps.iter().flat_map(|taps| taps.chunks(side * side));
        let each = functions.map(|function| {
            let wave = |along: &dyn Fn(usize) -> usize| {
                let (mut real, mut imaginary) = (0.0, 0.0);
                for (n, &tap) in function.iter().enumerate() {
                    let (sin, cos) = (TAU * frequency * along(n) as f64).sin_cos();
                    real += f64::from(tap) * cos;
                    imaginary += f64::from(tap) * sin;
                }
                real.hypot(imaginary)
            };
            wave(&|n| n % side).max(wave(&|n| n / side))
        });
        each.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use crate::calibration::{Calibration, example};

    /// A calibration whose functions are Gaussians of `sigma` pixels.
    fn blurred_by(sigma: f32) -> Calibration {
        let mut calibration = example::calibration();
        let functions = &mut calibration.functions;
        (functions.rows, functions.columns, functions.support_px) = (1, 1, 41);
        let bell = (0..41 * 41).map(|n| {
            let (x, y) = ((n % 41) as f32 - 20.0, (n / 41) as f32 - 20.0);
            (-(x * x + y * y) / (2.0 * sigma * sigma)).exp()
        });
        let bell: Vec<f32> = bell.collect();
        let total: f32 = bell.iter().sum();
        functions.taps = [(); 3].map(|()| bell.iter().map(|tap| tap / total).collect());
        calibration
    }

    #[test]
    fn pixels_are_binned_as_far_as_the_lens_passes_nothing() {
        for (sigma, by) in [(1.5, 1), (2.0, 2), (3.0, 2), (4.0, 4)] {
            assert_eq!(blurred_by(sigma).binning_without_loss(1), by, "{sigma} px");
        }
        assert_eq!(blurred_by(4.0).binning_without_loss(4), 2);
        // The sharpest channel decides.
        let mut sharp = blurred_by(4.0);
        sharp.functions.taps[1] = blurred_by(1.5).functions.taps[1].clone();
        assert_eq!(sharp.binning_without_loss(1), 1);
    }
}
