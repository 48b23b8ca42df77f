//! The five folders under one root, and the lock that keeps a second daemon out.

use std::ffi::OsStr;
use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};

use super::{DaemonError, durable, ledger::Ledger};

/// `inbox/ working/ outbox/ done/ failed/` under one root.
#[derive(Debug)]
pub struct Folders {
    root: PathBuf,
    /// Held for as long as this value lives.
    _lock: File,
}

impl Folders {
    /// Makes the folders where they are missing, keeps others out, and finishes or takes back whatever
    /// was under way when the last daemon ended.
    ///
    /// # Errors
    /// [`DaemonError::InUse`], or [`DaemonError::Files`] when a folder cannot be made or is no folder.
    pub fn open(root: &Path) -> Result<Folders, DaemonError> {
        std::fs::create_dir_all(root).map_err(DaemonError::files("make the folder", root))?;
        let root = root.canonicalize().map_err(DaemonError::files("find the folder", root))?;
        let path = root.join(LOCK);
        let lock = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(DaemonError::files("open", &path))?;
        if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
            return Err(DaemonError::InUse { path: root });
        }
        let folders = Folders { root, _lock: lock };
        for folder in [
            folders.inbox(),
            folders.working(),
            folders.outbox(),
            folders.done(),
            folders.failed(),
            folders.previews(),
        ] {
            std::fs::create_dir_all(&folder).map_err(DaemonError::files("make the folder", &folder))?;
            durable::sweep(&folder)?;
        }
        durable::sweep(&folders.root)?;
        durable::sync_folder(&folders.root)?;
        folders.recover()?;
        Ok(folders)
    }

    /// Whether a daemon works on `root` at this moment.
    pub fn in_use(root: &Path) -> bool {
        File::open(root.join(LOCK))
            .is_ok_and(|lock| flock(&lock, FlockOperation::NonBlockingLockShared).is_err())
    }

    /// The root, absolute.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where photos are dropped.
    pub fn inbox(&self) -> PathBuf {
        self.root.join("inbox")
    }

    /// Photos being restored.
    pub fn working(&self) -> PathBuf {
        self.root.join("working")
    }

    /// Results, their reports and the gallery.
    pub fn outbox(&self) -> PathBuf {
        self.root.join("outbox")
    }

    /// Originals whose result is in the outbox.
    pub fn done(&self) -> PathBuf {
        self.root.join("done")
    }

    /// Originals that could not be restored, each with its reason.
    pub fn failed(&self) -> PathBuf {
        self.root.join("failed")
    }

    /// Pictures the gallery shows.
    pub fn previews(&self) -> PathBuf {
        self.outbox().join("gallery")
    }

    /// Moves the photo `name` from the inbox to `working`; its new path.
    pub(super) fn claim(&self, name: &OsStr) -> Result<PathBuf, DaemonError> {
        durable::move_to(&self.inbox().join(name), &self.working(), name)
    }

    /// Finishes jobs whose result was delivered, and puts other photos back into the inbox.
    fn recover(&self) -> Result<(), DaemonError> {
        let working = self.working();
        let entries = std::fs::read_dir(&working).map_err(DaemonError::files("read the folder", &working))?;
        for entry in entries.flatten() {
            let name = entry.file_name();
            if super::inbox::is_hidden(&name) {
                continue;
            }
            let mut ledger = Ledger::of(self, &name);
            let result = ledger.result();
            let delivered = result.as_ref().is_some_and(|result| self.outbox().join(result).exists());
            if let Some(result) = result.filter(|_| !delivered) {
                // A report without its result; another photo may want the name.
                let _ = std::fs::remove_file(self.outbox().join(super::job::report_name(&result)));
                ledger.forget_result()?;
            }
            let (to, what) = if delivered { (self.done(), "done") } else { (self.inbox(), "inbox") };
            durable::move_to(&entry.path(), &to, &name)?;
            log::info!("{}: found in working after a stop, moved to {what}", name.to_string_lossy());
            if delivered {
                ledger.close()?;
            }
        }
        Ledger::sweep(self)
    }
}

/// Name of the lock file in the root.
const LOCK: &str = ".relens-lock";
