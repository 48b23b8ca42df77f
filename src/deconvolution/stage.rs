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
            ResultStage::Photo => "the photo is blank: nothing in it rises above its noise",
            ResultStage::LensModel => {
                "the measured lens explains the photo; captures found nothing to correct"
            }
            ResultStage::Captures => {
                "captures showed what the measured lens misses, and it was corrected"
            }
        }
    }
}
