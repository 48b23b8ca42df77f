//! What a box shows to the one who stands before it: lamps, screens, and what it makes of a press.
//!
//! ```text
//! button ─ edge, then level ─► [`press`] ─► [`attend`] ─► [`lamp`] lit at once
//!                                             │  ▲
//!                                     presses ▼  │ state
//!                                      [`front_panel`], shared with the daemon ─► [`screen`]
//! ```
//!
//! [`attend`] runs on a thread of its own and touches neither camera, panel nor disk: a press is
//! acknowledged whatever the daemon is doing. Screens are shown on the rig's panel, between jobs.

pub mod attend;
pub mod front_panel;
pub mod lamp;
pub mod press;
pub mod screen;

mod drawing;
pub mod lettering;
