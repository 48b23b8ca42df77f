//! What can be wrong with a rig file.

use std::path::PathBuf;

use crate::frame::NpyError;
use crate::remedy::{Remediable, Remedy};

/// Why a rig file was not taken. `at` is the rig file, with the line where one is meant.
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
    /// There is none.
    #[error(
        "found no rig file {path}{near}{} one that is part of relens: {names}",
        if near.is_empty() { ", allowed a file, or" } else { " Allowed are a file, or" }
    )]
    NoFile {
        /// The name asked for.
        path: PathBuf,
        /// The one that may be meant, as a question.
        near: String,
        /// Those that are part of relens.
        names: String,
    },
    /// The text is not TOML.
    #[error("{at}: found {found}, allowed {allowed}")]
    NotToml {
        /// Where.
        at: String,
        /// What stands there.
        found: String,
        /// What may.
        allowed: &'static str,
    },
    /// A key nobody knows.
    #[error("{at}: unknown key `{key}`; {nearest}")]
    UnknownKey {
        /// Where.
        at: String,
        /// The key as written.
        key: String,
        /// The nearest known key, or all known ones, in words.
        nearest: String,
    },
    /// A key, or a table, that has no default and is not there.
    #[error("{at}: missing {what}; it has no default. What it is: {meaning}")]
    Missing {
        /// Where.
        at: String,
        /// "key refresh-hz in `[panel]`".
        what: String,
        /// What the key or the table is.
        meaning: String,
    },
    /// A value of another kind, out of its range, or at odds with another one.
    #[error("{at}: {key}: found {found}, allowed {allowed}")]
    Value {
        /// Where.
        at: String,
        /// The key with its table.
        key: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The measured blur grid cannot be read.
    #[error("{at}: lens.blur cannot be used")]
    Blur {
        /// Where.
        at: String,
        /// The cause.
        #[source]
        source: NpyError,
    },
    /// A hardware rig in a program without device support.
    #[error(
        "{at}: this is a rig of real devices, and this relens was built without them; build it \
         with `--features hardware` or use a simulated rig"
    )]
    NoHardware {
        /// Where.
        at: String,
    },
}

impl Remediable for ConfigError {
    fn remedy(&self) -> Remedy {
        Remedy::CallOperator
    }
}
