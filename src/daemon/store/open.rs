//! Opening the drop folder: subfolders made where missing, the root locked against a second daemon,
//! interrupted jobs recovered.

use std::fs::{File, OpenOptions};
use std::io::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

use super::folders::{Folders, NAMES};
use super::recover;
use crate::daemon::error::DaemonError;
use crate::disk::{Disk, FileError, Files};

const LOCK: &str = ".relens-lock";

impl Folders {
    /// Locks the root, makes missing folders, and completes or reverts interrupted jobs.
    ///
    /// # Errors
    /// [`DaemonError::InUse`]; [`DaemonError::Nested`] when one folder lies in another, through
    /// links or not; [`DaemonError::Files`] when a folder cannot be made or is no folder.
    pub fn open(root: &Path) -> Result<Folders, DaemonError> {
        let lock = Folders::lock(root)?;
        let root = made(root)?;
        let mut places = NAMES.map(|name| root.join(name));
        for place in &mut places {
            *place = made(place)?;
        }
        for (n, outer) in places.iter().enumerate() {
            let mut others = places.iter().enumerate().filter(|&(m, _)| m != n);
            if let Some((_, inner)) = others.find(|(_, inner)| inner.starts_with(outer)) {
                return Err(DaemonError::Nested { inner: inner.clone(), outer: outer.clone() });
            }
        }
        let files = Files::beneath(places.iter().cloned().chain([root.clone()]).collect());
        recovered(Folders::at(files, root, places, Some(lock)))
    }

    /// Locks `root` against other processes while the returned file lives.
    ///
    /// # Errors
    /// [`DaemonError::InUse`]; [`DaemonError::Files`] when the folder cannot be made.
    pub fn lock(root: &Path) -> Result<File, DaemonError> {
        let root = made(root)?;
        let path = root.join(LOCK);
        let mut how = OpenOptions::new();
        // Over NFS an exclusive lock needs a file open for writing.
        how.create(true).truncate(false).read(true).write(true);
        let lock = how.open(&path).map_err(FileError::at("open", &path))?;
        match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => Ok(lock),
            Err(Errno::WOULDBLOCK) => Err(DaemonError::InUse { path: root }),
            Err(errno) => Err(FileError::at("lock", &path)(errno.into()).into()),
        }
    }

    /// Opens the folders on any `disk`, as [`Folders::open`] does but without a lock. `root` must
    /// exist.
    pub fn on(disk: Arc<dyn Disk>, root: &Path) -> Result<Folders, DaemonError> {
        let places = NAMES.map(|name| root.join(name));
        recovered(Folders::at(Files::on(disk), root.to_owned(), places, None))
    }

    /// Whether a daemon works on `root` at this moment.
    pub fn in_use(root: &Path) -> bool {
        File::open(root.join(LOCK))
            .is_ok_and(|lock| flock(&lock, FlockOperation::NonBlockingLockShared).is_err())
    }
}

/// Removes temporary files and completes or reverts interrupted jobs.
fn recovered(folders: Folders) -> Result<Folders, DaemonError> {
    let files = &folders.files;
    for folder in folders.all() {
        files.make_folder(folder)?;
        files.sweep(folder)?;
    }
    files.sweep(&folders.root)?;
    files.sync_folder(&folders.root)?;
    files.sync_folder(&folders.outbox)?;
    recover::recover(&folders)?;
    Ok(folders)
}

/// Makes the folder `path` if missing; returns it with links resolved.
fn made(path: &Path) -> Result<PathBuf, FileError> {
    let dangling = path.is_symlink() && !path.exists();
    std::fs::create_dir_all(path).map_err(|error| {
        let words =
            "it is a link to a folder that is not there: make that folder, or mount its disk";
        let error = if dangling { Error::new(error.kind(), words) } else { error };
        FileError::at("make the folder", path)(error)
    })?;
    path.canonicalize().map_err(FileError::at("find the folder", path))
}
