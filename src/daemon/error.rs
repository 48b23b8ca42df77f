//! Why the daemon could not do its part of a job: folders, names, disks.

use std::path::{Path, PathBuf};

use crate::remedy::{Remediable, Remedy};

/// A failure of the drop folder itself, as opposed to one of a photo or the rig.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// The file system refused something.
    #[error("cannot {what} {path}")]
    Files {
        /// What was tried, as a verb.
        what: &'static str,
        /// On which file or folder.
        path: PathBuf,
        /// The cause.
        #[source]
        source: std::io::Error,
    },
    /// Another daemon works on this folder.
    #[error(
        "the folder {path} is in use: found a running relens, allowed one at a time, or several \
         that share it"
    )]
    InUse {
        /// The root folder.
        path: PathBuf,
    },
    /// A box's name is to be the name of a folder.
    #[error(
        "a box cannot be called `{found}`, allowed is any name of a folder that does not begin \
         with a dot"
    )]
    BoxName {
        /// The name asked for.
        found: String,
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
    /// The rig, or the way to it, needs a person.
    #[error("the operator is needed: {reason}")]
    Held {
        /// The cause in full, with what to do if it is known.
        reason: String,
    },
}

impl DaemonError {
    /// Wraps an input/output error with what was tried on which path.
    pub(super) fn files(
        what: &'static str,
        path: &Path,
    ) -> impl FnOnce(std::io::Error) -> DaemonError {
        let path = path.to_owned();
        move |source| DaemonError::Files { what, path, source }
    }
}

impl DaemonError {
    /// Whether a name was taken that should have been free.
    pub(super) fn is_taken(&self) -> bool {
        matches!(self, DaemonError::Files { source, .. } if source.kind() == std::io::ErrorKind::AlreadyExists)
    }
}

impl Remediable for DaemonError {
    fn remedy(&self) -> Remedy {
        use std::io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem};
        match self {
            DaemonError::Files { source, .. } => match source.kind() {
                PermissionDenied | ReadOnlyFilesystem => Remedy::CallOperator,
                _ => Remedy::RetryLater,
            },
            DaemonError::Full { .. } => Remedy::RetryLater,
            DaemonError::BoxName { .. }
            | DaemonError::InUse { .. }
            | DaemonError::Nested { .. }
            | DaemonError::Held { .. } => Remedy::CallOperator,
        }
    }
}
