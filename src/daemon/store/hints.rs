//! Events of the inbox: a reason to look sooner, and never more than that.
//!
//! They miss what another machine does on a network mount, files in folders moved in or just made,
//! and whatever comes while their queue is full; they end without a word when the disk is mounted
//! anew (inotify(7), and measured). So a box without them is slower by one look and otherwise the
//! same.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::ffi::OsStr;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};

/// The events of the inbox and of the folders in it.
#[derive(Debug)]
pub(crate) struct Hints {
    inotify: Option<OwnedFd>,
    /// The way from the inbox to each folder that is listened to, by the kernel's number for it.
    ways: RefCell<HashMap<i32, PathBuf>>,
    moved: RefCell<HashSet<PathBuf>>,
}

impl Hints {
    /// No events, for a machine that has no more to give or a test that wants none.
    pub(crate) fn none() -> Hints {
        Hints { inotify: None, ways: RefCell::default(), moved: RefCell::default() }
    }

    /// Events, if the kernel has any to give.
    pub(crate) fn new() -> Hints {
        let opened = inotify::init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC);
        let told = opened.inspect_err(|errno| log::debug!("no events of the inbox: {errno}"));
        Hints { inotify: told.ok(), ..Hints::none() }
    }

    /// Listens to the folder `way` of `inbox` from now on. Asked again, it listens to what has that
    /// name by then.
    pub(crate) fn listen(&self, inbox: &Path, way: &Path) {
        let flags = WatchFlags::CLOSE_WRITE
            | WatchFlags::MOVED_TO
            | WatchFlags::CREATE
            | WatchFlags::ATTRIB
            | WatchFlags::ONLYDIR;
        let Some(inotify) = &self.inotify else { return };
        let folder = if way.as_os_str().is_empty() { inbox.to_owned() } else { inbox.join(way) };
        match inotify::add_watch(inotify, &folder, flags) {
            Ok(number) => drop(self.ways.borrow_mut().insert(number, way.to_owned())),
            Err(errno) => log::debug!("no events of {}: {errno}", folder.display()),
        }
    }

    /// Whether anything happened since this was last asked. What came by being moved here, and so
    /// was written elsewhere, is remembered.
    pub(crate) fn heard(&self) -> bool {
        let Some(inotify) = &self.inotify else { return false };
        let mut space = [MaybeUninit::uninit(); 4096];
        let mut events = Reader::new(inotify, &mut space);
        let mut heard = false;
        while let Ok(event) = events.next() {
            heard = true;
            let moved = event.events().contains(ReadFlags::MOVED_TO);
            if let Some(name) = event.file_name().filter(|_| moved)
                && let Some(way) = self.ways.borrow().get(&event.wd())
            {
                self.moved.borrow_mut().insert(way.join(OsStr::from_bytes(name.to_bytes())));
            }
        }
        heard
    }

    /// Ways to what was moved here since this was last asked, as far as it was heard.
    pub(crate) fn moved(&self) -> HashSet<PathBuf> {
        self.moved.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_in_is_heard_once() {
        let folder = tempfile::tempdir().unwrap();
        let hints = Hints::new();
        hints.listen(folder.path(), Path::new(""));
        assert!(!hints.heard());
        std::fs::write(folder.path().join("a.jpg"), b"a").unwrap();
        assert!(hints.heard() && !hints.heard());
        std::fs::hard_link(folder.path().join("a.jpg"), folder.path().join("b.jpg")).unwrap();
        assert!(hints.heard() && hints.moved().is_empty());
        std::fs::rename(folder.path().join("b.jpg"), folder.path().join("c.jpg")).unwrap();
        assert!(hints.heard() && hints.moved() == HashSet::from(["c.jpg".into()]));
        std::fs::create_dir(folder.path().join("holiday")).unwrap();
        hints.listen(folder.path(), Path::new("holiday"));
        std::fs::rename(folder.path().join("c.jpg"), folder.path().join("holiday/d.jpg")).unwrap();
        assert!(hints.heard() && hints.moved() == HashSet::from(["holiday/d.jpg".into()]));
        assert!(!Hints::none().heard());
    }
}
