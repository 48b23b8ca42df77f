//! Disk operations behind one small trait, which tests replace to cut the power between any two
//! operations, to fill the disk, or to remove it.
//!
//! The guarantees of the drop folder and of the calibration slots rest on these properties, which
//! journalling POSIX file systems (ext4, f2fs, xfs, btrfs) have and FAT does not:
//!
//! - a rename is atomic, even between folders;
//! - a file's content is durable once [`Unsynced::sync`] has returned;
//! - a name made, changed or removed is durable once [`Disk::sync_folder`] has returned for one of
//!   the folders concerned.
//!
//! No order is assumed in which anything else reaches the disk.

mod error;
pub mod files;
mod local;

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

pub(crate) use error::FREE_SPACE;
pub use error::FileError;
pub use error::if_found;
pub use files::Files;
pub use local::LocalDisk;

/// Type of a directory entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)] // The names describe them.
pub enum FileKind {
    File,
    Folder,
    Link,
    /// A pipe, socket or device.
    Other,
}

/// Metadata of a file, compared to see whether the file is still being written. Size alone would
/// not do: some copying programs set it first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Metadata {
    /// Type.
    pub kind: FileKind,
    /// Length in bytes.
    pub size: u64,
    /// Time of the last change of content: seconds and nanoseconds since 1970. The owner may set
    /// it.
    pub changed: (i64, i64),
    /// Time of the last change of content or metadata, seconds since 1970. No user may set it.
    pub touched_unix_s: i64,
    /// Inode number.
    pub inode: u64,
}

/// A file that is written but not yet durable.
pub trait Unsynced {
    /// Returns once the content is durable. After an error the file must be written anew: the
    /// kernel has dropped the pages, and a repeated call would report success.
    ///
    /// # Errors
    /// If the content may not be durable.
    fn sync(self: Box<Self>) -> io::Result<()>;
}

/// A disk. Paths are absolute; below the folders the disk was opened on, links are not followed.
pub trait Disk: Send + Sync {
    /// Names and types of the entries of `folder`, in no order.
    ///
    /// # Errors
    /// `NotADirectory`, or any error of the disk.
    fn list(&self, folder: &Path) -> io::Result<Vec<(OsString, FileKind)>>;

    /// Metadata of `path` itself.
    ///
    /// # Errors
    /// `NotFound`, or any error of the disk.
    fn metadata(&self, path: &Path) -> io::Result<Metadata>;

    /// Opens the regular file `path` for reading, without blocking on a pipe or following a link.
    ///
    /// # Errors
    /// `NotFound`; `InvalidInput` for anything but a regular file; any error of the disk.
    fn open(&self, path: &Path) -> io::Result<File>;

    /// Free bytes on the disk of `folder`.
    ///
    /// # Errors
    /// `NotFound`; `StorageFull` for a disk with room for bytes but not for files; any error of the
    /// disk.
    fn free_bytes(&self, folder: &Path) -> io::Result<u64>;

    /// Makes the folder, unless it exists.
    fn make_folder(&self, folder: &Path) -> io::Result<()>;

    /// Writes `content` to the file `path`, created or truncated first.
    ///
    /// # Errors
    /// Any error of the disk; part of the content may then be written.
    fn write(&self, path: &Path, content: &mut dyn Read) -> io::Result<Box<dyn Unsynced>>;

    /// Returns once the content of the file `path` is durable.
    fn sync_file(&self, path: &Path) -> io::Result<()>;

    /// Renames `from` to `to`, replacing an existing file.
    ///
    /// # Errors
    /// Any error of the disk; nothing has changed then.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Renames `from` to `to`, which must not exist.
    ///
    /// # Errors
    /// `AlreadyExists`, or any error of the disk; nothing has changed then.
    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Removes the file `path`.
    ///
    /// # Errors
    /// `NotFound`, or any error of the disk.
    fn remove(&self, path: &Path) -> io::Result<()>;

    /// Returns once the names in `folder` are durable.
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;
}
