//! Errors of file operations: operation, path, cause, and what to do.

use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::io::Errno;

use crate::remedy::{Remediable, Remedy};

/// "Operation not permitted" (errno(3)): an error that mode bits do not explain.
const EPERM: i32 = Errno::PERM.raw_os_error();
/// Mode bit of folders in which only the owner may move a file (chmod(1)).
const STICKY: u32 = 0o1000;
/// Errors of a disk or network share that went away (errno(3)).
const GONE: [Errno; 8] = [
    Errno::NODEV,
    Errno::NXIO,
    Errno::STALE,
    Errno::NOTCONN,
    Errno::TIMEDOUT,
    Errno::HOSTDOWN,
    Errno::HOSTUNREACH,
    Errno::NETUNREACH,
];

/// The advice on a full disk.
pub(crate) const FREE_SPACE: &str =
    "Free some disk space: move results out of the outbox and originals out of done.";

/// A failed file operation.
#[derive(Debug, thiserror::Error)]
#[error("cannot {what} {path}")]
pub struct FileError {
    what: &'static str,
    path: PathBuf,
    source: io::Error,
}

impl FileError {
    /// Adds the operation and the path to an input/output error.
    pub fn at(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FileError {
        let path = path.to_owned();
        move |source| FileError { what, path, source }
    }

    /// Kind of the cause.
    pub fn kind(&self) -> ErrorKind {
        self.source.kind()
    }

    /// Whether the error is about `path` itself.
    pub fn is_about(&self, path: &Path) -> bool {
        self.path == path
    }

    /// Whether the whole disk is affected, and so every photo.
    pub fn is_of_disk(&self) -> bool {
        use ErrorKind::{QuotaExceeded, ReadOnlyFilesystem, StorageFull};
        let is_gone = |errno: &Errno| self.source.raw_os_error() == Some(errno.raw_os_error());
        matches!(self.kind(), StorageFull | QuotaExceeded | ReadOnlyFilesystem)
            || GONE.iter().any(is_gone)
    }

    /// Replaces the path by the present path of the file.
    #[must_use]
    pub fn with_path(self, path: PathBuf) -> FileError {
        FileError { path, ..self }
    }

    /// The apparent reason why `user` may not access the file, and what to do.
    fn explain_denial(&self, user: u32) -> (&'static str, String) {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let (about, around) = (self.path.symlink_metadata().ok(), folder.metadata().ok());
        let mine = about.as_ref().is_some_and(|about| about.uid() == user);
        let unread = about.is_some_and(|about| about.mode() & 0o400 == 0);
        let is_locked = self.source.raw_os_error() == Some(EPERM);
        let theirs =
            "give it to that user (chown), or copy it in as a member of the folder's group";
        let theirs = ("it belongs to another user", theirs.to_owned());
        let Some(around) = around else { return theirs };
        let sticky = around.mode() & STICKY != 0 && around.uid() != user && !mine;
        match self.what {
            _ if mine && unread => {
                ("its owner may not read it", "make it readable (chmod u+r)".to_owned())
            }
            "move" if is_locked && !sticky => {
                ("the file or folder is immutable", "make it mutable (chattr -i -a)".to_owned())
            }
            "move" if !sticky => {
                let folder = folder.display();
                let words = "to that user (chown), or make it group-writable";
                ("its folder is not writable", format!("give the folder {folder} {words}"))
            }
            _ => theirs,
        }
    }

    /// The message for the owner of the photo, or folder of photos, concerned.
    pub fn message_for_owner(&self) -> String {
        let (path, source) = (self.path.display(), &self.source);
        match self.kind() {
            ErrorKind::PermissionDenied => {
                let user = rustix::process::geteuid().as_raw();
                let (reason, to_do) = self.explain_denial(user);
                format!("{path}: user {user} may not read or move it: {reason}; {to_do}")
            }
            _ => format!(
                "{path}: cannot be read: {source}; relens tries again by itself; if this persists, \
                 copy the photo in again and check the disk"
            ),
        }
    }
}

/// Turns a `NotFound` error of `looked` into `None`.
pub fn if_found<T>(looked: Result<T, FileError>) -> Result<Option<T>, FileError> {
    match looked {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        looked => looked.map(Some),
    }
}

impl From<FileError> for io::Error {
    fn from(error: FileError) -> io::Error {
        error.source
    }
}

impl Remediable for FileError {
    fn remedy(&self) -> Remedy {
        match self.kind() {
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => Remedy::CallOperator,
            _ => Remedy::RetryLater,
        }
    }

    fn what_to_do(&self) -> &'static str {
        match self.kind() {
            ErrorKind::StorageFull => FREE_SPACE,
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                "Check the disk: relens may not write to it."
            }
            _ => "Check the disk or the network share.",
        }
    }
}
