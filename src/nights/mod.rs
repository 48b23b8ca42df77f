//! Nights: hours, trust in the calendar, drift of the rig since its calibration.
//!
//! [`window`] computes the hours, across daylight saving too; [`trust`] judges the calendar;
//! [`pilot`] measures drift with one known picture; [`warm_up`] waits for the rig to become steady.
//! The daemon decides what to do about them.

pub mod pilot;
pub mod trust;
pub mod warm_up;
pub mod window;
