//! Evidence about a result by itself: residuals, grain and fine colours.

use super::fine_colour::FineColour;
use super::grain::Grain;
use super::limits::{EXCESS_LIGHT, FOREIGN_SHARE, MORE_THAN_NOISE};
use crate::deconvolution::data_term::NOISE_MIN;

/// Evidence about a result by itself, without a reference solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Residuals, channel by channel.
    pub channels: Vec<Residuals>,
    /// Grain where the result is flat.
    pub grain: Grain,
    /// Finest colours of the result.
    pub fine_colour: FineColour,
}

impl Evidence {
    /// Difference of the result's light from the photo's, as a share of the photo's (at least one
    /// grey level), over all channels: a lens spreads light and creates none.
    pub fn excess_light(&self) -> f32 {
        let sum = |of: fn(&Residuals) -> f32| self.channels.iter().map(of).sum::<f32>();
        (sum(|of| of.excess_light) / sum(|of| of.light).max(1.0)).abs()
    }

    /// Luma's model residual over the untouched photo's; `None` if the result removed grain from a
    /// noisy photo, which is a gain in itself if the photo holds more than noise.
    pub fn luma_residual_over_photo(&self) -> Option<f64> {
        // Green, or the one channel of a grey photo.
        let luma = self.channels.get(self.channels.len() / 2)?;
        let is_denoised = self.grain.is_cleared()
            && luma.model < luma.contrast
            && f64::from(self.excess_light()) <= EXCESS_LIGHT;
        (!is_denoised).then(|| luma.over_untouched().into())
    }
}

/// Residuals of one channel, RMS over the photo in grey levels, without saturated pixels and those
/// to which the lens brings light from saturated ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residuals {
    /// Model residual, K̂L − B.
    pub model: f32,
    /// Residual of the untouched photo, K̂B − B.
    pub untouched: f32,
    /// Noise of the photo.
    pub photo_noise: f32,
    /// Error of the lens model on the held-out chart, scaled to the photo's contrast.
    pub model_error: f32,
    /// Mean of B.
    pub light: f32,
    /// Mean of K̂L − B.
    pub excess_light: f32,
    /// RMS of B about its mean.
    pub contrast: f32,
}

impl Residuals {
    /// The model residual over its floor: what noise and the lens model's known error would leave.
    pub fn over_floor(&self) -> f32 {
        self.model / self.photo_noise.hypot(self.model_error).max(NOISE_MIN)
    }

    /// The model residual over the untouched photo's.
    pub fn over_untouched(&self) -> f32 {
        self.model / self.untouched.max(f32::MIN_POSITIVE)
    }

    /// The model residual over its floor times that over the untouched photo's.
    ///
    /// Either factor alone proves little: in a busy photo an imperfect model leaves a little more
    /// than noise, and in a calm one noise is a large part of the untouched residual.
    pub(in crate::pipeline) fn product(&self) -> f32 {
        self.over_floor() * self.over_untouched()
    }
}

/// The channel with the largest [`Residuals::product`] of those where both factors exceed their
/// minimum. NaN exceeds it.
pub(super) fn worst_unexplained(channels: &[Residuals]) -> Option<&Residuals> {
    let counts = |of: &&Residuals| {
        !(of.over_floor() <= MORE_THAN_NOISE || of.over_untouched() <= FOREIGN_SHARE)
    };
    channels.iter().filter(counts).max_by(|a, b| a.product().total_cmp(&b.product()))
}

/// [`Residuals::product`] of the channel that is explained worst; 0 if no channel counts.
pub fn unexplained_product(channels: &[Residuals]) -> f64 {
    worst_unexplained(channels).map_or(0.0, |of| of.product().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Luma's residual over the photo's for a correct result, whose residual is the noise and hence
    /// larger than that of the untouched photo.
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
        Evidence { channels: vec![luma], grain, fine_colour }.luma_residual_over_photo()
    }

    #[test]
    fn the_light_of_a_black_photo_has_no_share() {
        let dark = Residuals {
            model: 0.1,
            untouched: 0.1,
            photo_noise: 0.3,
            model_error: 0.1,
            light: 0.0,
            excess_light: 0.02,
            contrast: 0.0,
        };
        let (grain, fine_colour) = (Grain::default(), FineColour::default());
        let of = Evidence { channels: vec![dark], grain, fine_colour };
        assert!(f64::from(of.excess_light()) <= EXCESS_LIGHT, "{}", of.excess_light());
    }

    #[test]
    fn a_noisy_photo_gains_by_the_grain_removed_unless_it_is_nothing_but_noise() {
        assert_eq!(residual_over_photo(6.0, 1.0, 10.0), None, "a noisy sky");
        assert!(residual_over_photo(1.0, 0.3, 10.0).is_some(), "a calm photo has no grain");
        assert!(residual_over_photo(6.0, 4.0, 10.0).is_some(), "grain remains");
        assert!(residual_over_photo(6.0, 1.0, 2.2).is_some(), "nothing but noise");
    }
}
