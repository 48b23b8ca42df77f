//! The table by which results are judged: the witnesses against a result, the reasons to return a
//! photo as it is, and the limits of both.
//!
//! A photo's data have limits of their own: [`prepare`](crate::pipeline::Pipeline::prepare) and the
//! [spectral check](crate::deconvolution::focus::check_spectrum) of noise and lens.
//!
//! "Set on the limits" means: on the laboratory's group of rigs and scenes for setting limits
//! (`tests/tables/judging.md`), which shares nothing with the group that rates are stated on.

use super::measures::{self, Case};

/// Optical residual over its floor up to which a photograph is the photo. Guess: about what the
/// spread of a noise estimate explains.
pub(in crate::pipeline) const CONFIRMED: f64 = 1.25;
/// Optical residual over its floor up to which a photograph is nearly the photo. Guess: three parts
/// of unexplained power to one of noise.
pub(in crate::pipeline) const NEARLY_CONFIRMED: f64 = 2.0;
/// Noise above which agreement shows little, grey levels. Guess: three times that of a photo at a
/// sensor's highest useful gain.
pub(in crate::pipeline) const NOISY_GREY_LEVELS: f64 = 12.0;
/// Distance from the reference solution, the untouched photo's being 1. Set on the limits:
/// healthy results have 1.07 at most, harmful ones that no other witness sees 1.26.
const DISTANCE: f64 = 1.15;
/// Difference of a result's light from the photo's, as a share of it. Set on the limits: sound
/// results have 2.7 % at most, harmful ones 5.8 % at least.
pub(super) const EXCESS_LIGHT: f64 = 0.04;
/// Luma's residual over the untouched photo's above which a result gains nothing. Set on the limits:
/// harmless results have 0.85 at most, harmful ones 1.25.
pub(super) const NO_GAIN: f64 = 1.05;

/// Product of the residual over its floor and over the untouched photo's above which no scene gives
/// the photo, of the reference solution, and a result is suspect. Set on `small.toml` under the
/// laboratory's faults.
pub(super) const FOREIGN: f64 = 0.72;
/// Residual over its floor from which a channel shows more than noise. Set as [`FOREIGN`].
pub(super) const MORE_THAN_NOISE: f32 = 1.6;
/// Least residual over the untouched photo's of a channel that counts for [`FOREIGN`]: a contrasty
/// photo solved with a coarse lens model has a smaller one, and gains.
pub(super) const FOREIGN_SHARE: f32 = 0.32;
/// Steps of the short reference solution, of one channel, that is tried first. Guess.
pub(super) const SHORT_STEPS: u32 = 12;
/// The product above which the short solution suffices to call a photo foreign. On both groups it
/// leaves 0.7 at most of photos that the whole solution explains, and more than this of four of six
/// foreign ones.
pub(super) const CLEARLY_FOREIGN: f64 = 2.0 * FOREIGN;

/// Mean slope of lightness, codes a pixel, up to which a pixel is flat. Set on the limits.
pub(super) const FLAT: f32 = 2.0;
/// Grain that is seen, and in a photo worth removing, codes. Set on the limits: ordinary photos have
/// 1.8 at most, those with 8 grey levels of noise 2.6 at least.
pub(super) const GRAIN_SEEN: f32 = 2.5;
/// Grain over that of the other picture above which it is more than that. Set on the limits.
pub(super) const GRAIN_TIMES: f32 = 2.0;

/// Fine colour that is seen, units of CIE L\*a\*b\*. Set on the limits.
pub(super) const FINE_COLOUR_SEEN: f64 = 1.5;
/// Fine colour over fine lightness above which colours are dotted. Set on the limits: healthy
/// results have 2.4 at most, harmful ones 3.0 to 6.5.
pub(super) const DOTTED: f64 = 2.7;

/// Share of pixels below which valid ones, or flat ones, say nothing. Guess.
pub(super) const DATA_SHARE_MIN: f64 = 0.05;
/// Error of a camera's interpolation between its filters, over that of means of the nearest sites.
/// Guess: by directions and by the other colours, cameras do twice as well.
pub(super) const FILLED_IN: f32 = 0.5;

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
pub struct Witness {
    /// Name in the laboratory's tables.
    pub name: &'static str,
    /// Unit of the measure.
    pub unit: Unit,
    /// The measure; `None` where it does not apply.
    pub(super) measure: fn(&Case<'_>) -> Option<f64>,
    /// Above this the reference solution is solved.
    pub suspect_above: Option<f64>,
    /// Above this the result is replaced.
    pub harm_above: Option<f64>,
    /// Sentence for the user; `{found}` and `{allowed}` stand for numbers in the unit.
    pub(super) sentence: &'static str,
}

/// The witnesses, in the order in which harm is stated.
pub const WITNESSES: [Witness; 8] = [
    Witness {
        name: "light",
        unit: Unit::Share,
        measure: measures::excess_light,
        suspect_above: Some(EXCESS_LIGHT),
        harm_above: Some(EXCESS_LIGHT),
        sentence: "the brightness of the result differed from the photo's by {found} (allowed \
                   {allowed}), as after captures of a panel that is darker or brighter than when \
                   it was measured",
    },
    Witness {
        name: "no gain",
        unit: Unit::Times,
        measure: measures::luma_residual_over_photo,
        suspect_above: Some(NO_GAIN),
        harm_above: Some(NO_GAIN),
        sentence: "noise hides what the lens did to the photo, and the result explained the photo \
                   less than the photo itself does",
    },
    Witness {
        name: "explains less",
        unit: Unit::Times,
        measure: measures::residual_over_photo,
        suspect_above: None,
        harm_above: Some(1.0),
        sentence: "the result explained the photo less than the photo itself does",
    },
    Witness {
        name: "unexplained",
        unit: Unit::Times,
        measure: measures::unexplained,
        suspect_above: Some(FOREIGN),
        harm_above: None,
        sentence: "",
    },
    Witness {
        name: "distance",
        unit: Unit::Share,
        measure: measures::distance,
        suspect_above: None,
        harm_above: Some(DISTANCE),
        sentence: "the result was too far from what the measured lens alone makes of the photo \
                   ({found} as far as the photo itself, allowed {allowed})",
    },
    Witness {
        name: "colour distance",
        unit: Unit::Share,
        measure: measures::colour_distance,
        suspect_above: None,
        harm_above: Some(DISTANCE),
        sentence: "the result was too far in colour from what the measured lens alone makes of \
                   the photo ({found} as far as the photo itself, allowed {allowed})",
    },
    Witness {
        name: "dots of colour",
        unit: Unit::Times,
        measure: measures::colour_dots,
        suspect_above: Some(DOTTED),
        harm_above: Some(DOTTED),
        sentence: "the colours of the result alternated from pixel to pixel where its lightness \
                   did not, as of a photo out of focus",
    },
    Witness {
        name: "grain",
        unit: Unit::Times,
        measure: measures::grain,
        suspect_above: Some(1.0),
        harm_above: Some(1.0),
        sentence: "the flat parts of the result were grainier than the photo's ({found} what is \
                   allowed)",
    },
];

/// The sentence on a photo of nothing but noise.
pub(in crate::pipeline) const NOTHING_BUT_NOISE: &str = "from pixel to pixel the photo changes as much as anywhere, which no lens lets through; it is \
     dithered, screened as in print, or hardly anything but noise";
/// The sentence on a photo of a sharper lens.
pub(in crate::pipeline) const SHARPER: &str = "the photo is far sharper than the measured lens makes any, as a lens stopped down or another \
     one does, and a restoration would overshoot; calibrate at the aperture that you photograph \
     with";
/// The sentence on a photo of which neither method nor reference solution explains more.
pub(super) const NOTHING_GAINED: &str = "what the lens did to this photo cannot be told from the photo's noise; any restoration would \
     be made of that noise";
