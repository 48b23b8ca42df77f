//! The drop folder: photos in, restored photos out, and at every instant nothing lost.
//!
//! [`store`] knows what lies on the disk and moves it, [`report`] tells of it, [`schedule`] gives
//! turns (the button's, the night's), [`job`] takes one photo through, and [`run`] is the loop.
//! Everything asked of a disk goes through [`Disk`](crate::disk::Disk), and a photo's bytes are
//! read in a [`worker`](crate::picture::worker) process.
//!
//! The daemon decides by an error's [`Remedy`](crate::remedy::Remedy) alone. What restores is
//! behind [`Restorer`]; what watches (a terminal, a test) behind [`Watcher`]; what decides when
//! photos may be taken behind [`Schedule`].

mod error;
mod job;
pub mod log_writer;
mod reader;
mod report;
mod run;
mod schedule;
pub mod service;
mod setting;
mod store;
mod watcher;

pub use error::DaemonError;
pub use job::JobEnd;
pub use reader::Reader;
pub use report::gallery::{SCENES, write_report};
pub use report::state::{Doing, State};
pub use report::summary::{PhotoCounts, Summary};
pub use run::Daemon;
pub use schedule::attended::{Attended, interruption};
pub use schedule::nightly::{Nightly, Times};
pub use schedule::{Event, Notice, Question, Schedule, Turn};
pub use setting::DaemonSetting;
pub use store::claim::JobStep;
pub use store::error::FolderError;
pub use store::folders::Folders;
pub use store::report_file::{Delivered, Failed, Report, ResultKind};
pub use store::waiting::{Awaited, Waiting};
pub use watcher::Watcher;

pub use crate::restorer::{Progress, Restorer};
