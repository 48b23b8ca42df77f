//! The tables only a simulated rig has: lens, pose, display, sensor and faults.

use serde::{Deserialize, Serialize};

use super::BlurGrid;
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
    pub display: Display,
    /// The sensor's physics.
    pub sensor: Sensor,
    /// How often things go wrong.
    pub faults: Faults,
    /// What changes from one capture to the next.
    pub unrest: Unrest,
}

/// What lies outside the frame when a photo is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Surround {
    /// The scene goes on, mirrored at the frame.
    Scene,
    /// Nothing.
    Black,
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

/// A lens as its maker writes it down.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Prescription {
    /// Refracting surfaces and rims, from the object to the image.
    pub surfaces: Vec<Surface>,
    /// Index of the surface whose vertex plane carries the stop; only flat rims in air may come
    /// before it.
    pub stop_at_surface: usize,
    /// Diameter of the stop.
    pub stop_diameter_mm: f64,
    /// From the panel (and the scene) to the first refracting surface.
    pub object_distance_mm: f64,
    /// At what distance the lens is focused; left out, at the panel's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus_distance_mm: Option<f64>,
    /// From a photo's scene to the first refracting surface; left out, the panel's distance. No
    /// calibration depends on it.
    #[serde(skip)]
    pub scene_distance_mm: Option<f64>,
    /// Sensor pixel pitch.
    pub pixel_pitch_um: f64,
    /// Width and height of a point spread function, odd.
    pub support_px: usize,
    /// Columns of the grid of points the functions are traced at, spread over the sensor.
    pub node_columns: usize,
    /// Rows of that grid.
    pub node_rows: usize,
    /// Whether the functions keep their place.
    pub geometry: LensGeometry,
    /// Whether light falls off towards the corners as the trace says.
    pub dark_corner: bool,
    /// From the sensor's middle to where the optical axis meets it, columns and rows: a lens that
    /// is not centred blurs, and darkens, about another place. Only of a lens whose functions keep
    /// their place.
    pub axis_offset_px: [f64; 2],
}

/// One surface of a lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Surface {
    /// Radius of curvature, positive when its centre is on the image side; `inf` for a flat one.
    pub radius_mm: f64,
    /// To the next surface; for the last one it is not used, the image plane is found by focusing.
    pub thickness_mm: f64,
    /// What follows the surface: a glass of the catalogue, or `air`.
    pub glass: String,
    /// Rays beyond this diameter are lost.
    pub clear_diameter_mm: f64,
}

/// Whether point spread functions keep their place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LensGeometry {
    /// Distortion and lateral colour are as traced.
    Traced,
    /// Every function is centred on its centroid, as in the study.
    Centred,
}

/// `[pose]`: where the panel stands before the lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Pose {
    /// Sensor pixels that one panel pixel covers at the centre.
    pub sensor_px_per_panel_px: f64,
    /// The panel's centre to the right of the sensor's, in sensor pixels.
    pub shift_x_px: f64,
    /// The panel's centre below the sensor's, in sensor pixels.
    pub shift_y_px: f64,
    /// Turn about the optical axis, clockwise as seen.
    pub rotation_deg: f64,
    /// Turn about the panel's horizontal axis.
    pub tilt_x_deg: f64,
    /// Turn about the panel's vertical axis.
    pub tilt_y_deg: f64,
}

/// A wavelength in nm and its weight, which is relative to the others of its list.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wavelength(pub f64, pub f64);

/// Wavelengths of the three channels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Primaries {
    /// Of the red channel.
    pub red_nm: Vec<Wavelength>,
    /// Of the green channel.
    pub green_nm: Vec<Wavelength>,
    /// Of the blue channel.
    pub blue_nm: Vec<Wavelength>,
}

impl Primaries {
    /// The three lists in storage order.
    pub fn lists(&self) -> [&[Wavelength]; 3] {
        [&self.red_nm, &self.green_nm, &self.blue_nm]
    }
}

/// `[display]`: the display's physics. Light of code c is
/// `leakage + (1 − leakage)·(((c/255 + toe)/(1 + toe))^gamma − (toe/(1 + toe))^gamma) / (1 −
/// (toe/(1 + toe))^gamma)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Display {
    /// What the panel's red, green and blue are made of.
    pub primaries: Primaries,
    /// Exponent of the response curve, per channel.
    pub gamma: [f64; 3],
    /// Offset of the response curve, per channel, 0 or more; with one the curve is no pure power.
    pub toe: [f64; 3],
    /// Light of code 0 as a share of the light of code 255.
    pub leakage_share: f64,
    /// Refreshes the panel's electronics take before a new picture starts to appear.
    pub latency_refreshes: u32,
    /// Time constant of the exponential approach from the last picture to the new one.
    pub response_ms: f64,
    /// How a panel pixel's colours lie beside each other; on one place when left out.
    #[serde(default, skip_serializing_if = "is_default")]
    pub subpixels: Subpixels,
    /// How its light differs over the panel; not at all when left out.
    #[serde(default, skip_serializing_if = "is_default")]
    pub uneven: Uneven,
}

/// How the three colours of a panel pixel lie.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Subpixels {
    /// All on the whole pixel.
    #[default]
    Whole,
    /// Red, green, blue from left to right, a third of the pixel each.
    Stripes,
}

/// `[display.uneven]`: how a panel's light differs over its area. Keys left out are 0. A place's
/// light is `code's light · (1 − loss) + leakage added`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Uneven {
    /// Share of the light that the panel's corners lack, growing with the distance from its middle
    /// squared; 0..1.
    pub corner_loss: f64,
    /// How much more of it blue lacks than red, as a share; green is between them.
    pub corner_tint: f64,
    /// Share of the light lost when seen 10° aslant, growing with the angle squared.
    pub loss_at_10_deg: f64,
    /// Leakage added when seen 10° aslant, as a share of white, growing with the angle squared.
    pub leakage_at_10_deg: f64,
}

/// `[sensor]`: the sensor's physics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Sensor {
    /// Through what the sensor's red, green and blue see the broad light of a scene.
    pub filters: Primaries,
    /// Row: sensor channel, column: panel primary; diagonal 1.
    pub cross_channel: [[f64; 3]; 3],
    /// Counts without light, at this sensor's bits.
    pub black_level_counts: f64,
    /// Share of the range above black that a white panel fills, seen in one channel through its own
    /// primary.
    pub white_share: f64,
    /// Electrons at the largest count; `inf` for no shot noise.
    pub full_well_electrons: f64,
    /// Gaussian noise independent of the light, in grey levels of 255.
    pub read_noise_levels: f64,
    /// Other light on the panel, per channel, in grey levels of 255.
    pub ambient_levels: [f64; 3],
    /// From the end of the exposure to the frame.
    pub readout_ms: f64,
    /// The colour filters over its sites; left out, every pixel sees all three colours.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mosaic: Option<Mosaic>,
    /// Standard deviation of the pixels' gains, as a share: their fixed pattern. The pattern is the
    /// sensor's own and hangs on no seed.
    #[serde(default, skip_serializing_if = "is_default")]
    pub gain_deviation: f64,
    /// Share of pixels that are hot.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hot_pixel_share: f64,
    /// Light of their own that hot pixels have on average, in grey levels of 255; exponentially
    /// distributed.
    #[serde(default, skip_serializing_if = "is_default")]
    pub hot_pixel_levels: f64,
    /// How counts stand for light; a straight line when left out.
    #[serde(default, skip_serializing_if = "is_default")]
    pub curve: SensorCurve,
}

/// `[sensor.curve]`: how counts stand for light, both as shares of the range above black. Keys left
/// out are 1, which is a straight line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct SensorCurve {
    /// Exponent: counts = light^gamma.
    pub gamma: f64,
    /// The knee: where in the counts so far the curve becomes flatter.
    pub knee_share: f64,
    /// Slope above the knee.
    pub knee_slope: f64,
}

impl Default for SensorCurve {
    fn default() -> Self {
        SensorCurve { gamma: 1.0, knee_share: 1.0, knee_slope: 1.0 }
    }
}

/// `[simulation.unrest]`: what changes from one capture to the next. Keys left out are 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Unrest {
    /// Step of the panel's wander before the lens, a capture and axis, in sensor pixels (standard
    /// deviation). It is pulled back, so that it stays within about seven steps.
    pub wander_px: f64,
    /// Displacement of one capture alone, an axis, in sensor pixels (standard deviation).
    pub vibration_px: f64,
    /// Standard deviation of the panel's light from capture to capture, as a share.
    pub flicker_share: f64,
    /// How far the panel creeps to the right and down in an hour, in sensor pixels.
    pub drift_px_per_h: [f64; 2],
    /// Share of the panel's light that comes (goes, when negative) in an hour.
    pub drift_share_per_h: f64,
}

/// Whether a value is what it is when its key is left out: such keys are not part of an identity.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// `[faults]`: how often things go wrong, each a probability per exposure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Faults {
    /// The frame is of the picture shown before.
    pub stale: f64,
    /// The last frame is delivered a second time, with its own number.
    pub duplicate: f64,
    /// No frame comes.
    pub missing: f64,
    /// The upper rows are of the picture shown before.
    pub mixed: f64,
    /// The camera goes away.
    pub unplugged: f64,
    /// How long it stays away before it can be opened again.
    pub unplugged_ms: f64,
}
