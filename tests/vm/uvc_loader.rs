//! Maps the controls of the USB camera's extension unit to V4L2 controls, as
//! `tcam-uvc-extension-loader` does: `uvc_loader /dev/videoN`.
#![allow(unsafe_code)] // ioctl
// A test program, which panics on errors.
#![allow(clippy::unwrap_used, missing_docs)]

use std::fs::File;
use std::os::fd::AsRawFd;

/// Argument of UVCIOC_CTRL_MAP (include/uapi/linux/uvcvideo.h).
#[repr(C)]
struct Mapping {
    id: u32,
    name: [u8; 32],
    unit: [u8; 16],
    selector: u8,
    bits: u8,
    offset: u8,
    v4l2_type: u32,
    data_type: u32,
    menu: *const MenuEntry,
    menu_count: u32,
    reserved: [u32; 4],
}

#[repr(C)]
struct MenuEntry {
    value: u32,
    name: [u8; 32],
}

/// `_IOWR('u', 0x20, struct uvc_xu_control_mapping)`.
const MAP: u64 = 3 << 30 | (size_of::<Mapping>() as u64) << 16 | 0x75 << 8 | 0x20;

/// Guid 0aba49de-5c0b-49d5-8f71-0be40f94a67a, in the order of the bytes on the cable.
const UNIT: [u8; 16] = *b"\xde\x49\xba\x0a\x0b\x5c\xd5\x49\x8f\x71\x0b\xe4\x0f\x94\xa6\x7a";

fn name(text: &str) -> [u8; 32] {
    let mut name = [0; 32];
    name[..text.len()].copy_from_slice(text.as_bytes());
    name
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: uvc_loader /dev/videoN")?;
    let node = File::options().read(true).write(true).open(path)?;
    let edges = ["Rising Edge", "Falling Edge"];
    let menu: Vec<MenuEntry> =
        (0..).zip(edges).map(|(value, edge)| MenuEntry { value, name: name(edge) }).collect();
    // As in tiscamera's data/uvc-extensions/usb33.json: a boolean of one bit, and a menu of bytes.
    let trigger_mode = Mapping {
        id: 0x199e208,
        name: name("Trigger Mode"),
        unit: UNIT,
        selector: 0x05,
        bits: 1,
        offset: 0,
        v4l2_type: 2,
        data_type: 3,
        menu: std::ptr::null(),
        menu_count: 0,
        reserved: [0; 4],
    };
    let trigger_polarity = Mapping {
        id: 0x199e234,
        name: name("Trigger Polarity"),
        selector: 0x41,
        bits: 8,
        v4l2_type: 3,
        data_type: 2,
        menu: menu.as_ptr(),
        menu_count: menu.len() as u32,
        ..trigger_mode
    };
    for mut mapping in [trigger_mode, trigger_polarity] {
        // SAFETY: the kernel reads and writes one such structure, and reads its menu, which lives.
        unsafe { v4l::v4l2::ioctl(node.as_raw_fd(), MAP, (&raw mut mapping).cast())? };
    }
    Ok(())
}
