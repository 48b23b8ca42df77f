//! V4L2 calls of a camera.
//!
//! Crate `v4l` opens nodes and provides structures and request numbers. Its wrappers are not used
//! where they unwrap unknown values of a driver (control types, colour spaces) or lose a buffer
//! after a timeout.
#![allow(unsafe_code)] // mmap, and the descriptor of a device that `v4l` opened.

use std::ffi::c_void;
use std::io;
use std::ops::Range;
use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;

use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use v4l::v4l_sys as sys;

use super::request::{
    self, EnumerateFormats, FrameTiming, GetControl, GetTiming, MappedBuffer, PictureFormat,
    QueryBuffer, QueryCapability, QueryControl, QueueBuffer, RequestBuffers, SetControl, SetFormat,
    SetTiming, TakeBuffer, buffers_wanted, call, format_description, is, zeroed,
};

pub(super) struct Node(v4l::Device);

impl AsFd for Node {
    fn as_fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the descriptor stays open as long as the device, which outlives the borrow.
        unsafe { BorrowedFd::borrow_raw(self.0.handle().fd()) }
    }
}

/// Ids of user and camera controls in <linux/v4l2-controls.h>, with room for more.
const STANDARD_CONTROLS: [Range<u32>; 2] = [
    sys::V4L2_CID_BASE..sys::V4L2_CID_BASE + 64,
    sys::V4L2_CID_CAMERA_CLASS_BASE..sys::V4L2_CID_CAMERA_CLASS_BASE + 64,
];

#[derive(Debug, Clone)]
pub(super) struct NodeIdentity {
    pub(super) card: String,
    pub(super) driver: String,
    /// Whether the node captures pictures and streams them through buffers.
    pub(super) streams_pictures: bool,
}

/// A control as described by its driver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Control {
    pub(super) id: u32,
    /// Name as printed by `v4l2-ctl`: lower case with `_`.
    pub(super) name: String,
    pub(super) minimum: i32,
    pub(super) maximum: i32,
    pub(super) default: i32,
    /// Whether it is enabled, writable and has a value.
    pub(super) settable: bool,
}

/// A filled buffer taken from the queue. It cannot be copied or constructed elsewhere; while it
/// exists, the driver does not write to the buffer.
#[derive(Debug, PartialEq)]
pub(super) struct Filled {
    index: u32,
    pub(super) bytes_used: usize,
    pub(super) damaged: bool,
    pub(super) sequence: u32,
    /// Seconds on the monotonic clock; `None` if the driver uses another clock.
    pub(super) at_s: Option<f64>,
    /// Whether the driver declares the stamp as the exposure's start rather than the frame's end.
    pub(super) at_start: bool,
}

/// Text up to its terminating zero.
pub(super) fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes.split(|&b| b == 0).next().unwrap_or_default()).into_owned()
}

impl Node {
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        v4l::Device::with_path(path).map(Node)
    }

    pub(super) fn identity(&self) -> io::Result<NodeIdentity> {
        let mut caps = zeroed();
        call::<QueryCapability>(self, &mut caps)?;
        let own = if caps.capabilities & sys::V4L2_CAP_DEVICE_CAPS != 0 {
            caps.device_caps
        } else {
            caps.capabilities
        };
        let needed = sys::V4L2_CAP_VIDEO_CAPTURE | sys::V4L2_CAP_STREAMING;
        Ok(NodeIdentity {
            card: text(&caps.card),
            driver: text(&caps.driver),
            streams_pictures: own & needed == needed,
        })
    }

    pub(super) fn formats(&self) -> Vec<String> {
        let mut all = Vec::new();
        loop {
            let mut entry = format_description(all.len() as u32);
            if call::<EnumerateFormats>(self, &mut entry).is_err() {
                return all;
            }
            all.push(String::from_utf8_lossy(&entry.pixelformat.to_le_bytes()).into_owned());
        }
    }

    /// Requests a format and returns the driver's choice, which may differ without an error.
    pub(super) fn settle(
        &self,
        (width, height): (u32, u32),
        pixelformat: u32,
    ) -> io::Result<sys::v4l2_pix_format> {
        let field = sys::v4l2_field_V4L2_FIELD_NONE;
        let wanted = sys::v4l2_pix_format { width, height, pixelformat, field, ..zeroed() };
        let mut format = PictureFormat::new(wanted);
        call::<SetFormat>(self, &mut format)?;
        Ok(format.pix())
    }

    /// Frame interval in seconds; `None` if the driver does not state one.
    pub(super) fn frame_interval_s(&self) -> io::Result<Option<f64>> {
        let mut timing = FrameTiming::of_interval(0, 1);
        call::<GetTiming>(self, &mut timing)?;
        Ok(timing.interval_s())
    }

    /// Requests a frame interval, rounded up to 0.1 ms, and returns the driver's choice.
    pub(super) fn set_frame_interval_s(&self, seconds: f64) -> io::Result<Option<f64>> {
        let mut timing = FrameTiming::of_interval((seconds * 1e4).ceil() as u32, 10_000);
        call::<SetTiming>(self, &mut timing)?;
        Ok(timing.interval_s())
    }

    /// All controls that the driver can describe. uvcvideo fails for a control whose range the
    /// camera refuses, and does not name the next one, which is then searched for by its id.
    pub(super) fn controls(&self) -> Vec<Control> {
        let mut all: Vec<Control> = Vec::new();
        let mut last = 0;
        loop {
            let next = self.described(last | sys::V4L2_CTRL_FLAG_NEXT_CTRL);
            if next.as_ref().is_err_and(|end| is(end, Errno::INVAL)) {
                return all;
            }
            let mut later = STANDARD_CONTROLS.into_iter().flatten().filter(|&id| id > last);
            match next.ok().or_else(|| later.clone().find_map(|id| self.described(id).ok())) {
                Some(control) => {
                    last = control.id;
                    all.push(control);
                }
                // Past the standard controls come those of makers, with larger ids.
                None => match later.next_back() {
                    Some(end) => last = end,
                    None => return all,
                },
            }
        }
    }

    fn described(&self, id: u32) -> io::Result<Control> {
        let mut query = sys::v4l2_queryctrl { id, ..zeroed() };
        call::<QueryControl>(self, &mut query)?;
        let kinds = [
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_BOOLEAN,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_MENU,
            sys::v4l2_ctrl_type_V4L2_CTRL_TYPE_INTEGER_MENU,
        ];
        let locked = sys::V4L2_CTRL_FLAG_DISABLED | sys::V4L2_CTRL_FLAG_READ_ONLY;
        Ok(Control {
            id: query.id,
            name: control_name(&text(&query.name)),
            minimum: query.minimum,
            maximum: query.maximum,
            default: query.default_value,
            settable: kinds.contains(&query.type_) && query.flags & locked == 0,
        })
    }

    pub(super) fn set_control(&self, id: u32, value: i32) -> io::Result<()> {
        call::<SetControl>(self, &mut sys::v4l2_control { id, value })
    }

    pub(super) fn control(&self, id: u32) -> io::Result<i32> {
        let mut control = sys::v4l2_control { id, value: 0 };
        call::<GetControl>(self, &mut control)?;
        Ok(control.value)
    }

    /// Requests `count` buffers and returns the driver's count.
    pub(super) fn request_buffers(&self, count: u32) -> io::Result<u32> {
        let mut request = buffers_wanted(count);
        call::<RequestBuffers>(self, &mut request)?;
        Ok(request.count)
    }

    pub(super) fn map(&self, index: u32) -> io::Result<Buffer> {
        let mut buffer = MappedBuffer::new(index);
        call::<QueryBuffer>(self, &mut buffer)?;
        let (length, place) = (buffer.length as usize, u64::from(buffer.offset()));
        let access = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: a fresh mapping of `length` bytes at the offset the kernel gave for memory-mapped
        // buffers.
        let start =
            unsafe { mmap(std::ptr::null_mut(), length, access, MapFlags::SHARED, self, place)? };
        Ok(Buffer { start, length, index })
    }

    /// Marks the end of a frame in `buffer` with [`UNTOUCHED`], and gives the buffer to the driver.
    pub(super) fn queue(&self, buffer: &mut Buffer, frame_bytes: usize) -> io::Result<()> {
        buffer.mark(frame_bytes);
        call::<QueueBuffer>(self, &mut MappedBuffer::new(buffer.index))
    }

    /// Dequeues a filled buffer; `WouldBlock` if there is none.
    pub(super) fn take(&self) -> io::Result<Filled> {
        let mut buffer = MappedBuffer::new(0);
        call::<TakeBuffer>(self, &mut buffer)?;
        let monotonic = buffer.flags & sys::V4L2_BUF_FLAG_TIMESTAMP_MASK
            == sys::V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        let stamp = buffer.timestamp.tv_sec as f64 + buffer.timestamp.tv_usec as f64 * 1e-6;
        Ok(Filled {
            index: buffer.index,
            bytes_used: buffer.bytesused as usize,
            damaged: buffer.flags & sys::V4L2_BUF_FLAG_ERROR != 0,
            sequence: buffer.sequence,
            at_s: monotonic.then_some(stamp),
            at_start: buffer.flags & sys::V4L2_BUF_FLAG_TSTAMP_SRC_MASK
                == sys::V4L2_BUF_FLAG_TSTAMP_SRC_SOE,
        })
    }

    pub(super) fn stream(&self, on: bool) -> io::Result<()> {
        request::stream(self, on)
    }
}

/// Spells a driver's control name like `v4l2-ctl`: "Exposure Time, Absolute" →
/// `exposure_time_absolute`.
pub(super) fn control_name(title: &str) -> String {
    let words = title.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("_")
}

/// Last bytes of a frame that the driver has not written yet. A receiver may deliver a frame as
/// good although its lower rows were lost on the cable (rp1-cfe).
const UNTOUCHED: &[u8; 16] = b"relens: no frame";

pub(super) struct Buffer {
    start: *mut c_void,
    length: usize,
    index: u32,
}

// SAFETY: the mapping belongs to this value alone.
unsafe impl Send for Buffer {}

impl Buffer {
    /// Writes [`UNTOUCHED`] at the end of a frame of `frame_bytes`, if it fits.
    fn mark(&mut self, frame_bytes: usize) {
        if frame_bytes >= UNTOUCHED.len() && frame_bytes <= self.length {
            // SAFETY: the place is within the writable mapping. Only `Node::queue` calls this,
            // before the driver has the buffer, and `&mut self` excludes readers of it.
            unsafe {
                let end = self.start.cast::<u8>().add(frame_bytes - UNTOUCHED.len());
                std::ptr::copy_nonoverlapping(UNTOUCHED.as_ptr(), end, UNTOUCHED.len());
            }
        }
    }

    /// Whether the driver has not written the end of a frame of `frame_bytes`.
    pub(super) fn is_torn(&self, filled: &Filled, frame_bytes: usize) -> bool {
        self.bytes(filled).get(..frame_bytes).is_some_and(|frame| frame.ends_with(UNTOUCHED))
    }

    /// Bytes written by the driver.
    pub(super) fn bytes<'a>(&'a self, filled: &'a Filled) -> &'a [u8] {
        let used = filled.bytes_used.min(self.length);
        // SAFETY: the mapping is at least this long, readable, and lives as long as `self`; the
        // driver does not write to a buffer as long as its `Filled` exists.
        unsafe { std::slice::from_raw_parts(self.start.cast::<u8>(), used) }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: unmaps exactly what `map` mapped. A failure would leak a mapping and
        // nothing else.
        let _ = unsafe { munmap(self.start, self.length) };
    }
}

impl Filled {
    pub(super) fn index(&self) -> usize {
        self.index as usize
    }
}

#[cfg(test)]
mod tests {
    use super::control_name;

    #[test]
    fn control_names_are_spelled_as_v4l2_ctl_prints_them() {
        assert_eq!(control_name("Exposure Time, Absolute"), "exposure_time_absolute");
        assert_eq!(control_name("White Balance, Automatic"), "white_balance_automatic");
        assert_eq!(control_name("Gain"), "gain");
    }
}
