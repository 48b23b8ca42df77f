//! `relens run`: the daemon over a drop folder.

use std::io::IsTerminal;
use std::path::Path;
use std::time::SystemTime;

use relens::config::Rig;
use relens::daemon::{Daemon, Folders, ProgressLine, Reader, Restorer, Setting, Summary, Watcher};

use relens::picture::worker::Worker;

use super::clock::MachineClock;
use super::{Trouble, rigged, say, single};

/// Watches the inbox in `folder`, or empties it `once`.
pub(super) fn run(rig: &Path, folder: &Path, once: bool) -> Result<(), Trouble> {
    let rig = single::rig(rig)?;
    let folders = Folders::open(folder)?;
    let mut restorer = rigged::restorer(&rig, folders.root(), None, &mut |words| log::info!("{words}"))?;
    let gallery = folders.outbox().join("index.html");
    if once {
        let summary = empty_inbox(&rig, folders, &mut *restorer)?;
        return conclude(&summary, &gallery);
    }
    log::info!("watching {}; results are shown by {}", folders.inbox().display(), gallery.display());
    let (clock, mut watcher) = (MachineClock::new(), watcher());
    let mut daemon =
        Daemon::open(folders, setting(&rig), &mut *restorer, &clock, &SystemTime::now, &mut *watcher)?;
    // The process is ended by a signal; whatever that interrupts, the next start takes up.
    daemon.run(&|| false);
    Ok(())
}

/// Restores all that is in the inbox of `folders`.
pub(super) fn empty_inbox(
    rig: &Rig,
    folders: Folders,
    restorer: &mut dyn Restorer,
) -> Result<Summary, Trouble> {
    let (clock, mut watcher) = (MachineClock::new(), watcher());
    let mut daemon = Daemon::open(folders, setting(rig), restorer, &clock, &SystemTime::now, &mut *watcher)?;
    Ok(daemon.once()?)
}

/// A line that moves on a terminal, nothing elsewhere: the log has one line a photo.
fn watcher() -> Box<dyn Watcher> {
    match std::io::stderr().is_terminal() {
        true => Box::new(ProgressLine::new(std::io::stderr())),
        false => Box::new(()),
    }
}

fn setting(rig: &Rig) -> Setting {
    let reader = Reader::Worker(Worker::of_this_program());
    Setting { reader, ..Setting::new(&rig.name, rig.photo.size(), rig.photo.curve) }
}

fn conclude(summary: &Summary, gallery: &Path) -> Result<(), Trouble> {
    let (restored, failed, left) = (summary.restored.len(), summary.failed.len(), summary.left.len());
    if restored + failed + left == 0 {
        return say("the inbox is empty");
    }
    for photo in &summary.failed {
        say(&format!("not restored: {}", photo.reason))?;
    }
    for photo in &summary.left {
        say(&format!("left in the inbox: {}", photo.reason))?;
    }
    say(&format!("{restored} restored, {failed} failed, {left} left; see {}", gallery.display()))?;
    match failed + left {
        0 => Ok(()),
        failed => Err(Trouble::SomeFailed { failed, all: restored + failed }),
    }
}
