//! When photos may be taken: asked before each one, told what became of each.

use super::vigil::Missed;
use super::withdrawal::Delivered;
use super::{DaemonError, Failed, Report, Restorer};
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
        /// When that will change on the daemon's clock, if it is known: it is asked again then, and
        /// before that every quarter of a minute.
        until: Option<Moment>,
    },
    /// Nothing goes on until somebody has helped; it is asked again after a while.
    Help {
        /// What is wrong.
        reason: String,
    },
    /// These results cannot be stood by: withdrawn, and their photos put back into the inbox. Asked
    /// again at once.
    Again(Vec<Delivered>),
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
        /// Name of the original in `done`, and of the result in the outbox.
        delivered: &'a Delivered,
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

    /// Told that a photo is begun: its name, its number in this go and how many there are.
    fn begun(&mut self, photo: &str, number: usize, of: usize, rig: &mut dyn Restorer) {
        let _ = (photo, number, of, rig);
    }

    /// Told what became of the photo taken last.
    fn after(&mut self, ended: Ended<'_>, rig: &mut dyn Restorer) {
        let _ = (ended, rig);
    }

    /// Asked at each look at the inbox that finds nothing to take; `waiting` photos rest until they
    /// are tried again.
    fn idle(&mut self, waiting: usize, rig: &mut dyn Restorer) -> Turn {
        let _ = (waiting, rig);
        Turn::Go
    }

    /// Photos and results that may still be asked back with [`Turn::Again`]: not to be removed.
    fn unproven(&self) -> &[Delivered] {
        &[]
    }

    /// Told that nothing goes on until somebody has helped.
    fn held(&mut self, error: &DaemonError, rig: &mut dyn Restorer) {
        let _ = (error, rig);
    }

    /// Told that `waiting` photos wait for something that is not this schedule's to say, and for
    /// what.
    fn kept_waiting(&mut self, waiting: usize, why: &str) {
        let _ = (waiting, why);
    }

    /// A whole night that passed without a photo being restored though photos wait, until one is.
    fn missed(&self) -> Option<Missed> {
        None
    }

    /// What the operator should know though work goes on or waits, in a sentence each.
    fn attention(&self) -> Vec<String> {
        self.missed().iter().map(Missed::to_string).collect()
    }

    /// Whether to look again now, ahead of time, and to try what rests. Asked several times a
    /// second.
    fn impatient(&self) -> bool {
        false
    }
}

/// Every photo at once.
impl Schedule for () {}
