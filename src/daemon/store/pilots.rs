//! Log of the pilots for the morning report: one entry a pilot, the newest thousand.

use serde::{Deserialize, Serialize};

use super::folders::Folders;
use crate::disk::FileError;
use crate::disk::files::json;
use crate::nights::pilot::Drift;

/// Name of the file among the gallery's pictures.
const NAME: &str = "pilots.json";

/// Entries kept: three weeks of nights with fifty pilots each, 150 kB.
const ENTRIES_MAX: usize = 1000;

/// One pilot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) struct PilotEntry {
    /// Time, seconds since 1970 UTC.
    pub(crate) unix_s: u64,
    /// Measured drift.
    pub(crate) drift: Drift,
    /// Decision.
    pub(crate) verdict: PilotVerdict,
    /// Temperature of the board, °C, where it has a sensor.
    pub(crate) temperature_c: Option<f64>,
}

/// Decision after a pilot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PilotVerdict {
    /// The rig is not steady yet.
    Warming,
    /// The drift is within its limits.
    Good,
    /// The drift is past a limit.
    Drifted,
}

/// The entries, oldest first.
pub(crate) fn load(folders: &Folders) -> Vec<PilotEntry> {
    let path = folders.previews().join(NAME);
    folders.files().read_json(&path).ok().flatten().unwrap_or_default()
}

/// Appends `entry`.
pub(crate) fn add(folders: &Folders, entry: PilotEntry) -> Result<(), FileError> {
    let mut entries = load(folders);
    entries.push(entry);
    let beyond = entries.len().saturating_sub(ENTRIES_MAX);
    entries.drain(..beyond);
    let previews = folders.previews();
    folders.files().replace(previews, NAME.as_ref(), &json(&entries, previews)?)
}
