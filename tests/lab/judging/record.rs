//! One result, how good it is, and what the box makes of it.

use relens::deconvolution::method::Method;
use relens::pipeline::{Prepared, Verdict};

use crate::Failure;
use crate::harness::Harness;
use crate::likeness::{Likeness, Truth};

/// One method on one photo.
#[derive(Debug, Clone)]
pub(crate) struct Record {
    /// Rig, fault, strength, how the photo is kept, view, method.
    pub(crate) of: [String; 6],
    /// Without a fault.
    pub(crate) healthy: bool,
    pub(crate) photo: Likeness,
    pub(crate) result: Likeness,
    pub(crate) delivered: Likeness,
    pub(crate) verdict: Verdict,
}

impl Record {
    /// Of what `method` makes of `photo`, whose scene is `truth`.
    pub(crate) fn of(
        harness: &mut Harness,
        photo: &Prepared<'_>,
        truth: &Truth,
        method: &dyn Method,
    ) -> Result<Record, Failure> {
        let (solved, outcome) = harness.judge(photo, method)?;
        Ok(Record {
            of: Default::default(),
            healthy: false,
            photo: truth.likeness(&photo.photo),
            result: truth.likeness(&solved.picture),
            delivered: truth.likeness(&outcome.picture),
            verdict: outcome.verdict,
        })
    }

    /// Whether the method's result is worse than the photo.
    pub(crate) fn harms(&self) -> bool {
        self.result.harms(self.photo)
    }

    /// Whether a healthy result that does no harm is not delivered.
    pub(crate) fn is_alarm(&self) -> bool {
        self.healthy && !self.harms() && self.verdict.noticed()
    }

    /// Whether what is delivered is worse than the result.
    pub(crate) fn costs(&self) -> bool {
        self.delivered.harms(self.result)
    }

    /// Heads of [`Record::cells`].
    pub(crate) const HEAD: &str = "rig,fault,strength,photo,view,method,healthy,verdict,\
        photo SSIM,photo ΔE,SSIM,ΔE,delivered SSIM,delivered ΔE";

    /// A line of the list of all.
    pub(crate) fn cells(&self) -> String {
        let mut cells: Vec<String> = self.of.to_vec();
        cells.push(u8::from(self.healthy).to_string());
        cells.push(format!("{:?}", self.verdict).to_lowercase());
        for of in [self.photo, self.result, self.delivered] {
            let difference = of.difference.map_or(String::new(), |v| format!("{v:.3}"));
            cells.extend([format!("{:.4}", of.ssim), difference]);
        }
        cells.join(",")
    }
}
