//! Errors of the drop folder: folders, names, disks.

use std::path::PathBuf;

use crate::disk::FileError;
use crate::remedy::{Remediable, Remedy};

/// A failure of the drop folder itself, as opposed to one of a photo or the rig.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum FolderError {
    #[error(transparent)]
    Files(#[from] FileError),
    #[error(
        "the folder {path} is in use by another relens; stop that one first (the service: \
         systemctl stop relens)"
    )]
    InUse { path: PathBuf },
    /// The disk is nearly full; photos wait for space.
    #[error(
        "the disk of {path} is nearly full: found {found_mib} MiB free, needed {floor_mib}; remove \
         files, work then continues by itself"
    )]
    Full { path: PathBuf, found_mib: u64, floor_mib: u64 },
    /// One of the five folders is inside another: photos would circulate endlessly.
    #[error("the folder {inner} is inside {outer}; the five folders must be separate")]
    Nested { inner: PathBuf, outer: PathBuf },
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
