//! Who looks on: a line on a terminal, nobody, or a test that stops the daemon between two steps.

use super::report::state::Doing;
use super::store::claim::JobStep;
use crate::restorer::Progress;

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
    fn step(&mut self, step: JobStep) {
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
