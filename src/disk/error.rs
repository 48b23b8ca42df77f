//! What a file system refused: what was tried, on which path, and what to do.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::remedy::{Remediable, Remedy};

/// The file system refused something.
#[derive(Debug, thiserror::Error)]
#[error("cannot {what} {path}")]
pub struct FileError {
    /// What was tried, as a verb.
    what: &'static str,
    /// On which file or folder.
    path: PathBuf,
    /// The cause.
    #[source]
    source: io::Error,
}

impl FileError {
    /// Says of an input/output error what was tried on which path.
    pub fn at(what: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FileError {
        let path = path.to_owned();
        move |source| FileError { what, path, source }
    }

    /// What kind of cause it has.
    pub fn kind(&self) -> ErrorKind {
        self.source.kind()
    }

    /// Whether it is about `path` itself.
    pub fn is_about(&self, path: &Path) -> bool {
        self.path == path
    }

    /// Whether the whole disk is in a state in which nothing can be done for any photo.
    pub fn is_of_disk(&self) -> bool {
        use ErrorKind::{QuotaExceeded, ReadOnlyFilesystem, StorageFull};
        matches!(self.kind(), StorageFull | QuotaExceeded | ReadOnlyFilesystem)
    }

    /// The same about a file that is at `path` by now.
    #[must_use]
    pub fn now_at(self, path: PathBuf) -> FileError {
        FileError { path, ..self }
    }

    /// The same for the one who dropped the photo, or folder of photos, that it is about.
    pub fn of_photo(&self) -> String {
        let (path, source) = (self.path.display(), &self.source);
        match self.kind() {
            ErrorKind::PermissionDenied => {
                let user = rustix::process::geteuid().as_raw();
                format!(
                    "{path}: relens may not read or move it: found a file of somebody else's, \
                     allowed files that user {user} may read and move; give it to that user \
                     (chown), or copy it in as one who shares the folder"
                )
            }
            _ => format!(
                "{path}: the disk does not give it: {source}; relens tries again by itself; if \
                 that stays so, copy the photo in again and look after the disk"
            ),
        }
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
            ErrorKind::StorageFull => {
                "Make room on the disk: take results out of the outbox and originals out of done."
            }
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                "Look after the disk: relens may not write to it."
            }
            _ => "Look after the disk or the network share.",
        }
    }
}
