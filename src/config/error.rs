//! Errors of a rig file.

use std::path::PathBuf;

use crate::remedy::{Remediable, Remedy};

/// Error of a rig file.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the rig file {0}")]
    Read(PathBuf, #[source] std::io::Error),
    /// There is no such file.
    #[error(
        "found no rig file {path}{near}{} a file or a built-in one: {names}",
        if near.is_empty() { ", allowed" } else { " Allowed:" }
    )]
    NoFile {
        /// Requested name.
        path: PathBuf,
        /// Suggestion of a built-in rig file.
        near: String,
        /// Names of the built-in rig files.
        names: String,
    },
    /// Not TOML, an unknown or missing key, or an invalid value: what was found and is allowed.
    #[error("{at}: {what}")]
    Invalid {
        /// File and line.
        at: String,
        /// The fault.
        what: String,
    },
    /// Real rig, in this file, in a program without device support.
    #[error(
        "{0}: this is a rig of real devices, but this relens was built without support for them; \
         build it with `--features hardware` or use a simulated rig"
    )]
    NoHardware(String),
}

impl Remediable for ConfigError {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}
