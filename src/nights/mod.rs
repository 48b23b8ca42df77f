//! Nights: when they are, whether the clock may be believed, and whether the rig still is what was
//! calibrated.
//!
//! [`window`] knows the hours, through daylight saving; [`trust`] whether the calendar is one to go
//! by; [`pilot`] shows one known picture and reads from its captures how far the rig has drifted;
//! [`warm_up`] waits until it no longer does. What follows from all that is decided in
//! [`crate::daemon`].

pub mod pilot;
pub mod trust;
pub mod warm_up;
pub mod window;
