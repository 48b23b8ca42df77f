//! Everything that is asked of a disk to keep, behind one small trait: what a test stands in for to
//! cut the power between any two operations, to fill the disk, or to take it away.
//!
//! The promises of the drop folder and of the calibration slots rest on this much, which POSIX file
//! systems with a journal keep (ext4, f2fs, xfs, btrfs) and FAT does not: a rename is atomic, also
//! from one folder to another; what a file holds is safe once [`Unsynced::sync`] has returned, and
//! not before; a name given, changed or taken away is safe once one of the folders concerned was
//! synchronised with [`Disk::sync_folder`], and not before. Nothing is assumed about the order in
//! which anything else reaches the disk.

mod error;
pub mod files;
mod local;

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

pub use error::FileError;
pub use files::Files;
pub use local::LocalDisk;

/// What something in a folder is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum FileKind {
    /// A plain file.
    File,
    /// A folder.
    Folder,
    /// A symbolic link, to whatever.
    Link,
    /// A pipe, socket or device.
    Other,
}

/// What changes while a file is being written. Size alone does not: some copies set it first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Look {
    /// What it is.
    pub kind: FileKind,
    /// Length in bytes.
    pub size: u64,
    /// When its content last changed: seconds and nanoseconds since 1970. Whoever owns the file may
    /// set it.
    pub changed: (i64, i64),
    /// When anything about it last changed, by the disk's own calendar. Nobody may set it.
    pub touched_unix_s: i64,
    /// Which file it is.
    pub inode: u64,
}

/// A file written and not yet safe.
pub trait Unsynced {
    /// Returns when what was written is safe. After an error nothing is known about it, and asking
    /// again would be answered wrongly (the kernel has by then forgotten the pages): write anew.
    ///
    /// # Errors
    /// When it is not safe.
    fn sync(self: Box<Self>) -> io::Result<()>;
}

/// A disk. Paths are absolute; a link is never followed below the folders the disk was opened on.
pub trait Disk: Send + Sync {
    /// Names and kinds of what `folder` holds, in no order.
    ///
    /// # Errors
    /// When it cannot be read, `NotADirectory` when it is none.
    fn list(&self, folder: &Path) -> io::Result<Vec<(OsString, FileKind)>>;

    /// A look at `path` itself.
    ///
    /// # Errors
    /// `NotFound`, or whatever the disk says.
    fn look(&self, path: &Path) -> io::Result<Look>;

    /// The plain file `path` for reading. Never blocks on a pipe, never follows a link.
    ///
    /// # Errors
    /// `NotFound`; `InvalidInput` for anything but a plain file; whatever the disk says.
    fn open(&self, path: &Path) -> io::Result<File>;

    /// Bytes that may still be written to the disk of `folder`.
    ///
    /// # Errors
    /// When the disk does not tell.
    fn free_bytes(&self, folder: &Path) -> io::Result<u64>;

    /// Makes the folder, unless it is there.
    ///
    /// # Errors
    /// When it cannot.
    fn make_folder(&self, folder: &Path) -> io::Result<()>;

    /// Writes all of `content` to the file `path`, made new or emptied first.
    ///
    /// # Errors
    /// When it cannot; part of it may then be there.
    fn write(&self, path: &Path, content: &mut dyn Read) -> io::Result<Box<dyn Unsynced>>;

    /// Returns when what the file `path` holds is safe, whoever wrote it.
    ///
    /// # Errors
    /// When it is not.
    fn sync_file(&self, path: &Path) -> io::Result<()>;

    /// Gives `from` the name `to`, in place of what had it.
    ///
    /// # Errors
    /// When it cannot; nothing has changed then.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Gives `from` the name `to`, which must be free.
    ///
    /// # Errors
    /// `AlreadyExists` when it is not; nothing has changed then.
    fn rename_new(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Removes the file `path`.
    ///
    /// # Errors
    /// `NotFound`, or whatever the disk says.
    fn remove(&self, path: &Path) -> io::Result<()>;

    /// Returns when the names in `folder` are safe.
    ///
    /// # Errors
    /// When they are not.
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;
}
