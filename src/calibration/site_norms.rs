//! How strong the measured lens is at the sites of colour filters.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::{Channel, Mosaic};

/// Rounds of the power method for each wavelet level.
pub(super) const LEVEL_ROUNDS: usize = 8;

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
