//! The drop folder, with a restorer that only brightens.

// Shared test functions may panic as tests do.
#![allow(clippy::unwrap_used)]
// Files of one test crate share items with `pub`.
#![allow(unreachable_pub)]

mod attended;
mod bed;
mod clocks;
mod faults;
mod files;
mod hostile;
mod model_disk;
mod neighbours_of_bad;
mod places;
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
