//! Schedules: decide when photos are restored.

pub(super) mod attended;
pub(super) mod nightly;
pub(super) mod shooting;

mod before_box;

use super::error::DaemonError;
use super::job::JobEnd;
use super::store::report_file::Delivered;
use super::store::waiting::{Awaited, Waiting};
use crate::restorer::Restorer;
use crate::rig::Moment;

/// Decision of a schedule.
#[derive(Debug)]
#[allow(missing_docs)] // Fields are described with their variants.
pub enum Turn {
    /// Restore the next photo.
    Go,
    /// Restore no photo for now, for `reason`, until the moment `until` if it is known; ask again
    /// at the next scan.
    Hold { reason: String, awaited: Awaited, until: Option<Moment> },
    /// The operator is needed; ask again later.
    Help(DaemonError),
    /// Withdraw these results, put their photos back into the inbox, and ask again at once.
    Again(Vec<Delivered>),
    /// Stop the daemon.
    Stop,
}

impl Turn {
    fn hold(awaited: Awaited, reason: impl Into<String>, until: Option<Moment>) -> Turn {
        Turn::Hold { reason: reason.into(), awaited, until }
    }
}

/// The operator is needed.
impl From<DaemonError> for Turn {
    fn from(error: DaemonError) -> Turn {
        Turn::Help(error)
    }
}

/// A question to a schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Question {
    /// Complete photos in the inbox.
    pub waiting: usize,
    /// Numbers of all waiting photos, by what they wait for.
    pub parts: Waiting,
    /// Whether a complete photo can be restored now; otherwise all are deferred.
    pub is_ready: bool,
}

/// An event for a schedule.
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)] // Fields are described with their variants.
pub enum Event<'a> {
    /// A job begins: the photo's name, and its number, from 1, of those in this pass.
    Begun { photo: &'a str, number: usize, of: usize },
    /// The job has ended.
    Ended(&'a JobEnd),
    /// The operator is needed.
    Held(&'a DaemonError),
    /// The button was pressed.
    Pressed,
}

/// Decides when photos are restored. Between photos a schedule may use the rig.
pub trait Schedule {
    /// Decides what to do next; called before each photo and at each scan that finds none.
    fn turn(&mut self, _asked: Question, _rig: &mut dyn Restorer) -> Turn {
        Turn::Go
    }

    /// Receives an event.
    fn notify(&mut self, _event: Event<'_>, _rig: &mut dyn Restorer) {}

    /// Whether to scan at once and retry deferred photos; called several times a second.
    fn impatient(&self) -> bool {
        false
    }
}

/// Restores every photo at once.
impl Schedule for () {}
