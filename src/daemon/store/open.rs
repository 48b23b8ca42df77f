//! Opening the folders: made where they are missing, locked against a second daemon, and made good.

use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{FlockOperation, Timespec, flock};
use rustix::io::Errno;

use super::error::FolderError;
use super::folders::{Folders, NAMES, home};
use super::inbox::is_hidden;
use super::recover;
use crate::disk::{Disk, FileError, Files};

/// Name of the lock file in the root, and in a box's own folder.
const LOCK: &str = ".relens-lock";

/// Another box that starts at the same moment holds the lock alone while it looks whether it is
/// alone. That takes a round trip or two of the network; here two seconds pass before it is
/// believed that a daemon works there that does not share. Guess.
const JOIN_STEPS: u32 = 20;
const JOIN_STEP: Timespec = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };

impl Folders {
    /// Makes the folders where they are missing, keeps others out, and finishes or takes back
    /// whatever was under way when the last daemon ended.
    ///
    /// # Errors
    /// [`FolderError::InUse`]; [`FolderError::Nested`] when one folder lies in another, through
    /// links or not; [`FolderError::Files`] when a folder cannot be made or is no folder.
    pub fn open(root: &Path) -> Result<Folders, FolderError> {
        let lock = Folders::keep_out(root)?;
        local(made(root)?, None, true, vec![lock])
    }

    /// Keeps every daemon, and whoever else calls this, off `root` for as long as the value lives.
    ///
    /// # Errors
    /// [`FolderError::InUse`]; [`FolderError::Files`] when the folder cannot be made.
    pub fn keep_out(root: &Path) -> Result<File, FolderError> {
        let root = made(root)?;
        let path = root.join(LOCK);
        let lock = opened(&path)?;
        match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => Ok(lock),
            Err(Errno::WOULDBLOCK) => Err(FolderError::InUse { path: root }),
            Err(errno) => Err(FileError::at("lock", &path)(errno.into()).into()),
        }
    }

    /// The same for one box of several that share the folders, each under a name of its own.
    ///
    /// # Errors
    /// As [`Folders::open`]; [`FolderError::InUse`] when a box of that name, or a daemon that does
    /// not share, works there.
    pub fn open_shared(root: &Path, name: &OsStr) -> Result<Folders, FolderError> {
        if Path::new(name).file_name() != Some(name) || is_hidden(name) {
            return Err(FolderError::BoxName { found: name.to_string_lossy().into_owned() });
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
            return Err(FolderError::InUse { path: root });
        }
        let lock = opened(&made(&home(&root, Some(name)))?.join(LOCK))?;
        if flock(&lock, FlockOperation::NonBlockingLockExclusive) == Err(Errno::WOULDBLOCK) {
            return Err(FolderError::InUse { path: root.join("working").join(name) });
        }
        local(root, Some(name.to_owned()), alone, vec![all, lock])
    }

    /// The same on any `disk`, where nobody else is and `root` is there.
    ///
    /// # Errors
    /// [`FolderError::Files`], as [`Folders::open`].
    pub fn on(disk: Arc<dyn Disk>, root: &Path) -> Result<Folders, FolderError> {
        let places = NAMES.map(|name| root.join(name));
        made_good(Folders::at(Files::on(disk), root.to_owned(), places, None, Vec::new()), true)
    }

    /// Whether a daemon works on `root` at this moment.
    pub fn in_use(root: &Path) -> bool {
        File::open(root.join(LOCK))
            .is_ok_and(|lock| flock(&lock, FlockOperation::NonBlockingLockShared).is_err())
    }
}

fn local(
    root: PathBuf,
    name: Option<OsString>,
    alone: bool,
    locks: Vec<File>,
) -> Result<Folders, FolderError> {
    let mut places = NAMES.map(|name| root.join(name));
    for place in &mut places {
        *place = made(place)?;
    }
    for (n, outer) in places.iter().enumerate() {
        let mut others = places.iter().enumerate().filter(|&(m, _)| m != n);
        if let Some((_, inner)) = others.find(|(_, inner)| inner.starts_with(outer)) {
            return Err(FolderError::Nested { inner: inner.clone(), outer: outer.clone() });
        }
    }
    let files = Files::beneath(places.iter().cloned().chain([root.clone()]).collect());
    made_good(Folders::at(files, root, places, name, locks), alone)
}

/// Sweeps away what is half written, where nobody else may be writing it, and makes good what was
/// under way.
fn made_good(folders: Folders, alone: bool) -> Result<Folders, FolderError> {
    let files = folders.files();
    for folder in folders.all() {
        files.make_folder(folder)?;
        if alone || folder == folders.working() {
            files.sweep(folder)?;
        }
    }
    if alone {
        files.sweep(folders.root())?;
    }
    files.sync_folder(folders.root())?;
    files.sync_folder(folders.outbox())?;
    recover::recover(&folders)?;
    Ok(folders)
}

/// The folder `path`, made if need be, without links on the way to it.
fn made(path: &Path) -> Result<PathBuf, FileError> {
    std::fs::create_dir_all(path).map_err(FileError::at("make the folder", path))?;
    path.canonicalize().map_err(FileError::at("find the folder", path))
}

/// A file to lock, made if need be. Open for both: over NFS a shared lock needs reading, an
/// exclusive one writing.
fn opened(path: &Path) -> Result<File, FileError> {
    let mut how = OpenOptions::new();
    how.create(true).truncate(false).read(true).write(true);
    how.open(path).map_err(FileError::at("open", path))
}
