//! Errors of a rig file.

use std::path::PathBuf;

use crate::remedy::{Remediable, Remedy};

/// Error of a rig file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The messages describe them.
pub enum ConfigError {
    #[error("cannot read the rig file {0}")]
    Read(PathBuf, #[source] std::io::Error),
    #[error("found no rig file {path}, allowed a file or a built-in one: {names}")]
    NoFile { path: PathBuf, names: String },
    /// Not TOML, an unknown or missing key, or an invalid value: what was found and is allowed.
    #[error("{at}: {what}")]
    Invalid { at: String, what: String },
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
