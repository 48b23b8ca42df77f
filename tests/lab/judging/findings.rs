//! Everything that a verdict depends on, so that the table can be applied again, whole or without a
//! row, and no photo has to be solved again.

use relens::deconvolution::method::digital::Digital;
use relens::deconvolution::method::total_variation::TotalVariation;
use relens::frame::{Frame, Work};
use relens::pipeline::{Case, Evidence, Measures, Pipeline, Prepared, Solved, unexplained_product};

use crate::Failure;

/// Measures of a result, and of what would replace it.
#[derive(Debug, Clone)]
pub(crate) struct Findings {
    /// Measures of the result before the reference solution is solved.
    pub(crate) alone: Measures,
    /// Measures of the result compared with the reference solution.
    pub(crate) beside: Measures,
    /// Measures of the solution of `digital` compared with the reference solution.
    pub(crate) digital: Measures,
    /// [Unexplained product](unexplained_product) of the reference solution.
    pub(crate) foreign: f64,
    /// Residual in luma of the reference solution over that of the untouched photo.
    pub(crate) reference_gain: Option<f64>,
    /// The reference solution and the solution of `digital`.
    pub(crate) pictures: [Frame<Work>; 2],
}

impl Findings {
    /// The findings on `solved`, which `pipeline` solved for `photo`, whether it is suspect or not.
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
