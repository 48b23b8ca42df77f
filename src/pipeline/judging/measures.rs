//! Measures of a result, taken without knowing the scene: each is one function of a [`Case`] and
//! gives one number in the unit of its row in the [table](super::table).
//!
//! | measure | what it shows |
//! |---|---|
//! | model residual over noise and over the untouched photo's | another lens, a sharp photo |
//! | distance from the reference solution | noise and ringing that the lens hides |
//! | grain of flat parts | the same, at the finest scale |
//! | colours that alternate finer than lightness | channels blurred differently than measured |
//! | light gained or lost | captures of a panel that became brighter or darker |
//!
//! The *reference solution* is that of total variation with the measured lens
//! ([`TotalVariation::default`]): it uses no captures, and flat parts stay flat.

use super::distance::{Compared, lightness};
use super::evidence::{Evidence, Residuals};
use super::fine_colour::FineColour;
use super::grain::Grain;
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

/// Largest model residual over the untouched photo's, among the channels where it exceeds noise;
/// `None` if the result's photograph is the photo.
pub(super) fn residual_over_photo(case: &Case<'_>) -> Option<f64> {
    let over_noise =
        case.evidence.channels.iter().filter(|of| of.over_floor() > limits::MORE_THAN_NOISE);
    let largest = over_noise.map(Residuals::over_untouched).max_by(f32::total_cmp);
    largest.filter(|_| !is_certified(case)).map(f64::from)
}

/// Fine colour over fine lightness; `None` if the reference solution is dotted, too.
pub(super) fn colour_dots(case: &Case<'_>) -> Option<f64> {
    let in_reference = case.reference.is_some_and(|reference| {
        let of = FineColour::of(reference, case.photo.observation.channels);
        of.over_lightness() > limits::DOTTED
    });
    (!in_reference).then(|| case.evidence.fine_colour.over_lightness())
}

/// Grain of the result over the allowed grain, in the flat parts of the reference solution or,
/// before that is solved, of the photo.
pub(super) fn grain(case: &Case<'_>) -> Option<f64> {
    let seen = |picture: &Frame<Work>| lightness(picture, case.photo.observation.channels);
    let grain = match case.reference {
        None => case.evidence.grain,
        Some(reference) => {
            Grain::of(&seen(&case.solved.picture), &seen(&case.photo.photo), &seen(reference))
        }
    };
    Some(grain.over_allowed().into())
}

/// The result beside the photo and the reference solution; `None` before that is solved.
pub(super) fn compared<'a>(case: &Case<'a>) -> Option<Compared<'a>> {
    let Case { photo, solved, reference, .. } = *case;
    let (result, channels) = (&solved.picture, photo.observation.channels);
    Some(Compared { result, photo: &photo.photo, reference: reference?, channels })
}

/// Whether the result's photograph is the photo.
fn is_certified(case: &Case<'_>) -> bool {
    let ratio = case.solved.solution.certificate.ratio();
    ratio.is_some_and(|ratio| f64::from(ratio) <= limits::CONFIRMED)
}
