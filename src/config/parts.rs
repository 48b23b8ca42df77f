//! Tables of every rig, real or simulated; units are in the names of their fields.

use toml::Value;

use super::keys::{table, words};
use super::method_name::MethodName;
use super::simulation::is_default;
use crate::frame::{Channel, Size};

table! {
    /// Photos.
    pub struct PhotoTable {
        /// Pixels in a row.
        // The upper limit is a guess at the largest panel and sensor.
        width_px: usize, Whole(16, 16384), Says("the sensor without the canvas margins");
        /// Rows.
        height_px: usize, Whole(16, 16384), Says("the sensor without the canvas margins");
        /// Tone curve of photos whose file names none.
        curve: Curve, Word(Curve::WORDS), Means("\"srgb\"");
        /// Parts of the names of cameras, capitals or not, whose photos are restored: maker and
        /// model, as files state them. A photo whose file names another camera is returned
        /// unchanged; one whose file names none, or by `relens shoot`, is not affected.
        @[serde(default, skip_serializing_if = "Vec::is_empty")]
        cameras: Vec<String>, Such("texts in quotes between square brackets", |value| {
            let is_text = |one: &Value| one.as_str().is_some_and(|text| !text.trim().is_empty());
            value.as_array().is_some_and(|all| !all.is_empty() && all.iter().all(is_text))
        }), Says("photos of all cameras are restored");
        /// Format of results of raw photos.
        raw_results: RawResults, Word(RawResults::WORDS), Means("\"tiff\"");
    }
}

words! {
    /// Format of a raw photo's result.
    pub enum RawResults {
        /// 16 bits in the photo's curve; with an ICC profile if that is linear.
        Tiff = "tiff",
        /// 8 bits.
        Jpeg = "jpeg",
    }
}

words! {
    /// Tone curve of a photo file.
    pub enum Curve {
        /// IEC 61966-2-1.
        Srgb = "srgb",
        /// Codes proportional to light.
        Linear = "linear",
    }
}

table! {
    /// Display.
    pub struct PanelTable {
        /// Panel pixels in a row.
        width_px: usize, Whole(16, 16384), Never;
        /// Panel rows.
        height_px: usize, Whole(16, 16384), Never;
        /// Refresh rate.
        refresh_hz: f64, Number(1.0, 1000.0), Never;
        /// Wait from flip to trigger: processing latency, scan-out and response time together.
        /// `relens check` measures it.
        settle_ms: f64, Number(0.0, 10_000.0), Never;
        /// Places of red, green and blue within a pixel. A wrong layout gives results red and blue
        /// fringes at vertical edges.
        @[serde(default, skip_serializing_if = "is_default")]
        subpixels: Subpixels, Word(Subpixels::WORDS), Means("\"rgb\"");
    }
}

words! {
    /// Layout of a panel pixel's colours.
    @[derive(Default)]
    pub enum Subpixels {
        /// Stripes of a third of the pixel: red, green and blue from left to right, as in nearly
        /// every LCD.
        @[default]
        Rgb = "rgb",
        /// Stripes of blue, green and red from left to right.
        Bgr = "bgr",
        /// All on the whole pixel.
        Whole = "whole",
    }
}

impl Subpixels {
    /// Offset of `channel`'s part of a pixel to the right of the pixel's centre, in panel pixels.
    pub fn offset_px(self, channel: Channel) -> f64 {
        let third = (channel.index() as f64 - Channel::Green.index() as f64) / 3.0;
        match self {
            Subpixels::Rgb => third,
            Subpixels::Bgr => -third,
            Subpixels::Whole => 0.0,
        }
    }
}

table! {
    /// Sensor, and the photo's place on it.
    pub struct CameraTable {
        /// Sensor pixels along each side of a pixel of the solver: their means are captured,
        /// solved and judged, and results return to the photo's own pixels. For lenses whose blur
        /// is many sensor pixels wide. `[canvas]`, `[marks]` and `[calibration]` count such binned
        /// pixels; sensor and photo are whole numbers of them.
        binning: usize, Of(&[1, 2, 4, 8]), Means("1");
        /// Sensor pixels in a row.
        width_px: usize, Whole(16, 16384), Never;
        /// Sensor rows.
        height_px: usize, Whole(16, 16384), Never;
        /// Sensor column of the photo's first column.
        photo_x_px: usize, Whole(0, 16384), Says("the photo is in the middle of the sensor");
        /// Sensor row of the photo's first row.
        photo_y_px: usize, Whole(0, 16384), Says("the photo is in the middle of the sensor");
        /// Bits of a count.
        bits: u8, Of(&[8, 10, 12, 16]), Never;
        /// Exposure time; on a real rig a whole number of refreshes, or the backlight's flicker
        /// shows.
        exposure_ms: f64, Number(0.001, 60_000.0), Never;
        /// Latest arrival of a frame after its trigger; longer than the exposure.
        deadline_ms: f64, Number(1.0, 600_000.0), Says("ten exposures");
        /// Focus ring and aperture in the owner's words, such as `2.5 m, f/4`. They are written
        /// into photos taken by the rig; photos with other words are refused. Other words need a
        /// calibration of their own.
        @[serde(default, skip_serializing_if = "Option::is_none")]
        focus: Option<String>, Such("a text in quotes of 1 to 80 ASCII letters", |value| {
            value.as_str().is_some_and(|words| {
                (1..=80).contains(&words.len())
                    && words.bytes().all(|b| (b' '..=b'~').contains(&b))
                    && words.trim() == words
            })
        }), Says("photos name no focus");
    }
}

table! {
    /// Grid of the solver.
    pub struct CanvasTable {
        /// Margin of the canvas around the photo on every side: as far as the lens throws light
        /// across the photo's border. The canvas stays on the sensor.
        margin_px: usize, Whole(0, 16384), Says("the radius of the lens model's functions");
    }
}

table! {
    /// Frame marks: strips at the sensor's upper and lower edge with the number of the picture
    /// shown.
    pub struct Marks {
        /// Distance from the sensor's edge to the strip in sensor pixels. The canvas stays clear of
        /// strips that do not vanish.
        from_edge_px: usize, Whole(0, 16384), Means("8");
        /// Height of a strip in sensor pixels: wide compared with the blur.
        height_px: usize, Whole(2, 16384), Means("32");
        /// Whether the strips vanish before each capture: a first exposure with them identifies the
        /// picture, a second without them is the capture. The canvas may then reach the sensor's
        /// edges; captures take twice as long.
        @[serde(skip_serializing_if = "std::ops::Not::not")]
        vanish: bool, Truth, Means("false");
    }
}

table! {
    /// Calibration.
    pub struct CalibrationTable {
        /// Alignment of panel and sensor.
        geometry: Alignment, Word(Alignment::WORDS), Means("\"checkerboard\"");
        /// Side of a checkerboard square in panel pixels: wide compared with the blur, with enough
        /// corners for a spline.
        checker_square_px: usize, Whole(4, 400), Never;
        /// Columns of the lens model's grid of functions. 48 functions suffice; 192 gain nothing.
        function_columns: usize, Whole(1, 64), Means("8");
        /// Rows of the lens model's grid of functions.
        function_rows: usize, Whole(1, 64), Means("6");
        /// Width and height of a function: as wide as the blur.
        function_support_px: usize, Odd(3, 255), Never;
        /// Pseudo-random patterns that measure the lens model. Four are as good as ten.
        patterns: usize, Whole(1, 100), Means("4");
        /// Captures averaged per pattern; four halve the noise.
        captures_averaged: usize, Whole(1, 100), Means("1");
        /// Whether veiling glare, scattered farther than the functions reach, is measured; the term
        /// is kept only if significant.
        broad_term: bool, Truth, Means("true");
        /// Whether the camera's non-linearity is measured, by a gradation at one, two and three
        /// times the exposure where that can be set. It is corrected in captures and photos; one of
        /// more than a tenth is refused.
        @[serde(skip_serializing_if = "std::ops::Not::not")]
        linearity: bool, Truth, Means("false");
        /// Flats that measure each site's gain and find hot and dead sites; 0 takes all sites as
        /// equal. A hundred add less than a tenth of a photo's noise. A photo that does not show
        /// these gains was taken by another sensor and is returned.
        @[serde(skip_serializing_if = "is_default")]
        response_flats: usize, Whole(0, 10_000), Means("0");
    }
}

words! {
    /// Alignment of panel and sensor.
    pub enum Alignment {
        /// Measured per channel with a displayed checkerboard.
        Checkerboard = "checkerboard",
        /// Panel pixel (i, j) is sensor pixel (i, j) by construction; nothing is resampled.
        OneToOne = "one-to-one",
    }
}

table! {
    /// Restoration.
    pub struct Restore {
        /// Default method.
        method: MethodName, Word(MethodName::WORDS), Means("\"hybrid\"");
        /// Limit of defect corrections per photo. The first one reuses the capture of the
        /// certificate.
        corrections_max: usize, Whole(0, 100), Means("3");
        /// Rounds of block matching per solve, for the method of that name. One takes half as long
        /// again as `hybrid`. Eight gain on small photos, nothing on large ones, in four times the
        /// time.
        block_rounds: usize, Whole(1, 100), Means("1");
        /// Whether results lose the lens's dark corners, as measured by `relens calibrate
        /// --diffuser`. A photo returned unchanged keeps them.
        remove_vignetting: bool, Truth, Means("false");
        /// Criterion by which `relens calibrate` chooses method, steps and corrections on test
        /// scenes.
        operating_point: Option<OperatingPoint>, Word(OperatingPoint::WORDS),
            Says("the values of this table");
    }
}

words! {
    /// Criterion for the choice of a setting.
    pub enum OperatingPoint {
        /// The fastest with 90 % of the highest gain in SSIM, PSNR and, in colour, ΔE at edges.
        Fast = "fast",
        /// The fastest with 98 % of the highest gain.
        Balanced = "balanced",
        /// The highest gain, with block matching, at any cost.
        Best = "best",
    }
}

table! {
    /// Parameters of the method `paper` (§4).
    pub struct PaperTable {
        /// Iterations (Fig. 7).
        iterations: usize, Fixed, Means("11");
        /// Step τ of Eq. 7 (§4.1). It diverges above 1/‖K‖².
        tau: f32, Fixed, Means("0.8");
        /// Weight λ of the wavelet term (§4.1).
        lambda: f32, Fixed, Means("3.0");
        /// Side of a flip–FC–flip patch.
        patch_px: usize, Whole(4, i64::MAX),
            Says("80/1024 of the photo's width, at most 80 (§4.1)");
        /// Guard margin around a flip–FC–flip patch.
        margin_px: usize, Whole(0, 1024), Says("the radius of the lens model's functions");
    }
}

macro_rules! sizes {
    ($($table:ident)*) => {$(
        impl $table {
            /// Width and height.
            pub fn size(&self) -> Size {
                Size::new(self.width_px, self.height_px)
            }
        }
    )*};
}

sizes! { PhotoTable PanelTable CameraTable }

impl CameraTable {
    /// Largest count, 2^bits − 1.
    pub fn count_max(&self) -> u16 {
        ((1u32 << self.bits) - 1) as u16
    }
}
