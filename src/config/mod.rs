//! The rig file: TOML as written, checked into a [`RigFile`] that the rest may rely on.
//!
//! No physical quantity has a default; numbers of a method or a procedure have one, which stands at
//! their field and in `rig-config/README.md`. Every key names its unit. What is said about a file
//! that is not taken names line, key, what was found and what is allowed. The rig files of
//! `rig-config/` are part of the program, so `--rig simulated.toml` works from any folder.

mod appliance;
mod blur;
mod error;
mod hardware;
mod keys;
mod media;
pub mod methods;
mod parts;
mod places;
mod rig;
mod rules;
mod simulation;
mod written;

pub use appliance::{
    ClockSource, DiskTable, Keep, LargerPhotos, Mode, NightMinutes, Nights, RunTable,
};
pub use blur::BlurGrid;
pub use error::ConfigError;
pub use hardware::{
    ButtonDevice, CameraDevice, DisplayInterface, ExposureBy, FreeRunningKeys, GpioLine, Hardware,
    LampDevices, Level, PanelDevice, PulseLine, Stamps, TriggerDevice, V4l2Device,
};
pub use media::{MediaGraph, MediaLink, PadFormat, bus_format, bus_format_name, entity_and_pad};
pub use methods::MethodName;
pub use parts::{
    Alignment, CalibrationTable, CameraTable, CanvasTable, ColourChoice, Curve, Marks,
    OperatingPoint, PanelTable, PaperTable, PhotoTable, RawResults, Restore,
};
pub use rig::{Kind, RigFile};
pub use simulation::{
    DisplayTable, Faults, GLASSES, Glare, Lens, LensGeometry, LensSurface, Pose, Prescription,
    Primaries, SensorCurve, SensorTable, Simulation, Subpixels, Surround, Uneven, Unrest,
    Wavelength,
};
pub use written::edit_distance;

use std::path::Path;

use crate::frame::Size;

/// The rig files that are part of the program, by name.
const BUILT_IN: [(&str, &str); 8] = [
    ("simulated.toml", include_str!("../../rig-config/simulated.toml")),
    ("study.toml", include_str!("../../rig-config/study.toml")),
    ("small.toml", include_str!("../../rig-config/small.toml")),
    ("paper-synthetic.toml", include_str!("../../rig-config/paper-synthetic.toml")),
    ("raspberry-pi-5.toml", include_str!("../../rig-config/raspberry-pi-5.toml")),
    ("raspberry-pi-5-gs.toml", include_str!("../../rig-config/raspberry-pi-5-gs.toml")),
    ("truthful.toml", include_str!("../../rig-config/truthful.toml")),
    ("ideal.toml", include_str!("../../rig-config/ideal.toml")),
];

/// Names of the rig files that are part of the program.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

/// The rig in the file `path`; when there is no such file and `path` is the bare name of a rig file
/// that is part of the program, with `.toml` or without, that one.
///
/// # Errors
/// When the file cannot be read, is not TOML, has an unknown or missing key, or breaks a rule.
pub fn load(path: &Path) -> Result<RigFile, ConfigError> {
    found(path, parse)
}

/// The pixels of panel and sensor that such a rig file says, whatever else is in it: before
/// anything is bought a program without real devices plans with theirs.
///
/// # Errors
/// When the file cannot be read, is not TOML, or has an unknown or missing key.
pub fn sizes(path: &Path) -> Result<[Size; 2], ConfigError> {
    found(path, |text, name, _| {
        let (tables, _) = written::read(text, name)?;
        Ok([tables.panel.size(), tables.camera.size()])
    })
}

/// What `read` makes of the text of the rig file at `path`, its name and its folder.
fn found<T>(
    path: &Path,
    read: impl Fn(&str, &str, &Path) -> Result<T, ConfigError>,
) -> Result<T, ConfigError> {
    match std::fs::read_to_string(path) {
        Ok(text) => {
            let folder = path.parent().unwrap_or(Path::new(""));
            read(&text, &path.display().to_string(), folder)
        }
        Err(source) => {
            if source.kind() == std::io::ErrorKind::InvalidData {
                let source = std::io::Error::other("found other bytes, allowed text in UTF-8");
                return Err(ConfigError::Read { path: path.to_owned(), source });
            }
            if source.kind() != std::io::ErrorKind::NotFound {
                return Err(ConfigError::Read { path: path.to_owned(), source });
            }
            let is_meant = |name: &str| {
                path == Path::new(name) || path == Path::new(name.trim_end_matches(".toml"))
            };
            match BUILT_IN.iter().find(|(name, _)| is_meant(name)) {
                Some((name, text)) => read(text, name, Path::new("")),
                None => {
                    let names = built_in_names().collect::<Vec<_>>().join(", ");
                    let near = near(path);
                    Err(ConfigError::NoFile { path: path.to_owned(), near, names })
                }
            }
        }
    }
}

/// The rig that comes with the program which is meant by `path`, if that is nearly its name.
fn near(path: &Path) -> String {
    let found = path.to_string_lossy();
    let off = |name: &str| {
        edit_distance(&found, name).min(edit_distance(&found, name.trim_end_matches(".toml")))
    };
    match built_in_names().min_by_key(|name| off(name)) {
        Some(name) if off(name) <= found.len() / 3 => format!("; did you mean {name}?"),
        _ => String::new(),
    }
}

/// The rig in `text`, which is called `name` in messages; files it names are looked for in
/// `base_dir`.
///
/// # Errors
/// When it is not TOML, has an unknown or missing key, or breaks a rule.
pub fn parse(text: &str, name: &str, base_dir: &Path) -> Result<RigFile, ConfigError> {
    let (tables, places) = written::read(text, name)?;
    rules::check(tables, &places, base_dir)
}

#[cfg(test)]
mod tests;
