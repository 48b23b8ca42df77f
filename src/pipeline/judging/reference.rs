//! The reference solution of a photo, and whether any scene gives the photo through the measured
//! lens.

use super::evidence::unexplained_product;
use super::limits::FOREIGN;
use crate::deconvolution::method::{MethodError, Watch};
use crate::pipeline::Pipeline;
use crate::pipeline::stages::{LensAlone, Prepared, Reference};

impl Pipeline {
    /// Finding of the measured lens alone on `photo`.
    pub(in crate::pipeline) fn lens_alone(
        &self,
        photo: &Prepared<'_>,
        watch: &mut Watch<'_>,
    ) -> Result<LensAlone, MethodError> {
        let solved = self.by_lens_alone(&self.reference, photo, watch)?;
        let evidence = self.evidence(photo, &solved);
        let product = unexplained_product(&evidence.channels);
        Ok(match product > FOREIGN || product.is_nan() {
            true => LensAlone::Foreign(evidence.channels),
            false => LensAlone::Fitting(Box::new(Reference { solved, evidence })),
        })
    }
}
