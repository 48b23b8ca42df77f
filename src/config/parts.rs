//! The tables every rig has, simulated or not, as plain fields with their units in the names.

use serde::{Deserialize, Serialize};

use super::methods::MethodName;
use crate::frame::Size;

/// `[photo]`: the customer's photos.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Photo {
    /// Pixels in a row.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
    /// How the photo's codes stand for light when the file says nothing else.
    pub curve: Curve,
}

impl Photo {
    /// Width and height.
    pub fn size(&self) -> Size {
        Size::new(self.width_px, self.height_px)
    }
}

/// A photo file's grey-level curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Curve {
    /// IEC 61966-2-1.
    Srgb,
    /// Codes are proportional to light.
    Linear,
}

/// `[panel]`: the display.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Panel {
    /// Panel pixels in a row.
    pub width_px: usize,
    /// Panel rows.
    pub height_px: usize,
    /// Refreshes a second.
    pub refresh_hz: f64,
    /// Wait from the flip to the trigger: processing latency, scan-out and response time together.
    pub settle_ms: f64,
    /// From a flip to the first change anyone can see, at the least; `relens check` measures it.
    /// The next picture may be asked for this much before an exposure ends. Left out, every
    /// exposure ends first.
    pub latency_ms: Option<f64>,
}

impl Panel {
    /// Width and height.
    pub fn size(&self) -> Size {
        Size::new(self.width_px, self.height_px)
    }
}

/// `[camera]`: the sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Camera {
    /// Sensor pixels in a row.
    pub width_px: usize,
    /// Sensor rows.
    pub height_px: usize,
    /// Sensor column of the photo's first column.
    pub photo_x_px: usize,
    /// Sensor row of the photo's first row.
    pub photo_y_px: usize,
    /// Bits of a count: 8, 10, 12 or 16.
    pub bits: u8,
    /// Exposure time.
    pub exposure_ms: f64,
    /// A frame later than this after the trigger is missing.
    pub deadline_ms: f64,
    /// How often one picture is shot at the most before the rig gives up.
    pub exposures_max: u32,
}

impl Camera {
    /// Width and height.
    pub fn size(&self) -> Size {
        Size::new(self.width_px, self.height_px)
    }

    /// The largest count, 2^bits − 1.
    pub fn count_max(&self) -> u16 {
        ((1u32 << self.bits) - 1) as u16
    }
}

/// `[canvas]`: the grid the solver works on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Canvas {
    /// How far the canvas reaches beyond the photo on every side: light from outside falls into the
    /// photo.
    pub margin_px: usize,
}

/// `[marks]`: the strips at the sensor's upper and lower edge that carry the number of the picture
/// shown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Marks {
    /// From the sensor's edge to the strip, in sensor pixels.
    pub from_edge_px: usize,
    /// The strip's height in sensor pixels.
    pub height_px: usize,
}

/// `[calibration]`: how the rig is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Calibration {
    /// How panel and sensor are brought together.
    pub geometry: Geometry,
    /// Side of a checkerboard square on the panel.
    pub checker_square_px: usize,
    /// Columns of the lens model's grid of functions.
    pub function_columns: usize,
    /// Rows of the lens model's grid of functions.
    pub function_rows: usize,
    /// Width and height of a function, odd.
    pub function_support_px: usize,
    /// Pseudo-random patterns shown to measure the lens model.
    pub patterns: usize,
    /// Captures averaged for each pattern of the calibration.
    pub captures_averaged: usize,
    /// Whether light that is scattered wider than the functions reach is measured too.
    #[serde(default = "yes")]
    pub broad_term: bool,
}

const fn yes() -> bool {
    true
}

/// How panel and sensor are brought together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Geometry {
    /// Measured with a displayed checkerboard, per channel.
    Checkerboard,
    /// Panel pixel (i, j) is sensor pixel (i, j) by construction; nothing is resampled.
    OneToOne,
}

/// `[restore]`: how photos are restored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Restore {
    /// The method used when none is asked for.
    pub method: MethodName,
    /// Momentum steps of the solver.
    pub steps: usize,
    /// Shrinkage threshold in grey levels at one grey level of noise; it grows with the noise.
    pub shrinkage_at_one_grey_level: f32,
    /// Wavelet levels.
    pub levels: usize,
    /// Whether the shrinkage is averaged over shifts (cycle spinning).
    pub cycle_spun: bool,
    /// Whether the solver's prior sees the colours together.
    pub colours: Colours,
    /// Defect corrections a photo may cost at the most; the first of them reuses the certificate's
    /// capture.
    pub corrections_max: usize,
    /// Whether a photo's first capture may refine the measured lens for that photo; no when left
    /// out.
    #[serde(default)]
    pub refine_lens: bool,
    /// What `relens calibrate` is to choose method, steps and corrections by. Left out, they are as
    /// this file has them.
    pub operating_point: Option<OperatingPoint>,
}

/// What a setting is chosen by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OperatingPoint {
    /// The fastest within 0.01 SSIM of the best of those that take no longer than the rig file's
    /// own and lose no more than 1 dB to it.
    Fast,
    /// The fastest within 0.002 SSIM of the best of those that take no longer than the rig file's
    /// own and have no less PSNR.
    Balanced,
    /// The best, block matching among them, whatever it costs.
    Best,
}

impl OperatingPoint {
    /// The word in rig files.
    pub const fn name(self) -> &'static str {
        match self {
            OperatingPoint::Fast => "fast",
            OperatingPoint::Balanced => "balanced",
            OperatingPoint::Best => "best",
        }
    }
}

/// How the colours of a photo are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Colours {
    /// Together: the prior sees brightness and colour differences.
    Together,
    /// Each channel for itself.
    Apart,
}

/// `[paper]`: the paper's own parameters (§4).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Paper {
    /// Iterations.
    pub iterations: usize,
    /// Step τ of Eq. 7.
    pub tau: f32,
    /// Weight λ of the wavelet term.
    pub lambda: f32,
    /// Side of a flip–FC–flip patch.
    pub patch_px: usize,
    /// Guard margin around a patch.
    pub margin_px: usize,
}
