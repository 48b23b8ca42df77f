//! Takes the display from a program of the virtual rig for a while, as a desktop would: `taker PID
//! CARD SECONDS`.
//!
//! The right to set modes (DRM master) belongs to the open file, so a copy of the program's
//! descriptor suffices to drop it. This program then becomes master and shows its own picture; when
//! it ends, the kernel blanks the display.
// A test program, which panics on errors.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use std::fs::File;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;
use std::time::Duration;

use drm::Device as _;
use drm::buffer::DrmFourcc;
use drm::control::Device as _;
use rustix::process::{Pid, PidfdFlags, PidfdGetfdFlags, pidfd_getfd, pidfd_open};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

struct Card(OwnedFd);

impl AsFd for Card {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

impl drm::Device for Card {}
impl drm::control::Device for Card {}

/// Drops DRM master of the process `pid` for the display at `path`.
fn give_up_for(pid: Pid, path: &Path) -> Outcome<()> {
    let process = pidfd_open(pid, PidfdFlags::empty())?;
    for entry in std::fs::read_dir(format!("/proc/{}/fd", pid.as_raw_nonzero()))? {
        let entry = entry?;
        if std::fs::read_link(entry.path()).is_ok_and(|target| target == path) {
            let number = entry.file_name().to_string_lossy().parse()?;
            let copy = Card(pidfd_getfd(&process, number, PidfdGetfdFlags::empty())?);
            // A mere observer is no master.
            if copy.release_master_lock().is_ok() {
                return Ok(());
            }
        }
    }
    Err(format!("process {} does not drive {}", pid.as_raw_nonzero(), path.display()).into())
}

/// Shows a dark picture on the active display.
fn show_something(card: &Card) -> Outcome<()> {
    let all = card.resource_handles()?;
    for &crtc in all.crtcs() {
        let info = card.get_crtc(crtc)?;
        let Some(mode) = info.mode() else { continue };
        let (width, height) = (mode.size().0.into(), mode.size().1.into());
        let memory = card.create_dumb_buffer((width, height), DrmFourcc::Xrgb8888, 32)?;
        let picture = card.add_framebuffer(&memory, 24, 32)?;
        let mut lit = Vec::new();
        for &connector in all.connectors() {
            let encoder = card.get_connector(connector, false)?.current_encoder();
            let of = encoder.map(|encoder| card.get_encoder(encoder)).transpose()?;
            if of.and_then(|encoder| encoder.crtc()) == Some(crtc) {
                lit.push(connector);
            }
        }
        card.set_crtc(crtc, Some(picture), (0, 0), &lit, Some(mode))?;
        return Ok(());
    }
    Err("nothing is lit".into())
}

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [pid, card, seconds] = words.as_slice() else {
        return Err("usage: taker PID CARD SECONDS".into());
    };
    let pid = Pid::from_raw(pid.parse()?).ok_or("no process")?;
    let path = Path::new(card);
    give_up_for(pid, path)?;
    let card = Card(File::options().read(true).write(true).open(path)?.into());
    card.acquire_master_lock()?;
    show_something(&card)?;
    println!("the display is taken");
    std::thread::sleep(Duration::from_secs_f64(seconds.parse()?));
    Ok(())
}
