//! Measures of a result, taken without knowing the scene: each is one function of a [`Case`] and
//! gives one number in the unit of its row in the [table](super::table).
//!
//! | measure | what it shows |
//! |---|---|
//! | model residual over noise and over the untouched photo's | another lens, a sharp photo |
//! | distance from the reference solution | noise and ringing that the lens hides |
//! | grain of the result's flat parts | the same, at the finest scale |
//! | colours that alternate finer than lightness | channels blurred differently than measured |
//! | light gained or lost | captures of a panel that became brighter or darker |
//!
//! The *reference solution* is that of total variation with the measured lens
//! ([`TotalVariation::default`]): it uses no captures, and flat parts stay flat.

use super::distance::Compared;
use super::evidence::Evidence;
use super::fine_colour::FineColour;
use super::limits;
use crate::frame::{Frame, Work};
use crate::pipeline::stages::{Prepared, Solved};

/// A result under judgement.
pub struct Case<'a> {
    /// The photo.
    pub photo: &'a Prepared<'a>,
    /// The result.
    pub solved: &'a Solved,
    /// Evidence about the result by itself.
    pub evidence: &'a Evidence,
    /// The reference solution, once it is solved.
    pub reference: Option<&'a Frame<Work>>,
}

/// Fine colour over fine lightness; `None` if the reference solution is dotted, too.
pub(super) fn colour_dots(case: &Case<'_>) -> Option<f64> {
    let in_reference = case.reference.is_some_and(|reference| {
        let of = FineColour::of(reference, case.photo.observation.channels);
        of.over_lightness() > limits::DOTTED
    });
    (!in_reference).then(|| case.evidence.fine_colour.over_lightness())
}

/// The result beside the photo and the reference solution; `None` before that is solved.
pub(super) fn compared<'a>(case: &Case<'a>) -> Option<Compared<'a>> {
    let Case { photo, solved, reference, .. } = *case;
    let (result, channels) = (&solved.picture, photo.observation.channels);
    Some(Compared { result, photo: &photo.photo, reference: reference?, channels })
}
