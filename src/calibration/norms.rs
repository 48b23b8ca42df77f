//! How strong the measured lens is: ‖K‖² and the wavelet levels' norms, and another lens in its
//! place.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Calibration, lens_blur};
use crate::deconvolution::lens_model::{LensFunctions, LensModel, LensModelError};
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::{Channel, Mosaic, Plane};

/// Rounds of the power method from grey, which nearly is the dominant picture.
const POWER_ROUNDS: usize = 12;
/// Rounds of the power method for each wavelet level, and the seed of the picture they begin with.
const LEVEL_ROUNDS: usize = 8;
const LEVEL_SEED: u64 = 17;

/// The norms of √weight · K at the sites of colour filters, as
/// [`crate::deconvolution::method::Problem`] wants them for a raw photo.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SiteNorms {
    /// Largest squared singular value, per channel.
    pub norm_squared: [f32; 3],
    /// What each wavelet level lets through, per channel.
    pub level_norms: [LevelNorms; 3],
}

impl SiteNorms {
    /// Measured of `model` for so many wavelet `levels`. Which colour the first site has does not
    /// matter: all mosaics have the same norms.
    pub fn of(model: &LensModel, levels: usize) -> SiteNorms {
        let at_sites =
            |&c: &Channel| LevelNorms::at_sites(model, c, Mosaic::Rggb, levels, LEVEL_ROUNDS);
        let measured: Vec<(LevelNorms, f32)> = Channel::ALL.par_iter().map(at_sites).collect();
        SiteNorms {
            norm_squared: Channel::ALL.map(|c| measured[c.index()].1),
            level_norms: Channel::ALL.map(|c| measured[c.index()].0.clone()),
        }
    }

    pub(super) fn is_whole(&self) -> bool {
        let positive = |norm: &f32| norm.is_finite() && *norm > 0.0;
        self.norm_squared.iter().all(positive) && self.level_norms.iter().all(LevelNorms::is_whole)
    }
}

impl Calibration {
    /// Measures the norms of `model`, which is this calibration's, for so many wavelet `levels`,
    /// and `at_sites` where the camera has colour filters; green's dominant picture.
    pub fn measure_norms(&mut self, model: &LensModel, levels: usize, at_sites: bool) -> Plane {
        self.at_sites = at_sites.then(|| SiteNorms::of(model, levels));
        let dominant = |&c: &Channel| lens_blur::dominant(model, c, POWER_ROUNDS);
        let (norms, mut pictures): (Vec<f32>, Vec<Plane>) =
            Channel::ALL.par_iter().map(dominant).unzip();
        self.norm_squared.iter_mut().zip(norms).for_each(|(norm, found)| *norm = found);
        let measure =
            |&c: &Channel| LevelNorms::measure(model, c, levels, LEVEL_ROUNDS, LEVEL_SEED);
        let measured: Vec<LevelNorms> = Channel::ALL.par_iter().map(measure).collect();
        for (norms, found) in self.level_norms.iter_mut().zip(measured) {
            *norms = found;
        }
        pictures.swap_remove(Channel::Green.index())
    }

    /// The same calibration, one generation on, with the lens that photos have proved to be there
    /// in place of the measured one. All else is as it was measured; the operator error is the
    /// measured lens's.
    ///
    /// # Errors
    /// When the functions are none.
    pub fn with_lens(&self, functions: LensFunctions) -> Result<Calibration, LensModelError> {
        let generation = self.generation.wrapping_add(1);
        let mut changed = Calibration { functions, generation, ..self.clone() };
        let (model, levels) = (changed.lens_model()?, self.level_norms[0].levels());
        changed.measure_norms(&model, levels, self.at_sites.is_some());
        // By as much as the light differed from the measured lens, it may differ from this one.
        let green = Channel::Green.index();
        let ratio = changed.norm_squared[green] / self.norm_squared[green].max(f32::MIN_POSITIVE);
        changed.norm_squared_seen *= ratio;
        Ok(changed)
    }
}
