//! The tables only a simulated rig has: lens, pose, display, sensor and faults.

use serde::{Deserialize, Serialize};

use super::BlurGrid;

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
