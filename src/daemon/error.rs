//! Errors of the drop folder or the rig that stop all work until they are resolved.

use std::path::PathBuf;

use crate::disk::{FREE_SPACE, FileError};
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};

/// Reason why no photo can be restored at present.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum DaemonError {
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
    /// The rig failed, and repeating or repairing has not helped.
    #[error(
        "the operator is needed: {}{}",
        photo.as_ref().map_or(String::new(), |photo| format!("{photo}: ")),
        full_message(&**failure)
    )]
    Rig { photo: Option<String>, failure: AnyFailure },
    #[error("the operator is needed: no photo was taken: {}", full_message(&**failure))]
    NotTaken { failure: AnyFailure },
    /// The rig has drifted since its calibration, and the daemon may not calibrate it again.
    #[error(
        "the operator is needed: the rig has drifted{}: {complaint}",
        if *calibrations > 0 { " again and again" } else { "" }
    )]
    Drifted { complaint: String, calibrations: u32 },
    #[error("the operator is needed: {cause} cannot be calibrated: {}", full_message(&**failure))]
    Calibration { cause: String, failure: AnyFailure },
}

impl DaemonError {
    pub(super) fn of_rig(failure: AnyFailure) -> DaemonError {
        DaemonError::Rig { photo: None, failure }
    }
}

impl Remediable for DaemonError {
    fn remedy(&self) -> Remedy {
        match self {
            DaemonError::Files(error) => error.remedy(),
            DaemonError::Full { .. } => Remedy::RetryLater,
            _ => Remedy::CallOperator,
        }
    }

    fn was_asked_for(&self) -> bool {
        matches!(self, DaemonError::Calibration { failure, .. } if failure.was_asked_for())
    }

    fn what_to_do(&self) -> &'static str {
        match self {
            DaemonError::Files(error) => error.what_to_do(),
            DaemonError::InUse { .. } => "Stop the other relens.",
            DaemonError::Full { .. } => FREE_SPACE,
            DaemonError::Nested { .. } => "Move the folders apart.",
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
