//! The pilot's reading right after a calibration, from which drift is measured, kept beside it.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{keep, kept};
use crate::disk::files::json;
use crate::nights::pilot::PilotReading;
use crate::remedy::full_message;

const NAME: &str = "pilot.json";

#[derive(Serialize, Deserialize)]
struct Baseline {
    /// Generation of the calibration that the reading belongs to.
    generation: u32,
    reading: PilotReading,
}

/// The reading of calibration `generation`, if there is one.
pub(super) fn load(slots: &Path, generation: u32) -> Option<PilotReading> {
    let baseline: Baseline = serde_json::from_slice(&kept(slots, NAME).ok()??).ok()?;
    (baseline.generation == generation).then_some(baseline.reading)
}

/// Keeps `reading` for calibration `generation`; if that fails, the next pilot replaces it.
pub(super) fn save(slots: &Path, generation: u32, reading: &PilotReading) {
    let baseline = Baseline { generation, reading: *reading };
    let bytes = json(&baseline, &slots.join(NAME));
    if let Err(error) = bytes.and_then(|bytes| keep(slots, NAME, &bytes)) {
        log::warn!("the pilot's reading is not kept: {}", full_message(&error));
    }
}
