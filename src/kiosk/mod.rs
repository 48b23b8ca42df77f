//! What a box shows to the one who stands before it: lamps, screens, and what it makes of a press.
//!
//! ```text
//! button ─ edge, then level ─► [`press`] ─► [`desk`] ─► [`lamp`] lit at once
//!                                             │  ▲
//!                                     presses ▼  │ state
//!                                          [`front`], shared with the daemon ─► [`screen`] on the panel, between jobs
//! ```
//!
//! The desk runs on a thread of its own and touches neither camera, panel nor disk: a press is
//! acknowledged whatever the daemon is doing.

pub mod desk;
pub mod front;
pub mod lamp;
pub mod press;
pub mod screen;

mod drawing;
pub mod lettering;
