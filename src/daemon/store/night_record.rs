//! State of the nights that survives a reboot.

use serde::{Deserialize, Serialize};

use super::folders::Folders;
use super::report_file::Delivered;
use crate::disk::FileError;
use crate::disk::files::json;

const NAME: &str = ".relens-night.json";

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct NightRecord {
    /// Latest trusted time, seconds since 1970 UTC.
    pub(crate) floor_unix_s: f64,
    /// Photos restored since the last good pilot.
    pub(crate) unproven: Vec<Delivered>,
    /// Whether a pilot since then was past its limits, so that those photos must be restored again.
    pub(crate) must_repeat: bool,
    /// Whether those photos are being put back into the inbox.
    pub(crate) is_withdrawing: bool,
}

impl NightRecord {
    /// Reads the record in `folders`; empty if there is none or it is damaged.
    pub(crate) fn load(folders: &Folders) -> Result<NightRecord, FileError> {
        let found = folders.files.read_json(&folders.root.join(NAME))?;
        Ok(found.unwrap_or_default())
    }

    /// Writes the record, synchronised.
    pub(crate) fn save(&self, folders: &Folders) -> Result<(), FileError> {
        let path = folders.root.join(NAME);
        folders.files.replace_for_good(&path, &json(self, &path)?)
    }
}
