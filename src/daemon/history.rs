//! What the pilots said, for the morning report: one line a pilot, the newest thousand.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{DaemonError, atomic_file};
use crate::disk::Disk;
use crate::nights::pilot::Drift;

/// Name of the file among the gallery's pictures.
const NAME: &str = "pilots.json";

/// Entries kept: three weeks of nights with fifty pilots each, 150 kB.
const ENTRIES_MAX: usize = 1000;

/// A longer file is not ours.
const BYTES_MAX: u64 = 1 << 20;

/// What one pilot said.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) struct Entry {
    /// When, seconds since 1970 UTC.
    pub(super) unix_s: u64,
    /// How far the rig had drifted.
    pub(super) drift: Drift,
    /// What followed.
    pub(super) verdict: Verdict,
    /// Temperature of the board, if it tells.
    pub(super) temperature_c: Option<f64>,
}

/// What follows from a pilot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Verdict {
    /// The rig is not steady yet.
    Warming,
    /// All is well.
    Good,
    /// The rig is no longer what was calibrated.
    Drifted,
}

/// The entries under the folder of the gallery's pictures, oldest first.
pub(super) fn load(disk: &dyn Disk, folder: &Path) -> Vec<Entry> {
    let read = atomic_file::read(disk, &folder.join(NAME), BYTES_MAX).ok().flatten();
    read.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
}

/// Adds `entry`.
///
/// # Errors
/// When it cannot be written.
pub(super) fn add(disk: &dyn Disk, folder: &Path, entry: Entry) -> Result<(), DaemonError> {
    let mut entries = load(disk, folder);
    entries.push(entry);
    let beyond = entries.len().saturating_sub(ENTRIES_MAX);
    entries.drain(..beyond);
    let bytes = serde_json::to_vec(&entries).map_err(std::io::Error::other);
    atomic_file::replace(
        disk,
        folder,
        NAME.as_ref(),
        &bytes.map_err(DaemonError::files("write", folder))?,
    )
}
