//! The drop folder: photos in, restored photos out, and at every instant nothing lost.
//!
//! ```text
//! inbox/a.jpg ─claim (rename)─► working/a.jpg ─ read, restore ─► outbox/a.jpg.json, outbox/a.jpg, index.html
//!                                    │                                  only then
//!                                    ├─────────────────────────────► done/a.jpg
//!                                    └─ cannot be restored ─────────► failed/a.jpg, failed/a.jpg.txt
//! ```
//!
//! A photo is in exactly one of `inbox`, `working`, `done`, `failed`. Results are whole or absent
//! (temporary file, fsync, rename, fsync of the folder); no name is ever overwritten, a second one
//! gets a number. Whatever instant the power fails at, [`Folders::open`] finishes or takes back
//! what was under way; whatever a disk does to a living daemon, the next look at the inbox does
//! (`rollback`). Everything asked of a disk goes through [`Disk`](crate::disk::Disk), and a photo's
//! bytes are read in a [`worker`](crate::picture::worker) process.
//!
//! The daemon decides by an error's [`Remedy`](crate::remedy::Remedy) alone. What restores is
//! behind [`Restorer`]; what watches (a terminal, a test) behind [`Watcher`]; what decides when
//! photos may be taken behind [`Schedule`].

mod atomic_file;
mod attended;
mod delivery;
mod error;
mod folders;
mod gallery;
mod hints;
mod history;
mod inbox;
mod job;
mod keeping;
mod lease;
mod ledger;
pub mod log_writer;
mod nightly;
mod reader;
mod recovery;
mod report;
mod rollback;
mod run;
mod schedule;
pub mod service;
mod setting;
mod state;
mod vigil;
mod watcher;
mod withdrawal;

pub use attended::{Attended, interruption};
pub use error::DaemonError;
pub use folders::Folders;
pub use gallery::write_report;
pub use nightly::{Nightly, Times};
pub use reader::Reader;
pub use report::{Failed, Report, ReportedOutcome};
pub use run::{Daemon, Summary};
pub use schedule::{Ended, Schedule, Turn};
pub use setting::Setting;
pub use state::{Doing, State};
pub use vigil::Missed;
pub use watcher::{Step, Watcher};
pub use withdrawal::Delivered;

pub use crate::restorer::{Progress, Restorer};
