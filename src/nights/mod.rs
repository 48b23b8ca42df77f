//! Nights: hours, trust in the calendar, drift of the rig since its calibration.
//!
//! [`window`] has the hours, also across daylight saving; [`trust`] judges the calendar; [`pilot`]
//! measures drift with one known picture; [`warm_up`] waits for the rig to become steady. The
//! daemon decides what follows.

pub mod pilot;
pub mod trust;
pub mod warm_up;
pub mod window;
