//! Requests of a V4L2 node. Each is bound to the structure that it reads and writes, which makes
//! calls sound.
#![allow(unsafe_code)] // ioctl and the kernel's unions.

use std::io;
use std::ops::Deref;
use std::os::fd::{AsFd, AsRawFd};

#[cfg(test)]
pub(super) use super::tests::kernel::ioctl;
use rustix::io::Errno;
use v4l::v4l_sys as sys;
#[cfg(not(test))]
pub(super) use v4l::v4l2::ioctl;
use v4l::v4l2::vidioc;

const CAPTURE: u32 = sys::v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE;
const MMAP: u32 = sys::v4l2_memory_V4L2_MEMORY_MMAP;

/// A structure for which all zeros are valid.
///
/// # Safety
/// All bits zero must be a value of the type.
pub(super) unsafe trait Zeroable: Sized {}

/// A request: its number and the structure that it takes.
///
/// # Safety
/// For `NUMBER` the kernel must read and write one `Argument`, and no memory that its values point
/// to.
pub(super) unsafe trait Request {
    const NUMBER: vidioc::_IOC_TYPE;
    type Argument;
}

macro_rules! zeroable {
    ($($structure:ident)*) => {$(
        // SAFETY: plain integers, arrays and unions of such, without pointers or enums.
        unsafe impl Zeroable for sys::$structure {}
    )*};
}

zeroable! {
    v4l2_capability v4l2_fmtdesc v4l2_format v4l2_pix_format v4l2_queryctrl v4l2_requestbuffers
    v4l2_buffer v4l2_streamparm
}

macro_rules! requests {
    ($($name:ident = $number:ident($argument:ty);)*) => {$(
        pub(super) enum $name {}

        // SAFETY: <linux/videodev2.h> pairs number and structure, and `call` compares their sizes.
        // None of the structures points the kernel to other memory: formats and buffers, which
        // could, are constructed only here, for pictures in buffers that the driver owns.
        unsafe impl Request for $name {
            const NUMBER: vidioc::_IOC_TYPE = vidioc::$number;
            type Argument = $argument;
        }
    )*};
}

requests! {
    QueryCapability = VIDIOC_QUERYCAP(sys::v4l2_capability);
    EnumerateFormats = VIDIOC_ENUM_FMT(sys::v4l2_fmtdesc);
    SetFormat = VIDIOC_S_FMT(PictureFormat);
    QueryControl = VIDIOC_QUERYCTRL(sys::v4l2_queryctrl);
    SetControl = VIDIOC_S_CTRL(sys::v4l2_control);
    GetControl = VIDIOC_G_CTRL(sys::v4l2_control);
    GetTiming = VIDIOC_G_PARM(FrameTiming);
    SetTiming = VIDIOC_S_PARM(FrameTiming);
    RequestBuffers = VIDIOC_REQBUFS(sys::v4l2_requestbuffers);
    QueryBuffer = VIDIOC_QUERYBUF(MappedBuffer);
    QueueBuffer = VIDIOC_QBUF(MappedBuffer);
    TakeBuffer = VIDIOC_DQBUF(MappedBuffer);
    StreamOn = VIDIOC_STREAMON(u32);
    StreamOff = VIDIOC_STREAMOFF(u32);
}

/// Runs a request, and repeats it if a signal interrupts it.
pub(super) fn call<R: Request>(node: &impl AsFd, argument: &mut R::Argument) -> io::Result<()> {
    // A request's number contains the size of its structure (asm-generic/ioctl.h).
    const { assert!((R::NUMBER as usize >> 16) & 0x3fff == size_of::<R::Argument>()) };
    loop {
        let argument = std::ptr::from_mut(argument).cast();
        // SAFETY: the pointer is to a live `Argument`, and `Request` promises that the kernel
        // touches nothing else.
        match unsafe { ioctl(node.as_fd().as_raw_fd(), R::NUMBER, argument) } {
            Err(cause) if cause.kind() == io::ErrorKind::Interrupted => {}
            outcome => return outcome,
        }
    }
}

/// Whether `error` is the kernel's `errno`.
pub(super) fn is(error: &io::Error, errno: Errno) -> bool {
    Errno::from_io_error(error) == Some(errno)
}

pub(super) fn zeroed<T: Zeroable>() -> T {
    // SAFETY: guaranteed by the trait.
    unsafe { std::mem::zeroed() }
}

/// Query for the driver's picture format `index`.
pub(super) fn format_description(index: u32) -> sys::v4l2_fmtdesc {
    sys::v4l2_fmtdesc { index, type_: CAPTURE, ..zeroed() }
}

/// Request for `count` buffers that the driver owns and this program maps.
pub(super) fn buffers_wanted(count: u32) -> sys::v4l2_requestbuffers {
    sys::v4l2_requestbuffers { count, type_: CAPTURE, memory: MMAP, ..zeroed() }
}

/// Starts or stops streaming.
pub(super) fn stream(node: &impl AsFd, on: bool) -> io::Result<()> {
    let kind = &mut { CAPTURE };
    if on { call::<StreamOn>(node, kind) } else { call::<StreamOff>(node, kind) }
}

/// A format of captured pictures; other kinds of format hold pointers.
#[repr(transparent)]
pub(super) struct PictureFormat(sys::v4l2_format);

impl PictureFormat {
    pub(super) fn new(pix: sys::v4l2_pix_format) -> Self {
        let mut format = sys::v4l2_format { type_: CAPTURE, ..zeroed() };
        format.fmt.pix = pix;
        PictureFormat(format)
    }

    pub(super) fn pix(&self) -> sys::v4l2_pix_format {
        // SAFETY: the member was written by `new`, and any bits are a value of it.
        unsafe { self.0.fmt.pix }
    }
}

/// Timing of a stream of captured pictures.
#[repr(transparent)]
pub(super) struct FrameTiming(sys::v4l2_streamparm);

impl FrameTiming {
    /// Request for a frame interval of `numerator`/`denominator` seconds.
    pub(super) fn of_interval(numerator: u32, denominator: u32) -> Self {
        let mut timing = sys::v4l2_streamparm { type_: CAPTURE, ..zeroed() };
        timing.parm.capture.timeperframe = sys::v4l2_fract { numerator, denominator };
        FrameTiming(timing)
    }

    /// Frame interval in seconds; `None` if the driver does not state one.
    pub(super) fn interval_s(&self) -> Option<f64> {
        // SAFETY: any bits are a value of this member.
        let capture = unsafe { self.0.parm.capture };
        let sys::v4l2_fract { numerator, denominator } = capture.timeperframe;
        let has = capture.capability & sys::V4L2_CAP_TIMEPERFRAME != 0 && denominator > 0;
        has.then(|| f64::from(numerator) / f64::from(denominator))
    }
}

/// A buffer that the driver owns and this program maps; other kinds of buffer hold pointers.
#[repr(transparent)]
pub(super) struct MappedBuffer(sys::v4l2_buffer);

impl MappedBuffer {
    pub(super) fn new(index: u32) -> Self {
        MappedBuffer(sys::v4l2_buffer { index, type_: CAPTURE, memory: MMAP, ..zeroed() })
    }

    /// Offset at which to map the buffer, once it has been queried.
    pub(super) fn offset(&self) -> u32 {
        // SAFETY: any bits are a value of this member.
        unsafe { self.0.m.offset }
    }
}

impl Deref for MappedBuffer {
    type Target = sys::v4l2_buffer;

    fn deref(&self) -> &sys::v4l2_buffer {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a file that is no video node refuses the request.
    fn refused<R: Request>(mut argument: R::Argument) -> bool {
        let null = std::fs::File::open("/dev/null").unwrap();
        let error = call::<R>(&null, &mut argument).unwrap_err();
        is(&error, Errno::NOTTY)
    }

    #[test]
    fn every_request_reaches_the_kernel() {
        // The size of each structure is asserted at compile time.
        assert!(refused::<QueryCapability>(zeroed()));
        assert!(refused::<EnumerateFormats>(format_description(0)));
        assert!(refused::<SetFormat>(PictureFormat::new(zeroed())));
        assert!(refused::<QueryControl>(zeroed()));
        assert!(refused::<SetControl>(sys::v4l2_control { id: 0, value: 0 }));
        assert!(refused::<GetControl>(sys::v4l2_control { id: 0, value: 0 }));
        assert!(refused::<GetTiming>(FrameTiming::of_interval(0, 1)));
        assert!(refused::<SetTiming>(FrameTiming::of_interval(1, 20)));
        assert!(refused::<RequestBuffers>(buffers_wanted(2)));
        assert!(refused::<QueryBuffer>(MappedBuffer::new(0)));
        assert!(refused::<QueueBuffer>(MappedBuffer::new(0)));
        assert!(refused::<TakeBuffer>(MappedBuffer::new(0)));
        assert!(stream(&std::fs::File::open("/dev/null").unwrap(), true).is_err());
    }

    #[test]
    fn formats_and_buffers_are_of_pictures_in_the_driver_s_memory() {
        let pix = sys::v4l2_pix_format { width: 7, height: 5, ..zeroed() };
        let format = PictureFormat::new(pix);
        assert_eq!((format.0.type_, format.pix().width, format.pix().height), (CAPTURE, 7, 5));
        let buffer = MappedBuffer::new(3);
        assert_eq!((buffer.index, buffer.type_, buffer.memory), (3, CAPTURE, MMAP));
        assert_eq!((buffer.offset(), buffer.length), (0, 0));
    }
}
