//! Observers of the daemon: a terminal, a service manager, or a test that stops it between steps.

use super::report::state::Doing;
use super::store::claim::JobStep;
use crate::restorer::Progress;

/// Observes the daemon. The default methods do nothing.
pub trait Watcher {
    /// A photo is begun: its name, its number in this pass and the number of photos.
    fn begun(&mut self, _name: &str, _number: usize, _of: usize) {}
    /// The restoration has progressed.
    fn progress(&mut self, _progress: Progress) {}
    /// A step of the job has changed the disk.
    fn step(&mut self, _step: JobStep) {}
    /// The job has ended; its log line follows.
    fn ended(&mut self) {}
    /// The inbox was scanned.
    fn scanned(&mut self) {}
    /// The state of the daemon has changed.
    fn doing(&mut self, _doing: &Doing) {}
}

/// No observer.
impl Watcher for () {}
