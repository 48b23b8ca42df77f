//! The stage of a restoration that produced its result.

use serde::{Deserialize, Serialize};

/// The stage that produced a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResultStage {
    /// No stage: the photo is returned unchanged.
    Photo,
    /// The solve with the measured lens; captures found nothing to correct, or none was made.
    LensModel,
    /// Captures: they measured what the lens model misses, or the method solves by them alone.
    Captures,
}

impl ResultStage {
    /// Explanation, for the user, of why the result is of this stage.
    pub const fn reason(self) -> &'static str {
        match self {
            ResultStage::Photo => "the photo is blank: it shows no detail above its noise",
            ResultStage::LensModel => {
                "the measured lens explains the photo; captures showed nothing to correct"
            }
            ResultStage::Captures => {
                "captures showed errors of the measured lens, and the result was corrected for \
                 them"
            }
        }
    }
}
