//! The tables every rig has, simulated or not, as plain fields with their units in the names.

use super::keys::{table, words};
use super::methods::MethodName;
use super::simulation::is_default;
use crate::frame::Size;

table! {
    /// The customer's photos.
    pub struct PhotoTable {
        /// Pixels in a row.
        // The upper limit is a guess at the largest panel and sensor one will meet.
        width_px: usize, Whole(16, 16384), Never;
        /// Rows.
        height_px: usize, Whole(16, 16384), Never;
        /// How the photo's codes stand for light when the file says nothing else.
        curve: Curve, Word(Curve::WORDS), Never;
        /// What is made of raw photos.
        raw_results: RawResults, Word(RawResults::WORDS), Means("\"tiff\"");
    }
}

words! {
    /// The format of a raw photo's result.
    pub enum RawResults {
        /// 16 bits with the photo's curve; a linear one has a profile that says so.
        Tiff = "tiff",
        /// 8 bits.
        Jpeg = "jpeg",
    }
}

words! {
    /// A photo file's grey-level curve.
    pub enum Curve {
        /// IEC 61966-2-1.
        Srgb = "srgb",
        /// Codes are proportional to light.
        Linear = "linear",
    }
}

table! {
    /// The display.
    pub struct PanelTable {
        /// Panel pixels in a row.
        width_px: usize, Whole(16, 16384), Never;
        /// Panel rows.
        height_px: usize, Whole(16, 16384), Never;
        /// Refreshes a second.
        refresh_hz: f64, Number(1.0, 1000.0), Never;
        /// Wait from the flip to the trigger: processing latency, scan-out and response time
        /// together; `relens check` measures it.
        settle_ms: f64, Number(0.0, 10_000.0), Never;
        /// From a flip to the first change anyone can see, at the least and at most `settle-ms`;
        /// `relens check` measures it. The next picture may be asked for this much before an
        /// exposure ends.
        latency_ms: Option<f64>, Number(0.0, 10_000.0),
            Says("every exposure ends before the next picture is asked for");
    }
}

table! {
    /// The sensor.
    pub struct CameraTable {
        /// Sensor pixels in a row.
        width_px: usize, Whole(16, 16384), Never;
        /// Sensor rows.
        height_px: usize, Whole(16, 16384), Never;
        /// Sensor column of the photo's first column.
        photo_x_px: usize, Whole(0, 16384), Never;
        /// Sensor row of the photo's first row.
        photo_y_px: usize, Whole(0, 16384), Never;
        /// Bits of a count.
        bits: u8, Of(&[8, 10, 12, 16]), Never;
        /// Exposure time; on a real rig a whole number of refreshes, or the backlight's flicker
        /// shows.
        exposure_ms: f64, Number(0.001, 60_000.0), Never;
        /// A frame later than this after the trigger is missing; more than the exposure. The
        /// default is a guess: ten exposures of 50 ms.
        deadline_ms: f64, Number(1.0, 600_000.0), Means("500.0");
        /// How often one picture is shot at the most before the rig gives up. The default is a
        /// guess.
        exposures_max: u32, Whole(1, 100), Means("3");
        /// Focus ring and aperture in your words, such as `2.5 m, f/4`: goes into the photos that
        /// the rig takes, and one with other words is refused. Other words are another rig, which
        /// must be measured.
        @[serde(default, skip_serializing_if = "Option::is_none")]
        focus: Option<String>, Such("a text in quotes of 1 to 80 ASCII letters", |value| {
            value.as_str().is_some_and(|words| {
                (1..=80).contains(&words.len())
                    && words.bytes().all(|b| (b' '..=b'~').contains(&b))
                    && words.trim() == words
            })
        }), Says("photos say nothing of it");
    }
}

table! {
    /// The grid the solver works on.
    pub struct CanvasTable {
        /// How far the canvas reaches beyond the photo on every side: as far as the lens throws
        /// light across the photo's border. The canvas stays on the sensor.
        margin_px: usize, Whole(0, 16384), Never;
    }
}

table! {
    /// The strips at the sensor's upper and lower edge that carry the number of the picture shown.
    pub struct Marks {
        /// From the sensor's edge to the strip, in sensor pixels. The canvas stays free of strips
        /// that do not vanish.
        from_edge_px: usize, Whole(0, 16384), Never;
        /// The strip's height in sensor pixels: wide against the blur.
        height_px: usize, Whole(2, 16384), Never;
        /// Whether the strips vanish before each capture: a first exposure with them proves the
        /// picture, a second without them is the capture. The canvas may then reach the sensor's
        /// edges, and captures take twice as long.
        @[serde(skip_serializing_if = "std::ops::Not::not")]
        vanish: bool, Truth, Means("false");
    }
}

table! {
    /// How the rig is measured.
    pub struct CalibrationTable {
        /// How panel and sensor are brought together.
        geometry: Alignment, Word(Alignment::WORDS), Means("\"checkerboard\"");
        /// Side of a checkerboard square in panel pixels: wide against the blur, and enough
        /// corners for a spline.
        checker_square_px: usize, Whole(4, 400), Never;
        /// Columns of the lens model's grid of functions. 48 functions are enough, 192 gain
        /// nothing.
        function_columns: usize, Whole(1, 64), Means("8");
        /// Rows of the lens model's grid of functions.
        function_rows: usize, Whole(1, 64), Means("6");
        /// Width and height of a function: as wide as the lens blurs.
        function_support_px: usize, Odd(3, 255), Never;
        /// Pseudo-random patterns shown to measure the lens model. Four are as good as ten.
        patterns: usize, Whole(1, 100), Means("4");
        /// Captures averaged for each pattern: four halve the noise.
        captures_averaged: usize, Whole(1, 100), Means("1");
        /// Whether light that is scattered wider than the functions reach (veiling glare) is
        /// measured too. It is kept only where it is there.
        broad_term: bool, Truth, Means("true");
        /// Whether it is measured how the camera's counts bend: a gradation at one, two and three
        /// times the exposure, where the exposure can be set. A bend is undone in captures and
        /// photos; a camera that bends counts by more than a tenth is refused.
        @[serde(skip_serializing_if = "std::ops::Not::not")]
        linearity: bool, Truth, Means("false");
        /// Flats by which each of the sensor's sites is compared with its surroundings, and hot and
        /// dead ones are found; none: all are taken to be alike. With a hundred the comparison adds
        /// less than a tenth of a photo's noise.
        @[serde(skip_serializing_if = "is_default")]
        response_flats: usize, Whole(0, 10_000), Means("0");
    }
}

words! {
    /// How panel and sensor are brought together.
    pub enum Alignment {
        /// Measured with a displayed checkerboard, per channel.
        Checkerboard = "checkerboard",
        /// Panel pixel (i, j) is sensor pixel (i, j) by construction; nothing is resampled.
        OneToOne = "one-to-one",
    }
}

table! {
    /// How photos are restored.
    pub struct Restore {
        /// The method used when none is asked for.
        method: MethodName, Word(MethodName::WORDS), Means("\"hybrid\"");
        /// Momentum steps of the solver, which starts from Wiener's filter.
        steps: usize, Whole(1, 10_000), Means("16");
        /// Shrinkage threshold in grey levels at one grey level of noise; it grows with the noise.
        shrinkage_at_one_grey_level: f32, Number(0.0, 255.0), Means("0.09");
        /// Wavelet levels.
        levels: usize, Whole(1, 8), Means("4");
        /// Whether the shrinkage is averaged over shifts (cycle spinning): worth more than any
        /// change of iteration.
        cycle_spun: bool, Truth, Means("true");
        /// Whether the solver's prior sees the colours together.
        colours: ColourChoice, Word(ColourChoice::WORDS), Means("\"along-axes\"");
        /// Defect corrections a photo may cost at the most; the first of them reuses the
        /// certificate's capture.
        corrections_max: usize, Whole(0, 100), Means("3");
        /// Rounds of block matching in a solve, where that is the method: 1 takes half as long
        /// again as `hybrid`. More are for small photos; of large ones 8 gain nothing and take four
        /// times as long.
        block_rounds: usize, Whole(1, 100), Means("1");
        /// Whether results lose the lens's dark corners, as `relens calibrate --diffuser` measured
        /// them; a photo returned as it is keeps them.
        remove_vignetting: bool, Truth, Means("false");
        /// What `relens calibrate` is to choose method, steps and corrections by, from scenes it
        /// shows.
        operating_point: Option<OperatingPoint>, Word(OperatingPoint::WORDS),
            Says("they are as this table has them");
    }
}

words! {
    /// What a setting is chosen by.
    pub enum OperatingPoint {
        /// The fastest that keeps 90 % of the most that any gains: SSIM, PSNR and, in colour, ΔE
        /// at edges together.
        Fast = "fast",
        /// The fastest that keeps 98 % of it.
        Balanced = "balanced",
        /// The one that gains most, block matching among them, whatever it costs.
        Best = "best",
    }
}

words! {
    /// How the colours of a photo are solved.
    pub enum ColourChoice {
        /// Together: start and prior see details along the axes of the photo's colours, in three
        /// quarters of `steps`, or at a raw photo's sites in all of them; a JPEG as "together".
        AlongAxes = "along-axes",
        /// Together: the prior sees brightness and colour differences.
        Together = "together",
        /// Each channel for itself.
        Apart = "apart",
    }
}

table! {
    /// The paper's own parameters (§4), used by the methods `paper` and `residual`.
    pub struct PaperTable {
        /// Iterations (Fig. 7).
        iterations: usize, Whole(0, 10_000), Means("11");
        /// Step τ of Eq. 7 (§4.1). Above 1/‖K‖² it diverges, and may be written all the same.
        tau: f32, Number(1e-6, 10.0), Means("0.8");
        /// Weight λ of the wavelet term (§4.1).
        lambda: f32, Number(0.0, 1e4), Means("3.0");
        /// Side of a flip–FC–flip patch.
        patch_px: usize, Whole(4, i64::MAX), Says("80/1024 of the photo's width, as in the paper");
        /// Guard margin around a patch.
        margin_px: usize, Whole(0, 1024), Says("the radius of the lens model's functions");
    }
}

impl PhotoTable {
    /// Width and height.
    pub fn size(&self) -> Size {
        Size::new(self.width_px, self.height_px)
    }
}

impl PanelTable {
    /// Width and height.
    pub fn size(&self) -> Size {
        Size::new(self.width_px, self.height_px)
    }
}

impl CameraTable {
    /// Width and height.
    pub fn size(&self) -> Size {
        Size::new(self.width_px, self.height_px)
    }

    /// The largest count, 2^bits − 1.
    pub fn count_max(&self) -> u16 {
        ((1u32 << self.bits) - 1) as u16
    }
}
