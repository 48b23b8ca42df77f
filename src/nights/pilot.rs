//! The pilot: one known picture whose captures measure the drift of the rig.
//!
//! The lens model predicts the capture. Each channel of the capture is fitted to its prediction
//! with shift, gain and added light ([`Registration::fit_with_offset`]); the difference of two
//! captures gives their noise. Drift is the change of these figures since the fit that was made
//! right after the calibration.

use serde::{Deserialize, Serialize};

use crate::deconvolution::data_term::TRUSTED;
use crate::deconvolution::forward_convolution::{ForwardConvolution, Seen};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::registration::{Comparison, Registration, common_mask};
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};
use crate::light_path::LightPath;
use crate::remedy::AnyFailure;

/// Side of the pilot's squares, Work pixels: much wider than the blur, so that their middles give
/// the brightness and their edges the position.
const SQUARE_PX: usize = 16;

/// Range of the pilot's light, grey levels: away from black and white, where captures clip.
const LIGHTS: (f32, f32) = (40.0, 200.0);

/// Fit of one channel of a pilot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct PilotFit {
    /// Brightness relative to the prediction.
    pub gain: f64,
    /// Added light, grey levels.
    pub offset_levels: f64,
    /// Displacement to the right, sensor pixels.
    pub shift_x_px: f64,
    /// Displacement downwards, sensor pixels.
    pub shift_y_px: f64,
    /// Noise of one capture, grey levels RMS.
    pub noise_levels: f64,
}

/// Fits of a pilot, by channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PilotReading(pub [PilotFit; 3]);

/// Change of the rig since its calibration. Each value is that of its worst channel.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Drift {
    /// Displacement, sensor pixels.
    pub shift_px: f64,
    /// Change of brightness, per cent.
    pub gain_percent: f64,
    /// Change of added light, grey levels.
    pub offset_levels: f64,
    /// Noise relative to that at calibration.
    pub noise_ratio: f64,
}

/// Limits of drift. A displacement of 0.25 px costs 1 % of the gain in dB, 0.5 px 5 % and 1 px a
/// quarter: captures are registered, but the panel's pixels are taken to be where the calibration
/// saw them (`small.toml`, 2 photos, November 2026). The other limits are guesses; the panel's
/// noise and a camera's gain vary by less.
pub const LIMITS: Drift =
    Drift { shift_px: 0.25, gain_percent: 3.0, offset_levels: 1.0, noise_ratio: 1.5 };

impl PilotReading {
    /// Drift since `before`.
    pub fn since(&self, before: &PilotReading) -> Drift {
        let worst = |of: &dyn Fn(&PilotFit, &PilotFit) -> f64| {
            let each = self.0.iter().zip(&before.0).map(|(now, then)| of(now, then));
            each.fold(0.0, |worst: f64, v| if v.abs() > worst.abs() { v } else { worst })
        };
        Drift {
            shift_px: worst(&|now, then| {
                (now.shift_x_px - then.shift_x_px).hypot(now.shift_y_px - then.shift_y_px)
            }),
            gain_percent: worst(&|now, then| 100.0 * (now.gain / then.gain.max(1e-9) - 1.0)),
            offset_levels: worst(&|now, then| now.offset_levels - then.offset_levels),
            noise_ratio: worst(&|now, then| now.noise_levels / then.noise_levels.max(1e-9)),
        }
    }
}

impl Drift {
    /// Describes the drifts past [`LIMITS`]; `None` without any.
    pub fn complaint(&self) -> Option<String> {
        let Drift { shift_px, gain_percent, offset_levels, noise_ratio } = *self;
        let rows = [
            (shift_px, LIMITS.shift_px, format!("displaced by {shift_px:.2} px")),
            (
                gain_percent,
                LIMITS.gain_percent,
                format!("brightness changed by {gain_percent:+.1} %"),
            ),
            (
                offset_levels,
                LIMITS.offset_levels,
                format!("stray light changed by {offset_levels:+.1} grey levels"),
            ),
            (
                noise_ratio,
                LIMITS.noise_ratio,
                format!("noise {noise_ratio:.1} times that at calibration"),
            ),
        ];
        // NaN is past every limit.
        let past =
            rows.into_iter().filter(|(found, most, _)| found.is_nan() || found.abs() > *most);
        let complaints: Vec<String> =
            past.map(|(_, most, words)| format!("{words}, allowed {most}")).collect();
        (!complaints.is_empty()).then(|| complaints.join("; "))
    }

    /// Largest difference from `other`, as a share of the value's limit in [`LIMITS`].
    pub fn difference(&self, other: &Drift) -> f64 {
        [
            (self.shift_px - other.shift_px) / LIMITS.shift_px,
            (self.gain_percent - other.gain_percent) / LIMITS.gain_percent,
            (self.offset_levels - other.offset_levels) / LIMITS.offset_levels,
            (self.noise_ratio - other.noise_ratio) / LIMITS.noise_ratio,
        ]
        .into_iter()
        .fold(0.0, |largest, v| largest.max(v.abs()))
    }
}

/// The pilot for a canvas of `size`: pseudorandom squares, always the same.
pub fn picture(size: Size) -> Frame<Work> {
    Frame::from_fn(|c| {
        Plane::from_fn(size, |x, y| {
            // A multiplicative hash (Knuth) of the square's position; its top bits are well mixed.
            let square =
                (x / SQUARE_PX) as u32 + 251 * (y / SQUARE_PX) as u32 + 65_521 * c.index() as u32;
            let mixed =
                (square.wrapping_mul(2_654_435_761) ^ (square << 7)).wrapping_mul(2_246_822_519);
            let share = (mixed >> 24) as f32 / 255.0;
            LIGHTS.0 + share * (LIGHTS.1 - LIGHTS.0)
        })
    })
}

/// Shows the pilot twice and compares the captures with the prediction over `photo`, the photo's
/// part of the canvas.
pub fn read(
    path: &mut LightPath<'_>,
    model: &LensModel,
    photo: Rect,
) -> Result<PilotReading, AnyFailure> {
    let shown = picture(path.size());
    let captures = [path.forward(&shown)?, path.forward(&shown)?];
    let predicted = model.seen(&Channel::ALL, &shown);
    Ok(fit(&predicted, &captures, photo))
}

/// Fits the mean of two captures to its prediction, channel by channel.
fn fit(predicted: &Frame<Work>, captures: &[Seen; 2], photo: Rect) -> PilotReading {
    let [first, second] = captures;
    let mask = common_mask(&first.trusted, &second.trusted);
    let mean = Frame::from_fn(|c| {
        let mut sum = first.light.plane(c).clone();
        sum.add_scaled(1.0, second.light.plane(c));
        sum.scale(0.5);
        sum
    });
    PilotReading(Channel::ALL.map(|c| {
        let channels = &[c];
        let comparison = Comparison { seen: &mean, predicted, mask: &mask, area: photo, channels };
        let (Registration { shift_px, gain }, offset_levels) =
            Registration::fit_with_offset(&comparison);
        let (shift_x_px, shift_y_px) = shift_px;
        let noise_levels = capture_noise(captures, mask.plane(c), c, photo);
        PilotFit { gain, offset_levels, shift_x_px, shift_y_px, noise_levels }
    }))
}

/// Noise of one capture, from the difference of two where `mask` is set.
fn capture_noise(captures: &[Seen; 2], mask: &Plane<u8>, channel: Channel, photo: Rect) -> f64 {
    let (mut squared, mut count) = (0.0f64, 0.0f64);
    for y in photo.rows() {
        for x in photo.columns() {
            if mask.at(x, y) == TRUSTED {
                let [a, b] = captures.each_ref().map(|seen| seen.light.plane(channel).at(x, y));
                squared += f64::from(a - b).powi(2);
                count += 1.0;
            }
        }
    }
    (squared / count.max(1.0) / 2.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size::new(96, 80);

    /// A smooth picture, and a capture of it that is displaced, brighter and rippled.
    fn seen(dx: f64, dy: f64, gain: f64, offset: f64, ripple: f32) -> (Frame<Work>, Seen) {
        let light = |x: f64, y: f64| 100.0 + 50.0 * (x / 5.0).sin() * (y / 7.0).cos();
        let predicted = Plane::from_fn(SIZE, |x, y| light(x as f64, y as f64) as f32);
        let plane = Plane::from_fn(SIZE, |x, y| {
            let sign = if (x + y) % 2 == 0 { ripple } else { -ripple };
            (gain * light(x as f64 - dx, y as f64 - dy) + offset) as f32 + sign
        });
        let trusted = Frame::filled(SIZE, 1u8);
        let light = Frame::from_fn(|_| plane.clone());
        (Frame::from_fn(|_| predicted.clone()), Seen { light, trusted })
    }

    #[test]
    fn a_known_drift_is_measured() {
        let (predicted, once) = seen(0.2, -0.1, 1.04, 2.0, 0.5);
        let (_, twice) = seen(0.2, -0.1, 1.04, 2.0, -0.5);
        let photo = Rect { x: 0, y: 0, size: SIZE };
        let fit = fit(&predicted, &[once, twice], photo).0[Channel::Green.index()];
        assert!(
            (fit.gain - 1.04).abs() < 0.002 && (fit.offset_levels - 2.0).abs() < 0.2,
            "{fit:?}"
        );
        assert!(
            (fit.shift_x_px - 0.2).abs() < 0.005 && (fit.shift_y_px + 0.1).abs() < 0.005,
            "{fit:?}"
        );
        // The captures differ by 1 everywhere, as two captures with a noise of √½ do.
        assert!((fit.noise_levels - 0.5f64.sqrt()).abs() < 1e-3, "{fit:?}");
    }

    #[test]
    fn drifts_past_their_limits_are_described_with_the_limits() {
        let fine =
            Drift { shift_px: 0.1, gain_percent: -2.0, offset_levels: 0.5, noise_ratio: 1.1 };
        assert_eq!(fine.complaint(), None);
        let darker = Drift { gain_percent: -4.2, ..fine };
        assert_eq!(darker.complaint().unwrap(), "brightness changed by -4.2 %, allowed 3");
        assert!(Drift { shift_px: f64::NAN, ..fine }.complaint().is_some());
    }

    #[test]
    fn the_pilot_is_coloured_and_not_near_black_or_white() {
        let pilot = picture(SIZE);
        for c in Channel::ALL {
            assert!(pilot.plane(c).data().iter().all(|v| (LIGHTS.0..=LIGHTS.1).contains(v)));
        }
        assert!(pilot.plane(Channel::Red) != pilot.plane(Channel::Blue));
    }
}
