//! Events of the inbox: a reason to look sooner, and never more than that.
//!
//! They miss what another machine does on a network mount, files in folders moved in, and whatever
//! comes while their queue is full; they end without a word when the disk is mounted anew
//! (inotify(7), and measured). So a box without them is slower by one look and otherwise the same.

use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::path::Path;

use rustix::fs::inotify::{self, CreateFlags, Reader, WatchFlags};

/// The events of one folder.
#[derive(Debug)]
pub(crate) struct Hints(Option<OwnedFd>);

impl Hints {
    /// No events, for a machine that has no more to give or a test that wants none.
    pub(crate) fn none() -> Hints {
        Hints(None)
    }

    /// Events, if the kernel has any to give.
    pub(crate) fn new() -> Hints {
        let opened = inotify::init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC);
        Hints(opened.inspect_err(|errno| log::debug!("no events of the inbox: {errno}")).ok())
    }

    /// Listens to `folder` from now on. Asked again, it listens to what has that name by then.
    pub(crate) fn listen(&self, folder: &Path) {
        let flags = WatchFlags::CLOSE_WRITE
            | WatchFlags::MOVED_TO
            | WatchFlags::CREATE
            | WatchFlags::ATTRIB
            | WatchFlags::ONLYDIR;
        if let Some(inotify) = &self.0 {
            let _ = inotify::add_watch(inotify, folder, flags)
                .inspect_err(|errno| log::debug!("no events of {}: {errno}", folder.display()));
        }
    }

    /// Whether anything happened since this was last asked.
    pub(crate) fn heard(&self) -> bool {
        let Some(inotify) = &self.0 else { return false };
        let mut space = [MaybeUninit::uninit(); 4096];
        let mut events = Reader::new(inotify, &mut space);
        let mut heard = false;
        while events.next().is_ok() {
            heard = true;
        }
        heard
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_in_is_heard_once() {
        let folder = tempfile::tempdir().unwrap();
        let hints = Hints::new();
        hints.listen(folder.path());
        assert!(!hints.heard());
        std::fs::write(folder.path().join("a.jpg"), b"a").unwrap();
        assert!(hints.heard() && !hints.heard());
        std::fs::hard_link(folder.path().join("a.jpg"), folder.path().join("b.jpg")).unwrap();
        assert!(hints.heard());
        assert!(!Hints::none().heard());
    }
}
