//! A problem on pixels binned by two: the first of a solve's two levels.
//!
//! Behind a lens that blurs widely the photo's own grid carries little that binned pixels do not. A
//! step on binned pixels costs a quarter, and a few steps on the own grid add the rest. The
//! residual of the binned picture on the own grid shows whether they suffice.

use super::Problem;
use crate::deconvolution::colour_axis::width_px;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::observation::Observation;
use crate::frame::Channel;

/// Minimum width of the lens functions for a solve on two levels, pixels. At 3.8 px photos gain
/// 0.1 dB; behind narrower functions they gain nothing or lose (`tests/tables/tried.md`).
const WIDTH_MIN_PX: f32 = 4.0;

/// Observation, lens and norms of a problem on binned pixels.
pub(super) struct BinnedProblem {
    observation: Observation,
    model: LensModel,
    level_norms: [LevelNorms; 3],
}

impl BinnedProblem {
    /// `problem` on binned pixels; `None` if the lens functions are too narrow, or if data, sides
    /// or wavelet levels cannot be binned.
    pub(super) fn of(problem: &Problem<'_>) -> Option<BinnedProblem> {
        let own = problem.observation;
        let has_levels = problem.level_norms.iter().all(|norms| norms.levels() > 1);
        if !has_levels || width_px(problem.model.functions()) < WIDTH_MIN_PX {
            return None;
        }
        let observation = own.binned()?;
        let places = Channel::each(|c| own.light_of_square(c));
        let model = problem.model.binned(&places).ok()?;
        let level_norms = problem.pixel_norms.each_ref().map(LevelNorms::binned);
        Some(BinnedProblem { observation, model, level_norms })
    }

    /// The binned problem; `own` is the problem on the photo's own grid.
    pub(super) fn problem<'a>(&'a self, own: &Problem<'a>) -> Problem<'a> {
        let BinnedProblem { observation, model, level_norms } = self;
        Problem { observation, model, level_norms, is_hopeless: None, capture_mosaic: None, ..*own }
    }
}
