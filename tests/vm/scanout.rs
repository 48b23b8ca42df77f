//! Scan-out of the virtual panel: the display driver's current buffer, mapped and read.

use std::fs::{File, OpenOptions};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;

use drm::Device as _;
use drm::control::Device as _;
use relens::frame::{Codes, Plane, Size};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

use super::Outcome;

/// The display driver's node, opened as an observer.
pub struct Card(File);

impl AsFd for Card {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl drm::Device for Card {}
impl drm::control::Device for Card {}

impl Card {
    pub fn open(path: &Path) -> Outcome<Card> {
        let card = Card(OpenOptions::new().read(true).write(true).open(path)?);
        // The first program to open a node becomes its master, which would exclude the daemon.
        let _ = card.release_master_lock();
        card.set_client_capability(drm::ClientCapability::UniversalPlanes, true)?;
        Ok(card)
    }

    /// Buffer of the first active plane; `None` while the display is off.
    pub fn scanned_out(&self) -> Outcome<Option<Shown>> {
        for plane in self.plane_handles()? {
            let info = self.get_plane(plane)?;
            let (Some(_), Some(picture)) = (info.crtc(), info.framebuffer()) else { continue };
            let info = self.get_planar_framebuffer(picture)?;
            let buffer =
                info.buffers()[0].ok_or("the kernel hides the buffer; physics must run as root")?;
            let fd = self.buffer_to_prime_fd(buffer, rustix::fs::OFlags::CLOEXEC.bits())?;
            self.close_buffer(buffer)?;
            let (pitch, (width, height)) = (info.pitches()[0] as usize, info.size());
            let length = pitch * height as usize;
            // SAFETY: a fresh read-only mapping of the buffer's own length.
            let start = unsafe {
                mmap(std::ptr::null_mut(), length, ProtFlags::READ, MapFlags::SHARED, &fd, 0)?
            };
            let size = Size::new(width as usize, height as usize);
            return Ok(Some(Shown { start, length, pitch, size, number: u32::from(picture) }));
        }
        Ok(None)
    }
}

/// A mapped buffer of the scan-out.
pub struct Shown {
    start: *mut std::ffi::c_void,
    length: usize,
    pitch: usize,
    size: Size,
    /// The driver's number of the buffer.
    pub number: u32,
}

impl Shown {
    pub fn codes(&self) -> Codes {
        // SAFETY: the mapping is this long and lives as long as `self`.
        let bytes = unsafe { std::slice::from_raw_parts(self.start.cast::<u8>(), self.length) };
        // XRGB8888, little-endian: blue, green, red, unused.
        Codes::from_planes(
            [2, 1, 0]
                .map(|at| Plane::from_fn(self.size, |x, y| bytes[y * self.pitch + x * 4 + at])),
        )
    }
}

impl Drop for Shown {
    fn drop(&mut self) {
        // SAFETY: exactly what `scanned_out` mapped.
        let _ = unsafe { munmap(self.start, self.length) };
    }
}
