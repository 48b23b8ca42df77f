//! When photos may be taken: asked before each one, told what became of each.

use std::ffi::OsStr;

use super::{Failed, Report, Restorer};
use crate::rig::Moment;

/// What may happen next.
#[derive(Debug, Clone, PartialEq)]
pub enum Turn {
    /// The oldest photo may be taken.
    Go,
    /// None may be taken for now; it is asked again at the next look.
    Hold {
        /// Why, for the state file and the log.
        reason: String,
        /// Not before this moment on the daemon's clock, if that is known.
        until: Option<Moment>,
    },
    /// The daemon is to end in good order.
    Stop,
}

/// What became of a photo.
#[derive(Debug, Clone, Copy)]
pub enum Ended<'a> {
    /// Its result is in the outbox.
    Restored {
        /// The report beside it.
        report: &'a Report,
        /// Name of the original in `done`.
        kept: &'a OsStr,
    },
    /// It is in `failed`.
    Failed(&'a Failed),
    /// It is back in the inbox.
    Left(&'a Failed),
}

/// Decides when photos may be taken. Between photos the rig is the schedule's to use.
pub trait Schedule {
    /// Asked before each photo is taken, with the number of those that are ready.
    fn before(&mut self, waiting: usize, rig: &mut dyn Restorer) -> Turn {
        let _ = (waiting, rig);
        Turn::Go
    }

    /// Told what became of the photo taken last.
    fn after(&mut self, ended: Ended<'_>, rig: &mut dyn Restorer) {
        let _ = (ended, rig);
    }

    /// Called at each look at the inbox that finds nothing to take; `waiting` photos rest until they are
    /// tried again.
    fn idle(&mut self, waiting: usize, rig: &mut dyn Restorer) {
        let _ = (waiting, rig);
    }

    /// Whether to look again now, ahead of time. Asked several times a second.
    fn wakes(&self) -> bool {
        false
    }
}

/// Every photo at once.
impl Schedule for () {}
