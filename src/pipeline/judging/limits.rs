//! Every limit by which results are judged, with its source, and the sentences for photos that are
//! returned as they are.
//!
//! A photo's data have limits of their own: [`prepare`](crate::pipeline::Pipeline::prepare) and the
//! [spectral check](crate::deconvolution::focus::check_spectrum) of noise and lens.
//!
//! "Set on the limits" means: on the laboratory's group of rigs and scenes for setting limits
//! (`tests/tables/judging.md`), which shares nothing with the group that rates are stated on.

/// Optical residual over its floor up to which a photograph is the photo. Guess: about what the
/// spread of a noise estimate explains.
pub(in crate::pipeline) const CONFIRMED: f64 = 1.25;
/// Optical residual over its floor up to which a photograph is nearly the photo. Set on the limits
/// (`truthful.toml`): sound results of own photos have 3.0 at most, the errors of a JPEG's coding
/// being more than noise.
pub(in crate::pipeline) const NEARLY_CONFIRMED: f64 = 3.0;
/// Noise above which agreement shows little, grey levels. Guess: three times that of a photo at a
/// sensor's highest useful gain.
pub(in crate::pipeline) const NOISY_GREY_LEVELS: f64 = 12.0;
/// Distance from the reference solution, the untouched photo's being 1. Healthy results of two rigs
/// of the limits have 1.07 at most; the margin above is a guess, made knowing that two harmful
/// results of the rates have 1.17 and 1.18.
pub(super) const DISTANCE: f64 = 1.15;
/// Difference of a result's light from the photo's, as a share of it. Set on the limits: sound
/// results have 2.7 % at most, harmful ones 5.8 % at least.
pub(super) const EXCESS_LIGHT: f64 = 0.04;
/// Luma's residual over the untouched photo's above which a result gains nothing. Set on the
/// limits: harmless results have 0.85 at most, harmful ones 1.25.
pub const NO_GAIN: f64 = 1.05;

/// Product of the residual over its floor and over the untouched photo's above which no scene gives
/// the photo, of the reference solution, and a result is suspect. Set on `small.toml` under the
/// laboratory's faults.
pub const FOREIGN: f64 = 0.72;
/// Residual over its floor from which a channel shows more than noise. Set as [`FOREIGN`].
pub(super) const MORE_THAN_NOISE: f32 = 1.6;
/// Least residual over the untouched photo's of a channel that counts for [`FOREIGN`]: a contrasty
/// photo solved with a coarse lens model has a smaller one, and gains.
pub(super) const FOREIGN_SHARE: f32 = 0.32;
/// Limits on the same product by place, in a foreign photo.
#[derive(Debug, Clone, Copy)]
pub(in crate::pipeline) struct OutlierLimits {
    /// Connected pixels above this are one place.
    pub(in crate::pipeline) of_any: f32,
    /// A place with a pixel above this is an outlier.
    pub(in crate::pipeline) of_clearest: f32,
}

/// Limits from strict to loose: those apply that first leave a photo which the lens explains. The
/// first are set on stamps of the limits. The others are for watermarks, set on those of the rates.
pub(in crate::pipeline) const OUTLIERS: [OutlierLimits; 3] = [
    OutlierLimits { of_any: 2.0, of_clearest: 4.0 },
    OutlierLimits { of_any: 2.0, of_clearest: 2.0 },
    OutlierLimits { of_any: 1.4, of_clearest: 1.4 },
];
/// Share of a photo, and of its informative pixels, above which outliers make it foreign. A
/// watermark over a fifth is still one of a photo of this lens.
pub(in crate::pipeline) const OUTLIERS_MOST: f64 = 1.0 / 3.0;
/// Residual of the untouched photo over its noise from which pixels are informative. Guess.
pub(in crate::pipeline) const INFORMATIVE: f32 = 2.0;
/// Steps of the short reference solution, of one channel, that is tried first. Guess.
pub(super) const SHORT_STEPS: u32 = 12;
/// The product above which the short solution suffices to call a photo foreign. Of 165
/// results of both groups it leaves 1.0 at most of those that the whole solution explains, and more
/// than this of four of six foreign ones.
pub(super) const CLEARLY_FOREIGN: f64 = 2.0 * FOREIGN;

/// Mean slope of lightness, codes a pixel, up to which a pixel is flat. Set on the limits.
pub(super) const FLAT: f32 = 2.0;
/// Grain that is seen, and in a photo worth removing, codes. Set on the limits: ordinary photos
/// have 1.8 at most, those with 8 grey levels of noise 2.6 at least.
pub(super) const GRAIN_SEEN: f32 = 2.5;
/// Grain over that of the other picture above which it is more than that. Set on the limits.
pub(super) const GRAIN_TIMES: f32 = 2.0;
/// Grain over that which is seen and that of the photo, above which a result harms. Set on the
/// limits: sound results have 0.96 at most, harmful ones that nothing else names 1.30.
pub(super) const GRAIN: f64 = 1.1;

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

// Why photos are returned as they are.

pub(in crate::pipeline) const NOTHING_BUT_NOISE: &str = "from pixel to pixel the photo changes as \
    much as anywhere, which no lens lets through; it is dithered, screened as in print, or hardly \
    anything but noise";
pub(in crate::pipeline) const ANOTHER_SENSOR: &str = "the photo does not show the pattern of this \
    camera's pixels: another camera took it, or it was resized or cut since; with \
    response-flats = 0 in the rig file and a new calibration, such photos are restored";
pub(in crate::pipeline) const NOT_CONFIRMED: &str = "photographed through the lens again, its \
    restoration differs from it, and the photo does not show the pattern of this camera's pixels: \
    another camera may have taken it, or it is too small or too strongly compressed to tell";
pub(in crate::pipeline) const UNPLACED: &str = "the photo is a part of what this rig's camera \
    takes, and does not show the pattern of its pixels clearly enough to tell which part; drop the \
    photo as the camera took it";
pub(in crate::pipeline) const SHARPER: &str = "the photo is far sharper than the measured lens \
    makes any, as a lens stopped down or another one does, and a restoration would overshoot; \
    calibrate at the aperture that you photograph with";
/// Neither method nor reference solution explains more.
pub(super) const NOTHING_GAINED: &str = "what the lens did to this photo cannot be told from the \
    photo's noise; any restoration would be made of that noise";
