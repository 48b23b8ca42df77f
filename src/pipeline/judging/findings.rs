//! All that a verdict follows from, for the laboratory: with it the table is walked again, whole or
//! without a row, and no photo is solved anew.

use super::evidence::{Evidence, unexplained_product};
use super::limits::{FOREIGN, NO_GAIN};
use super::measures::Case;
use super::table::WITNESSES;
use super::verdict::{self, Measures};
use crate::deconvolution::method::MethodError;
use crate::frame::{Frame, Work};
use crate::pipeline::Pipeline;
use crate::pipeline::stages::{Prepared, Solved};

/// Measures of a result, and of what would replace it.
#[derive(Debug, Clone)]
pub struct Findings {
    /// Measures before the reference solution is solved.
    pub alone: Measures,
    /// Measures beside the reference solution.
    pub beside: Measures,
    /// The same of what `digital` makes of the photo.
    pub digital: Measures,
    /// What the reference solution leaves unexplained.
    pub foreign: f64,
    /// Luma's residual of the reference solution over the untouched photo's.
    pub reference_gain: Option<f64>,
    /// The reference solution and what `digital` makes of the photo.
    pub pictures: [Frame<Work>; 2],
}

/// Limits on a photo as a whole.
#[derive(Debug, Clone, Copy)]
pub struct PhotoLimits {
    /// Above this of [`Findings::foreign`] no scene gives the photo.
    pub foreign_above: f64,
    /// Above this of luma nothing is gained.
    pub no_gain_above: f64,
}

/// The limits that the pipeline has.
pub const PHOTO_LIMITS: PhotoLimits =
    PhotoLimits { foreign_above: FOREIGN, no_gain_above: NO_GAIN };

impl Pipeline {
    /// The findings on what was `solved` for `photo`, suspect or not.
    ///
    /// # Errors
    /// When there is no lens model.
    pub fn findings(&self, photo: &Prepared<'_>, solved: &Solved) -> Result<Findings, MethodError> {
        let evidence = self.evidence(photo, solved);
        let measures = |solved: &Solved, evidence: &Evidence, reference| {
            verdict::measure(&WITNESSES, &Case { photo, solved, evidence, reference })
        };
        let reference = self.by_lens_alone(&self.reference, photo, &mut |_, _| {})?;
        let of_reference = self.evidence(photo, &reference);
        let digital = self.by_lens_alone(&self.digital, photo, &mut |_, _| {})?;
        let of_digital = self.evidence(photo, &digital);
        Ok(Findings {
            alone: measures(solved, &evidence, None),
            beside: measures(solved, &evidence, Some(&reference.picture)),
            digital: measures(&digital, &of_digital, Some(&reference.picture)),
            foreign: unexplained_product(&of_reference.channels),
            reference_gain: of_reference.luma_residual_over_photo(),
            pictures: [reference.picture, digital.picture],
        })
    }
}
