//! Measures of a result, taken without knowing the scene: each is one function of a [`Case`] and
//! gives one number in the unit of its row in [`super::table`].
//!
//! | measure | what it shows |
//! |---|---|
//! | model residual over noise and over the untouched photo's | another lens, a sharp photo |
//! | distance from the reference solution | noise and ringing that the lens hides |
//! | grain of flat parts | the same, at the finest scale |
//! | colours that alternate finer than lightness | channels blurred otherwise than measured |
//! | light gained or lost | captures of a panel that is not as bright as it was |
//!
//! The *reference solution* is total variation's with the measured lens
//! ([`crate::pipeline::reference_solution`]): no capture goes into it, and flat parts stay flat in it.

use super::distance::{Compared, lightness};
use super::fine_colour::FineColour;
use super::grain::Grain;
use super::residuals::{Residuals, unexplained_product};
use super::table;
use crate::frame::{Frame, Work};
use crate::pipeline::stages::{Prepared, Solved};

/// A result under judgement.
pub(super) struct Case<'a> {
    pub(super) photo: &'a Prepared<'a>,
    pub(super) solved: &'a Solved,
    pub(super) evidence: &'a Evidence,
    /// The reference solution, once it is solved.
    pub(super) reference: Option<&'a Frame<Work>>,
}

/// What is known of a result by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Residuals, channel by channel.
    pub channels: Vec<Residuals>,
    /// Grain where the photo is flat.
    pub grain: Grain,
    /// Grain where the result is flat: a very noisy photo is flat nowhere.
    pub cleared: Grain,
    /// Finest colours of the result.
    pub fine_colour: FineColour,
}

impl Evidence {
    /// Difference of the result's light from the photo's, as a share of it, all channels together:
    /// a lens spreads light and makes none.
    pub fn excess_light(&self) -> f32 {
        let sum = |of: fn(&Residuals) -> f32| self.channels.iter().map(of).sum::<f32>();
        (sum(|of| of.excess_light) / sum(|of| of.light).max(f32::MIN_POSITIVE)).abs()
    }

    /// Luma's model residual over the untouched photo's; `None` where the result took grain out of
    /// a noisy photo, which gains by that alone if there is more in it than noise.
    pub(super) fn luma_residual_over_photo(&self) -> Option<f64> {
        // Green, or the one channel of a grey photo.
        let luma = self.channels.get(self.channels.len() / 2)?;
        let is_cleared = self.grain.is_cleared() || self.cleared.is_cleared();
        let is_denoised = is_cleared
            && luma.model < luma.contrast
            && f64::from(self.excess_light()) <= table::EXCESS_LIGHT;
        (!is_denoised).then(|| luma.over_untouched().into())
    }
}

/// [`Evidence::excess_light`].
pub(super) fn excess_light(case: &Case<'_>) -> Option<f64> {
    Some(case.evidence.excess_light().into())
}

/// [`Evidence::luma_residual_over_photo`].
pub(super) fn luma_residual_over_photo(case: &Case<'_>) -> Option<f64> {
    case.evidence.luma_residual_over_photo()
}

/// Largest model residual over the untouched photo's, of the channels where it is more than noise;
/// `None` where the result's photograph is the photo.
pub(super) fn residual_over_photo(case: &Case<'_>) -> Option<f64> {
    let over_noise =
        case.evidence.channels.iter().filter(|of| of.over_floor() > table::MORE_THAN_NOISE);
    let largest = over_noise.map(Residuals::over_untouched).max_by(f32::total_cmp);
    largest.filter(|_| !is_certified(case)).map(f64::from)
}

/// [`unexplained_product`] of the result.
pub(super) fn unexplained(case: &Case<'_>) -> Option<f64> {
    Some(unexplained_product(&case.evidence.channels))
}

/// Distance of the result from the reference solution in lightness, the photo's being 1.
pub(super) fn distance(case: &Case<'_>) -> Option<f64> {
    Some(compared(case)?.by_lightness())
}

/// Distance of the result from the reference solution in colour; `None` for a grey photo.
pub(super) fn colour_distance(case: &Case<'_>) -> Option<f64> {
    compared(case)?.by_colour()
}

/// Fine colour over fine lightness; `None` where the reference solution is dotted, too.
pub(super) fn colour_dots(case: &Case<'_>) -> Option<f64> {
    let in_reference = case.reference.is_some_and(|reference| {
        let of = FineColour::of(reference, case.photo.observation.channels);
        of.over_lightness() > table::DOTTED
    });
    (!in_reference).then(|| case.evidence.fine_colour.over_lightness())
}

/// Grain of the result over what is allowed, where the reference solution is flat, or, before that
/// is solved, the photo.
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

fn compared<'a>(case: &Case<'a>) -> Option<Compared<'a>> {
    let Case { photo, solved, reference, .. } = *case;
    let (result, channels) = (&solved.picture, photo.observation.channels);
    Some(Compared { result, photo: &photo.photo, reference: reference?, channels })
}

/// Whether the result's photograph is the photo.
fn is_certified(case: &Case<'_>) -> bool {
    case.solved
        .solution
        .certificate
        .ratio()
        .is_some_and(|ratio| f64::from(ratio) <= table::CONFIRMED)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Luma's residual over the photo's for a right result: it leaves the noise, which is more than
    /// the photo leaves.
    fn residual_over_photo(photo_grain: f32, result_grain: f32, contrast: f32) -> Option<f64> {
        let luma = Residuals {
            model: 2.3,
            untouched: 2.1,
            photo_noise: 2.2,
            model_error: 0.1,
            light: 90.0,
            excess_light: 0.0,
            contrast,
        };
        let (grain, fine_colour) =
            (Grain { result: result_grain, photo: photo_grain }, FineColour::default());
        let residual = |grain, cleared| {
            Evidence { channels: vec![luma], grain, cleared, fine_colour }
                .luma_residual_over_photo()
        };
        // Where the photo is flat, or where the result is.
        let none = Grain::default();
        assert_eq!(residual(grain, none), residual(none, grain));
        residual(grain, none)
    }

    #[test]
    fn a_noisy_photo_gains_by_the_grain_removed_unless_it_is_nothing_but_noise() {
        assert_eq!(residual_over_photo(6.0, 1.0, 10.0), None, "a noisy sky");
        assert!(residual_over_photo(1.0, 0.3, 10.0).is_some(), "a calm photo has no grain");
        assert!(residual_over_photo(6.0, 4.0, 10.0).is_some(), "grain remains");
        assert!(residual_over_photo(6.0, 1.0, 2.2).is_some(), "nothing but noise");
    }
}
