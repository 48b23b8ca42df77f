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
    #[error("the folder {path} is in use: found a running relens, allowed one at a time")]
    InUse {
        /// The root folder.
        path: PathBuf,
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
    pub(super) fn files(what: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> DaemonError {
        let path = path.to_owned();
        move |source| DaemonError::Files { what, path, source }
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
            DaemonError::InUse { .. } | DaemonError::Held { .. } => Remedy::CallOperator,
        }
    }
}
