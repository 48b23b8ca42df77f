//! A real display as panel: kernel mode setting with two dumb buffers and time-stamped flips.
//!
//! The kernel's text console does not draw over a DRM master with a lit pipe. Faults in the field
//! (another program takes the display, the cable is pulled, the link needs training) are looked for
//! before every picture and repaired by setting the mode again; until that succeeds, each call
//! returns the error.

use drm::Device as _;
use drm::buffer::{Buffer as _, DrmFourcc};
use drm::control::{
    AtomicCommitFlags, Device as _, Event, Mode, atomic::AtomicModeReq, connector, crtc,
    dumbbuffer::DumbBuffer, framebuffer, property,
};
use rustix::io::Errno;

use super::display_link::{ConnectorState, Display, Link, unplugged};
use super::kms_card::{Card, commit_failed, failed};
use super::modeset::{Pipe, darken, light_up};
use super::monotonic::{Monotonic, ready_by};
use super::{Clock, Flip, Moment, Panel, RigError};
use crate::config::{PanelDevice, PanelTable};
use crate::frame::{Codes, Size};

/// Refreshes without a flip event after which the pipe counts as dead. A live driver needs one or
/// two; the kernel itself waits 10 s.
const FLIP_REFRESHES_MAX: f64 = 30.0;
/// Number of flips timed when the panel is opened. Psychtoolbox takes 50; the kernel's stamps are
/// exact to microseconds.
const TIMED_FLIPS: usize = 24;
/// Relative tolerance of the measured refresh interval: accepts 59.94 Hz for 60, not 50.
const INTERVAL_ERROR_MAX: f64 = 0.005;

struct PictureBuffer {
    picture: framebuffer::Handle,
    memory: DumbBuffer,
}

/// A display driven by this program as DRM master.
pub struct KmsPanel {
    card: Card,
    connector: String,
    size: Size,
    pipe: Pipe,
    mode: Mode,
    /// The plane's FB_ID.
    picture_property: property::Handle,
    buffers: [PictureBuffer; 2],
    /// Index of the buffer shown or requested last.
    front: usize,
    link: Link,
    before: Option<crtc::Info>,
    interval_s: f64,
    /// One packed row in ordinary memory, since buffers are write-combined on Arm.
    row: Vec<u8>,
}

impl KmsPanel {
    /// Opens and lights the display of `device`, which must have a mode of `panel`'s size and
    /// refresh rate, and measures its refresh interval.
    ///
    /// # Errors
    /// [`RigError::Gone`] without a node or a display, [`RigError::Held`] while another program
    /// drives it, [`RigError::Refused`] if connector, mode, settings or measured interval do not
    /// match.
    pub fn open(panel: &PanelTable, device: &PanelDevice) -> Result<Self, RigError> {
        let (PanelDevice { node, connector: name }, size) = (device, panel.size());
        let card = Card::open(node.as_deref(), name)?;
        if card.acquire_master_lock().is_err() {
            return Err(commit_failed(Errno::ACCESS.into()));
        }
        // The kernel lists primary planes only with the first capability.
        for capability in [drm::ClientCapability::UniversalPlanes, drm::ClientCapability::Atomic] {
            card.set_client_capability(capability, true).map_err(|_| {
                let found = "a display driver without atomic mode setting";
                let allowed = "a driver with it, which every current graphics chip has";
                RigError::refused("panel", found, allowed)
            })?;
        }
        let connector = card.connector(name)?;
        if connector.state() != connector::State::Connected {
            return Err(unplugged(name));
        }
        let mode = find_mode(&connector, panel)?;
        let pipe = find_pipe(&card, &connector)?;
        let picture_property = card.properties(pipe.plane)?.handle("FB_ID")?;
        let before = card.get_crtc(pipe.crtc).ok();
        let buffers = [new_buffer(&card, size)?, new_buffer(&card, size)?];
        let row = vec![0; size.width * 4];
        let mut panel = KmsPanel {
            card,
            connector: name.clone(),
            size,
            pipe,
            mode,
            picture_property,
            buffers,
            front: 0,
            link: Link::default(),
            before,
            interval_s: 1.0 / panel.refresh_hz,
            row,
        };
        panel.light()?;
        panel.interval_s = panel.measured_interval()?;
        Ok(panel)
    }

    /// Refresh interval in seconds, as measured when the panel was opened.
    pub fn interval_s(&self) -> f64 {
        self.interval_s
    }

    /// Checks cable and link, and sets the mode again after a loss.
    fn keep_lit(&mut self) -> Result<(), RigError> {
        let mut link = std::mem::take(&mut self.link);
        let kept = link.keep(self);
        self.link = link;
        if kept? {
            log::info!("panel: {} lit again", self.connector);
        }
        Ok(())
    }

    /// Writes `codes` into the hidden buffer and requests it for the next refresh, without waiting.
    ///
    /// # Errors
    /// If the panel is disconnected, another program has taken it over, or another flip is pending.
    pub fn put(&mut self, codes: &Codes) -> Result<(), RigError> {
        if codes.size() != self.size {
            let found = format!("a picture of {}", codes.size());
            return Err(RigError::refused("panel", found, self.size.to_string()));
        }
        self.keep_lit()?;
        let back = 1 - self.front;
        self.write(back, codes)?;
        self.request_flip(back)
    }

    fn write(&mut self, buffer: usize, codes: &Codes) -> Result<(), RigError> {
        let memory = &mut self.buffers[buffer].memory;
        let pitch = memory.pitch() as usize;
        let mut map = self.card.map_dumb_buffer(memory).map_err(failed("map a picture buffer"))?;
        for (y, to) in map.chunks_mut(pitch).take(codes.size().height).enumerate() {
            let [red, green, blue] = codes.planes().each_ref().map(|plane| plane.row(y));
            for (pixel, ((r, g), b)) in
                self.row.chunks_exact_mut(4).zip(red.iter().zip(green).zip(blue))
            {
                // XRGB8888 is a little-endian word: blue comes first in memory.
                pixel.copy_from_slice(&[*b, *g, *r, 0]);
            }
            to[..self.row.len()].copy_from_slice(&self.row);
        }
        Ok(())
    }

    fn request_flip(&mut self, buffer: usize) -> Result<(), RigError> {
        let picture = self.buffers[buffer].picture;
        let mut request = AtomicModeReq::new();
        let shown = property::Value::Framebuffer(Some(picture));
        request.add_property(self.pipe.plane, self.picture_property, shown);
        let flags = AtomicCommitFlags::NONBLOCK | AtomicCommitFlags::PAGE_FLIP_EVENT;
        self.card.atomic_commit(flags, request).map_err(|cause| {
            self.link.lose();
            commit_failed(cause)
        })?;
        self.front = buffer;
        Ok(())
    }

    /// Waits until scan-out of the picture of [`KmsPanel::put`] begins.
    ///
    /// # Errors
    /// [`RigError::Gone`] if the display stopped refreshing.
    pub fn flipped(&mut self) -> Result<Flip, RigError> {
        let deadline = Moment(Monotonic.now().0 + (FLIP_REFRESHES_MAX * self.interval_s).max(1.0));
        loop {
            let events = ready_by(&self.card, deadline).map_err(failed("wait for a refresh"))?;
            if events.is_empty() {
                self.link.lose();
                let what = "the display stopped refreshing (no flip event)";
                return Err(RigError::gone("panel", what));
            }
            for event in self.card.receive_events().map_err(failed("read a refresh event"))? {
                if let Event::PageFlip(flip) = event {
                    // `duration` is a moment on CLOCK_MONOTONIC.
                    return Ok(Flip {
                        at: Moment(flip.duration.as_secs_f64()),
                        vblank: flip.frame.into(),
                    });
                }
            }
        }
    }

    /// Measures the refresh interval over a run of flips, by the kernel's time stamps and vblank
    /// counter.
    fn measured_interval(&mut self) -> Result<f64, RigError> {
        let mut flip = || {
            self.request_flip(1 - self.front)?;
            self.flipped()
        };
        let first = flip()?;
        let mut last = first;
        for _ in 0..TIMED_FLIPS {
            last = flip()?;
        }
        let refreshes = last.vblank.wrapping_sub(first.vblank) as u32;
        let interval_s = (last.at.0 - first.at.0) / f64::from(refreshes.max(1));
        let wanted_s = self.interval_s;
        if (interval_s / wanted_s - 1.0).abs() > INTERVAL_ERROR_MAX {
            let found = format!("a measured refresh interval of {:.3} ms", interval_s * 1e3);
            let (wanted_ms, percent) = (wanted_s * 1e3, INTERVAL_ERROR_MAX * 100.0);
            let allowed =
                format!("{wanted_ms:.3} ms ± {percent:.1} % (refresh-hz in the rig file)");
            return Err(RigError::refused("panel", found, allowed));
        }
        Ok(interval_s)
    }
}

impl Display for KmsPanel {
    fn name(&self) -> &str {
        &self.connector
    }

    fn state(&mut self) -> Result<ConnectorState, RigError> {
        let connector = self.card.get_connector(self.pipe.connector, false);
        let connector = connector.map_err(failed("ask the connector"))?;
        let properties = self.card.properties(self.pipe.connector)?;
        let link_status = properties.get("link-status").map(|(_, value)| value);
        let plugged_in = connector.state() == connector::State::Connected;
        Ok(ConnectorState { plugged_in, link_status })
    }

    fn probe(&mut self) -> Result<bool, RigError> {
        let connector = self.card.connector(&self.connector)?;
        Ok(connector.state() == connector::State::Connected)
    }

    fn take(&mut self) -> Result<(), RigError> {
        self.card.acquire_master_lock().map_err(|_| commit_failed(Errno::ACCESS.into()))
    }

    fn darken(&mut self) -> Result<(), RigError> {
        darken(&self.card, self.pipe)
    }

    fn light(&mut self) -> Result<(), RigError> {
        let picture = self.buffers[self.front].picture;
        light_up(&self.card, self.pipe, &self.mode, picture)
    }
}

impl Panel for KmsPanel {
    fn size(&self) -> Size {
        self.size
    }

    fn show(&mut self, codes: &Codes) -> Result<Flip, RigError> {
        self.put(codes)?;
        self.flipped()
    }
}

impl Drop for KmsPanel {
    /// Restores the screen; failures are ignored.
    fn drop(&mut self) {
        if let Some(before) = self.before.filter(|info| info.framebuffer().is_some()) {
            let (crtc, place, connectors) =
                (self.pipe.crtc, before.position(), [self.pipe.connector]);
            let shown = before.framebuffer();
            let _ = self.card.set_crtc(crtc, shown, place, &connectors, before.mode());
        }
        for buffer in &self.buffers {
            let _ = self.card.destroy_framebuffer(buffer.picture);
            let _ = self.card.destroy_dumb_buffer(buffer.memory);
        }
        let _ = self.card.release_master_lock();
    }
}

/// Exact refresh rate of a mode; the kernel's own figure is rounded to whole hertz.
fn exact_refresh_hz(mode: &Mode) -> f64 {
    f64::from(mode.clock()) * 1e3 / (f64::from(mode.hsync().2) * f64::from(mode.vsync().2))
}

fn find_mode(connector: &connector::Info, panel: &PanelTable) -> Result<Mode, RigError> {
    let fits = |mode: &&Mode| {
        let (width, height) = mode.size();
        (usize::from(width), usize::from(height)) == (panel.width_px, panel.height_px)
            && !mode.flags().contains(drm::control::ModeFlags::INTERLACE)
            && (exact_refresh_hz(mode) / panel.refresh_hz - 1.0).abs() < INTERVAL_ERROR_MAX
    };
    connector.modes().iter().find(fits).copied().ok_or_else(|| {
        let spelled = |mode: &Mode| {
            let (width, height) = mode.size();
            format!("{width}×{height} at {:.2} Hz", exact_refresh_hz(mode))
        };
        let offered: Vec<String> = connector.modes().iter().map(spelled).collect();
        let found = format!("mode {} at {} Hz on {connector}", panel.size(), panel.refresh_hz);
        RigError::refused("panel", found, offered.join(", "))
    })
}

/// Finds a CRTC that the connector can use, with its primary plane.
fn find_pipe(card: &Card, connector: &connector::Info) -> Result<Pipe, RigError> {
    let resources = card.resource_handles().map_err(failed("list pipes"))?;
    let planes = card.plane_handles().map_err(failed("list planes"))?;
    for &encoder in connector.encoders() {
        let encoder = card.get_encoder(encoder).map_err(failed("ask an encoder"))?;
        for crtc in resources.filter_crtcs(encoder.possible_crtcs()) {
            for &plane in &planes {
                let usable = resources.filter_crtcs(
                    card.get_plane(plane).map_err(failed("ask a plane"))?.possible_crtcs(),
                );
                let kind = card.properties(plane)?.get("type").map(|(_, value)| value);
                if usable.contains(&crtc) && kind == Some(drm::control::PlaneType::Primary as u64) {
                    return Ok(Pipe { connector: connector.handle(), crtc, plane });
                }
            }
        }
    }
    let found = format!("no display controller (CRTC) that can drive {connector}");
    Err(RigError::refused("panel", found, "a connector with a free display controller"))
}

fn new_buffer(card: &Card, size: Size) -> Result<PictureBuffer, RigError> {
    let size = (size.width as u32, size.height as u32);
    let failed = failed("make a picture buffer");
    let memory = card.create_dumb_buffer(size, DrmFourcc::Xrgb8888, 32).map_err(&failed)?;
    let picture = card.add_framebuffer(&memory, 24, 32).map_err(&failed)?;
    Ok(PictureBuffer { picture, memory })
}
