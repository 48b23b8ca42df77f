//! What of a night survives a reboot.

use serde::{Deserialize, Serialize};

use super::folders::Folders;
use super::report_file::Delivered;
use crate::disk::FileError;
use crate::disk::files::json;

/// Name of the file in the root.
const NAME: &str = ".relens-night.json";

/// A longer file is not ours: room for the names of ten thousand photos.
const BYTES_MAX: u64 = 16 << 20;

/// What of a night survives a reboot.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct NightRecord {
    /// The latest believed time.
    pub(crate) floor_unix_s: f64,
    /// Photos restored since the last good pilot.
    pub(crate) unproven: Vec<Delivered>,
    /// A pilot was past its limits since then: they are to be restored anew.
    pub(crate) doubted: bool,
    /// They are being put back.
    pub(crate) again: bool,
    /// Photos that wait, and what keeps them. (The name is that of the files there are.)
    #[serde(default, rename = "vigil")]
    pub(crate) waiting: WaitingRecord,
}

/// Photos that wait, and what keeps them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct WaitingRecord {
    /// Since when photos wait, none being restored; `None` when none wait.
    pub(crate) since_unix_s: Option<f64>,
    /// What kept them from being restored, and when that was so last, if the time was known.
    pub(crate) obstacle: Option<(Option<f64>, String)>,
}

impl WaitingRecord {
    /// Whether this says what `other` does, but for less than an hour: one small write an hour.
    pub(crate) fn is_like(&self, other: &WaitingRecord) -> bool {
        let near = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < 3600.0,
            (a, b) => a.is_some() == b.is_some(),
        };
        near(self.since_unix_s, other.since_unix_s)
            && match (&self.obstacle, &other.obstacle) {
                (Some((a, words)), Some((b, others))) => near(*a, *b) && words == others,
                (a, b) => a.is_some() == b.is_some(),
            }
    }
}

impl NightRecord {
    /// The record in `folders`; an empty one when none is readable.
    pub(crate) fn load(folders: &Folders) -> Result<NightRecord, FileError> {
        let found = folders.files().read_json(&folders.root().join(NAME), BYTES_MAX)?;
        Ok(found.unwrap_or_default())
    }

    /// Writes it down, to last.
    pub(crate) fn save(&self, folders: &Folders) -> Result<(), FileError> {
        let root = folders.root();
        folders.files().replace_for_good(root, NAME.as_ref(), &json(self, root)?)
    }
}
