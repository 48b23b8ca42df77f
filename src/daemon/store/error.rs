//! Why a drop folder cannot be worked on: folders, names, disks.

use std::path::PathBuf;

use crate::disk::FileError;
use crate::remedy::{Remediable, Remedy};

/// A failure of the drop folder itself, as opposed to one of a photo or the rig.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The file system refused something.
    #[error(transparent)]
    Files(#[from] FileError),
    /// Another daemon works on this folder.
    #[error(
        "the folder {path} is in use: found a running relens, allowed one at a time; end that one \
         first (the service: systemctl stop relens)"
    )]
    InUse {
        /// The root folder.
        path: PathBuf,
    },
    /// The disk is nearly full; photos wait until there is room.
    #[error(
        "the disk of {path} is nearly full: found {found_mib} MiB free, allowed more than \
         {floor_mib}; remove files, it then goes on by itself"
    )]
    Full {
        /// A folder on it.
        path: PathBuf,
        /// Free by now.
        found_mib: u64,
        /// To be left free.
        floor_mib: u64,
    },
    /// A folder of the daemon's lies in another: what goes into one would come out of the other for
    /// ever.
    #[error("the folder {inner} lies in {outer}: found one inside the other, allowed five apart")]
    Nested {
        /// The one inside.
        inner: PathBuf,
        /// The one around it.
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
                "Make room on the disk: take results out of the outbox and originals out of done."
            }
            FolderError::InUse { .. } => "End the other relens.",
            FolderError::Nested { .. } => "Move the folders apart.",
        }
    }
}
