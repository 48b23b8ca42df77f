//! The user interface of a box: lamps, screens, button.
//!
//! ```text
//! button ─ edge, then level ─► [`press`] ─► [`attend`] ─► [`lamp`] at once
//!                                             │  ▲
//!                                     presses ▼  │ state
//!                                      [`front_panel`], shared with the daemon ─► [`screen`]
//! ```
//!
//! [`attend`] runs on its own thread and uses neither camera, panel nor disk, so that a press is
//! acknowledged whatever the daemon is doing. Screens are shown on the rig's panel between jobs.

pub mod attend;
pub mod front_panel;
pub mod lamp;
pub mod press;
pub mod screen;

mod drawing;
pub mod lettering;
