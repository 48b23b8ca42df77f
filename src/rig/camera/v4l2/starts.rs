//! Record of failed starts of boards' cameras. After the second failure the operator is called:
//! rp1-cfe crashes the kernel when a sensor fails to start while its front end is unused
//! (raspberrypi/linux, issue 7398).

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::config::MediaGraph;
use crate::rig::RigError;
use crate::rig::camera::memory::refused;

/// Failed starts after which the sensor is not started again until the program restarts.
const FAILURES_MAX: usize = 2;

/// Sensors that failed to start, once for each failure since the last success.
static FAILED: Mutex<Vec<String>> = Mutex::new(Vec::new());

fn failed() -> MutexGuard<'static, Vec<String>> {
    FAILED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn name(graph: &MediaGraph) -> &String {
    graph.sensor.as_ref().unwrap_or(&graph.capture)
}

/// Checks that the sensor of `graph` has failed to start fewer than [`FAILURES_MAX`] times.
pub(super) fn check(graph: &MediaGraph) -> Result<(), RigError> {
    let failures = failed().iter().filter(|one| *one == name(graph)).count();
    if failures < FAILURES_MAX {
        return Ok(());
    }
    Err(refused(
        format!("{:?}, which failed to start {failures} times", name(graph)),
        "a sensor that starts: switch the board off, press the ribbon into both sockets, and \
         switch the board on",
    ))
}

pub(super) fn record(graph: &MediaGraph, has_started: bool) {
    let mut failed = failed();
    match has_started {
        true => failed.retain(|one| one != name(graph)),
        false => failed.push(name(graph).clone()),
    }
}
