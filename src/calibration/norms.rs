//! Norms of the measured lens: ‖K‖² and those of the wavelet levels.

use rayon::prelude::*;

use super::site_norms::{ROUNDS, SiteNorms};
use super::{Calibration, lens_blur};
use crate::deconvolution::lens_model::{LensFunctions, LensModel, LensModelError};
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

    /// The next generation with other lens functions and their norms; all else, including the
    /// operator error, as measured.
    ///
    /// # Errors
    /// When the functions are invalid.
    pub fn with_lens(&self, functions: LensFunctions) -> Result<Calibration, LensModelError> {
        let generation = self.generation.wrapping_add(1);
        let mut changed = Calibration { functions, generation, ..self.clone() };
        let (model, levels) = (changed.lens_model()?, self.level_norms[0].levels());
        changed.measure_norms(&model, levels, self.at_sites.is_some());
        // The measured ‖K‖² scales with the computed one.
        let green = Channel::Green.index();
        let ratio = changed.norm_squared[green] / self.norm_squared[green].max(f32::MIN_POSITIVE);
        changed.norm_squared_seen *= ratio;
        Ok(changed)
    }
}
