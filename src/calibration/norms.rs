//! Norms of the measured lens: ‖K‖² and those of the wavelet levels.

use rayon::prelude::*;

use super::site_norms::{ROUNDS, SiteNorms};
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
        self.at_sites = at_sites.then(|| SiteNorms::of(model, levels));
        let dominant = |&c: &Channel| lens_blur::dominant(model, c, POWER_ROUNDS);
        let (norms, mut pictures): (Vec<f32>, Vec<Plane>) =
            Channel::ALL.par_iter().map(dominant).unzip();
        self.norm_squared.iter_mut().zip(norms).for_each(|(norm, found)| *norm = found);
        let measure = |&c: &Channel| LevelNorms::measure(model, c, levels, ROUNDS, LEVEL_SEED);
        let measured: Vec<LevelNorms> = Channel::ALL.par_iter().map(measure).collect();
        for (norms, found) in self.level_norms.iter_mut().zip(measured) {
            *norms = found;
        }
        pictures.swap_remove(Channel::Green.index())
    }
}
