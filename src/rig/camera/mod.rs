//! The cameras there are: each kind is a file of this folder.

pub mod v4l2;

use super::{Camera, RigError};
use crate::config::{self, CameraDevice};

/// Opens the camera of a rig file.
///
/// # Errors
/// Whatever that kind of camera has to say.
pub(super) fn open(
    rig: &config::RigFile,
    device: &CameraDevice,
) -> Result<Box<dyn Camera + Send>, RigError> {
    match device {
        CameraDevice::V4l2(device) => {
            Ok(Box::new(v4l2::V4l2Camera::open(v4l2::CameraSettings::of(rig, device)?)?))
        }
    }
}
