//! Why the daemon holds: a drop folder, or a rig, that needs somebody or some time.

use super::store::error::FolderError;
use crate::disk::FileError;
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};

/// Why nothing goes on.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// The drop folder.
    #[error(transparent)]
    Store(#[from] FolderError),
    /// The rig failed, and doing it again or putting it right has not helped.
    #[error("the operator is needed: {about}{}", full_message(&**failure))]
    Rig {
        /// The photo's name and a colon, if a photo was being restored.
        about: String,
        /// What failed.
        failure: AnyFailure,
    },
    /// The rig is no longer what was calibrated, and may not be calibrated by itself.
    #[error("the operator is needed: the rig has drifted{}: {complaint}", again(*.calibrations))]
    Drifted {
        /// What is past its limit.
        complaint: String,
        /// Calibrations in a row that have not helped.
        calibrations: u32,
    },
    /// A calibration that was needed failed.
    #[error("the operator is needed: {why}cannot be calibrated: {}", full_message(&**failure))]
    Calibration {
        /// What it was needed for: the beginning of the sentence.
        why: String,
        /// What failed.
        failure: AnyFailure,
    },
}

fn again(calibrations: u32) -> &'static str {
    if calibrations > 0 { " again and again" } else { "" }
}

impl From<FileError> for DaemonError {
    fn from(error: FileError) -> DaemonError {
        DaemonError::Store(error.into())
    }
}

impl Remediable for DaemonError {
    fn remedy(&self) -> Remedy {
        match self {
            DaemonError::Store(error) => error.remedy(),
            _ => Remedy::CallOperator,
        }
    }

    fn was_asked_for(&self) -> bool {
        matches!(self, DaemonError::Calibration { failure, .. } if failure.was_asked_for())
    }

    fn what_to_do(&self) -> &'static str {
        match self {
            DaemonError::Store(error) => error.what_to_do(),
            DaemonError::Rig { failure, .. } => failure.what_to_do(),
            DaemonError::Drifted { .. } => {
                "Look whether lens, camera or panel were moved, and whether light falls in. Then \
                 measure the lens anew: hold the button while the box starts, then press it long."
            }
            DaemonError::Calibration { .. } => {
                "The lens could not be measured: see that the camera sees the whole panel, sharp, \
                 and that no light falls in. The box tries again every minute."
            }
        }
    }
}
