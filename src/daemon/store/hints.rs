//! File system events of the inbox, which only make the next scan come sooner.
//!
//! Events are missing for changes by another machine on a network mount, for files in folders moved
//! in or just made, and while the queue is full; they end silently when the disk is remounted
//! (inotify(7), and measured). Without events a box is slower by one scan and otherwise the same.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::ffi::OsStr;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, Reader, WatchFlags};

/// Events of the inbox and its subfolders; by default none.
#[derive(Debug, Default)]
pub(crate) struct Hints {
    inotify: Option<OwnedFd>,
    /// Path of each watched folder, relative to the inbox, by its watch descriptor.
    watched: RefCell<HashMap<i32, PathBuf>>,
    moved: RefCell<HashSet<PathBuf>>,
}

impl Hints {
    /// Opens the events of the inbox; there are none if the kernel provides no watch.
    pub(crate) fn new() -> Hints {
        let opened = inotify::init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC);
        let opened = opened.inspect_err(|errno| log::debug!("no events of the inbox: {errno}"));
        Hints { inotify: opened.ok(), ..Hints::default() }
    }

    /// Watches the folder `path`, relative to `inbox`. A repeated call watches the folder that now
    /// has the name.
    pub(crate) fn watch(&self, inbox: &Path, path: &Path) {
        let flags = WatchFlags::CLOSE_WRITE
            | WatchFlags::MOVED_TO
            | WatchFlags::CREATE
            | WatchFlags::ATTRIB
            | WatchFlags::ONLYDIR;
        let Some(inotify) = &self.inotify else { return };
        let folder = if path.as_os_str().is_empty() { inbox.to_owned() } else { inbox.join(path) };
        match inotify::add_watch(inotify, &folder, flags) {
            Ok(watch) => drop(self.watched.borrow_mut().insert(watch, path.to_owned())),
            Err(errno) => log::debug!("no events of {}: {errno}", folder.display()),
        }
    }

    /// Whether there were events since the last call. Files moved in are collected for
    /// [`Hints::take_moved`].
    pub(crate) fn poll(&self) -> bool {
        let Some(inotify) = &self.inotify else { return false };
        let mut space = [MaybeUninit::uninit(); 4096];
        let mut events = Reader::new(inotify, &mut space);
        let mut any = false;
        while let Ok(event) = events.next() {
            any = true;
            let moved = event.events().contains(ReadFlags::MOVED_TO);
            if let Some(name) = event.file_name().filter(|_| moved)
                && let Some(folder) = self.watched.borrow().get(&event.wd())
            {
                self.moved.borrow_mut().insert(folder.join(OsStr::from_bytes(name.to_bytes())));
            }
        }
        any
    }

    /// Paths, relative to the inbox, of files moved in since the last call, as far as events report
    /// them.
    pub(crate) fn take_moved(&self) -> HashSet<PathBuf> {
        self.moved.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_event_is_reported_once() {
        let folder = tempfile::tempdir().unwrap();
        let hints = Hints::new();
        hints.watch(folder.path(), Path::new(""));
        assert!(!hints.poll());
        std::fs::write(folder.path().join("a.jpg"), b"a").unwrap();
        assert!(hints.poll() && !hints.poll());
        std::fs::hard_link(folder.path().join("a.jpg"), folder.path().join("b.jpg")).unwrap();
        assert!(hints.poll() && hints.take_moved().is_empty());
        std::fs::rename(folder.path().join("b.jpg"), folder.path().join("c.jpg")).unwrap();
        assert!(hints.poll() && hints.take_moved() == HashSet::from(["c.jpg".into()]));
        std::fs::create_dir(folder.path().join("holiday")).unwrap();
        hints.watch(folder.path(), Path::new("holiday"));
        std::fs::rename(folder.path().join("c.jpg"), folder.path().join("holiday/d.jpg")).unwrap();
        assert!(hints.poll() && hints.take_moved() == HashSet::from(["holiday/d.jpg".into()]));
        assert!(!Hints::default().poll());
    }
}
