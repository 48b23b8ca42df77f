//! Kinds of cameras, one folder each.

#[cfg(feature = "genicam")]
pub mod genicam;
mod memory;
pub mod v4l2;

use self::v4l2::{CameraSettings, V4l2Camera};
use super::{Camera, RigError};
use crate::config::{CameraDevice, CameraTable, Hardware};

pub(super) fn open(
    camera: &CameraTable,
    hardware: &Hardware,
) -> Result<Box<dyn Camera + Send>, RigError> {
    match &hardware.camera {
        CameraDevice::V4l2(device) => {
            let settings = CameraSettings::of(camera, device, &hardware.trigger)?;
            Ok(Box::new(V4l2Camera::open(settings)?))
        }
        #[cfg(feature = "genicam")]
        CameraDevice::Genicam(device) => {
            let settings = genicam::GenicamSettings::of(camera, device)?;
            Ok(Box::new(genicam::GenicamCamera::open(settings)?))
        }
        #[cfg(not(feature = "genicam"))]
        CameraDevice::Genicam(_) => Err(memory::refused(
            "kind = \"genicam\" in [hardware.camera]",
            "\"v4l2\"; this relens was built without `--features genicam`",
        )),
    }
}
