//! The rig file: parsed from TOML and validated into a [`RigFile`].
//!
//! Physical quantities have no defaults; numbers of a method or procedure do, declared at their
//! field and listed in `rig-config/README.md`. Every key names its unit. An error message names
//! line, key, the value found and the values allowed. The rig files of `rig-config/` are compiled
//! in, so `--rig simulated.toml` works from any folder.

mod appliance;
mod error;
mod hardware;
mod keys;
mod media;
mod method_name;
mod parts;
mod places;
mod rig;
mod rules;
mod simulation;
mod spectra;
mod written;

pub use appliance::{ClockSource, DiskTable, LargerPhotos, Mode, NightMinutes, Nights, RunTable};
pub use error::ConfigError;
pub use hardware::{
    CameraDevice, ExposureBy, FeatureValue, FreeRunningKeys, GenicamDevice, GpioLine, Hardware,
    LampDevices, Level, PanelDevice, PwmChannel, Stamps, TriggerDevice, V4l2Device,
};
pub use media::{MediaGraph, MediaLink, PadFormat, bus_format, bus_format_name, entity_and_pad};
pub use method_name::MethodName;
pub use parts::{
    Alignment, CalibrationTable, CameraTable, CanvasTable, Curve, Marks, OperatingPoint,
    PanelTable, PaperTable, PhotoTable, RawResults, Restore, Subpixels,
};
pub use rig::{Kind, RigFile};
pub use simulation::{
    DisplayTable, Faults, Glare, Glass, LensGeometry, LensSurface, Pose, Prescription, SensorCurve,
    SensorTable, Simulation, Surround, Uneven, Unrest,
};
pub use spectra::{Primaries, SpectralLight, Wavelength};

use std::path::Path;

/// The built-in rig files by name.
const BUILT_IN: [(&str, &str); 9] = [
    ("simulated.toml", include_str!("../../rig-config/simulated.toml")),
    ("study.toml", include_str!("../../rig-config/study.toml")),
    ("small.toml", include_str!("../../rig-config/small.toml")),
    ("paper-synthetic.toml", include_str!("../../rig-config/paper-synthetic.toml")),
    ("raspberry-pi-5.toml", include_str!("../../rig-config/raspberry-pi-5.toml")),
    ("raspberry-pi-5-gs.toml", include_str!("../../rig-config/raspberry-pi-5-gs.toml")),
    ("genicam.toml", include_str!("../../rig-config/genicam.toml")),
    ("truthful.toml", include_str!("../../rig-config/truthful.toml")),
    ("ideal.toml", include_str!("../../rig-config/ideal.toml")),
];

/// Names of the built-in rig files.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

/// Loads the rig file `path`, or the built-in one of that name (with or without `.toml`) if there
/// is no such file.
///
/// # Errors
/// When the file cannot be read, is not TOML, has an unknown or missing key, or breaks a rule.
pub fn load(path: &Path) -> Result<RigFile, ConfigError> {
    match std::fs::read_to_string(path) {
        Ok(text) => return parse(&text, &path.display().to_string()),
        Err(source) if source.kind() == std::io::ErrorKind::NotFound => {}
        Err(source) => return Err(ConfigError::Read(path.to_owned(), source)),
    }
    let is_named =
        |name: &str| path == Path::new(name) || path == Path::new(name.trim_end_matches(".toml"));
    if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| is_named(name)) {
        return parse(text, name);
    }
    let names = built_in_names().collect::<Vec<_>>().join(", ");
    Err(ConfigError::NoFile { path: path.to_owned(), names })
}

/// Parses the rig file `text`, called `name` in messages.
///
/// # Errors
/// When it is not TOML, has an unknown or missing key, or breaks a rule.
pub fn parse(text: &str, name: &str) -> Result<RigFile, ConfigError> {
    let (tables, places) = written::read(text, name)?;
    rules::check(tables, &places)
}

#[cfg(test)]
mod tests;
