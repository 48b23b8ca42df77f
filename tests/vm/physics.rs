//! The light between panel and camera of the virtual rig: a process of its own that sees what is on scan-out when
//! the trigger line rises, sends it through the simulator's lens and sensor, and feeds the camera's node.
//!
//! `physics TRUTH.toml /dev/dri/card0 /dev/video0 LINE-NUMBER` runs until it is killed. It knows nothing of the
//! daemon: the trigger comes from the kernel's trace of GPIO values, the picture from the display driver.
#![allow(unsafe_code)] // mmap of the scanned-out buffer
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)] // a bench program: it says what failed and stops

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::path::Path;

use drm::Device as _;
use drm::control::Device as _;
use relens::config;
use relens::frame::{Codes, Counts, Plane, Size};
use relens::rig::exposure::Rig;
use relens::rig::simulated;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use v4l::video::Output;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

struct Card(File);

impl AsFd for Card {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl drm::Device for Card {}
impl drm::control::Device for Card {}

/// The buffer on scan-out, mapped.
struct Shown {
    start: *mut std::ffi::c_void,
    length: usize,
    pitch: usize,
    size: Size,
}

impl Shown {
    /// The buffer of the first active plane; `None` while the display is off.
    fn now(card: &Card) -> Outcome<Option<Shown>> {
        for plane in card.plane_handles()? {
            let info = card.get_plane(plane)?;
            let (Some(_), Some(picture)) = (info.crtc(), info.framebuffer()) else { continue };
            let info = card.get_planar_framebuffer(picture)?;
            let buffer = info.buffers()[0].ok_or("the kernel hides the buffer; physics must run as root")?;
            let fd = card.buffer_to_prime_fd(buffer, rustix::fs::OFlags::CLOEXEC.bits())?;
            card.close_buffer(buffer)?;
            let (pitch, (width, height)) = (info.pitches()[0] as usize, info.size());
            let length = pitch * height as usize;
            // SAFETY: a fresh read-only mapping of the buffer's own length.
            let start =
                unsafe { mmap(std::ptr::null_mut(), length, ProtFlags::READ, MapFlags::SHARED, &fd, 0)? };
            return Ok(Some(Shown {
                start,
                length,
                pitch,
                size: Size::new(width as usize, height as usize),
            }));
        }
        Ok(None)
    }

    fn codes(&self) -> Codes {
        // SAFETY: the mapping is this long and lives as long as `self`.
        let bytes = unsafe { std::slice::from_raw_parts(self.start.cast::<u8>(), self.length) };
        // XRGB8888, little-endian: blue, green, red, unused.
        Codes::from_planes(
            [2, 1, 0].map(|at| Plane::from_fn(self.size, |x, y| bytes[y * self.pitch + x * 4 + at])),
        )
    }
}

impl Drop for Shown {
    fn drop(&mut self) {
        // SAFETY: exactly what `now` mapped.
        let _ = unsafe { munmap(self.start, self.length) };
    }
}

/// A private instance of the kernel's tracer with the two events that matter.
fn trace() -> Outcome<File> {
    let folder = Path::new("/sys/kernel/tracing/instances/physics");
    if !folder.exists() {
        fs::create_dir(folder)?;
    }
    fs::write(folder.join("events/gpio/gpio_value/enable"), "1")?;
    fs::write(folder.join("events/drm/drm_vblank_event_delivered/enable"), "1")?;
    fs::write(folder.join("trace"), "")?;
    Ok(File::open(folder.join("trace_pipe"))?)
}

/// Red, green, blue bytes of 8-bit counts.
fn pack(counts: &Counts, bytes: &mut Vec<u8>) {
    bytes.clear();
    let [red, green, blue] = counts.planes().each_ref().map(|p| p.data());
    for ((r, g), b) in red.iter().zip(green).zip(blue) {
        bytes.extend([r, g, b].map(|&count| count.min(255) as u8));
    }
}

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [truth, card, video, line] = words.as_slice() else {
        return Err("usage: physics TRUTH.toml CARD VIDEO LINE-NUMBER".into());
    };
    let truth = config::load(Path::new(truth))?;
    let (mut bench, _): (Rig, _) = simulated::open(&truth)?;

    let card = Card(OpenOptions::new().read(true).write(true).open(card)?);
    // The first to open a node becomes its master, and would lock the daemon out.
    let _ = card.release_master_lock();
    card.set_client_capability(drm::ClientCapability::UniversalPlanes, true)?;
    let mut node = v4l::Device::with_path(video)?;
    let size = truth.camera.size();
    let wanted = v4l::Format::new(size.width as u32, size.height as u32, v4l::FourCC::new(b"RGB3"));
    let got = Output::set_format(&node, &wanted)?;
    if (got.width, got.height, got.fourcc) != (wanted.width, wanted.height, wanted.fourcc) {
        return Err(format!("the camera's node takes {got}").into());
    }
    // Until a writer has streamed, a reader's STREAMON fails.
    let kind = v4l::buffer::Type::VideoOutput as u32;
    // SAFETY: VIDIOC_STREAMON takes a pointer to the buffer type.
    unsafe {
        let argument = std::ptr::from_ref(&kind).cast_mut().cast();
        v4l::v4l2::ioctl(node.handle().fd(), v4l::v4l2::vidioc::VIDIOC_STREAMON, argument)?;
    }
    let mut trace = trace()?;
    let mut shown = Shown::now(&card)?;
    println!("physics is ready");

    let rise = format!("gpio_value: {line} set 1");
    let (mut text, mut chunk, mut bytes) = (String::new(), [0u8; 4096], Vec::new());
    loop {
        let read = trace.read(&mut chunk)?;
        text.push_str(std::str::from_utf8(&chunk[..read])?);
        while let Some(end) = text.find('\n') {
            let event: String = text.drain(..=end).collect();
            if event.contains("drm_vblank_event_delivered") {
                // Taken here and not at the trigger: the kernel names a buffer before its scan-out began.
                shown = Shown::now(&card)?;
            } else if event.contains(&rise) {
                let black = || Codes::zeros(truth.panel.size());
                let codes = shown.as_ref().map_or_else(black, Shown::codes);
                if codes.size() != truth.panel.size() {
                    println!(
                        "physics: the panel shows {}, the truth has {}",
                        codes.size(),
                        truth.panel.size()
                    );
                    continue;
                }
                pack(&bench.capture(&codes)?.counts, &mut bytes);
                if node.write(&bytes)? != bytes.len() {
                    return Err("the camera's node takes smaller frames".into());
                }
            }
        }
    }
}
