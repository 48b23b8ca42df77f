//! The drop folder with a restorer that only brightens: what goes in, what comes out, what survives
//! a stop.

// The functions that the tests share stop a test as the tests themselves do.
#![allow(clippy::unwrap_used)]
// One crate of a few files, which share by `pub`.
#![allow(unreachable_pub)]

mod attended;
mod bed;
mod faults;
mod files;
mod hostile;
mod keeping;
mod model_disk;
mod neighbours_of_bad;
mod power;
mod power_checks;
mod readiness;
mod remedies;
mod shooting;
mod shooting_rig;
mod slots;
mod soak;
mod stops;
mod turns;
mod withdrawal;
