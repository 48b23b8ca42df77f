//! The methods as a rig file sets them.

use crate::config::methods::{self, Solving};
use crate::config::{MethodName, RigFile};
use crate::deconvolution::method::digital::Digital;
use crate::deconvolution::method::hybrid::Hybrid;
use crate::deconvolution::method::paper::Paper;
use crate::deconvolution::method::total_variation::TotalVariation;

/// The method `which` with the numbers of `rig`.
pub fn method(rig: &RigFile, which: MethodName) -> Solving {
    which.with(&rig.numbers())
}

/// The paper's loop with the numbers of `rig`.
pub fn paper(rig: &RigFile) -> Paper {
    methods::paper(&rig.numbers())
}

/// `digital` with the numbers of `rig`.
pub fn digital(rig: &RigFile) -> Digital {
    methods::digital(&rig.numbers())
}

/// `hybrid` with the numbers of `rig`.
pub fn hybrid(rig: &RigFile) -> Hybrid {
    methods::hybrid(&rig.numbers())
}

/// What a result on `rig` is judged by.
pub fn reference_solution(rig: &RigFile) -> TotalVariation {
    methods::total_variation(&rig.numbers())
}
