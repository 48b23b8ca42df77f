//! What one step of a photo's way hands to the next: [`Prepared`], [`Solved`], [`Evidence`].

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use super::fine_colour::FineColour;
use super::grain::Grain;
use crate::calibration::SiteNorms;
use crate::deconvolution::data_term::NOISE_MIN;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::method::{About, Solution};
use crate::deconvolution::observation::Observation;
use crate::frame::{Frame, Work};

/// Noises that a residual is seen to be more than. Guess.
const FEW_NOISES: f32 = 2.0;

/// A result gains nothing that leaves more than this share of what the photo leaves unexplained
/// itself. On the group of limits no harmless result without a fault leaves more than 0.85, and
/// harmful ones that nothing else tells leave 1.25.
const NO_GAIN: f32 = 1.05;
/// A result that leaves this share of the photo's contrast found nothing but noise in it. Guess.
const ALL_NOISE: f32 = 0.95;
/// By what share a result's light may differ from the photo's: captures of a panel that dims lead
/// it astray. On the laboratory's group of limits sound results are off by 2.7 % at the most,
/// harmful ones by 5.8 % at the least (`tests/tables/judging.md`).
pub(super) const EXCESS_LIGHT: f32 = 0.04;

/// A photo made ready for the methods.
#[derive(Clone)]
pub struct Prepared<'a> {
    /// The photo, photo-sized, linear light 0..255; of raw sites divided by the sensor's gain
    /// pattern.
    pub photo: Cow<'a, Frame<Work>>,
    /// Its data on the canvas.
    pub observation: Observation,
    /// The focus at which it was taken, where that is another than the panel's.
    pub focus: Option<PhotoFocus>,
    /// Whether its spectrum shows a lens much sharper than the measured one; of raw photos.
    pub is_of_sharper_lens: bool,
    /// Notes for the report.
    pub notes: Vec<String>,
    /// The verdict of the measured lens alone, computed when first needed.
    pub(super) lens_alone: OnceLock<LensAlone>,
    /// RMS of K̂B − B by the measured lens, likewise.
    pub(super) untouched: OnceLock<[f32; 3]>,
}

/// The focus at which a photo was taken, where that is another than the panel's.
#[derive(Clone)]
pub struct PhotoFocus {
    /// 1/distance of the scene − 1/distance of the panel, dioptres; positive is nearer.
    pub offset: f32,
    /// Whether it is as near or far as the lens was measured: the photo may lie beyond.
    pub at_end: bool,
    /// The lens there.
    pub(super) model: Arc<LensModel>,
    pub(super) norm_squared: [f32; 3],
    pub(super) level_norms: [LevelNorms; 3],
    pub(super) at_sites: OnceLock<SiteNorms>,
}

impl PhotoFocus {
    /// What it means for the picture, for one who drops photos and picks results up.
    pub fn told(&self) -> String {
        let side = if self.offset > 0.0 { "nearer" } else { "farther" };
        let distance = match self.offset.abs() < 0.005 {
            true => "as far as the panel".to_owned(),
            false => format!("{side} than the panel by {:.2} dioptres (1/m)", self.offset.abs()),
        };
        let beyond = match self.at_end {
            true => ", the most that the lens was measured for; it may be more",
            false => "",
        };
        format!(
            "the scene was {distance}{beyond}: it was restored with the lens as measured for that \
             focus, and its photograph was computed for that focus"
        )
    }
}

impl Prepared<'_> {
    /// The same photo as if it had been taken at the panel's focus.
    pub(super) fn at_panel(&self) -> Self {
        let (lens_alone, untouched) = (OnceLock::new(), OnceLock::new());
        Prepared { focus: None, lens_alone, untouched, ..self.clone() }
    }
}

/// What a method makes of a photo, not yet judged.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The picture, photo-sized, linear light 0..255.
    pub picture: Frame<Work>,
    /// What the method returned, on its canvas.
    pub solution: Solution,
    /// The method.
    pub about: &'static About,
    /// Captures this photo cost.
    pub captures: usize,
    /// Seconds of those captures on the rig's clock.
    pub capture_seconds: f64,
    /// Seconds on the stopwatch spent waiting for captures (and, on a simulated rig, computing
    /// them).
    pub waited_seconds: f64,
    /// The lens by which the result is judged: as measured, or as the photo's captures say it is.
    pub lens: Arc<LensModel>,
}

/// What is known of one channel of a result; residuals are RMS over the photo in grey levels,
/// saturated pixels and as far as the lens throws their light left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residuals {
    /// K̂L − B.
    pub model: f32,
    /// K̂B − B: of the untouched photo.
    pub untouched: f32,
    /// The photo's noise.
    pub photo_noise: f32,
    /// What the lens model missed of the chart, of as much contrast as the photo has.
    pub model_error: f32,
    /// Mean of B, grey levels; saturated pixels left out as above.
    pub light: f32,
    /// Mean of K̂L − B there.
    pub excess_light: f32,
    /// RMS of B about its mean there.
    pub contrast: f32,
}

impl Residuals {
    /// What noise and the lens model's known error leave of a right result.
    fn floor(&self) -> f32 {
        self.photo_noise.hypot(self.model_error).max(NOISE_MIN)
    }
}

/// What is known of a result by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Channel by channel.
    pub channels: Vec<Residuals>,
    /// Where the photo is flat.
    pub grain: Grain,
    /// Where the result is flat: a very noisy photo is nowhere.
    pub cleared: Grain,
    /// The result's.
    pub fine_colour: FineColour,
}

impl Evidence {
    /// How far the result's light is from the photo's, as a share of it, all channels together: a
    /// lens spreads light and makes none.
    pub fn excess_light(&self) -> f32 {
        let sum = |of: fn(&Residuals) -> f32| self.channels.iter().map(of).sum::<f32>();
        (sum(|of| of.excess_light) / sum(|of| of.light).max(f32::MIN_POSITIVE)).abs()
    }

    /// Whether the result explains some channel of the photo less than the photo does itself, by
    /// more than noise.
    pub(super) fn explains_less(&self) -> bool {
        self.channels.iter().any(|of| of.model > of.untouched && of.model > FEW_NOISES * of.floor())
    }

    /// Whether the result explains the luma of the photo less than the photo does itself: what the
    /// lens did is less than the noise, and what a method made of it is noise.
    pub(super) fn gains_nothing(&self) -> bool {
        // Green, or the one channel of a grey photo.
        let luma = self.channels.get(self.channels.len() / 2);
        luma.is_some_and(|of| {
            // A noisy photo is better for the noise that is taken out, if there is more in it.
            let is_cleared = self.grain.is_cleared() || self.cleared.is_cleared();
            let is_cleared = is_cleared
                && of.model <= ALL_NOISE * of.contrast
                && self.excess_light() <= EXCESS_LIGHT;
            of.model > NO_GAIN * of.untouched && !is_cleared
        })
    }

    /// The model residual over its floor, and over the untouched photo's; of the channel
    /// where their product is largest among those with more than `noises` of the first and more
    /// than `share` of the second. Zeros when there is none.
    ///
    /// Either alone tells little: a little more than noise is left of a busy photo by any model
    /// that is not perfect, and of a calm one noise itself is a good part of all there is. Both
    /// together are what no scene explains.
    pub fn unexplained(&self, noises: f32, share: f32) -> (f32, f32) {
        unexplained(&self.channels, noises, share)
    }
}

/// The model residual of a channel over its floor, times the same over the untouched photo's.
pub(super) fn product(of: &Residuals) -> f32 {
    of.model / of.floor() * of.model / of.untouched.max(f32::MIN_POSITIVE)
}

/// [`Evidence::unexplained`] of these channels.
pub(super) fn unexplained(channels: &[Residuals], noises: f32, share: f32) -> (f32, f32) {
    let each = channels
        .iter()
        .map(|r| (r.model / r.floor(), r.model / r.untouched.max(f32::MIN_POSITIVE)));
    // Not a number is past every limit.
    let much = each.filter(|of| !(of.0 <= noises || of.1 <= share));
    much.max_by(|a, b| (a.0 * a.1).total_cmp(&(b.0 * b.1))).unwrap_or_default()
}

/// What the lens alone says of a photo.
#[derive(Clone)]
pub(super) enum LensAlone {
    /// No scene gives it: what is left in the channels that tell.
    Foreign(Vec<Residuals>),
    /// Some scene may.
    Fitting(Box<Reference>),
}

/// What a result is judged by.
#[derive(Clone)]
pub(super) struct Reference {
    pub(super) solved: Solved,
    pub(super) evidence: Evidence,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_noisy_photo_gains_by_the_grain_that_is_taken_out_unless_it_is_nothing_but_noise() {
        // A right result leaves the noise, which is more than the photo leaves itself.
        let gains_nothing = |photo: f32, result: f32, contrast: f32| {
            let luma = Residuals {
                model: 2.3,
                untouched: 2.1,
                photo_noise: 2.2,
                model_error: 0.1,
                light: 90.0,
                excess_light: 0.0,
                contrast,
            };
            let (grain, fine_colour) = (Grain { result, photo }, FineColour::default());
            let nowhere = Grain::default();
            let of = |grain, cleared| {
                Evidence { channels: vec![luma], grain, cleared, fine_colour }.gains_nothing()
            };
            // Where the photo is flat, or where the result is.
            assert_eq!(of(grain, nowhere), of(nowhere, grain));
            of(grain, nowhere)
        };
        assert!(!gains_nothing(6.0, 1.0, 10.0), "a noisy sky");
        assert!(gains_nothing(1.0, 0.3, 10.0), "of a calm photo there is no grain to take out");
        assert!(gains_nothing(6.0, 4.0, 10.0), "and here it was not");
        assert!(gains_nothing(6.0, 1.0, 2.4), "noise alone");
    }
}
