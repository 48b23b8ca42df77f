//! Simulated rigs against the simulator's truth: calibration, restoration of photos, and operation
//! over nights.

// A failed unwrap is a failed test, also in shared functions. Measured values are printed beside
// assertions; `--nocapture` shows them.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod averaged;
mod binned;
mod broad_light;
mod calibration;
mod colour_focus;
mod computed_optics;
mod divergence;
mod focus;
mod lateral_colour;
mod method;
mod nights;
#[path = "../golden/npy.rs"]
mod npy;
mod operating_point;
mod own_sensor;
mod raw_file;
mod raw_sites;
mod restorer;
mod timing;
mod truthful;
mod wander;
mod whole_sensor;

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock};

use relens::calibration::Calibration;
use relens::config::{self, RigFile};
use relens::measurement::{CalibrateError, calibrate, to_the_end};
use relens::rig::simulated;

/// Loads the built-in rig file `name`.
fn load(name: &str) -> RigFile {
    config::load(Path::new(name)).unwrap()
}

type Found = Arc<OnceLock<Result<Calibration, CalibrateError>>>;

/// Calibrates the newly opened simulated rig of `rig`, once for all tests of the same rig.
fn measured(rig: &RigFile) -> Result<Calibration, String> {
    static FOUND: OnceLock<Mutex<HashMap<String, Found>>> = OnceLock::new();
    // A calibration does not depend on methods.
    let asked = RigFile { restore: load("small.toml").restore, ..rig.clone() };
    let found = Arc::clone(
        FOUND.get_or_init(Mutex::default).lock().unwrap().entry(format!("{asked:?}")).or_default(),
    );
    let measure = || calibrate(&mut simulated::open(rig).unwrap().0, rig, None, &mut to_the_end);
    found
        .get_or_init(measure)
        .as_ref()
        .cloned()
        .map_err(|error| relens::remedy::full_message(error))
}
