//! Tables of a simulated rig: lens, pose, display, sensor and faults.

use serde::{Deserialize, Deserializer, Serialize};
use toml::Value;

use super::keys::{Word as KeyWord, numbers, table, words};
use super::parts::CameraTable;
use super::spectra::{Primaries, SpectralLight};
use crate::frame::Mosaic;

/// A simulated rig.
#[derive(Debug, Clone)]
#[allow(missing_docs)] // The parts are described with their types.
pub struct Simulation {
    /// Seed of noise, faults and jitter.
    pub seed: u64,
    pub surround: Surround,
    pub lens: Prescription,
    pub glare: Glare,
    pub pose: Pose,
    pub display: DisplayTable,
    pub sensor: SensorTable,
    pub faults: Faults,
    pub unrest: Unrest,
}

table! {
    /// Simulation as a whole.
    pub(super) struct SimulationTable {
        /// Seed of noise, faults and jitter.
        seed: u64, Whole(0, i64::MAX), Never;
        /// Light from outside the photo's frame.
        surround: Surround, Word(Surround::WORDS), Never;
        /// Spectra of panel, scene and colour filters.
        light: SpectralLight, Word(SpectralLight::WORDS), Never;
        /// Whether panel and camera move and flicker: a step of 0.03 sensor pixels per capture and
        /// axis, 0.05 of vibration, 0.3 % of flicker, and a slow drift.
        @[serde(deserialize_with = "usual", skip_serializing)]
        unrest: Unrest, Truth, Means("false");
    }
}

/// Changes from capture to capture.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Unrest {
    /// Standard deviation of the panel's step per capture and axis, in sensor pixels. A pull
    /// towards its place keeps the panel within about three steps.
    pub wander_px: f64,
    /// Standard deviation of one capture's displacement per axis, in sensor pixels.
    pub vibration_px: f64,
    /// Standard deviation of the panel's light from capture to capture, as a share.
    pub flicker_share: f64,
    /// Drift of the panel to the right and down, in sensor pixels per hour.
    pub drift_px_per_h: [f64; 2],
    /// Drift of the panel's light, as a share per hour.
    pub drift_share_per_h: f64,
}

impl Usual for Unrest {
    /// Guesses, field by field: the changing warmth of a room; footsteps and a fan; a backlight's
    /// current over whole periods; a bolted panel; a panel that has warmed up.
    const USUAL: Unrest = Unrest {
        wander_px: 0.03,
        vibration_px: 0.05,
        flicker_share: 0.003,
        drift_px_per_h: [0.02, -0.01],
        drift_share_per_h: -0.005,
    };
}

/// Imperfections that one boolean key switches on; the default has none.
trait Usual: Default {
    const USUAL: Self;
}

fn usual<'de, D: Deserializer<'de>, T: Usual>(deserializer: D) -> Result<T, D::Error> {
    let is_on = bool::deserialize(deserializer)?;
    Ok(if is_on { T::USUAL } else { T::default() })
}

/// Whether `value` is the default, which is left out of a rig's identity.
pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

words! {
    /// Light from outside the photo's frame.
    pub enum Surround {
        /// The scene continues, mirrored at the frame.
        Scene = "scene",
        /// None.
        Black = "black",
    }
}

/// Veiling glare: light scattered far beyond the point spread function.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Glare {
    /// Share of the light that is scattered, 0..1.
    pub share: f32,
    /// Standard deviation of the glare's Gaussian, in sensor pixels.
    pub radius_px: f32,
}

/// Distance of the panel from the first refracting surface (paper, §4.1).
const PANEL_DISTANCE_MM: f64 = 4000.0;

/// Prescription of a lens; most fields are documented as keys of `[lens]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Prescription {
    pub surfaces: Vec<LensSurface>,
    pub stop_at_surface: usize,
    pub stop_diameter_mm: f64,
    pub object_distance_mm: f64,
    /// Distance in focus; `None` for that of the panel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus_distance_mm: Option<f64>,
    /// No calibration depends on it.
    #[serde(skip)]
    pub scene_distance_mm: Option<f64>,
    pub pixel_pitch_um: f64,
    pub support_px: usize,
    pub node_columns: usize,
    pub node_rows: usize,
    pub geometry: LensGeometry,
    pub dark_corner: bool,
    /// Offset of the optical axis from the sensor's middle, columns and rows. Only for centred
    /// geometry.
    pub axis_offset_px: [f64; 2],
}

table! {
    /// Lens.
    pub(super) struct LensTable {
        /// Refracting surfaces and rims, from the object to the image.
        surface: Vec<LensSurface>, Tables(&LensSurface::TABLE), Never;
        /// Diameter of the stop.
        stop_diameter_mm: f64, MoreThan(0.0), Never;
        /// Distance of a photo's scene from the first refracting surface. No calibration depends on
        /// it.
        scene_distance_mm: Option<f64>, Number(1.0, 1e7), Says("the distance of the panel, 4 m");
        /// Pixel pitch of the sensor.
        pixel_pitch_um: f64, Number(0.1, 1000.0), Never;
        /// Width and height of a point spread function.
        support_px: usize, Odd(3, 511), Never;
        /// Columns of the grid of traced functions over the sensor; its rows follow from the
        /// sensor's aspect ratio.
        node_columns: usize, Whole(2, 128), Never;
        /// Geometry of the image.
        geometry: LensGeometry, Word(LensGeometry::WORDS), Never;
        /// Veiling glare: share of the light that is scattered far beyond the functions.
        glare_share: f32, Number(0.0, 0.9), Never;
        /// Standard deviation of the glare's Gaussian, in sensor pixels.
        glare_radius_px: f32, Number(1.0, 1e4), Never;
    }
}

impl LensTable {
    /// The lens, focused on the panel and centred on the sensor of `camera`, and its glare.
    pub(super) fn into_lens(self, camera: &CameraTable) -> (Prescription, Glare) {
        let [width, height] = [camera.width_px, camera.height_px].map(|side| side as f64);
        let rows = (self.node_columns as f64 * height / width).round();
        let is_rim = |surface: &&LensSurface| surface.radius_mm.is_infinite();
        let lens = Prescription {
            // The vertex plane of the first refracting surface carries the stop.
            stop_at_surface: self.surface.iter().take_while(is_rim).count(),
            surfaces: self.surface,
            stop_diameter_mm: self.stop_diameter_mm,
            object_distance_mm: PANEL_DISTANCE_MM,
            focus_distance_mm: None,
            scene_distance_mm: self.scene_distance_mm,
            pixel_pitch_um: self.pixel_pitch_um,
            support_px: self.support_px,
            node_columns: self.node_columns,
            node_rows: rows.max(2.0) as usize,
            geometry: self.geometry,
            dark_corner: self.geometry == LensGeometry::Traced,
            axis_offset_px: [0.0; 2],
        };
        (lens, Glare { share: self.glare_share, radius_px: self.glare_radius_px })
    }
}

table! {
    /// A surface of the lens.
    pub struct LensSurface {
        /// Radius of curvature, positive with its centre on the image side; `inf` for a flat one.
        radius_mm: f64, Such("a number, anything but 0", |value| {
            super::keys::number(value).is_some_and(|radius| radius.abs() > 0.0)
        }), Never;
        /// Distance to the next surface; unused for the last one, since the image plane is found by
        /// focusing.
        thickness_mm: f64, Number(0.0, 1e4), Never;
        /// Medium behind the surface.
        glass: Glass, Word(Glass::WORDS), Never;
        /// Clear diameter; rays beyond it are lost.
        clear_diameter_mm: f64, MoreThan(0.0), Never;
    }
}

words! {
    /// Medium behind a surface.
    pub enum Glass {
        /// None.
        Air = "air",
        /// Borosilicate crown by Schott.
        NBk7 = "N-BK7",
        /// Flint by Schott.
        F2 = "F2",
        /// Fused silica.
        FusedSilica = "fused-silica",
    }
}

words! {
    /// Geometry of the image.
    pub enum LensGeometry {
        /// Distortion and lateral colour as traced, with dark corners.
        Traced = "traced",
        /// Each function centred on its centroid, without dark corners, as in the study.
        Centred = "centred",
    }
}

// A pixel's footprint on the panel is taken as upright, which fails beyond 5°.
table! {
    /// Pose of the panel before the lens.
    pub struct Pose {
        /// Sensor pixels covered by one panel pixel at the centre.
        // The simulated panel's area weights reach over three panel pixels.
        sensor_px_per_panel_px: f64, Number(0.5, 8.0), Never;
        /// Offset of the panel's centre to the right of the sensor's, in sensor pixels.
        shift_x_px: f64, Number(-1e4, 1e4), Never;
        /// Offset of the panel's centre below the sensor's, in sensor pixels.
        shift_y_px: f64, Number(-1e4, 1e4), Never;
        /// Rotation about the optical axis, clockwise as seen.
        rotation_deg: f64, Number(-5.0, 5.0), Never;
        /// Tilt about the panel's horizontal axis.
        tilt_x_deg: f64, Number(-5.0, 5.0), Never;
        /// Tilt about the panel's vertical axis.
        tilt_y_deg: f64, Number(-5.0, 5.0), Never;
    }
}

table! {
    /// Physics of the display. The light of code c is
    /// `leakage + (1 − leakage)·(((c/255 + toe)/(1 + toe))^gamma − (toe/(1 + toe))^gamma) / (1 −
    /// (toe/(1 + toe))^gamma)`.
    pub struct DisplayTable {
        /// Spectra of the panel's red, green and blue.
        @[serde(skip_deserializing)]
        primaries: Primaries, Fixed, Says("computed");
        /// Exponent of the response curve, per channel.
        gamma: [f64; 3], Such("three numbers, 0.2 to 5", |value| numbers(value, 3, 0.2, 5.0)),
            Never;
        /// Offset of the response curve, per channel; above 0 the curve is no pure power.
        toe: [f64; 3], Such("three numbers, 0 to 1", |value| numbers(value, 3, 0.0, 1.0)), Never;
        /// Light of code 0 as a share of the light of code 255.
        leakage_share: f64, Number(0.0, 0.5), Never;
        /// Refreshes before a new picture starts to appear.
        latency_refreshes: u32, Whole(0, 100), Never;
        /// Time constant of the exponential approach from one picture to the next.
        response_ms: f64, Number(0.0, 10_000.0), Never;
        /// Whether the panel is as uneven as usual: corners darker by 15 %, light and leakage that
        /// depend on the angle of view.
        @[serde(deserialize_with = "usual", skip_serializing_if = "is_default")]
        uneven: Uneven, Truth, Means("false");
    }
}

/// Unevenness of a panel: the light of a place is `light of the code · (1 − loss) + leakage added`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct Uneven {
    /// Share of the light missing in the corners, growing with the squared distance from the
    /// middle.
    pub corner_loss: f64,
    /// Corner loss of blue minus that of red, as a share of the light; green is halfway between.
    pub corner_tint: f64,
    /// Share of the light lost at 10° of view, growing with the squared angle.
    pub loss_at_10_deg: f64,
    /// Leakage added at 10° of view, as a share of white, growing with the squared angle.
    pub leakage_at_10_deg: f64,
}

impl Usual for Uneven {
    const USUAL: Uneven = Uneven {
        // White differs by 15 % over a monitor on average, by 20 % over a Dell U2412M (published
        // tests of monitors).
        corner_loss: 0.15,
        // Guess: a few just noticeable steps of white.
        corner_tint: 0.02,
        // Guess: an IPS panel.
        loss_at_10_deg: 0.02,
        // Guess: half of what a contrast of 1000:1 leaks.
        leakage_at_10_deg: 0.0005,
    };
}

/// Whether `value` is a cross-channel matrix.
fn cross_channel(value: &Value) -> bool {
    let is_row = |row: &Value, n: usize| {
        let diagonal = row.get(n).and_then(super::keys::number);
        numbers(row, 3, 0.0, 1.0) && diagonal.is_some_and(|entry| (entry - 1.0).abs() < 1e-12)
    };
    let rows = value.as_array().filter(|rows| rows.len() == 3);
    rows.is_some_and(|rows| rows.iter().enumerate().all(|(n, row)| is_row(row, n)))
}

table! {
    /// Physics of the sensor.
    pub struct SensorTable {
        /// Spectra of a scene's light behind the red, green and blue filters.
        @[serde(skip_deserializing)]
        filters: Primaries, Fixed, Says("computed");
        /// Sensitivity of each sensor channel (row) to each panel primary (column).
        cross_channel: [[f64; 3]; 3],
            Such("three rows of three numbers, 0 to 1, with 1 on the diagonal", cross_channel),
            Never;
        /// Counts without light, at this sensor's bits; at most half of the largest.
        black_level_counts: f64, Number(0.0, 32_767.5), Never;
        /// Share of the range above black that white of a channel's own primary fills.
        white_share: f64, Number(0.01, 10.0), Never;
        /// Electrons at the largest count; `inf` for no shot noise.
        full_well_electrons: f64, MoreThan(1.0), Never;
        /// Standard deviation of the light-independent noise, in grey levels of 255.
        read_noise_levels: f64, Number(0.0, 255.0), Never;
        /// Ambient light on the panel per channel, in grey levels of 255.
        ambient_levels: [f64; 3],
            Such("three numbers, 0 to 255", |value| numbers(value, 3, 0.0, 255.0)), Never;
        /// Time from the end of the exposure to the frame.
        readout_ms: f64, Number(0.0, 10_000.0), Never;
        /// Colour filters, by the colours of the first two pixels of the first two rows.
        @[serde(skip_serializing_if = "Option::is_none")]
        mosaic: Option<Mosaic>, Word(MOSAICS), Says("every pixel sees all three colours");
        /// Whether pixels differ as usual: 1 % in gain, and one in 5000 hot.
        @[serde(skip_serializing)]
        pixels_differ: bool, Truth, Means("false");
        /// Standard deviation of the pixels' gains, as a share. The pattern belongs to the sensor
        /// and depends on no seed.
        @[serde(skip_deserializing, skip_serializing_if = "is_default")]
        gain_deviation: f64, Fixed, Says("computed");
        /// Share of hot pixels.
        @[serde(skip_deserializing, skip_serializing_if = "is_default")]
        hot_pixel_share: f64, Fixed, Says("computed");
        /// Mean signal of hot pixels in the dark, in grey levels of 255; exponentially distributed.
        @[serde(skip_deserializing, skip_serializing_if = "is_default")]
        hot_pixel_levels: f64, Fixed, Says("computed");
        /// Whether counts bend as those of industrial sensors do near the full well.
        @[serde(deserialize_with = "usual", skip_serializing_if = "is_default")]
        curve: SensorCurve, Truth, Means("false");
    }
}

impl SensorTable {
    /// The sensor with its computed values, in `light`.
    pub(super) fn completed(mut self, light: SpectralLight) -> SensorTable {
        self.filters = light.filters();
        if self.pixels_differ {
            // The upper end of industrial sensors' data sheets (EMVA 1288).
            self.gain_deviation = 0.01;
            // Guesses.
            (self.hot_pixel_share, self.hot_pixel_levels) = (0.0002, 20.0);
        }
        self
    }
}

/// Words for [`Mosaic`].
const MOSAICS: &[KeyWord] = &[
    KeyWord { word: "bggr", meaning: "Blue first, green to its right and below." },
    KeyWord { word: "gbrg", meaning: "Green first, blue to its right." },
    KeyWord { word: "grbg", meaning: "Green first, red to its right." },
    KeyWord { word: "rggb", meaning: "Red first, green to its right and below." },
];

/// Counts over light, both as shares of the range above black. A curve of ones is a straight line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct SensorCurve {
    /// Exponent: counts = light^gamma.
    pub gamma: f64,
    /// Counts at the knee, above which the curve is flatter.
    pub knee_share: f64,
    /// Slope above the knee.
    pub knee_slope: f64,
}

impl Usual for SensorCurve {
    /// Guesses: raw counts of industrial sensors are straight to about 1 %, here 1.4 % at half the
    /// range, and bend near the full well.
    const USUAL: SensorCurve = SensorCurve { gamma: 0.98, knee_share: 0.85, knee_slope: 0.7 };
}

impl Default for SensorCurve {
    fn default() -> Self {
        SensorCurve { gamma: 1.0, knee_share: 1.0, knee_slope: 1.0 }
    }
}

table! {
    /// Probabilities of simulated faults, per exposure; at most 1 together.
    @[derive(Copy)]
    pub struct Faults {
        /// The frame shows the previous picture.
        stale: f64, Number(0.0, 1.0), Means("0.0");
        /// The last frame is delivered again, with its number.
        duplicate: f64, Number(0.0, 1.0), Means("0.0");
        /// No frame arrives.
        missing: f64, Number(0.0, 1.0), Means("0.0");
        /// The upper rows show the previous picture.
        mixed: f64, Number(0.0, 1.0), Means("0.0");
        /// The camera disconnects.
        unplugged: f64, Number(0.0, 1.0), Means("0.0");
        /// Time before a disconnected camera can be opened again. Guess.
        unplugged_ms: f64, Fixed, Means("2000.0");
    }
}
