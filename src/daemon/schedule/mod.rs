//! When photos may be taken: asked before each one, told what became of each.

pub(super) mod attended;
pub(super) mod nightly;

mod alarm;
mod before_box;
mod shooting;

use super::error::DaemonError;
use super::job::JobEnd;
use super::store::report_file::Delivered;
use super::store::waiting::{Awaited, Waiting};
use crate::restorer::Restorer;
use crate::rig::Moment;

/// What may happen next.
#[derive(Debug)]
pub enum Turn {
    /// The oldest photo may be taken.
    Go,
    /// None may be taken for now; it is asked again at the next look.
    Hold {
        /// Why, for the state file and the log.
        reason: String,
        /// What the photos wait for.
        awaited: Awaited,
        /// When that will change on the daemon's clock, if it is known: it is asked again then, and
        /// before that every quarter of a minute.
        until: Option<Moment>,
    },
    /// Nothing goes on until somebody has helped; it is asked again after a while.
    Help(DaemonError),
    /// These results cannot be stood by: withdrawn, and their photos put back into the inbox. Asked
    /// again at once.
    Again(Vec<Delivered>),
    /// The daemon is to end in good order.
    Stop,
}

/// What a schedule is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Question {
    /// Photos that wait and are all there.
    pub waiting: usize,
    /// All that wait, by what for.
    pub parts: Waiting,
    /// Whether one of them may be taken now, if the schedule agrees; otherwise they rest until they
    /// are tried again.
    pub is_ready: bool,
}

/// What a schedule is told.
#[derive(Debug, Clone, Copy)]
pub enum Event<'a> {
    /// A photo is begun.
    Begun {
        /// Its name.
        photo: &'a str,
        /// Its number in this go, from 1.
        number: usize,
        /// How many there are in this go.
        of: usize,
    },
    /// What became of the photo begun last.
    Ended(&'a JobEnd),
    /// Nothing goes on until somebody has helped.
    Held(&'a DaemonError),
    /// The button was pressed: work is to begin.
    Pressed,
    /// Photos wait for something that is not this schedule's to say.
    KeptWaiting {
        /// How many.
        waiting: usize,
        /// For what.
        why: &'a str,
    },
}

/// What the operator should know though work goes on or waits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// What is wrong: a sentence without its full stop.
    pub what: String,
    /// Why, as far as is known.
    pub why: String,
}

impl std::fmt::Display for Notice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.what, self.why)
    }
}

/// Decides when photos may be taken. Between photos the rig is the schedule's to use.
pub trait Schedule {
    /// Asked before each photo is taken, and at each look at the inbox that finds none to take.
    fn turn(&mut self, asked: Question, rig: &mut dyn Restorer) -> Turn {
        let _ = (asked, rig);
        Turn::Go
    }

    /// Told what happens.
    fn told(&mut self, event: Event<'_>, rig: &mut dyn Restorer) {
        let _ = (event, rig);
    }

    /// Photos and results that may still be asked back with [`Turn::Again`]: not to be removed.
    fn unproven(&self) -> &[Delivered] {
        &[]
    }

    /// What the operator should know though work goes on or waits.
    fn attention(&self) -> Vec<Notice> {
        Vec::new()
    }

    /// Whether to look again now, ahead of time, and to try what rests. Asked several times a
    /// second.
    fn impatient(&self) -> bool {
        false
    }
}

/// Every photo at once.
impl Schedule for () {}
