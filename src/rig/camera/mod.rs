//! Kinds of cameras, one folder each.

pub mod v4l2;

use self::v4l2::{CameraSettings, V4l2Camera};
use super::{Camera, RigError};
use crate::config::{CameraTable, Hardware};

/// Opens the camera of a rig.
///
/// # Errors
/// As [`CameraSettings::of`] and [`V4l2Camera::open`].
pub(super) fn open(
    camera: &CameraTable,
    hardware: &Hardware,
) -> Result<Box<dyn Camera + Send>, RigError> {
    Ok(Box::new(V4l2Camera::open(CameraSettings::of(camera, hardware)?)?))
}
