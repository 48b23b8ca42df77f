//! The five folders under one root, and the lock that keeps a second daemon out.

use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{FlockOperation, flock};

use super::{DaemonError, durable, recovery};
use crate::disk::{Disk, LocalDisk};

/// `inbox/ working/ outbox/ done/ failed/` under one root. Each may be a link to a folder elsewhere on the same
/// disk; within them no link is followed.
pub struct Folders {
    disk: Arc<dyn Disk>,
    root: PathBuf,
    inbox: PathBuf,
    working: PathBuf,
    outbox: PathBuf,
    done: PathBuf,
    failed: PathBuf,
    previews: PathBuf,
    /// Held for as long as this value lives.
    _lock: Option<File>,
}

impl std::fmt::Debug for Folders {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Folders").field("root", &self.root).finish_non_exhaustive()
    }
}

impl Folders {
    /// Makes the folders where they are missing, keeps others out, and finishes or takes back whatever
    /// was under way when the last daemon ended.
    ///
    /// # Errors
    /// [`DaemonError::InUse`]; [`DaemonError::Nested`] when one folder lies in another, through links or not;
    /// [`DaemonError::Files`] when a folder cannot be made or is no folder.
    pub fn open(root: &Path) -> Result<Folders, DaemonError> {
        let found = |path: &Path| path.canonicalize().map_err(DaemonError::files("find the folder", path));
        std::fs::create_dir_all(root).map_err(DaemonError::files("make the folder", root))?;
        let root = found(root)?;
        let lock = lock(&root)?;
        let mut places = Vec::with_capacity(NAMES.len());
        for name in NAMES {
            let path = root.join(name);
            std::fs::create_dir_all(&path).map_err(DaemonError::files("make the folder", &path))?;
            places.push(found(&path)?);
        }
        let anchors = places.iter().cloned().chain([root.clone()]).collect();
        Folders::over(Arc::new(LocalDisk::new(anchors)), root, &places, Some(lock))
    }

    /// The same on any `disk`, where nobody else is and `root` is there.
    ///
    /// # Errors
    /// [`DaemonError::Files`], as [`Folders::open`].
    pub fn on(disk: Arc<dyn Disk>, root: &Path) -> Result<Folders, DaemonError> {
        let places = NAMES.map(|name| root.join(name));
        Folders::over(disk, root.to_owned(), &places, None)
    }

    fn over(
        disk: Arc<dyn Disk>,
        root: PathBuf,
        places: &[PathBuf],
        lock: Option<File>,
    ) -> Result<Folders, DaemonError> {
        for (n, outer) in places.iter().enumerate() {
            if let Some((_, inner)) =
                places.iter().enumerate().find(|&(m, inner)| m != n && inner.starts_with(outer))
            {
                return Err(DaemonError::Nested { inner: inner.clone(), outer: outer.clone() });
            }
        }
        let [inbox, working, outbox, done, failed] =
            <&[PathBuf; 5]>::try_from(places).map_err(|_| DaemonError::InUse { path: root.clone() })?.clone();
        let previews = outbox.join("gallery");
        let folders = Folders { disk, root, inbox, working, outbox, done, failed, previews, _lock: lock };
        let disk = folders.disk();
        for folder in places.iter().chain([&folders.previews]) {
            disk.make_folder(folder).map_err(DaemonError::files("make the folder", folder))?;
            durable::sweep(disk, folder)?;
        }
        durable::sweep(disk, &folders.root)?;
        durable::sync_folder(disk, &folders.root)?;
        durable::sync_folder(disk, &folders.outbox)?;
        recovery::recover(&folders)?;
        Ok(folders)
    }

    /// Whether a daemon works on `root` at this moment.
    pub fn in_use(root: &Path) -> bool {
        File::open(root.join(LOCK))
            .is_ok_and(|lock| flock(&lock, FlockOperation::NonBlockingLockShared).is_err())
    }

    /// The disk the folders are on.
    pub fn disk(&self) -> &dyn Disk {
        &*self.disk
    }

    /// The root, absolute.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where photos are dropped.
    pub fn inbox(&self) -> &Path {
        &self.inbox
    }

    /// Photos being restored.
    pub fn working(&self) -> &Path {
        &self.working
    }

    /// Results, their reports and the gallery.
    pub fn outbox(&self) -> &Path {
        &self.outbox
    }

    /// Originals whose result is in the outbox.
    pub fn done(&self) -> &Path {
        &self.done
    }

    /// Originals that could not be restored, each with its reason.
    pub fn failed(&self) -> &Path {
        &self.failed
    }

    /// Pictures the gallery shows.
    pub fn previews(&self) -> &Path {
        &self.previews
    }

    /// Whether the disk of the results has more than `floor_bytes` free. A disk that does not tell has.
    ///
    /// # Errors
    /// [`DaemonError::Full`].
    pub(super) fn room(&self, floor_bytes: u64) -> Result<(), DaemonError> {
        for folder in [&self.outbox, &self.working] {
            match self.disk().free_bytes(folder) {
                Ok(free) if free < floor_bytes => {
                    const MIB: u64 = 1 << 20;
                    let (found_mib, floor_mib) = (free / MIB, floor_bytes.div_ceil(MIB));
                    return Err(DaemonError::Full { path: folder.clone(), found_mib, floor_mib });
                }
                Ok(_) => {}
                Err(error) => log::debug!("{}: {error}", folder.display()),
            }
        }
        Ok(())
    }

    /// Moves the photo at `way` from the inbox to `working`; its new path.
    pub(super) fn claim(&self, way: &Path) -> Result<PathBuf, DaemonError> {
        durable::move_to(self.disk(), &self.inbox.join(way), &self.working, &flat(way))
    }
}

/// The folders of a root, in the order of [`Folders`]' fields.
const NAMES: [&str; 5] = ["inbox", "working", "outbox", "done", "failed"];

/// Name of the lock file in the root.
const LOCK: &str = ".relens-lock";

fn lock(root: &Path) -> Result<File, DaemonError> {
    let path = root.join(LOCK);
    let lock = OpenOptions::new()
        .create(true)
        .truncate(false)
        .write(true)
        .open(&path)
        .map_err(DaemonError::files("open", &path))?;
    match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(lock),
        Err(_) => Err(DaemonError::InUse { path: root.to_owned() }),
    }
}

/// The name of a photo that lies in folders of the inbox: theirs and its own, joined with hyphens.
fn flat(way: &Path) -> OsString {
    way.iter().collect::<Vec<&OsStr>>().join(OsStr::new("-"))
}
