//! The state file, which `relens status` reads.

use std::io::{Error, ErrorKind};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::summary::PhotoCounts;
use crate::daemon::store::folders::Folders;
use crate::disk::FileError;
use crate::disk::files::json_in_lines;

const NAME: &str = ".relens-state.json";

/// State of the daemon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "is")]
#[allow(missing_docs)] // Fields are described with their variants.
pub enum Doing {
    /// No photo waits.
    Waiting,
    /// A photo is being restored: its progress, 0..1, and the estimated seconds until it and the
    /// waiting photos are done.
    Restoring { photo: String, done: f64, remaining_s: Option<f64> },
    /// Photos wait for button, panel or night.
    Paused { reason: String },
    /// The operator is needed.
    Held { reason: String },
    /// The daemon has stopped.
    Ended,
}

impl std::fmt::Display for Doing {
    /// The status line of the gallery.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Doing::Waiting => f.write_str("Ready"),
            Doing::Restoring { photo, done, remaining_s } => {
                write!(f, "Restoring {photo}: {:.0} % done", 100.0 * done)?;
                remaining_s.map_or(Ok(()), |s| write!(f, ", about {s:.0} s to go"))
            }
            Doing::Paused { reason } => write!(f, "Waiting: {reason}"),
            Doing::Held { reason } => write!(f, "Help needed: {reason}"),
            Doing::Ended => f.write_str("Switched off"),
        }
    }
}

/// Contents of the state file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)] // The names describe them.
pub struct State {
    pub rig: String,
    pub doing: Doing,
    #[serde(flatten)]
    pub counts: PhotoCounts,
    pub needs_button: bool,
    /// Time of writing, seconds since 1970 UTC by the box's calendar.
    pub written_unix_s: u64,
}

impl State {
    /// The state of a new daemon on the rig called `rig`.
    pub fn new(rig: &str, doing: Doing, written_unix_s: u64) -> State {
        State {
            rig: rig.to_owned(),
            doing,
            counts: PhotoCounts::default(),
            needs_button: true,
            written_unix_s,
        }
    }

    /// Writes the state file, atomically.
    pub fn write(&self, folders: &Folders) -> Result<(), FileError> {
        let path = folders.root.join(NAME);
        folders.files.replace_for_now(&path, &json_in_lines(self, &path)?)
    }

    /// Reads the state file under `root`; `None` when there is none.
    pub fn read(root: &Path) -> Result<Option<State>, FileError> {
        let path = root.join(NAME);
        let read = match std::fs::read(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            read => read.and_then(|bytes| {
                let what = "not a state file of this version of relens";
                serde_json::from_slice(&bytes).map_err(|_| Error::new(ErrorKind::InvalidData, what))
            }),
        };
        read.map(Some).map_err(FileError::at("read the state", &path))
    }
}
