//! What can be wrong with a rig file.

use std::path::PathBuf;

use crate::frame::NpyError;
use crate::remedy::{Remediable, Remedy};

/// Why a rig file was not taken.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the rig file {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// The text is not TOML, or a value has the wrong type, or a key is missing.
    #[error("{file}:{line}: {what}")]
    Text {
        /// The rig file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What the parser says.
        what: String,
    },
    /// A key nobody knows.
    #[error("{file}:{line}: unknown key `{key}`; {nearest}")]
    UnknownKey {
        /// The rig file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The key as written.
        key: String,
        /// The nearest known key, or all known ones, in words.
        nearest: String,
    },
    /// A value out of its range, or at odds with another one.
    #[error("{file}: {key}: found {found}, allowed {allowed}")]
    Value {
        /// The rig file.
        file: String,
        /// The key with its table.
        key: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The measured blur grid cannot be read.
    #[error("{file}: lens.blur cannot be used")]
    Blur {
        /// The rig file.
        file: String,
        /// The cause.
        #[source]
        source: NpyError,
    },
    /// A hardware rig in a program without device support.
    #[error(
        "{file}: this is a rig of real devices, and this relens was built without them; build it \
         with \
         `--features hardware` or use a simulated rig"
    )]
    NoHardware {
        /// The rig file.
        file: String,
    },
}

impl Remediable for ConfigError {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}
