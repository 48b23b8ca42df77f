//! A camera on a V4L2 node: found by a stable name, with all automatic adjustments off, read frame
//! by frame.

mod controls;
mod describe;
mod finding;
mod kernel;
mod media;
mod request;
mod ring;
mod starts;
#[cfg(test)]
mod tests;

pub use controls::{Exposure, GainControl};
use controls::{
    amplify, await_controls, expose, needs_longer_interval, settle_controls, settle_orientation,
};
pub use describe::describe;
use finding::{busy_or, by_card, by_link};
use kernel::Node;
use request::is;
use ring::Ring;
use rustix::io::Errno;
use v4l::v4l_sys as sys;

use super::memory::{FrameMemory, gone, not_open, refused};
use crate::config::{CameraTable, MediaGraph, TriggerDevice, V4l2Device};
use crate::frame::{Counts, Size};
use crate::picture::worker::Worker;
use crate::rig::monotonic::Monotonic;
use crate::rig::pixel_format::PixelFormat;
use crate::rig::stamps::{StampedBy, earliest_start};
use crate::rig::{Camera, Clock, Exposed, Moment, RigError};

/// Name and settings of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraSettings {
    /// Keys of the rig file; exactly one of `device`, `card` and `media` is given.
    pub device: V4l2Device,
    /// Exact size of a frame.
    pub size: Size,
    /// Layout of a frame.
    pub format: PixelFormat,
    /// Control of the exposure time.
    pub exposure: Exposure,
    /// Control of the gain, if the rig file names it.
    pub gain: Option<GainControl>,
    /// Whether the camera exposes continuously rather than on request.
    pub free_running: bool,
}

impl CameraSettings {
    /// Settings of a rig file.
    ///
    /// # Errors
    /// [`RigError::Refused`] for an unsupported pixel format, or one whose depth is not
    /// `camera.bits`.
    pub fn of(
        camera: &CameraTable,
        device: &V4l2Device,
        trigger: &TriggerDevice,
    ) -> Result<Self, RigError> {
        let bits = camera.bits;
        let format = PixelFormat::from_code_and_bits(&device.format, bits).ok_or_else(|| {
            let fits = |code: &&str| PixelFormat::from_code_and_bits(code, bits).is_some();
            let allowed = PixelFormat::ALL.iter().map(|(code, _)| *code).filter(fits);
            let code = &device.format;
            let found = format!("hardware.camera.format = {code:?} with camera.bits = {bits}");
            refused(found, allowed.collect::<Vec<_>>().join(", "))
        })?;
        Ok(CameraSettings {
            device: device.clone(),
            size: camera.size(),
            format,
            exposure: Exposure { by: device.exposure_by, exposure_ms: camera.exposure_ms },
            gain: device.gain_step_db.and_then(|step_db| {
                let held = |name: &&str| Some((name.to_string(), *device.controls.get(*name)?));
                let (name, value) = GainControl::NAMES.iter().find_map(held)?;
                Some(GainControl { name, value, step_db })
            }),
            // A PWM channel repeats its pulses, so the camera does not expose on request, either.
            free_running: !matches!(trigger, TriggerDevice::Line(_)),
        })
    }

    /// Format and size, for messages.
    fn picture(&self) -> String {
        format!("{} of {}", self.format.code(), self.size)
    }
}

/// A streaming camera.
pub struct V4l2Camera {
    settings: CameraSettings,
    /// `None` after the camera is lost, until [`Camera::reopen`] succeeds.
    ring: Option<Ring>,
    opened: Opened,
    /// Exposure as a multiple of the settings'.
    exposure_times: f64,
    memory: FrameMemory,
    /// Decoder of JPEG frames, which runs in another process.
    decoder: Worker,
}

/// Properties of an open camera.
struct Opened {
    stride_bytes: usize,
    driver: String,
    /// Node of the sensor's controls, if that is not the capture node.
    sensor: Option<Node>,
    /// Frame interval of a free-running camera.
    interval_s: Option<f64>,
}

impl V4l2Camera {
    /// Finds, configures and starts the camera.
    ///
    /// # Errors
    /// [`RigError::Gone`] if there is no such camera, [`RigError::Held`] while another program uses
    /// it, [`RigError::Refused`] if it refuses the format or a control.
    pub fn open(settings: CameraSettings) -> Result<Self, RigError> {
        let (ring, opened) = start(&settings)?;
        let memory = FrameMemory::new(settings.size);
        Ok(V4l2Camera {
            settings,
            ring: Some(ring),
            opened,
            exposure_times: 1.0,
            memory,
            decoder: Worker::of_this_program(),
        })
    }
}

impl Camera for V4l2Camera {
    fn size(&self) -> Size {
        self.settings.size
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        let began = Monotonic.now();
        let ring = self.ring.as_mut().ok_or_else(not_open)?;
        loop {
            let filled = match ring.next(deadline) {
                Ok(Some(filled)) => filled,
                Ok(None) => {
                    return Err(RigError::NoFrame { waited_ms: (deadline.0 - began.0) * 1e3 });
                }
                Err(cause) => {
                    self.ring = None;
                    return Err(gone(cause.to_string()));
                }
            };
            let mut counts = self.memory.take();
            let bytes = ring.bytes(&filled);
            let is_complete = !filled.damaged
                && !ring.is_torn(&filled)
                && match self.settings.format {
                    // A frame damaged on the cable may crash only the decoder's process.
                    PixelFormat::Jpeg => decode(&mut self.decoder, bytes, &mut counts),
                    format => {
                        let (stride_bytes, sites) =
                            (self.opened.stride_bytes, &mut self.memory.sites);
                        format.unpack(bytes, stride_bytes, &mut counts, sites).is_ok()
                    }
                };
            let stamp = filled.at_s.unwrap_or_else(|| Monotonic.now().0);
            let by = StampedBy {
                driver: &self.opened.driver,
                states_start: filled.at_start,
                exposure_s: self.settings.exposure.exposure_ms * self.exposure_times / 1e3,
                interval_s: self.opened.interval_s,
            };
            let at = earliest_start(self.settings.device.stamps, &by, stamp);
            let sequence = filled.sequence;
            if let Err(cause) = ring.give_back(filled) {
                self.ring = None;
                return Err(gone(cause.to_string()));
            }
            if is_complete {
                return Ok(Exposed { counts, sequence, at });
            }
            self.memory.give_back(counts);
            // Damaged frames may keep coming past the deadline.
            let waited_ms = (Monotonic.now().0 - began.0) * 1e3;
            if Monotonic.now() > deadline {
                return Err(RigError::NoFrame { waited_ms });
            }
        }
    }

    fn give_back(&mut self, counts: Counts) {
        self.memory.give_back(counts);
    }

    fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        let ring = self.ring.as_mut().ok_or_else(not_open)?;
        let exposure = &self.settings.exposure;
        // uvcvideo refuses another interval while it streams.
        let restarts = needs_longer_interval(&ring.node, exposure, times);
        if restarts {
            // Stopping returns all buffers, and the frames in them are lost.
            ring.node.stream(false).map_err(|cause| gone(cause.to_string()))?;
        }
        let node = self.opened.sensor.as_ref().unwrap_or(&ring.node);
        let is_set = expose(node, &node.controls(), exposure, times)?;
        if restarts {
            ring.resume().map_err(|cause| gone(cause.to_string()))?;
        }
        if is_set {
            self.exposure_times = times;
            self.opened.interval_s = interval(&ring.node, &self.settings, times);
        }
        Ok(is_set)
    }

    fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        let ring = self.ring.as_ref().ok_or_else(not_open)?;
        let Some(gain) = &self.settings.gain else { return Ok(None) };
        let node = self.opened.sensor.as_ref().unwrap_or(&ring.node);
        amplify(node, &node.controls(), gain, times)?;
        Ok(Some(gain.nearest(times)))
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        self.ring = None;
        let (ring, opened) = start(&self.settings)?;
        (self.ring, self.opened, self.exposure_times) = (Some(ring), opened, 1.0);
        Ok(())
    }
}

/// Decodes a JPEG into `counts`; returns false, with a warning, if it is damaged.
fn decode(decoder: &mut Worker, bytes: &[u8], counts: &mut Counts) -> bool {
    let decoded = decoder.frame(bytes, counts.size());
    decoded
        .map(|decoded| *counts = decoded)
        .inspect_err(|bad| log::warn!("skipped a frame: {bad}"))
        .is_ok()
}

/// Frame interval of a free-running camera at `times` the exposure: the driver's, but no shorter
/// than the exposure. `None` for a triggered camera.
fn interval(node: &Node, settings: &CameraSettings, times: f64) -> Option<f64> {
    let exposure_s = settings.exposure.exposure_ms * times / 1e3;
    let stated_s = || node.frame_interval_s().ok().flatten().unwrap_or(0.0);
    settings.free_running.then(|| stated_s().max(exposure_s))
}

fn start(settings: &CameraSettings) -> Result<(Ring, Opened), RigError> {
    let V4l2Device { device, card, media: graph, controls, buffers, .. } = &settings.device;
    let (node, sensor) = if let Some(graph) = graph {
        starts::check(graph)?;
        let media::SetUp { capture, sensor } = media::set_up(graph, settings.size, controls)?;
        (capture, sensor)
    } else {
        let node = match device {
            Some(path) => by_link(path)?,
            None => by_card(card.as_deref().unwrap_or_default())?,
        };
        await_controls(&node, controls);
        settle_orientation(&node, controls)?;
        (node, None)
    };
    let settled = settle_format(&node, settings)?;
    let controlled = sensor.as_ref().unwrap_or(&node);
    let missing = settle_controls(controlled, &settings.exposure, controls)?;
    // A board's sensor delivers unprocessed counts, so it needs none of these controls.
    if sensor.is_none() && !missing.is_empty() {
        log::warn!(
            "the camera has no control for {}; its automatic adjustment stays on",
            missing.join(", ")
        );
    }
    let opened = Opened {
        stride_bytes: settled.bytesperline as usize,
        driver: node.identity().map(|identity| identity.driver).unwrap_or_default(),
        sensor,
        interval_s: interval(&node, settings, 1.0),
    };
    let frame_bytes = settings.format.frame_bytes(settings.size, opened.stride_bytes);
    let started = Ring::start(node, *buffers, frame_bytes);
    let ring = started.map_err(|source| start_failed(settings, source))?;
    if let Some(graph) = graph {
        starts::record(graph, true);
    }
    Ok((ring, opened))
}

/// Error of a stream that did not start.
fn start_failed(settings: &CameraSettings, source: std::io::Error) -> RigError {
    let picture = settings.picture();
    match &settings.device.media {
        // EPIPE: the formats of a link's two pads differ, or there is no link.
        Some(MediaGraph { capture, .. }) if is(&source, Errno::PIPE) => refused(
            format!("media graph: no path from the sensor to {capture:?} with matching pads"),
            format!("enabled links along the path, and the format of {picture} at every pad"),
        ),
        Some(graph) => {
            let failure = busy_or(source, "start the stream");
            if matches!(failure, RigError::Failed { .. }) {
                starts::record(graph, false);
            }
            starts::check(graph).err().unwrap_or(failure)
        }
        // ENOSPC is usbcore's error for too little bandwidth, not that of a full disk.
        None if is(&source, Errno::NOSPC) => refused(
            format!("{picture}, for which the USB bus has no room"),
            "a fast socket of its own, without a hub or another camera",
        ),
        None => busy_or(source, "start the stream"),
    }
}

fn settle_format(node: &Node, settings: &CameraSettings) -> Result<sys::v4l2_pix_format, RigError> {
    let size = (settings.size.width as u32, settings.size.height as u32);
    let pixelformat = u32::from_le_bytes(settings.format.fourcc());
    let settled = node.settle(size, pixelformat);
    let settled = settled.map_err(|source| busy_or(source, "take its format"))?;
    let sys::v4l2_pix_format { width, height, quantization, .. } = settled;
    let full_range = quantization == sys::v4l2_quantization_V4L2_QUANTIZATION_FULL_RANGE;
    let same = ((width, height), settled.pixelformat) == (size, pixelformat);
    if same && !(settings.format.has_range() && full_range) {
        return Ok(settled);
    }
    let code = settled.pixelformat.to_le_bytes();
    let (code, range) =
        (String::from_utf8_lossy(&code), if full_range { ", full range" } else { "" });
    let allowed = format!(
        "the format that the driver chose ({code} of {width}×{height}{range}); it lists {}",
        node.formats().join(", "),
    );
    Err(refused(settings.picture(), allowed))
}
