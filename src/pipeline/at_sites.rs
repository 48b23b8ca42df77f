//! The lens's norms where a photo's data are a mosaic's sites.

use rayon::prelude::*;

use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::{Channel, Mosaic};

/// As [`crate::deconvolution::method::Problem`] wants them.
#[derive(Debug)]
pub(super) struct AtSites {
    pub(super) norm_squared: [f32; 3],
    pub(super) level_norms: [LevelNorms; 3],
}

/// Rounds of the power method for each wavelet level, as calibration's.
const LEVEL_ROUNDS: usize = 8;

impl AtSites {
    /// Measured of `model`, for so many `levels`; all mosaics have the same.
    pub(super) fn of(model: &LensModel, mosaic: Mosaic, levels: usize) -> AtSites {
        let measured: Vec<(LevelNorms, f32)> = Channel::ALL
            .par_iter()
            .map(|&c| LevelNorms::at_sites(model, c, mosaic, levels, LEVEL_ROUNDS))
            .collect();
        AtSites {
            norm_squared: Channel::ALL.map(|c| measured[c.index()].1),
            level_norms: Channel::ALL.map(|c| measured[c.index()].0.clone()),
        }
    }
}
