//! How strongly to shrink, from the noise of the photo.

use crate::deconvolution::data_term::NOISE_MIN;

/// The soft threshold of a proximal step as a function of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strength {
    /// Threshold for a photo with one grey level of noise, grey levels, per unit step.
    pub at_one_grey_level: f32,
}

/// Exponent of the law threshold ∝ noise^EXPONENT. The best thresholds of the study at noise 0.5,
/// 1, 2 and 4 are 0.06, 0.1, 0.3 and 0.75 to 1.5: a straight line in logarithms has slope 1.3 to
/// 1.5.
const EXPONENT: f32 = 1.4;

impl Strength {
    /// The threshold for noise of standard deviation `noise`, both in grey levels.
    pub fn threshold(self, noise: f32) -> f32 {
        self.at_one_grey_level * noise.max(NOISE_MIN).powf(EXPONENT)
    }
}
