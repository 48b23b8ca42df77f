//! Checks of what the kernel grants a USB3 Vision camera: its node, and memory for its frames.

use std::fs::read_to_string;
use std::path::{Path, PathBuf};

use rustix::fs::Access;

use crate::rig::RigError;
use crate::rig::camera::memory::refused;

/// Fails if there is a USB3 Vision camera (class ef, subclass 05 of the interface; USB3 Vision 1.0)
/// that this user may not open, under the file system `root`.
pub(super) fn refuse_forbidden(root: &Path) -> Result<(), RigError> {
    for interface in std::fs::read_dir(root.join("sys/bus/usb/devices")).into_iter().flatten() {
        let Ok(interface) = interface else { continue };
        let value = |path: PathBuf| read_to_string(path).map(|text| text.trim().to_owned());
        let is = |name, wanted| value(interface.path().join(name)).is_ok_and(|has| has == wanted);
        if !is("bInterfaceClass", "ef") || !is("bInterfaceSubClass", "05") {
            continue;
        }
        // An interface is named after its device: 2-1:1.0 belongs to 2-1.
        let name = interface.file_name().to_string_lossy().into_owned();
        let device = interface.path().with_file_name(name.split(':').next().unwrap_or_default());
        let number = |name| value(device.join(name)).ok().and_then(|n| n.parse::<u32>().ok());
        let (Some(bus), Some(device)) = (number("busnum"), number("devnum")) else { continue };
        let node = root.join(format!("dev/bus/usb/{bus:03}/{device:03}"));
        if rustix::fs::access(&node, Access::READ_OK | Access::WRITE_OK).is_err() {
            return Err(refused(
                format!("a USB3 Vision camera at {} that this user may not open", node.display()),
                "one that the user may read and write: the udev rule for USB3 Vision in \
                 70-relens.rules, and the group `video`",
            ));
        }
    }
    Ok(())
}

/// Refuses a stream whose `buffers` of `frame_bytes` each exceed the memory that the kernel grants
/// to all of USB: `usbfs_memory_mb` under the file system `root`, where 0 is no limit.
pub(super) fn check_memory(
    root: &Path,
    buffers: usize,
    frame_bytes: usize,
) -> Result<(), RigError> {
    let granted_mb = read_to_string(root.join("sys/module/usbcore/parameters/usbfs_memory_mb"));
    let needed_mb = (buffers * frame_bytes).div_ceil(1 << 20);
    match granted_mb.unwrap_or_default().trim().parse::<usize>() {
        Ok(mb) if mb != 0 && mb < needed_mb => Err(refused(
            format!("usbfs_memory_mb = {mb} of the kernel, with frames of {frame_bytes} bytes"),
            format!(
                "{needed_mb} or more: usbcore.usbfs_memory_mb={} on the kernel's command line",
                needed_mb.next_power_of_two().max(128)
            ),
        )),
        _ => Ok(()),
    }
}
