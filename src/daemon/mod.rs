//! The drop folder: photos in, restored photos out, nothing lost at any instant.
//!
//! [`store`] moves the files, [`report`] writes the gallery and the state, [`schedule`] decides
//! when photos are restored (button, night), [`job`] processes one photo, and [`run`] is the loop.
//! Disk operations go through [`Disk`](crate::disk::Disk); photos are decoded in a
//! [`worker`](crate::picture::worker) process.
//!
//! The daemon acts on an error's [`Remedy`](crate::remedy::Remedy) alone. Restoration, observers
//! and schedules are behind the traits [`Restorer`], [`Watcher`] and [`Schedule`].

mod clocks;
mod error;
mod job;
pub mod log_writer;
mod report;
mod run;
mod schedule;
pub mod service;
mod setting;
mod store;
mod watcher;

pub use error::DaemonError;
pub use job::JobEnd;
pub use report::gallery::SCENES;
pub use report::state::{Doing, State};
pub use report::summary::{PhotoCounts, Summary};
pub use run::Daemon;
pub use schedule::attended::{Attended, interruption};
pub use schedule::nightly::{Nightly, Times};
pub use schedule::shooting::Shooting;
pub use schedule::{Event, Question, Schedule, Turn};
pub use setting::DaemonSetting;
pub use store::claim::JobStep;
pub use store::folders::Folders;
pub use store::report_file::{Delivered, Failed, Report, ResultKind};
pub use store::waiting::{Awaited, Waiting};
pub use watcher::Watcher;

pub use crate::restorer::{Progress, Restorer};
