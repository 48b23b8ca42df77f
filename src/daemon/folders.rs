//! The five folders under one root, and the lock that keeps a second daemon out.

use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{FlockOperation, Timespec, flock};
use rustix::io::Errno;

use super::{DaemonError, atomic_file, recovery};
use crate::disk::{Disk, Kind, LocalDisk};

/// `inbox/ working/ outbox/ done/ failed/` under one root. Each may be a link to a folder elsewhere
/// on the same disk; within them no link is followed.
pub struct Folders {
    disk: Arc<dyn Disk>,
    root: PathBuf,
    inbox: PathBuf,
    /// Where this box works …
    working: PathBuf,
    /// … and where all boxes do.
    works: PathBuf,
    /// This box's name, when it shares the folders.
    name: Option<OsString>,
    outbox: PathBuf,
    done: PathBuf,
    failed: PathBuf,
    previews: PathBuf,
    /// Held for as long as this value lives.
    _locks: Arc<Vec<File>>,
}

impl std::fmt::Debug for Folders {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Folders").field("root", &self.root).finish_non_exhaustive()
    }
}

impl Folders {
    /// Makes the folders where they are missing, keeps others out, and finishes or takes back
    /// whatever was under way when the last daemon ended.
    ///
    /// # Errors
    /// [`DaemonError::InUse`]; [`DaemonError::Nested`] when one folder lies in another, through
    /// links or not; [`DaemonError::Files`] when a folder cannot be made or is no folder.
    pub fn open(root: &Path) -> Result<Folders, DaemonError> {
        let root = made(root)?;
        let path = root.join(LOCK);
        let lock = opened(&path)?;
        match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(Errno::WOULDBLOCK) => return Err(DaemonError::InUse { path: root }),
            Err(errno) => return Err(DaemonError::files("lock", &path)(errno.into())),
        }
        Folders::local(root, None, true, vec![lock])
    }

    /// The same for one box of several that share the folders, each under a name of its own.
    ///
    /// # Errors
    /// As [`Folders::open`]; [`DaemonError::InUse`] when a box of that name, or a daemon that does
    /// not share, works there.
    pub fn open_shared(root: &Path, name: &OsStr) -> Result<Folders, DaemonError> {
        let plain = Path::new(name).file_name() == Some(name) && !super::inbox::is_hidden(name);
        if !plain {
            return Err(DaemonError::BoxName { found: name.to_string_lossy().into_owned() });
        }
        let root = made(root)?;
        let all = opened(&root.join(LOCK))?;
        // Alone for a moment, which is when what others left half written may be swept away.
        let alone = flock(&all, FlockOperation::NonBlockingLockExclusive).is_ok();
        // On a mount without locks the names must differ by themselves.
        let refused = |_: &u32| {
            let refused =
                flock(&all, FlockOperation::NonBlockingLockShared) == Err(Errno::WOULDBLOCK);
            if refused {
                let _ = rustix::thread::nanosleep(&JOIN_STEP);
            }
            refused
        };
        if (0..JOIN_STEPS).take_while(refused).count() == JOIN_STEPS as usize {
            return Err(DaemonError::InUse { path: root });
        }
        let mut home = OsString::from(HOME);
        home.push(name);
        let lock = opened(&made(&root.join(home))?.join(LOCK))?;
        if flock(&lock, FlockOperation::NonBlockingLockExclusive) == Err(Errno::WOULDBLOCK) {
            return Err(DaemonError::InUse { path: root.join("working").join(name) });
        }
        Folders::local(root, Some(name.to_owned()), alone, vec![all, lock])
    }

    /// The same on any `disk`, where nobody else is and `root` is there.
    ///
    /// # Errors
    /// [`DaemonError::Files`], as [`Folders::open`].
    pub fn on(disk: Arc<dyn Disk>, root: &Path) -> Result<Folders, DaemonError> {
        let places = NAMES.map(|name| root.join(name));
        Folders::over(disk, root.to_owned(), places, None, true, Vec::new())
    }

    fn local(
        root: PathBuf,
        name: Option<OsString>,
        alone: bool,
        locks: Vec<File>,
    ) -> Result<Folders, DaemonError> {
        let mut places = NAMES.map(|name| root.join(name));
        for place in &mut places {
            *place = made(place)?;
        }
        let disk = LocalDisk::new(places.iter().cloned().chain([root.clone()]).collect());
        Folders::over(Arc::new(disk), root, places, name, alone, locks)
    }

    fn over(
        disk: Arc<dyn Disk>,
        root: PathBuf,
        places: [PathBuf; 5],
        name: Option<OsString>,
        alone: bool,
        locks: Vec<File>,
    ) -> Result<Folders, DaemonError> {
        for (n, outer) in places.iter().enumerate() {
            if let Some((_, inner)) =
                places.iter().enumerate().find(|&(m, inner)| m != n && inner.starts_with(outer))
            {
                return Err(DaemonError::Nested { inner: inner.clone(), outer: outer.clone() });
            }
        }
        let all = places.clone();
        let [inbox, works, outbox, done, failed] = places;
        let working = name.as_ref().map_or_else(|| works.clone(), |name| works.join(name));
        let previews = outbox.join("gallery");
        let locks = Arc::new(locks);
        let folders = Folders {
            disk,
            root,
            inbox,
            working,
            works,
            name,
            outbox,
            done,
            failed,
            previews,
            _locks: locks,
        };
        let disk = folders.disk();
        for folder in all.iter().chain([&folders.working, &folders.previews]) {
            disk.make_folder(folder).map_err(DaemonError::files("make the folder", folder))?;
            if alone || *folder == folders.working {
                atomic_file::sweep(disk, folder)?;
            }
        }
        if alone {
            atomic_file::sweep(disk, &folders.root)?;
        }
        atomic_file::sync_folder(disk, &folders.root)?;
        atomic_file::sync_folder(disk, &folders.outbox)?;
        recovery::recover(&folders)?;
        Ok(folders)
    }

    /// Whether a daemon works on `root` at this moment.
    pub fn in_use(root: &Path) -> bool {
        File::open(root.join(LOCK))
            .is_ok_and(|lock| flock(&lock, FlockOperation::NonBlockingLockShared).is_err())
    }

    /// The disk, for those who work beside the daemon.
    pub(super) fn shared_disk(&self) -> Arc<dyn Disk> {
        Arc::clone(&self.disk)
    }

    /// The disk the folders are on.
    pub fn disk(&self) -> &dyn Disk {
        &*self.disk
    }

    /// The root, absolute.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where what is this box's alone is kept, its calibration and its state: the root, or
    /// `box-NAME` in it when the folders are shared.
    pub fn home(&self) -> PathBuf {
        let Some(name) = &self.name else { return self.root.clone() };
        let mut home = OsString::from(HOME);
        home.push(name);
        self.root.join(home)
    }

    /// Where photos are dropped.
    pub fn inbox(&self) -> &Path {
        &self.inbox
    }

    /// Photos being restored by this box.
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

    /// Whether other boxes may work on these folders, too.
    pub(super) fn shared(&self) -> bool {
        self.name.is_some()
    }

    /// Names of the other boxes that ever worked here.
    pub(super) fn others(&self) -> Result<Vec<OsString>, DaemonError> {
        let all = &self.works;
        let found = self.disk().list(all).map_err(DaemonError::files("read the folder", all))?;
        let other = |name: &OsString| Some(name) != self.name.as_ref();
        Ok(found
            .into_iter()
            .filter(|(_, kind)| *kind == Kind::Folder)
            .map(|(n, _)| n)
            .filter(other)
            .collect())
    }

    /// The same folders as the box `name` has them.
    pub(super) fn of_box(&self, name: &OsStr) -> Folders {
        let Folders { disk, root, inbox, works, outbox, done, failed, previews, _locks, .. } = self;
        Folders {
            disk: Arc::clone(disk),
            root: root.clone(),
            inbox: inbox.clone(),
            working: works.join(name),
            works: works.clone(),
            name: Some(name.to_owned()),
            outbox: outbox.clone(),
            done: done.clone(),
            failed: failed.clone(),
            previews: previews.clone(),
            _locks: Arc::clone(_locks),
        }
    }

    /// Whether the disk of the results has more than `floor_bytes` free. A disk that does not tell
    /// has.
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
        atomic_file::move_to_own(self.disk(), &self.inbox.join(way), &self.working, &flat(way))
    }
}

/// The folders of a root, in the order of [`Folders`]' fields.
const NAMES: [&str; 5] = ["inbox", "working", "outbox", "done", "failed"];

/// Beginning of the name of a box's own folder, when several share a root.
const HOME: &str = "box-";

/// Name of the lock file in the root, and in a box's own folder.
const LOCK: &str = ".relens-lock";

/// Another box that starts at the same moment holds the lock alone while it looks whether it is
/// alone. That takes a round trip or two of the network; here two seconds pass before it is
/// believed that a daemon works there that does not share. Guess.
const JOIN_STEPS: u32 = 20;
const JOIN_STEP: Timespec = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };

/// The folder `path`, made if need be, without links on the way to it.
fn made(path: &Path) -> Result<PathBuf, DaemonError> {
    std::fs::create_dir_all(path).map_err(DaemonError::files("make the folder", path))?;
    path.canonicalize().map_err(DaemonError::files("find the folder", path))
}

/// A file to lock, made if need be. Open for both: over NFS a shared lock needs reading, an
/// exclusive one writing.
fn opened(path: &Path) -> Result<File, DaemonError> {
    let mut how = OpenOptions::new();
    how.create(true).truncate(false).read(true).write(true);
    how.open(path).map_err(DaemonError::files("open", path))
}

/// The name of a photo that lies in folders of the inbox: theirs and its own, joined with hyphens.
fn flat(way: &Path) -> OsString {
    way.iter().collect::<Vec<&OsStr>>().join(OsStr::new("-"))
}
