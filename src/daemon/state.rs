//! The state file, which `relens status` reads while the daemon works.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{DaemonError, Folders, atomic_file};

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

/// The daemon's state as last written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct State {
    /// Name of the rig.
    pub rig: String,
    /// What it is doing.
    pub doing: Doing,
    /// Photos with a result since it was started.
    pub restored: usize,
    /// Photos set aside since it was started.
    pub failed: usize,
    /// Photos put back into the inbox to be tried later.
    pub left: usize,
    /// What the operator should know though the box goes on: a night that was missed, a button that
    /// hangs; a sentence each.
    #[serde(default)]
    pub attention: Vec<String>,
    /// When this was written, seconds since 1970 UTC by the box's calendar.
    pub written_unix_s: u64,
}

impl State {
    /// The state of a daemon that has done nothing yet, on the rig called `rig`.
    pub fn new(rig: &str, doing: Doing, written_unix_s: u64) -> State {
        State {
            rig: rig.to_owned(),
            doing,
            restored: 0,
            failed: 0,
            left: 0,
            attention: Vec::new(),
            written_unix_s,
        }
    }

    /// Writes the state down, whole.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, folders: &Folders) -> Result<(), DaemonError> {
        let bytes = serde_json::to_vec_pretty(self).map_err(std::io::Error::other);
        atomic_file::replace_for_now(
            folders.disk(),
            &folders.home(),
            NAME.as_ref(),
            &bytes.map_err(DaemonError::files("write", folders.root()))?,
        )
    }

    /// The state last written under `root`; `None` when no daemon ever worked there.
    ///
    /// # Errors
    /// When the file is there and cannot be read.
    pub fn read(root: &Path) -> Result<Option<State>, DaemonError> {
        let path = root.join(NAME);
        match std::fs::read(&path) {
            Ok(bytes) => serde_json::from_slice(&bytes)
                .map(Some)
                .map_err(|e| DaemonError::files("read the state", &path)(e.into())),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(DaemonError::files("read the state", &path)(error)),
        }
    }
}
