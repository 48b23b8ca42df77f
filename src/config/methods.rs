//! The methods that a rig file can name: one row each, with what is made of the file's keys.
//!
//! A method says what it is in its own file of [`crate::deconvolution::method`]. To add one, write
//! that file, its line in `mod.rs` and a row here; help, messages, `rig-config/README.md`, charts
//! and the judge follow.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use super::keys::Word;
use super::parts::{ColourChoice, PaperTable, Restore};
use crate::deconvolution::method::blocks::{self, Blocks};
use crate::deconvolution::method::digital::{self, Digital};
use crate::deconvolution::method::hybrid::{self, Hybrid};
use crate::deconvolution::method::paper::{self, Backward, Paper};
use crate::deconvolution::method::richardson_lucy::{self, RichardsonLucy};
use crate::deconvolution::method::total_variation::{self, TotalVariation};
use crate::deconvolution::method::wiener::{self, Wiener};
use crate::deconvolution::method::{About, Method, Strength};
use crate::deconvolution::patches::PatchShape;

/// What a method is made of: the keys of a rig file, and the numbers that may be chosen in place of
/// them.
#[derive(Debug, Clone, Copy)]
pub struct Numbers<'a> {
    /// `[restore]`.
    pub restore: &'a Restore,
    /// `[paper]`.
    pub paper: &'a PaperTable,
    /// Steps of the solve with the lens model.
    pub steps: u32,
    /// Steps of each correction.
    pub correction_steps: u32,
    /// Captures a photo may cost.
    pub captures_max: u32,
    /// Rounds of block matching in each solve with it.
    pub rounds: u32,
}

/// A method ready to solve.
pub type Solving = Box<dyn Method + Send + Sync>;

/// The enum of methods from a row for each: its documentation, what it is, and how it is made.
macro_rules! methods {
    ($($(#[doc = $doc:literal])* $method:ident: $about:expr, $made:expr;)*) => {
        /// A method that a rig file can name.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum MethodName { $($(#[doc = $doc])* $method,)* }

        impl MethodName {
            /// All of them.
            pub const ALL: [MethodName; Self::WORDS.len()] = [$(MethodName::$method),*];
            /// The words for them in a rig file.
            pub(super) const WORDS: &'static [Word] =
                &[$(Word { word: $about.name, meaning: concat!($($doc),*) }),*];

            /// What it is.
            pub const fn about(self) -> &'static About {
                match self { $(MethodName::$method => &$about),* }
            }

            /// The method made of `numbers`.
            pub fn with(self, numbers: &Numbers<'_>) -> Solving {
                let make: fn(&Numbers<'_>) -> Solving =
                    match self { $(MethodName::$method => $made),* };
                make(numbers)
            }
        }
    };
}

methods! {
    /// The paper's loop as printed.
    Paper: paper::ABOUT, |n| Box::new(paper(n));
    /// Lens model only.
    Digital: digital::ABOUT, |n| Box::new(digital(n));
    /// Lens model, certified and corrected by captures.
    Hybrid: hybrid::ABOUT, |n| Box::new(hybrid(n));
    /// `hybrid` with block matching for the prior: better, and slower.
    BlockMatching: blocks::ABOUT, |n| {
        let blocks = Some(Blocks { rounds: n.rounds, model_error: [0.0; 3] });
        let digital = Digital { blocks, ..digital(n) };
        match n.captures_max {
            0 => Box::new(digital),
            _ => Box::new(Hybrid { digital, ..hybrid(n) }),
        }
    };
    /// Wiener filter by patches.
    Wiener: wiener::ABOUT, |_| Box::new(Wiener { noise_to_signal: wiener::NOISE_TO_SIGNAL });
    /// Richardson–Lucy.
    RichardsonLucy: richardson_lucy::ABOUT, |_| {
        Box::new(RichardsonLucy { steps: richardson_lucy::STEPS })
    };
}

impl MethodName {
    /// The word in rig files, tables and reports.
    pub const fn name(self) -> &'static str {
        self.about().name
    }
}

impl Serialize for MethodName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for MethodName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        let named = MethodName::ALL.into_iter().find(|method| method.name() == word);
        named.ok_or_else(|| de::Error::unknown_variant(&word, &[]))
    }
}

/// The paper's loop.
pub fn paper(numbers: &Numbers<'_>) -> Paper {
    let Numbers { restore, paper, .. } = *numbers;
    Paper {
        iterations: paper.iterations as u32,
        tau: paper.tau,
        lambda: paper.lambda,
        backward: Backward::Light(patches(paper)),
        levels: restore.levels,
        bounded: true,
    }
}

/// The lens model only.
pub fn digital(numbers: &Numbers<'_>) -> Digital {
    let restore = numbers.restore;
    Digital {
        steps: numbers.steps,
        strength: strength(numbers, 1.0),
        levels: restore.levels,
        cycle_spun: restore.cycle_spun,
        colours: match restore.colours {
            ColourChoice::AlongAxes => digital::Colours::AlongAxes,
            ColourChoice::Together => digital::Colours::Together,
            ColourChoice::Apart => digital::Colours::Apart,
        },
        blocks: None,
    }
}

/// The lens model, certified and corrected by captures.
pub fn hybrid(numbers: &Numbers<'_>) -> Hybrid {
    Hybrid {
        digital: digital(numbers),
        correction_steps: numbers.correction_steps,
        captures_max: numbers.captures_max,
        defect_threshold: hybrid::DEFECT_THRESHOLD,
        defect_floor: hybrid::DEFECT_FLOOR,
        carefulness: hybrid::CAREFULNESS,
    }
}

/// Total variation with the measured lens, which leaves flat what is flat: the reference solution
/// that results are judged by.
pub fn total_variation(numbers: &Numbers<'_>) -> TotalVariation {
    let strength = strength(numbers, total_variation::STRENGTH_FACTOR);
    TotalVariation { steps: total_variation::STEPS, strength }
}

/// `[restore]`'s shrinkage, so many times.
fn strength(numbers: &Numbers<'_>, factor: f32) -> Strength {
    Strength { at_one_grey_level: factor * numbers.restore.shrinkage_at_one_grey_level }
}

/// The patches of backward convolution.
fn patches(paper: &PaperTable) -> PatchShape {
    PatchShape { patch_px: paper.patch_px, margin_px: paper.margin_px }
}
