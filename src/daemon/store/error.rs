//! Errors of the drop folder: folders, names, disks.

use std::path::PathBuf;

use crate::disk::FileError;
use crate::remedy::{Remediable, Remedy};

/// A failure of the drop folder itself, as opposed to one of a photo or the rig.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// A file operation failed.
    #[error(transparent)]
    Files(#[from] FileError),
    /// Another daemon works on this folder.
    #[error(
        "the folder {path} is in use by another relens; stop that one first (the service: \
         systemctl stop relens)"
    )]
    InUse {
        /// The root folder.
        path: PathBuf,
    },
    /// The disk is nearly full; photos wait for space.
    #[error(
        "the disk of {path} is nearly full: found {found_mib} MiB free, needed {floor_mib}; remove \
         files, work then continues by itself"
    )]
    Full {
        /// A folder on the disk.
        path: PathBuf,
        /// Free space, MiB.
        found_mib: u64,
        /// Free space required, MiB.
        floor_mib: u64,
    },
    /// One of the five folders is inside another: photos would circulate endlessly.
    #[error("the folder {inner} is inside {outer}; the five folders must be separate")]
    Nested {
        /// The inner folder.
        inner: PathBuf,
        /// The outer folder.
        outer: PathBuf,
    },
}

impl Remediable for FolderError {
    fn remedy(&self) -> Remedy {
        match self {
            FolderError::Files(error) => error.remedy(),
            FolderError::Full { .. } => Remedy::RetryLater,
            FolderError::InUse { .. } | FolderError::Nested { .. } => Remedy::CallOperator,
        }
    }

    fn what_to_do(&self) -> &'static str {
        match self {
            FolderError::Files(error) => error.what_to_do(),
            FolderError::Full { .. } => {
                "Free some disk space: move results out of the outbox and originals out of done."
            }
            FolderError::InUse { .. } => "Stop the other relens.",
            FolderError::Nested { .. } => "Move the folders apart.",
        }
    }
}
