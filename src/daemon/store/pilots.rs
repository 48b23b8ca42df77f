//! What the pilots said, for the morning report: one line a pilot, the newest thousand.

use serde::{Deserialize, Serialize};

use super::folders::Folders;
use crate::disk::FileError;
use crate::disk::files::json;
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
pub(crate) struct PilotEntry {
    /// When, seconds since 1970 UTC.
    pub(crate) unix_s: u64,
    /// How far the rig had drifted.
    pub(crate) drift: Drift,
    /// What followed.
    pub(crate) verdict: PilotVerdict,
    /// Temperature of the board, if it tells.
    pub(crate) temperature_c: Option<f64>,
}

/// What follows from a pilot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PilotVerdict {
    /// The rig is not steady yet.
    Warming,
    /// All is well.
    Good,
    /// The rig is no longer what was calibrated.
    Drifted,
}

/// What the pilots said, oldest first.
pub(crate) fn load(folders: &Folders) -> Vec<PilotEntry> {
    let path = folders.previews().join(NAME);
    folders.files().read_json(&path, BYTES_MAX).ok().flatten().unwrap_or_default()
}

/// Adds `entry`.
pub(crate) fn add(folders: &Folders, entry: PilotEntry) -> Result<(), FileError> {
    let mut entries = load(folders);
    entries.push(entry);
    let beyond = entries.len().saturating_sub(ENTRIES_MAX);
    entries.drain(..beyond);
    let previews = folders.previews();
    folders.files().replace(previews, NAME.as_ref(), &json(&entries, previews)?)
}
