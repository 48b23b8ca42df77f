//! The state file, which `relens status` reads while the daemon works.

use std::io::{Error, ErrorKind};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::summary::PhotoCounts;
use crate::daemon::store::folders::Folders;
use crate::disk::FileError;
use crate::disk::files::json_in_lines;

/// Name of the state file in the root.
const NAME: &str = ".relens-state.json";

/// What the daemon is doing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "is")]
pub enum Doing {
    /// Nothing is waiting.
    Waiting,
    /// A photo is being restored.
    Restoring {
        /// Its name.
        photo: String,
        /// Share of it that is done, 0..1.
        #[serde(default)]
        done: f64,
        /// Seconds until it and those that wait for their turn are done, a guess by the last ones.
        #[serde(default)]
        left_s: Option<f64>,
    },
    /// Photos wait for their time: the button, the night.
    Paused {
        /// For what.
        reason: String,
    },
    /// Nothing goes on until the operator has helped.
    Held {
        /// Why.
        reason: String,
    },
    /// The daemon has ended in good order.
    Ended,
}

impl std::fmt::Display for Doing {
    /// For the page.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Doing::Waiting => f.write_str("Ready"),
            Doing::Restoring { photo, done, left_s } => {
                write!(f, "Restoring {photo}: {:.0} % done", 100.0 * done)?;
                left_s.map_or(Ok(()), |left_s| write!(f, ", about {left_s:.0} s left"))
            }
            Doing::Paused { reason } => write!(f, "Not now: {reason}"),
            Doing::Held { reason } => write!(f, "Somebody is needed: {reason}"),
            Doing::Ended => f.write_str("Switched off"),
        }
    }
}

/// The daemon's state as last written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct State {
    /// Name of the rig.
    pub rig: String,
    /// What it is doing.
    pub doing: Doing,
    /// What became of the photos whose results and reasons are there, and how many wait.
    #[serde(flatten)]
    pub counts: PhotoCounts,
    /// What the operator should know though the box goes on: a night that was missed, a button that
    /// hangs; a sentence each.
    #[serde(default)]
    pub attention: Vec<String>,
    /// Whether photos wait for a button: pressed for nothing on a box that takes them as they come.
    #[serde(default = "yes")]
    pub needs_button: bool,
    /// When this was written, seconds since 1970 UTC by the box's calendar.
    pub written_unix_s: u64,
}

/// What is said of a file that a daemon did not write, or another version's.
fn not_a_state() -> Error {
    Error::new(ErrorKind::InvalidData, "it is not what this version of relens writes")
}

/// What is taken for granted of a box that says nothing.
fn yes() -> bool {
    true
}

impl State {
    /// The state of a daemon that has done nothing yet, on the rig called `rig`.
    pub fn new(rig: &str, doing: Doing, written_unix_s: u64) -> State {
        State {
            rig: rig.to_owned(),
            doing,
            counts: PhotoCounts::default(),
            attention: Vec::new(),
            needs_button: yes(),
            written_unix_s,
        }
    }

    /// Writes the state down, whole.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, folders: &Folders) -> Result<(), FileError> {
        let root = folders.root();
        let bytes = json_in_lines(self, root)?;
        folders.files().replace_for_now(root, NAME.as_ref(), &bytes)
    }

    /// The state last written under `root`; `None` when no daemon ever worked there.
    ///
    /// # Errors
    /// When the file is there and cannot be read.
    pub fn read(root: &Path) -> Result<Option<State>, FileError> {
        let path = root.join(NAME);
        let read = match std::fs::read(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            read => {
                read.and_then(|bytes| serde_json::from_slice(&bytes).map_err(|_| not_a_state()))
            }
        };
        read.map(Some).map_err(FileError::at("read the state", &path))
    }
}
