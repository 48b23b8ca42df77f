//! The methods of a sweep, as a fault makes them.

use super::fault::Fault;
use crate::config;
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::method::{About, Method, MethodError, Problem, Solution, Watch};
use crate::pipeline::{method, reference_solution};

/// The methods that are swept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contestant {
    /// One that a rig file can name.
    Named(config::Method),
    /// Total variation, which no rig file names.
    TotalVariation,
}

impl Contestant {
    /// All of them.
    pub const ALL: [Contestant; 9] = [
        Contestant::Named(config::Method::Paper),
        Contestant::Named(config::Method::Residual),
        Contestant::Named(config::Method::Unmatched),
        Contestant::Named(config::Method::Hybrid),
        Contestant::Named(config::Method::BlockMatching),
        Contestant::Named(config::Method::Digital),
        Contestant::Named(config::Method::Wiener),
        Contestant::Named(config::Method::RichardsonLucy),
        Contestant::TotalVariation,
    ];

    /// The word in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Contestant::Named(method) => method.name(),
            Contestant::TotalVariation => "total-variation",
        }
    }

    /// Whether it looks through the lens.
    pub const fn captures(self) -> bool {
        use config::Method::{BlockMatching, Hybrid, Paper, Residual, Unmatched};
        matches!(self, Contestant::Named(Paper | Residual | Unmatched | Hybrid | BlockMatching))
    }

    /// Whether it sends pictures backward through the lens, patch by patch.
    pub const fn patches(self) -> bool {
        matches!(self, Contestant::Named(config::Method::Paper | config::Method::Residual))
    }

    /// Whether it goes by steps that could be too long.
    pub const fn steps(self) -> bool {
        !matches!(self, Contestant::Named(config::Method::Wiener | config::Method::RichardsonLucy))
    }

    /// The method with the settings of `rig` under `fault`.
    pub fn method(
        self,
        rig: &config::Rig,
        fault: Fault,
        strength: f64,
    ) -> Box<dyn Method + Send + Sync> {
        let mut rig = rig.clone();
        match fault {
            Fault::SmallPatch => {
                rig.paper.patch_px = strength as usize;
                // A margin wider than the patch would sew its neighbours' light in.
                rig.paper.margin_px = rig.paper.margin_px.min(rig.paper.patch_px / 2);
            }
            Fault::LargePatch => rig.paper.patch_px = strength as usize,
            Fault::Step => rig.paper.tau *= strength as f32,
            _ => {}
        }
        let made: Box<dyn Method + Send + Sync> = match self {
            Contestant::Named(which) => method(&rig, which),
            Contestant::TotalVariation => Box::new(reference_solution(&rig)),
        };
        match fault {
            Fault::Step => Box::new(Longer { method: made, times: strength as f32 }),
            _ => made,
        }
    }
}

/// A method that thinks ‖K‖ smaller than it is, and so steps too far.
struct Longer {
    method: Box<dyn Method + Send + Sync>,
    times: f32,
}

impl Method for Longer {
    fn about(&self) -> &'static About {
        self.method.about()
    }

    fn solve(
        &self,
        problem: &Problem<'_>,
        optics: &mut dyn ForwardConvolution,
        watch: &mut Watch<'_>,
    ) -> Result<Solution, MethodError> {
        let level_norms =
            problem.level_norms.each_ref().map(|norms| norms.scaled(1.0 / self.times));
        let norm_squared = problem.norm_squared.map(|norm| norm / self.times);
        let problem = Problem { norm_squared, level_norms: &level_norms, ..*problem };
        self.method.solve(&problem, optics, watch)
    }
}
