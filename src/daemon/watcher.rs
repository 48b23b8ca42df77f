//! Who looks on: a line on a terminal, nobody, or a test that stops the daemon between two steps.

use super::{Doing, Progress};

/// The steps of a job at which the disk has changed. Between any two the power may fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Step {
    /// The photo is in `working`.
    Claimed,
    /// The attempt is written down.
    Recorded,
    /// The picture is restored and held in memory.
    Restored,
    /// The result's name is written down.
    Named,
    /// The gallery's pictures and the report are in the outbox.
    Reported,
    /// The result is in the outbox.
    Delivered,
    /// The original is in `done`.
    Moved,
    /// The record of the job is removed.
    Closed,
}

impl Step {
    /// All steps in order.
    pub const ALL: [Step; 8] = [
        Step::Claimed,
        Step::Recorded,
        Step::Restored,
        Step::Named,
        Step::Reported,
        Step::Delivered,
        Step::Moved,
        Step::Closed,
    ];
}

/// Looks on while the daemon works. Each method may do nothing.
pub trait Watcher {
    /// A photo is begun: its name, its number in this pass and how many are waiting in all.
    fn begun(&mut self, name: &str, number: usize, of: usize) {
        let _ = (name, number, of);
    }
    /// The restoration of the photo begun last has come further.
    fn progress(&mut self, progress: Progress) {
        let _ = progress;
    }
    /// The disk has changed.
    fn step(&mut self, step: Step) {
        let _ = step;
    }
    /// The photo begun last is over and its log line is about to be written.
    fn ended(&mut self) {}
    /// The loop has come round: a look at the inbox is over, whatever it found.
    fn looked(&mut self) {}
    /// What the daemon does has changed.
    fn doing(&mut self, doing: &Doing) {
        let _ = doing;
    }
}

/// Nobody looks on.
impl Watcher for () {}
