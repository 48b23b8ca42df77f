//! Calls of a media device and its subdevices, with the structures of <linux/media.h> and
//! <linux/v4l2-subdev.h>.
#![allow(unsafe_code)] // ioctl, and structures that are all zeros at first.

use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use v4l::v4l2::vidioc;

use super::super::kernel::text;
use super::super::request::{Request, Zeroable, call, ioctl, is, zeroed};

/// Limit of entities, pads, links or interfaces: far more than on any board. Guess.
const OBJECTS_MAX: u32 = 4096;
/// Attempts to read a graph that changes while it is read.
const READINGS_MAX: usize = 8;
const ACTIVE: u32 = 1;
const LINK_KIND: u32 = 0xf << 28;
/// Kinds of links: from an interface to an entity, and between pads.
pub(super) const INTERFACE_LINK: u32 = 1 << 28;
pub(super) const PAD_LINK: u32 = 0;
pub(super) const ENABLED: u32 = 1;
pub(super) const IMMUTABLE: u32 = 2;

macro_rules! structures {
    ($($(#[$meta:meta])* $name:ident { $($field:ident: $type:ty,)* })*) => {$(
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy)]
        pub(super) struct $name { $(pub(super) $field: $type,)* }

        // SAFETY: plain integers and arrays of such.
        unsafe impl Zeroable for $name {}
    )*};
}

structures! {
    /// `media_device_info`.
    DeviceInfo {
        driver: [u8; 16], model: [u8; 32], serial: [u8; 40], bus: [u8; 32],
        media_version: u32, hardware: u32, driver_version: u32, reserved: [u32; 31],
    }
    /// `media_v2_entity`.
    GraphEntity { id: u32, name: [u8; 64], function: u32, flags: u32, reserved: [u32; 5], }
    /// `media_v2_interface` of a device node.
    GraphInterface {
        id: u32, kind: u32, flags: u32, reserved: [u32; 9], major: u32, minor: u32, rest: [u32; 14],
    }
    /// `media_v2_pad`.
    GraphPad { id: u32, entity: u32, flags: u32, index: u32, reserved: [u32; 4], }
    /// `media_v2_link`, between pads or from an interface to an entity.
    GraphLink { id: u32, source: u32, sink: u32, flags: u32, reserved: [u32; 6], }
    /// One of the lists of `media_v2_topology`.
    ObjectList { count: u32, reserved: u32, place: u64, }
    /// `media_v2_topology`.
    GraphRequest {
        version: u64,
        entities: ObjectList, interfaces: ObjectList, pads: ObjectList, links: ObjectList,
    }
    /// `media_pad_desc`.
    LinkEnd { entity: u32, pad: u16, unused: u16, flags: u32, reserved: [u32; 2], }
    /// `media_link_desc`.
    LinkSetting { source: LinkEnd, sink: LinkEnd, flags: u32, reserved: [u32; 2], }
    /// `v4l2_subdev_format` with the `v4l2_mbus_framefmt` in it.
    PadSetting {
        which: u32, pad: u32, width: u32, height: u32, code: u32, field: u32, colours: u32,
        encoding: u16, range: u16, transfer: u16, flags: u16, unused: [u16; 10],
        reserved: [u32; 8],
    }
}

/// `_IOWR(kind, number, Argument)` (asm-generic/ioctl.h).
const fn reads_and_writes<Argument>(kind: u8, number: u8) -> vidioc::_IOC_TYPE {
    let size = size_of::<Argument>() as u32;
    ((3 << 30) | (size << 16) | ((kind as u32) << 8) | number as u32) as vidioc::_IOC_TYPE
}

const READ_GRAPH: vidioc::_IOC_TYPE = reads_and_writes::<GraphRequest>(b'|', 4);

macro_rules! requests {
    ($($name:ident = $kind:literal, $number:literal, $argument:ty;)*) => {$(
        enum $name {}

        // SAFETY: the kernel's headers pair number and structure, and no field is an address.
        unsafe impl Request for $name {
            const NUMBER: vidioc::_IOC_TYPE = reads_and_writes::<$argument>($kind, $number);
            type Argument = $argument;
        }
    )*};
}

requests! {
    ReadInfo = b'|', 0, DeviceInfo;
    SetLink = b'|', 3, LinkSetting;
    GetPad = b'V', 4, PadSetting;
    SetPad = b'V', 5, PadSetting;
}

pub(super) struct MediaDevice(OwnedFd);

impl AsFd for MediaDevice {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

#[derive(Default)]
pub(super) struct Objects {
    pub(super) entities: Vec<GraphEntity>,
    pub(super) interfaces: Vec<GraphInterface>,
    pub(super) pads: Vec<GraphPad>,
    pub(super) links: Vec<GraphLink>,
}

impl GraphLink {
    /// [`INTERFACE_LINK`] or [`PAD_LINK`].
    pub(super) fn kind(&self) -> u32 {
        self.flags & LINK_KIND
    }
}

impl MediaDevice {
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let flags = OFlags::RDWR | OFlags::CLOEXEC;
        Ok(MediaDevice(rustix::fs::open(path, flags, Mode::empty())?))
    }

    pub(super) fn driver(&self) -> io::Result<String> {
        let mut info = zeroed::<DeviceInfo>();
        call::<ReadInfo>(self, &mut info)?;
        Ok(text(&info.driver))
    }

    pub(super) fn objects(&self) -> io::Result<Objects> {
        for _ in 0..READINGS_MAX {
            let mut objects = Objects::default();
            let mut request = zeroed::<GraphRequest>();
            self.read_graph(&mut request)?;
            objects.entities = room(&mut request.entities)?;
            objects.interfaces = room(&mut request.interfaces)?;
            objects.pads = room(&mut request.pads)?;
            objects.links = room(&mut request.links)?;
            match self.read_graph(&mut request) {
                Ok(()) => {
                    objects.entities.truncate(request.entities.count as usize);
                    objects.interfaces.truncate(request.interfaces.count as usize);
                    objects.pads.truncate(request.pads.count as usize);
                    objects.links.truncate(request.links.count as usize);
                    return Ok(objects);
                }
                // The graph has grown meanwhile.
                Err(cause) if is(&cause, Errno::NOSPC) => {}
                Err(cause) => return Err(cause),
            }
        }
        Err(io::Error::other("its graph keeps changing"))
    }

    /// Fills the lists of `request`; each has either no address, or room for its count.
    fn read_graph(&self, request: &mut GraphRequest) -> io::Result<()> {
        let argument = std::ptr::from_mut(request).cast();
        // SAFETY: the pointer is to a live `GraphRequest`. The kernel writes no more objects to a
        // list's place than its count (`media_device_get_topology`), for which `room` allocated it.
        unsafe { ioctl(self.0.as_raw_fd(), READ_GRAPH, argument) }
    }

    pub(super) fn set_link(&self, from: LinkEnd, to: LinkEnd, flags: u32) -> io::Result<()> {
        let mut setting = LinkSetting { source: from, sink: to, flags, ..zeroed() };
        call::<SetLink>(self, &mut setting)
    }
}

/// Allocates the objects counted by `list`, and sets its address.
fn room<T: Zeroable + Copy>(list: &mut ObjectList) -> io::Result<Vec<T>> {
    if list.count > OBJECTS_MAX {
        return Err(io::Error::other(format!("{} objects of one kind", list.count)));
    }
    let mut objects = vec![zeroed::<T>(); list.count as usize];
    list.place = if objects.is_empty() { 0 } else { objects.as_mut_ptr() as u64 };
    Ok(objects)
}

pub(super) fn link_end(entity: u32, pad: u32) -> LinkEnd {
    LinkEnd { entity, pad: pad as u16, ..zeroed() }
}

pub(super) fn pad_format(node: &impl AsFd, pad: u32) -> io::Result<PadSetting> {
    let mut setting = PadSetting { which: ACTIVE, pad, ..zeroed() };
    call::<GetPad>(node, &mut setting)?;
    Ok(setting)
}

/// Requests a format and returns the driver's choice, which may differ without an error.
pub(super) fn set_pad_format(node: &impl AsFd, wanted: PadSetting) -> io::Result<PadSetting> {
    let mut setting = PadSetting { which: ACTIVE, ..wanted };
    call::<SetPad>(node, &mut setting)?;
    Ok(setting)
}

/// Request for a size and bus format of `pad`, progressive (`V4L2_FIELD_NONE`), with the colour
/// fields of the pad `before` it, or else the driver's own.
pub(super) fn wish(
    pad: u32,
    size: (u32, u32),
    code: u32,
    before: Option<PadSetting>,
) -> PadSetting {
    let before = before.unwrap_or(zeroed());
    PadSetting { pad, width: size.0, height: size.1, code, field: 1, ..before }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_are_as_long_as_the_kernel_s() {
        // sizeof() of <linux/media.h> and <linux/v4l2-subdev.h> on a 64-bit machine.
        assert_eq!(size_of::<DeviceInfo>(), 256);
        assert_eq!(size_of::<GraphEntity>(), 96);
        assert_eq!(size_of::<GraphInterface>(), 112);
        assert_eq!(size_of::<GraphPad>(), 32);
        assert_eq!(size_of::<GraphLink>(), 40);
        assert_eq!(size_of::<GraphRequest>(), 72);
        assert_eq!(size_of::<LinkEnd>(), 20);
        assert_eq!(size_of::<LinkSetting>(), 52);
        assert_eq!(size_of::<PadSetting>(), 88);
    }

    #[test]
    fn requests_have_the_numbers_of_the_kernel_s_headers() {
        // As printed by a C program with these headers.
        assert_eq!(ReadInfo::NUMBER as u32, 0xc100_7c00);
        assert_eq!(SetLink::NUMBER as u32, 0xc034_7c03);
        assert_eq!(READ_GRAPH as u32, 0xc048_7c04);
        assert_eq!(GetPad::NUMBER as u32, 0xc058_5604);
        assert_eq!(SetPad::NUMBER as u32, 0xc058_5605);
    }

    #[test]
    fn a_file_that_is_no_media_device_is_an_error() {
        let null = MediaDevice::open(Path::new("/dev/null")).unwrap();
        for error in [
            null.driver().unwrap_err(),
            null.objects().err().unwrap(),
            null.set_link(link_end(1, 0), link_end(2, 0), ENABLED).unwrap_err(),
            pad_format(&null, 0).err().unwrap(),
            set_pad_format(&null, wish(0, (640, 480), 0x3001, None)).err().unwrap(),
        ] {
            assert!(is(&error, Errno::NOTTY), "{error}");
        }
    }
}
