//! Errors of a rig file.

use std::path::PathBuf;

use crate::remedy::{Remediable, Remedy};

/// Error of a rig file. `at` is the file, with a line where one is concerned.
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
    /// The text is not TOML.
    #[error("{at}: found {found}, allowed {allowed}")]
    NotToml {
        /// File and line.
        at: String,
        /// Text found.
        found: String,
        /// Text allowed.
        allowed: &'static str,
    },
    /// Unknown key.
    #[error("{at}: unknown key `{key}`; {nearest}")]
    UnknownKey {
        /// File and line.
        at: String,
        /// Key as written.
        key: String,
        /// Hint: the nearest known key, or all known keys.
        nearest: String,
    },
    /// Missing key or table without a default.
    #[error("{at}: missing {what}, which has no default: {meaning}")]
    Missing {
        /// File and line.
        at: String,
        /// Key or table, such as "key refresh-hz in `[panel]`".
        what: String,
        /// Documentation of the key or table.
        meaning: String,
    },
    /// Value of a wrong type, out of range, or inconsistent with another one.
    #[error("{at}: {key}: found {found}, allowed {allowed}")]
    Value {
        /// File and line.
        at: String,
        /// Key with its table.
        key: String,
        /// Value found.
        found: String,
        /// Values allowed.
        allowed: String,
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
