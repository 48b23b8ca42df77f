//! The rig file: TOML as written, checked into a [`Rig`] that the rest may rely on.
//!
//! No physical quantity has a default, every key names its unit, an unknown key is an error that
//! names the nearest known one, and rules across fields say what was found and what is allowed. The
//! rig files of `rig-config/` are part of the program, so `--rig simulated.toml` works from any
//! folder.

mod appliance;
mod blur;
mod error;
mod hardware;
pub mod methods;
mod parts;
mod rules;
mod simulation;
mod written;

pub use appliance::{ClockSource, Disk, Keep, Mode, Nights, Run, Share, Window};
pub use blur::BlurGrid;
pub use error::ConfigError;
pub use hardware::{
    ButtonDevice, CameraDevice, DisplayInterface, ExposureBy, Hardware, LampDevices, Level, Line,
    PanelDevice, TriggerDevice, V4l2Device,
};
pub use methods::MethodName;
pub use parts::{
    Calibration, Camera, Canvas, Colours, Curve, Geometry, Marks, OperatingPoint, Panel, Paper,
    Photo, Restore,
};
pub use simulation::{
    Display, Faults, Glare, Lens, LensGeometry, Pose, Prescription, Primaries, Sensor, SensorCurve,
    Simulation, Subpixels, Surface, Surround, Uneven, Unrest, Wavelength,
};

use std::path::Path;

use crate::deconvolution::method::{blocks, hybrid};
use crate::frame::{Rect, Size};

/// The rig files that are part of the program, by name.
const BUILT_IN: [(&str, &str); 5] = [
    ("simulated.toml", include_str!("../../rig-config/simulated.toml")),
    ("study.toml", include_str!("../../rig-config/study.toml")),
    ("small.toml", include_str!("../../rig-config/small.toml")),
    ("paper-synthetic.toml", include_str!("../../rig-config/paper-synthetic.toml")),
    ("truthful.toml", include_str!("../../rig-config/truthful.toml")),
];

/// A rig as checked: whoever holds one need not doubt its numbers.
#[derive(Debug, Clone)]
pub struct Rig {
    /// The rig's name, for reports.
    pub name: String,
    /// Simulated or made of hardware.
    pub kind: Kind,
    /// The customer's photos.
    pub photo: Photo,
    /// The display.
    pub panel: Panel,
    /// The sensor, and where the photo lies on it.
    pub camera: Camera,
    /// How far the solver's canvas reaches beyond the photo.
    pub canvas: Canvas,
    /// Where the frame marks are; without them a frame is trusted by its time alone.
    pub marks: Option<Marks>,
    /// How the rig is calibrated.
    pub calibration: Calibration,
    /// How photos are restored.
    pub restore: Restore,
    /// The paper's own parameters.
    pub paper: Paper,
    /// Who says when photos are restored.
    pub run: Run,
    /// When, if only at night; and how drift is watched.
    pub nights: Option<Nights>,
    /// How much of the disk is left free.
    pub disk: Disk,
    /// How long results and originals are kept.
    pub keep: Keep,
    /// How boxes that share folders tell which of them are dead.
    pub share: Share,
    /// A hash of everything a calibration depends on: a calibration of another identity is not this
    /// rig's. Seeds, faults, and how photos are restored are not part of it.
    pub identity: u64,
}

/// What the rig is made of.
#[derive(Debug, Clone)]
pub enum Kind {
    /// Physics by computing.
    Simulated(Box<Simulation>),
    /// Devices.
    Hardware(Box<Hardware>),
}

impl Rig {
    /// The photo's part of the sensor.
    pub fn photo_on_sensor(&self) -> Rect {
        Rect { x: self.camera.photo_x_px, y: self.camera.photo_y_px, size: self.photo.size() }
    }

    /// The canvas: the photo with the margin around it.
    pub fn canvas_size(&self) -> Size {
        let margin = 2 * self.canvas.margin_px;
        Size::new(self.photo.width_px + margin, self.photo.height_px + margin)
    }

    /// The canvas's part of the sensor.
    pub fn canvas_on_sensor(&self) -> Rect {
        let margin = self.canvas.margin_px;
        let (x, y) = (self.camera.photo_x_px - margin, self.camera.photo_y_px - margin);
        Rect { x, y, size: self.canvas_size() }
    }

    /// The photo's part of the canvas.
    pub fn photo_on_canvas(&self) -> Rect {
        Rect { x: self.canvas.margin_px, y: self.canvas.margin_px, size: self.photo.size() }
    }

    /// What methods are made of, as the file has it.
    pub fn numbers(&self) -> methods::Numbers<'_> {
        let Rig { restore, paper, .. } = self;
        methods::Numbers {
            restore,
            paper,
            steps: restore.steps as u32,
            correction_steps: hybrid::CORRECTION_STEPS,
            captures_max: 1 + restore.corrections_max as u32,
            rounds: blocks::ROUNDS,
        }
    }

    /// The simulation's tables, if the rig is a simulated one.
    pub fn simulation(&self) -> Option<&Simulation> {
        match &self.kind {
            Kind::Simulated(simulation) => Some(simulation),
            Kind::Hardware(_) => None,
        }
    }
}

/// Names of the rig files that are part of the program.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

/// The rig in the file `path`; when there is no such file and `path` is the bare name of a rig file
/// that is part of the program, that one.
///
/// # Errors
/// When the file cannot be read, is not TOML, has an unknown or missing key, or breaks a rule.
pub fn load(path: &Path) -> Result<Rig, ConfigError> {
    match std::fs::read_to_string(path) {
        Ok(text) => {
            let folder = path.parent().unwrap_or(Path::new(""));
            parse(&text, &path.display().to_string(), folder)
        }
        Err(source) => {
            let built_in = BUILT_IN.iter().find(|(name, _)| Path::new(name) == path);
            match built_in {
                Some((name, text)) if source.kind() == std::io::ErrorKind::NotFound => {
                    parse(text, name, Path::new(""))
                }
                _ => Err(ConfigError::Read { path: path.to_owned(), source }),
            }
        }
    }
}

/// The rig in `text`, which is called `name` in messages; files it names are looked for in
/// `base_dir`.
///
/// # Errors
/// When it is not TOML, has an unknown or missing key, or breaks a rule.
pub fn parse(text: &str, name: &str, base_dir: &Path) -> Result<Rig, ConfigError> {
    rules::check(written::read(text, name)?, name, base_dir)
}

#[cfg(test)]
mod tests;
