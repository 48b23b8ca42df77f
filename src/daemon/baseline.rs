//! The pilot's reading right after a calibration, kept beside it: what drift is counted from.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{DaemonError, atomic_file};
use crate::disk::LocalDisk;
use crate::nights::pilot::Reading;

/// Name of the file beside the calibration's slots.
const NAME: &str = "pilot.json";

#[derive(Serialize, Deserialize)]
struct Kept {
    /// Of the calibration it belongs to.
    generation: u32,
    reading: Reading,
}

/// The reading that belongs to calibration `generation`, if there is one.
pub(super) fn load(slots: &Path, generation: u32) -> Option<Reading> {
    let kept: Kept = serde_json::from_slice(&std::fs::read(slots.join(NAME)).ok()?).ok()?;
    (kept.generation == generation).then_some(kept.reading)
}

/// Keeps `reading`. One that cannot be kept is made again by the next pilot.
pub(super) fn save(slots: &Path, generation: u32, reading: &Reading) {
    let kept = Kept { generation, reading: *reading };
    let saved = serde_json::to_vec(&kept).map_err(std::io::Error::other);
    let saved = saved.and_then(|bytes| Ok((bytes, slots.canonicalize()?)));
    let saved = saved.map_err(DaemonError::files("write", slots)).and_then(|(bytes, slots)| {
        let disk = LocalDisk::new(vec![slots.clone()]);
        atomic_file::replace(&disk, &slots, NAME.as_ref(), &bytes)?;
        atomic_file::sync_folder(&disk, &slots)
    });
    if let Err(error) = saved {
        log::warn!("the pilot's reading is not kept: {}", crate::remedy::full_message(&error));
    }
}
