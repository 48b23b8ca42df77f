//! All that a verdict follows from: with it the table is walked again, whole or without a row, and
//! no photo is solved anew.

use relens::deconvolution::method::digital::Digital;
use relens::deconvolution::method::total_variation::TotalVariation;
use relens::frame::{Frame, Work};
use relens::pipeline::{Case, Evidence, Measures, Pipeline, Prepared, Solved, unexplained_product};

use crate::Failure;

/// Measures of a result, and of what would replace it.
#[derive(Debug, Clone)]
pub(crate) struct Findings {
    /// Measures before the reference solution is solved.
    pub(crate) alone: Measures,
    /// Measures beside the reference solution.
    pub(crate) beside: Measures,
    /// The same of what `digital` makes of the photo.
    pub(crate) digital: Measures,
    /// What the reference solution leaves unexplained.
    pub(crate) foreign: f64,
    /// Luma's residual of the reference solution over the untouched photo's.
    pub(crate) reference_gain: Option<f64>,
    /// The reference solution and what `digital` makes of the photo.
    pub(crate) pictures: [Frame<Work>; 2],
}

impl Findings {
    /// The findings on what `pipeline` has `solved` for `photo`, suspect or not.
    pub(crate) fn of(
        pipeline: &Pipeline,
        photo: &Prepared<'_>,
        solved: &Solved,
    ) -> Result<Findings, Failure> {
        let evidence = pipeline.evidence(photo, solved);
        let measures = |solved: &Solved, evidence: &Evidence, reference| {
            Case { photo, solved, evidence, reference }.measures()
        };
        let reference =
            pipeline.by_lens_alone(&TotalVariation::default(), photo, &mut |_, _| {})?;
        let of_reference = pipeline.evidence(photo, &reference);
        let digital = pipeline.by_lens_alone(&Digital::default(), photo, &mut |_, _| {})?;
        let of_digital = pipeline.evidence(photo, &digital);
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
