//! The threshold of the shrinkage as a function of the noise.

use crate::deconvolution::data_term::NOISE_MIN;

/// The law of the soft threshold of a proximal step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strength {
    /// Threshold at one grey level of noise for a step of length 1, grey levels.
    pub at_one_grey_level: f32,
}

/// Exponent of the law threshold ∝ noise^EXPONENT. The study's best thresholds at noise 0.5, 1, 2
/// and 4 are 0.06, 0.1, 0.3 and 0.75 to 1.5: in logarithms a line of slope 1.3 to 1.5.
const EXPONENT: f32 = 1.4;

impl Strength {
    /// The threshold at a noise σ of `noise`, both in grey levels.
    pub fn threshold(self, noise: f32) -> f32 {
        self.at_one_grey_level * noise.max(NOISE_MIN).powf(EXPONENT)
    }
}
