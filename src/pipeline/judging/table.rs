//! The table by which results are judged: the witnesses against a result, each with its measure,
//! its [limits](super::limits) and the user's sentence.

use super::evidence::unexplained_product;
use super::limits::{DISTANCE, DOTTED, EXCESS_LIGHT, FOREIGN, GRAIN, NO_GAIN};
use super::measures::{self, Case, compared};

/// Unit of a measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// A share, written in per cent.
    Share,
    /// A ratio.
    Times,
}

/// A row of the table: one witness against a result.
#[derive(Clone)]
pub struct WitnessRow {
    /// Name in the laboratory's tables.
    pub name: &'static str,
    /// Unit of the measure.
    pub unit: Unit,
    /// The measure; `None` where it does not apply.
    pub(super) measure: fn(&Case<'_>) -> Option<f64>,
    /// Measure above which a result is suspect, and the reference solution is solved.
    pub suspect_above: Option<f64>,
    /// Measure above which a result harms, and is replaced.
    pub harm_above: Option<f64>,
    /// Sentence for the user; `{found}` and `{allowed}` stand for numbers in the unit.
    pub(super) sentence: &'static str,
}

/// The witnesses, in the order in which harm is reported.
pub const WITNESSES: [WitnessRow; 7] = [
    WitnessRow {
        name: "light",
        unit: Unit::Share,
        measure: |case| Some(case.evidence.excess_light().into()),
        suspect_above: Some(EXCESS_LIGHT),
        harm_above: Some(EXCESS_LIGHT),
        sentence: "the brightness of the result differed from the photo's by {found} (allowed \
                   {allowed}), as after captures of a panel that is darker or brighter than when \
                   it was measured",
    },
    WitnessRow {
        name: "no gain",
        unit: Unit::Times,
        measure: |case| case.evidence.luma_residual_over_photo(),
        suspect_above: Some(NO_GAIN),
        harm_above: Some(NO_GAIN),
        sentence: "noise hides what the lens did to the photo, and the result explained the photo \
                   less than the photo itself does",
    },
    WitnessRow {
        name: "unexplained",
        unit: Unit::Times,
        measure: |case| Some(unexplained_product(&case.evidence.channels)),
        suspect_above: Some(FOREIGN),
        harm_above: None,
        sentence: "",
    },
    WitnessRow {
        name: "distance",
        unit: Unit::Share,
        measure: |case| Some(compared(case)?.by_lightness()),
        suspect_above: None,
        harm_above: Some(DISTANCE),
        sentence: "the result was too far from what the measured lens alone makes of the photo \
                   ({found} of the photo's own distance, allowed {allowed})",
    },
    WitnessRow {
        name: "colour distance",
        unit: Unit::Share,
        measure: |case| compared(case)?.by_colour(),
        suspect_above: None,
        harm_above: Some(DISTANCE),
        sentence: "the result was too far in colour from what the measured lens alone makes of the \
                   photo ({found} of the photo's own distance, allowed {allowed})",
    },
    WitnessRow {
        name: "dots of colour",
        unit: Unit::Times,
        measure: measures::colour_dots,
        suspect_above: Some(DOTTED),
        harm_above: Some(DOTTED),
        sentence: "the colours of the result alternated from pixel to pixel where its lightness \
                   did not, as happens when a photo is out of focus",
    },
    WitnessRow {
        name: "grain",
        unit: Unit::Times,
        measure: |case| Some(case.evidence.grain.over_allowed().into()),
        suspect_above: Some(GRAIN),
        harm_above: Some(GRAIN),
        sentence: "the flat parts of the result were grainier than the photo's ({found} the \
                   visible amount, allowed {allowed})",
    },
];
