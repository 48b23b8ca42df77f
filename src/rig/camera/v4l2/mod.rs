//! The camera on a real video node: found by a stable name, set to measure and not to please, read
//! frame by frame.

mod controls;
mod finding;
mod kernel;
mod media;
mod request;
mod ring;

pub use controls::{Exposure, GainControl};
use controls::{amplify, expose, settle_controls};
pub use finding::CameraName;
use finding::{busy_or, by_card, by_link, gone};
use kernel::{Node, Settled};
use ring::Ring;

use crate::config::{self, ExposureBy, Stamps, TriggerDevice, V4l2Device};
use crate::frame::{Counts, Plane, Size};
use crate::picture::worker::Worker;
use crate::rig::monotonic::Monotonic;
use crate::rig::pixel_format::PixelFormat;
use crate::rig::stamps::{StampedBy, begun};
use crate::rig::{Camera, Clock, Exposed, Moment, RigError};

/// Which camera, and how it is to be set.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraSettings {
    /// Which camera.
    pub name: CameraName,
    /// Pixels the format must have, exactly.
    pub size: Size,
    /// Layout of a frame.
    pub format: PixelFormat,
    /// Buffers in the ring.
    pub buffers: usize,
    /// What sets the exposure time.
    pub exposure: Exposure,
    /// What sets the gain, where the rig file says.
    pub gain: Option<GainControl>,
    /// What the stamps of its frames are of.
    pub stamps: Stamps,
    /// Whether it takes frames by itself.
    pub free_running: bool,
    /// Controls by their `v4l2-ctl` names and the values they must hold.
    pub controls: Vec<(String, i32)>,
}

impl CameraSettings {
    /// What the rig file asks for.
    ///
    /// # Errors
    /// [`RigError::Refused`] for a pixel format relens does not take, or one whose depth is not
    /// `camera.bits`.
    pub fn of(rig: &config::RigFile, device: &V4l2Device) -> Result<Self, RigError> {
        let bits = rig.camera.bits;
        let format = PixelFormat::from_code_and_bits(&device.format, bits).ok_or_else(|| {
            let fits = |code: &str| PixelFormat::from_code_and_bits(code, bits).is_some();
            let allowed = PixelFormat::ALL.iter().filter(|(code, _)| fits(code));
            RigError::Refused {
                device: "camera",
                found: format!(
                    "hardware.camera.format = {:?} with camera.bits = {}",
                    device.format, rig.camera.bits
                ),
                allowed: allowed.map(|(code, _)| *code).collect::<Vec<_>>().join(", "),
            }
        })?;
        // The rig file names exactly one of the three.
        let name = match (&device.device, &device.card, &device.media) {
            (Some(link), ..) => CameraName::Link(link.clone()),
            (_, _, Some(graph)) => CameraName::Graph(graph.clone()),
            (None, card, None) => CameraName::Card(card.clone().unwrap_or_default()),
        };
        let exposure_ms = rig.camera.exposure_ms;
        let free_running = match &rig.kind {
            config::Kind::Hardware(hardware) => {
                matches!(hardware.trigger, TriggerDevice::FreeRunning(_))
            }
            config::Kind::Simulated(_) => false,
        };
        Ok(CameraSettings {
            name,
            size: rig.camera.size(),
            format,
            buffers: device.buffers,
            exposure: match device.exposure_by {
                ExposureBy::Control => Exposure::Control { exposure_ms },
                ExposureBy::Pulse | ExposureBy::Elsewhere => Exposure::Elsewhere { exposure_ms },
            },
            gain: device.gain_step_db.and_then(|step_db| {
                let held = |name: &&str| Some((name.to_string(), *device.controls.get(*name)?));
                let (name, value) = GainControl::NAMES.iter().find_map(held)?;
                Some(GainControl { name, value, step_db })
            }),
            stamps: device.stamps,
            free_running,
            controls: device.controls.iter().map(|(name, v)| (name.clone(), *v)).collect(),
        })
    }
}

/// A streaming camera.
pub struct V4l2Camera {
    settings: CameraSettings,
    /// `None` between a loss and the next successful [`Camera::reopen`].
    ring: Option<Ring>,
    opened: Opened,
    /// How long exposures are against the settings'.
    exposure_times: f64,
    /// A spare frame and the Bayer sites: room that captures reuse.
    spare: heapless::Vec<Counts, 4>,
    sites: Plane<u16>,
    /// What decodes coded frames.
    decoder: Worker,
    /// Frames that came damaged or were jumped over in the sequence so far.
    lost: u64,
    last_sequence: Option<u32>,
}

/// What is known of a camera that was opened.
struct Opened {
    stride_bytes: usize,
    driver: String,
    /// Where the sensor's controls are, where that is not the node pictures come from.
    sensor: Option<Node>,
    /// From frame to frame where it runs free.
    interval_s: Option<f64>,
}

impl V4l2Camera {
    /// Finds, sets and starts the camera.
    ///
    /// # Errors
    /// [`RigError::Gone`] when there is no such camera, [`RigError::Held`] while another program
    /// uses it, [`RigError::Refused`] when format or a control cannot be what the rig file says.
    pub fn open(settings: CameraSettings) -> Result<Self, RigError> {
        let (ring, opened) = start(&settings)?;
        let sites = Plane::zeros(settings.size);
        Ok(V4l2Camera {
            settings,
            ring: Some(ring),
            opened,
            exposure_times: 1.0,
            spare: heapless::Vec::new(),
            sites,
            decoder: Worker::of_this_program(),
            lost: 0,
            last_sequence: None,
        })
    }

    /// Frames damaged or missing in the camera's sequence since it was first opened.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

impl Camera for V4l2Camera {
    fn size(&self) -> Size {
        self.settings.size
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        let began = Monotonic.now();
        let Some(ring) = &mut self.ring else {
            return Err(gone("it was lost and is not open".to_owned()));
        };
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
            let jumped = self
                .last_sequence
                .map_or(0, |last| filled.sequence.wrapping_sub(last).wrapping_sub(1));
            // A counter that goes backwards was started anew and says nothing.
            self.lost += u64::from(if jumped < u32::MAX / 2 { jumped } else { 0 });
            self.last_sequence = Some(filled.sequence);
            let mut counts = self.spare.pop().unwrap_or_else(|| Counts::zeros(self.settings.size));
            let bytes = ring.bytes(&filled);
            let whole = !filled.damaged
                && match self.settings.format {
                    // What a cable did to a coded frame may harm its decoder, and no more.
                    PixelFormat::Jpeg => match self.decoder.frame(bytes, self.settings.size) {
                        Ok(decoded) => {
                            counts = decoded;
                            true
                        }
                        Err(bad) => {
                            log::warn!("passed over: {bad}");
                            false
                        }
                    },
                    format => {
                        let stride_bytes = self.opened.stride_bytes;
                        format.unpack(bytes, stride_bytes, &mut counts, &mut self.sites).is_ok()
                    }
                };
            let stamp = filled.at_s.unwrap_or_else(|| Monotonic.now().0);
            let by = StampedBy {
                driver: &self.opened.driver,
                says_start: filled.at_start,
                exposure_s: self.settings.exposure.exposure_ms() * self.exposure_times / 1e3,
                interval_s: self.opened.interval_s,
            };
            let at = begun(self.settings.stamps, &by, stamp);
            let sequence = filled.sequence;
            if let Err(cause) = ring.give_back(filled) {
                self.ring = None;
                return Err(gone(cause.to_string()));
            }
            if whole {
                return Ok(Exposed { counts, sequence, at });
            }
            self.lost += 1;
            let _ = self.spare.push(counts);
        }
    }

    fn give_back(&mut self, counts: Counts) {
        if counts.size() == self.settings.size {
            // A spare too many is simply freed.
            let _ = self.spare.push(counts);
        }
    }

    fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        let Some(ring) = &self.ring else {
            return Err(gone("it was lost and is not open".to_owned()));
        };
        let node = self.opened.sensor.as_ref().unwrap_or(ring.node());
        let can = expose(node, &node.controls(), &self.settings.exposure, times)?;
        if can {
            self.exposure_times = times;
            self.opened.interval_s = interval(ring.node(), &self.settings, times);
        }
        Ok(can)
    }

    fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        let Some(ring) = &self.ring else {
            return Err(gone("it was lost and is not open".to_owned()));
        };
        let Some(gain) = &self.settings.gain else { return Ok(None) };
        let node = self.opened.sensor.as_ref().unwrap_or(ring.node());
        amplify(node, &node.controls(), gain, times)?;
        Ok(Some(gain.nearest(times)))
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        self.ring = None;
        self.last_sequence = None;
        let (ring, opened) = start(&self.settings)?;
        (self.ring, self.opened, self.exposure_times) = (Some(ring), opened, 1.0);
        Ok(())
    }
}

/// From frame to frame of a camera that runs free and exposes `times` as long as the settings say;
/// where its driver does not tell, it is taken to be no longer than the exposure.
fn interval(node: &Node, settings: &CameraSettings, times: f64) -> Option<f64> {
    let exposure_s = settings.exposure.exposure_ms() * times / 1e3;
    let told = || node.frame_interval_s().ok().flatten().unwrap_or(0.0);
    settings.free_running.then(|| told().max(exposure_s))
}

fn start(settings: &CameraSettings) -> Result<(Ring, Opened), RigError> {
    let (node, sensor) = match &settings.name {
        CameraName::Graph(graph) => {
            let media::SetUp { capture, sensor } = media::set_up(graph, settings.size)?;
            (capture, sensor)
        }
        CameraName::Link(path) => (by_link(path)?, None),
        CameraName::Card(card) => (by_card(card)?, None),
    };
    let settled = settle_format(&node, settings)?;
    let controlled = sensor.as_ref().unwrap_or(&node);
    let missing = settle_controls(controlled, &settings.exposure, &settings.controls)?;
    // A board's sensor sends its counts as they are.
    if sensor.is_none() && !missing.is_empty() {
        log::warn!(
            "the camera has no control of {}; whatever it does there of itself stays",
            missing.join(", ")
        );
    }
    let opened = Opened {
        stride_bytes: settled.stride_bytes as usize,
        driver: node.identity().map(|identity| identity.driver).unwrap_or_default(),
        sensor,
        interval_s: interval(&node, settings, 1.0),
    };
    let ring = Ring::start(node, settings.buffers).map_err(|source| {
        let is_pipe = rustix::io::Errno::from_io_error(&source) == Some(rustix::io::Errno::PIPE);
        match &settings.name {
            // EPIPE is the kernel's word for pads of a link that differ, or no link at all.
            CameraName::Graph(graph) if is_pipe => RigError::Refused {
                device: "camera",
                found: format!(
                    "media graph: no way from the sensor to {:?} on which all pads agree",
                    graph.capture
                ),
                allowed: format!(
                    "links that are on all the way, and at every pad the format of {} of {}",
                    settings.format.code(),
                    settings.size
                ),
            },
            _ => busy_or(source, "start the stream"),
        }
    })?;
    Ok((ring, opened))
}

fn settle_format(node: &Node, settings: &CameraSettings) -> Result<Settled, RigError> {
    let (width, height) = (settings.size.width as u32, settings.size.height as u32);
    let fourcc = settings.format.fourcc();
    let settled =
        node.settle(width, height, fourcc).map_err(|source| busy_or(source, "take its format"))?;
    let same = (settled.width, settled.height, settled.fourcc) == (width, height, fourcc);
    if same && !(settings.format.has_range() && settled.full_range) {
        return Ok(settled);
    }
    let formats: Vec<String> =
        node.formats().iter().map(|code| String::from_utf8_lossy(code).into_owned()).collect();
    Err(RigError::Refused {
        device: "camera",
        found: format!("{} of {}", settings.format.code(), settings.size),
        allowed: format!(
            "what the driver offers instead ({} of {}×{}{}); it lists {}",
            String::from_utf8_lossy(&settled.fourcc),
            settled.width,
            settled.height,
            if settled.full_range { ", full range" } else { "" },
            formats.join(", "),
        ),
    })
}
