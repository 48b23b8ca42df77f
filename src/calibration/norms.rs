//! Norms of the measured lens: ‖K‖² and those of the wavelet levels.

use super::operator_norms::{OperatorNorms, ROUNDS};
use super::{Calibration, lens_blur};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::{Channel, Plane};

/// Rounds of the power method, started from grey, which is close to the dominant picture.
const POWER_ROUNDS: usize = 12;
/// Seed of the initial picture for each wavelet level.
const LEVEL_SEED: u64 = 17;

impl Calibration {
    /// Computes the norms of this calibration's `model` for `levels` wavelet levels, and at sites
    /// if `at_sites`; returns green's dominant picture.
    pub fn measure_norms(&mut self, model: &LensModel, levels: usize, at_sites: bool) -> Plane {
        self.at_sites = at_sites.then(|| OperatorNorms::at_sites(model, levels));
        let found = Channel::each(|c| lens_blur::dominant(model, c, POWER_ROUNDS));
        self.norms.squared = found.each_ref().map(|(norm, _)| *norm);
        let measure = |c| LevelNorms::measure(model, c, levels, ROUNDS, LEVEL_SEED);
        self.norms.levels = Channel::each(measure);
        let [_, (_, green), _] = found;
        green
    }
}
