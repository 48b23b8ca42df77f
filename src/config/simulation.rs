//! The tables only a simulated rig has: lens, pose, display, sensor and faults.

use serde::Serialize;
use toml::Value;

use super::blur::BlurGrid;
use super::keys::{Word as Known, numbers, table, words};
use crate::frame::Mosaic;

/// Everything a simulated rig is made of.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// Where all noise, faults and jitter come from.
    pub seed: u64,
    /// What lies outside the frame when a photo is taken.
    pub surround: Surround,
    /// The lens.
    pub lens: Lens,
    /// Where the panel stands before the lens.
    pub pose: Pose,
    /// The display's physics.
    pub display: DisplayTable,
    /// The sensor's physics.
    pub sensor: SensorTable,
    /// How often things go wrong.
    pub faults: Faults,
    /// What changes from one capture to the next.
    pub unrest: Unrest,
}

/// What a lens may be made of; the simulator's catalogue has their indices.
pub const GLASSES: [&str; 5] = ["air", "N-BK7", "F2", "N-SF11", "fused-silica"];

table! {
    /// What a simulated rig is simulated with.
    pub(super) struct SimulationTable {
        /// Where all noise, faults and jitter come from.
        seed: u64, Whole(0, i64::MAX), Never;
        /// What lies outside the frame when a photo is taken.
        surround: Surround, Word(Surround::WORDS), Never;
        /// What changes from one capture to the next.
        unrest: Unrest, Table(&Unrest::TABLE), Means("{}");
    }
}

table! {
    /// What changes from one capture to the next.
    @[derive(Copy, Default)]
    pub struct Unrest {
        /// Step of the panel's wander before the lens, a capture and axis, in sensor pixels
        /// (standard deviation). It is pulled back, so that it stays within some three steps.
        wander_px: f64, Number(0.0, 1.0), Means("0.0");
        /// Displacement of one capture alone, an axis, in sensor pixels (standard deviation).
        vibration_px: f64, Number(0.0, 1.0), Means("0.0");
        /// Standard deviation of the panel's light from capture to capture, as a share.
        flicker_share: f64, Number(0.0, 0.2), Means("0.0");
        /// How far the panel creeps to the right and down in an hour, in sensor pixels.
        drift_px_per_h: [f64; 2],
            Such("two numbers, -100 to 100", |value| numbers(value, 2, -100.0, 100.0)),
            Means("[0.0, 0.0]");
        /// Share of the panel's light that comes (goes, when negative) in an hour.
        drift_share_per_h: f64, Number(-1.0, 1.0), Means("0.0");
    }
}

/// Whether a value is what it is when its key is left out. Keys that came after calibrations were
/// made are then not part of an identity.
pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

words! {
    /// What lies outside the frame when a photo is taken.
    pub enum Surround {
        /// The scene goes on, mirrored at the frame.
        Scene = "scene",
        /// Nothing.
        Black = "black",
    }
}

/// The lens: traced from its prescription, or measured elsewhere.
#[derive(Debug, Clone)]
pub enum Lens {
    /// Traced.
    Prescription(Prescription, Glare),
    /// Point spread functions from a file.
    Measured(BlurGrid, Glare),
}

impl Lens {
    /// The veiling glare of either kind.
    pub fn glare(&self) -> Glare {
        match self {
            Lens::Prescription(_, glare) | Lens::Measured(_, glare) => *glare,
        }
    }
}

/// Veiling glare: light scattered far beyond the point spread function.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Glare {
    /// Share of the light that is scattered, 0..1.
    pub share: f32,
    /// Standard deviation of the Gaussian it is scattered into, in sensor pixels.
    pub radius_px: f32,
}

/// A lens as its maker writes it down; the keys of `[lens]` say what each
/// field is.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Prescription {
    pub surfaces: Vec<LensSurface>,
    pub stop_at_surface: usize,
    pub stop_diameter_mm: f64,
    pub object_distance_mm: f64,
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
    pub axis_offset_px: [f64; 2],
}

const PRESCRIBED: &str = "then `blur` is needed";

table! {
    /// The lens: either `blur`, or a prescription, which is every other key but the glare's.
    pub(super) struct LensTable {
        /// A file with measured point spread functions, `[rows, columns, 3, k, k]` in NumPy's
        /// format, beside the rig file.
        blur: Option<String>, Text, Says("then a prescription is needed");
        /// Refracting surfaces and rims, from the object to the image.
        surface: Option<Vec<LensSurface>>, Tables(&LensSurface::TABLE), Says(PRESCRIBED);
        /// Number of the surface, from 0, whose vertex plane carries the stop; only flat rims in
        /// air may come before it.
        stop_at_surface: Option<usize>, Whole(0, 1000), Says(PRESCRIBED);
        /// Diameter of the stop.
        stop_diameter_mm: Option<f64>, MoreThan(0.0), Says(PRESCRIBED);
        /// From the panel (and the scene) to the first refracting surface.
        object_distance_mm: Option<f64>, Number(1.0, 1e7), Says(PRESCRIBED);
        /// At what distance the lens is focused.
        focus_distance_mm: Option<f64>, Number(1.0, 1e7), Says("at the distance of the panel");
        /// From a photo's scene to the first refracting surface. No calibration depends on it.
        scene_distance_mm: Option<f64>, Number(1.0, 1e7), Says("the panel's distance");
        /// Sensor pixel pitch.
        pixel_pitch_um: Option<f64>, Number(0.1, 1000.0), Says(PRESCRIBED);
        /// Width and height of a point spread function.
        support_px: Option<usize>, Odd(3, 255), Says(PRESCRIBED);
        /// Columns of the grid of points the functions are traced at, spread over the sensor.
        node_columns: Option<usize>, Whole(2, 128), Says(PRESCRIBED);
        /// Rows of that grid.
        node_rows: Option<usize>, Whole(2, 128), Says(PRESCRIBED);
        /// Whether the functions keep their place.
        geometry: Option<LensGeometry>, Word(LensGeometry::WORDS), Says(PRESCRIBED);
        /// Whether light falls off towards the corners as the trace says.
        dark_corner: Option<bool>, Truth, Says(PRESCRIBED);
        /// From the sensor's middle to where the optical axis meets it, columns and rows: a lens
        /// that is not centred blurs, and darkens, about another place. Only of a lens whose
        /// functions keep their place.
        axis_offset_px: Option<[f64; 2]>,
            Such("two numbers, -10000 to 10000", |value| numbers(value, 2, -1e4, 1e4)),
            Says("it is centred");
        /// Veiling glare: share of the light that is scattered far beyond the functions.
        glare_share: f32, Number(0.0, 0.9), Never;
        /// Standard deviation of the Gaussian it is scattered into, in sensor pixels.
        glare_radius_px: f32, Number(1.0, 1e4), Never;
    }
}

table! {
    /// A surface of the lens.
    pub struct LensSurface {
        /// Radius of curvature, positive when its centre is on the image side; `inf` for a flat
        /// one.
        radius_mm: f64, Such("a number, anything but 0", |value| {
            super::keys::number(value).is_some_and(|radius| radius.abs() > 0.0)
        }), Never;
        /// To the next surface; for the last one it is not used, the image plane is found by
        /// focusing.
        thickness_mm: f64, Number(0.0, 1e4), Never;
        /// What follows the surface.
        glass: String, Such("air, N-BK7, F2, N-SF11 or fused-silica", |value| {
            value.as_str().is_some_and(|name| GLASSES.contains(&name))
        }), Never;
        /// Rays beyond this diameter are lost.
        clear_diameter_mm: f64, MoreThan(0.0), Never;
    }
}

words! {
    /// Whether point spread functions keep their place.
    pub enum LensGeometry {
        /// Distortion and lateral colour are as traced.
        Traced = "traced",
        /// Every function is centred on its centroid, as in the study.
        Centred = "centred",
    }
}

// A sensor pixel's footprint on the panel is taken as upright; beyond 5° that is no longer true.
table! {
    /// Where the panel stands before the lens.
    pub struct Pose {
        /// Sensor pixels that one panel pixel covers at the centre.
        // The simulated panel's area weights reach over three panel pixels.
        sensor_px_per_panel_px: f64, Number(0.5, 1.0), Never;
        /// The panel's centre to the right of the sensor's, in sensor pixels.
        shift_x_px: f64, Number(-1e4, 1e4), Never;
        /// The panel's centre below the sensor's, in sensor pixels.
        shift_y_px: f64, Number(-1e4, 1e4), Never;
        /// Turn about the optical axis, clockwise as seen.
        rotation_deg: f64, Number(-5.0, 5.0), Never;
        /// Turn about the panel's horizontal axis; 0 with `lens.blur`.
        tilt_x_deg: f64, Number(-5.0, 5.0), Never;
        /// Turn about the panel's vertical axis; 0 with `lens.blur`.
        tilt_y_deg: f64, Number(-5.0, 5.0), Never;
    }
}

/// A wavelength in nm and its weight, which is relative to the others of its list.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, serde::Deserialize)]
pub struct Wavelength(pub f64, pub f64);

/// The catalogue's Sellmeier coefficients hold from 365 to 1014 nm and beyond.
const WAVELENGTHS: super::keys::Allowed = super::keys::Allowed::Such(
    "one or more [nm, weight], 365 to 1014 nm, a weight of more than 0",
    |value| {
        let of_light = |one: &Value| {
            let weight = one.get(1).and_then(super::keys::number);
            let nm = one.get(0).and_then(super::keys::number);
            one.as_array().is_some_and(|pair| pair.len() == 2)
                && nm.is_some_and(|nm| (365.0..=1014.0).contains(&nm))
                && weight.is_some_and(|weight| weight > 0.0)
        };
        value.as_array().is_some_and(|all| !all.is_empty() && all.iter().all(of_light))
    },
);

table! {
    /// Wavelengths of the three channels, each with its weight among the others.
    pub struct Primaries {
        /// Of the red channel.
        red_nm: Vec<Wavelength>, WAVELENGTHS, Never;
        /// Of the green channel.
        green_nm: Vec<Wavelength>, WAVELENGTHS, Never;
        /// Of the blue channel.
        blue_nm: Vec<Wavelength>, WAVELENGTHS, Never;
    }
}

impl Primaries {
    /// The three lists in storage order.
    pub fn lists(&self) -> [&[Wavelength]; 3] {
        [&self.red_nm, &self.green_nm, &self.blue_nm]
    }
}

table! {
    /// The display's physics. Light of code c is
    /// `leakage + (1 − leakage)·(((c/255 + toe)/(1 + toe))^gamma − (toe/(1 + toe))^gamma) / (1 −
    /// (toe/(1 + toe))^gamma)`.
    pub struct DisplayTable {
        /// What the panel's red, green and blue are made of.
        primaries: Primaries, Table(&Primaries::TABLE), Never;
        /// Exponent of the response curve, per channel.
        gamma: [f64; 3], Such("three numbers, 0.2 to 5", |value| numbers(value, 3, 0.2, 5.0)),
            Never;
        /// Offset of the response curve, per channel; with one the curve is no pure power.
        toe: [f64; 3], Such("three numbers, 0 to 1", |value| numbers(value, 3, 0.0, 1.0)), Never;
        /// Light of code 0 as a share of the light of code 255.
        leakage_share: f64, Number(0.0, 0.5), Never;
        /// Refreshes the panel's electronics take before a new picture starts to appear.
        latency_refreshes: u32, Whole(0, 100), Never;
        /// Time constant of the exponential approach from the last picture to the new one.
        response_ms: f64, Number(0.0, 10_000.0), Never;
        /// How the three colours of a panel pixel lie.
        @[serde(skip_serializing_if = "is_default")]
        subpixels: Subpixels, Word(Subpixels::WORDS), Means("\"whole\"");
        /// How its light differs over the panel.
        @[serde(skip_serializing_if = "is_default")]
        uneven: Uneven, Table(&Uneven::TABLE), Means("{}");
    }
}

words! {
    /// How the three colours of a panel pixel lie.
    @[derive(Default)]
    pub enum Subpixels {
        /// All on the whole pixel.
        @[default]
        Whole = "whole",
        /// Red, green, blue from left to right, a third of the pixel each.
        Stripes = "stripes",
    }
}

table! {
    /// How a panel's light differs over its area. A place's light is
    /// `code's light · (1 − loss) + leakage added`.
    @[derive(Copy, Default)]
    pub struct Uneven {
        /// Share of the light that the panel's corners lack, growing with the distance from its
        /// middle squared.
        corner_loss: f64, Number(0.0, 0.9), Means("0.0");
        /// How much more of it blue lacks than red, as a share; green is between them.
        corner_tint: f64, Number(0.0, 0.5), Means("0.0");
        /// Share of the light lost when seen 10° aslant, growing with the angle squared.
        loss_at_10_deg: f64, Number(0.0, 0.5), Means("0.0");
        /// Leakage added when seen 10° aslant, as a share of white, growing with the angle squared.
        leakage_at_10_deg: f64, Number(0.0, 0.5), Means("0.0");
    }
}

/// Whether `value` is a cross-channel matrix.
fn cross_channel(value: &Value) -> bool {
    let one = |row: &Value, n: usize| {
        let diagonal = row.get(n).and_then(super::keys::number);
        numbers(row, 3, 0.0, 1.0) && diagonal.is_some_and(|entry| (entry - 1.0).abs() < 1e-12)
    };
    value
        .as_array()
        .is_some_and(|rows| rows.len() == 3 && rows.iter().enumerate().all(|(n, row)| one(row, n)))
}

table! {
    /// The sensor's physics.
    pub struct SensorTable {
        /// Through what the sensor's red, green and blue see the broad light of a scene.
        filters: Primaries, Table(&Primaries::TABLE), Never;
        /// How much each sensor channel (row) sees of each panel primary (column).
        cross_channel: [[f64; 3]; 3],
            Such("three rows of three numbers, 0 to 1, with 1 on the diagonal", cross_channel),
            Never;
        /// Counts without light, at this sensor's bits; at most half of the largest.
        black_level_counts: f64, Number(0.0, 32_767.5), Never;
        /// Share of the range above black that a white panel fills, seen in one channel through
        /// its own primary.
        white_share: f64, Number(0.01, 10.0), Never;
        /// Electrons at the largest count; `inf` for no shot noise.
        full_well_electrons: f64, MoreThan(1.0), Never;
        /// Gaussian noise independent of the light, in grey levels of 255.
        read_noise_levels: f64, Number(0.0, 255.0), Never;
        /// Other light on the panel, per channel, in grey levels of 255.
        ambient_levels: [f64; 3],
            Such("three numbers, 0 to 255", |value| numbers(value, 3, 0.0, 255.0)), Never;
        /// From the end of the exposure to the frame.
        readout_ms: f64, Number(0.0, 10_000.0), Never;
        /// The colour filters over its sites, by the colours of the first two pixels of the first
        /// two rows.
        @[serde(skip_serializing_if = "Option::is_none")]
        mosaic: Option<Mosaic>, Word(MOSAICS), Says("every pixel sees all three colours");
        /// Standard deviation of the pixels' gains, as a share: their fixed pattern. The pattern is
        /// the sensor's own and hangs on no seed.
        @[serde(skip_serializing_if = "is_default")]
        gain_deviation: f64, Number(0.0, 0.2), Means("0.0");
        /// Share of pixels that are hot.
        @[serde(skip_serializing_if = "is_default")]
        hot_pixel_share: f64, Number(0.0, 0.1), Means("0.0");
        /// Light of their own that hot pixels have on average, in grey levels of 255;
        /// exponentially distributed.
        @[serde(skip_serializing_if = "is_default")]
        hot_pixel_levels: f64, Number(0.0, 1e4), Means("0.0");
        /// The camera codes its frames as JPEG of this quality, as libjpeg counts, with half as
        /// many samples of colour across (4:2:2, as webcams do); of 8 bits and without `mosaic`.
        @[serde(skip_serializing_if = "Option::is_none")]
        jpeg_quality: Option<u32>, Whole(1, 100), Says("its frames are not coded");
        /// How counts stand for light.
        @[serde(skip_serializing_if = "is_default")]
        curve: SensorCurve, Table(&SensorCurve::TABLE), Means("{}");
    }
}

/// The words of [`Mosaic`].
const MOSAICS: &[Known] = &[
    Known { word: "bggr", meaning: "Blue first, green to its right and below." },
    Known { word: "gbrg", meaning: "Green first, blue to its right." },
    Known { word: "grbg", meaning: "Green first, red to its right." },
    Known { word: "rggb", meaning: "Red first, green to its right and below." },
];

table! {
    /// How counts stand for light, both as shares of the range above black. A curve of ones is a
    /// straight line.
    @[derive(Copy)]
    pub struct SensorCurve {
        /// Exponent: counts = light^gamma.
        gamma: f64, Number(0.2, 5.0), Means("1.0");
        /// The knee: where in the counts so far the curve becomes flatter.
        knee_share: f64, Number(0.01, 1.0), Means("1.0");
        /// Slope above the knee.
        knee_slope: f64, Number(0.01, 1.0), Means("1.0");
    }
}

impl Default for SensorCurve {
    fn default() -> Self {
        SensorCurve { gamma: 1.0, knee_share: 1.0, knee_slope: 1.0 }
    }
}

table! {
    /// How often things go wrong in the simulation, each a probability per exposure; together at
    /// most 1.
    @[derive(Copy)]
    pub struct Faults {
        /// The frame is of the picture shown before.
        stale: f64, Number(0.0, 1.0), Means("0.0");
        /// The last frame is delivered a second time, with its own number.
        duplicate: f64, Number(0.0, 1.0), Means("0.0");
        /// No frame comes.
        missing: f64, Number(0.0, 1.0), Means("0.0");
        /// The upper rows are of the picture shown before.
        mixed: f64, Number(0.0, 1.0), Means("0.0");
        /// The camera goes away.
        unplugged: f64, Number(0.0, 1.0), Means("0.0");
        /// How long it stays away before it can be opened again.
        unplugged_ms: f64, Number(0.0, 1e9), Means("2000.0");
    }
}
