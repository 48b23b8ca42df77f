//! What a file system refused: what was tried, on which path, and what to do.

use std::io::{self, ErrorKind};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::remedy::{Remediable, Remedy};

/// "Operation not permitted" (errno(3)): what no mode bits forbid.
const EPERM: i32 = rustix::io::Errno::PERM.raw_os_error();
/// In such a folder everybody moves only what is his (chmod(1)).
const STICKY: u32 = 0o1000;

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

    /// What keeps `user` from a file or folder, as far as that can be seen, and what to do.
    fn denied(&self, user: u32) -> (String, String) {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let (about, around) = (self.path.symlink_metadata(), folder.metadata());
        let mine = about.as_ref().is_ok_and(|about| about.uid() == user);
        let unread = about.as_ref().is_ok_and(|about| about.mode() & 0o400 == 0);
        let is_locked = self.source.raw_os_error() == Some(EPERM);
        let sticky = around
            .as_ref()
            .is_ok_and(|around| around.mode() & STICKY != 0 && around.uid() != user && !mine);
        let give_folder = || {
            let folder = folder.display();
            format!("give the folder {folder} to that user (chown), or let its group write there")
        };
        let theirs = (
            "a file of somebody else's".to_owned(),
            "give it to that user (chown), or copy it in as one who shares the folder".to_owned(),
        );
        match self.what {
            _ if around.is_err() => theirs,
            _ if mine && unread => (
                "a file that its owner may not read".to_owned(),
                "let it be read (chmod u+r)".to_owned(),
            ),
            "move" if is_locked && !sticky => (
                "a file or folder that is locked against changes".to_owned(),
                "unlock it (chattr -i -a)".to_owned(),
            ),
            "move" if !sticky => {
                ("a folder that lets nothing be moved out of it".to_owned(), give_folder())
            }
            _ => theirs,
        }
    }

    /// The same for the one who dropped the photo, or folder of photos, that it is about.
    pub fn of_photo(&self) -> String {
        let (path, source) = (self.path.display(), &self.source);
        match self.kind() {
            ErrorKind::PermissionDenied => {
                let user = rustix::process::geteuid().as_raw();
                let (found, to_do) = self.denied(user);
                format!(
                    "{path}: relens may not read or move it: found {found}, allowed files that \
                     user {user} may read and move; {to_do}"
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
