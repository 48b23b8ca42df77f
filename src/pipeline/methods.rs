//! Methods made from a rig file.
//!
//! A new method is a file of [`crate::deconvolution::method`], a row of [`MethodName`] and an arm
//! of [`Setting::method`]; help, messages, `rig-config/README.md`, charts and the judge follow.

use super::setting::Setting;
use crate::config::{MethodName, RigFile};
use crate::deconvolution::method::Method;
use crate::deconvolution::method::blocks::Blocks;
use crate::deconvolution::method::digital::Digital;
use crate::deconvolution::method::hybrid::Hybrid;
use crate::deconvolution::method::paper::{Backward, Paper};
use crate::deconvolution::method::richardson_lucy::{self, RichardsonLucy};
use crate::deconvolution::method::wiener::{self, Wiener};
use crate::deconvolution::patches::PatchShape;

/// A method with its parameters.
pub(super) type Solving = Box<dyn Method + Send + Sync>;

impl Setting {
    /// The method with these numbers, on `rig`.
    pub fn method(&self, rig: &RigFile) -> Solving {
        let Setting { steps, correction_steps, captures_max, rounds, .. } = *self;
        let digital = Digital { steps, ..Digital::default() };
        let hybrid = Hybrid { digital, correction_steps, captures_max };
        match self.method {
            MethodName::Paper => Box::new(paper(rig)),
            MethodName::Digital => Box::new(digital),
            MethodName::Hybrid => Box::new(hybrid),
            MethodName::BlockMatching => {
                let blocks = Some(Blocks { rounds, model_error: [0.0; 3] });
                let digital = Digital { blocks, ..digital };
                match captures_max {
                    0 => Box::new(digital),
                    _ => Box::new(Hybrid { digital, ..hybrid }),
                }
            }
            MethodName::Wiener => Box::new(Wiener { noise_to_signal: wiener::NOISE_TO_SIGNAL }),
            MethodName::RichardsonLucy => {
                Box::new(RichardsonLucy { steps: richardson_lucy::STEPS })
            }
        }
    }
}

/// The method `which` with the numbers of `rig`.
pub fn method(rig: &RigFile, which: MethodName) -> Solving {
    Setting::as_filed(rig, which).method(rig)
}

/// The paper's loop with the numbers of `rig`.
pub fn paper(rig: &RigFile) -> Paper {
    let numbers = &rig.paper;
    let patches = PatchShape { patch_px: numbers.patch_px, margin_px: numbers.margin_px };
    Paper {
        iterations: numbers.iterations as u32,
        tau: numbers.tau,
        lambda: numbers.lambda,
        backward: Backward::Light(patches),
        levels: Digital::default().levels,
        bounded: true,
    }
}

/// `hybrid` with the numbers of `rig`.
pub fn hybrid(rig: &RigFile) -> Hybrid {
    let Setting { correction_steps, captures_max, .. } = Setting::as_filed(rig, MethodName::Hybrid);
    Hybrid { digital: Digital::default(), correction_steps, captures_max }
}
