//! Errors that hold the whole daemon, in the drop folder or the rig.

use super::store::error::FolderError;
use crate::disk::FileError;
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};

/// Why work is held.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum DaemonError {
    #[error(transparent)]
    Store(#[from] FolderError),
    /// The rig failed, and repeating or repairing has not helped.
    #[error("the operator is needed: {}{}", prefix(photo.as_deref()), full_message(&**failure))]
    Rig { photo: Option<String>, failure: AnyFailure },
    #[error("the operator is needed: no photo was taken: {}", full_message(&**failure))]
    NotTaken { failure: AnyFailure },
    /// The rig has drifted since its calibration and may not be calibrated by itself.
    #[error("the operator is needed: the rig has drifted{}: {complaint}", again(*.calibrations))]
    Drifted { complaint: String, calibrations: u32 },
    #[error("the operator is needed: {cause} cannot be calibrated: {}", full_message(&**failure))]
    Calibration { cause: CalibrationCause, failure: AnyFailure },
}

/// What made a calibration necessary.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum CalibrationCause {
    #[error("the rig")]
    Photo,
    #[error("the rig has drifted ({0}) and")]
    Drifted(String),
    #[error("the panel was moved ({0}) and")]
    PanelMoved(String),
}

fn prefix(photo: Option<&str>) -> String {
    photo.map_or(String::new(), |photo| format!("{photo}: "))
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
            DaemonError::Rig { failure, .. } | DaemonError::NotTaken { failure } => {
                failure.what_to_do()
            }
            DaemonError::Drifted { .. } => {
                "Check whether lens, camera or panel were moved, and whether stray light falls in. \
                 Then measure the lens: hold the button while the box starts, then press it long."
            }
            DaemonError::Calibration { .. } => {
                "The lens could not be measured: check that the camera sees the whole panel, \
                 sharp, and that no stray light falls in. The box tries again every minute."
            }
        }
    }
}
