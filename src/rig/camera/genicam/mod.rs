//! A camera of USB3 Vision or GigE Vision: found by its names, with all automatic adjustments off,
//! read frame by frame through Aravis.

mod clock;
mod features;
mod finding;
#[cfg(test)]
pub(crate) mod tests;
mod usb;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use aravis::prelude::*;
use aravis::{Buffer, BufferPayloadType, BufferStatus, Device, Stream};
pub use finding::describe;
use finding::{choose, failed, list};

use super::memory::{FrameMemory, gone, not_open, refused};
use crate::config::{CameraTable, ExposureBy, FeatureValue, GenicamDevice, Stamps};
use crate::frame::{Counts, Size};
use crate::rig::monotonic::Monotonic;
use crate::rig::pixel_format::PixelFormat;
use crate::rig::stamps::{StampedBy, earliest_start};
use crate::rig::{Camera, Clock, Exposed, Moment, RigError};

/// Maximum wait for a frame before checking that the camera is still there, in seconds.
const LOOK_S: f64 = 0.1;

/// Names and settings of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct GenicamSettings {
    /// Keys of the rig file.
    pub device: GenicamDevice,
    /// Exact size of a frame.
    pub size: Size,
    /// Layout of a frame.
    pub format: PixelFormat,
    /// Exposure time.
    pub exposure_ms: f64,
}

impl GenicamSettings {
    /// Settings of a rig file.
    ///
    /// # Errors
    /// [`RigError::Refused`] for an unsupported pixel format, one whose depth is not `camera.bits`,
    /// or a packed one whose rows do not end with a byte.
    pub fn of(camera: &CameraTable, device: &GenicamDevice) -> Result<Self, RigError> {
        let (bits, size) = (camera.bits, camera.size());
        let format = PixelFormat::from_code_and_bits(&device.format, bits)
            .filter(|format| format.has_whole_rows(size.width));
        let Some(format) = format else {
            let (code, width) = (&device.format, size.width);
            return Err(refused(
                format!(
                    "hardware.camera.format = {code:?} with camera.bits = {bits} and rows of \
                     {width} pixels"
                ),
                "Mono, BayerBG, BayerGB, BayerGR or BayerRG with 8, 10, 12, 16, 10p, 12p, 10Packed \
                 or 12Packed, RGB8, BGR8; packed ones with whole bytes in a row",
            ));
        };
        let (device, exposure_ms) = (device.clone(), camera.exposure_ms);
        Ok(GenicamSettings { device, size, format, exposure_ms })
    }
}

/// A streaming camera.
pub struct GenicamCamera {
    settings: GenicamSettings,
    /// `None` after the camera is lost, until [`Camera::reopen`] succeeds.
    open: Option<Open>,
    /// Exposure as a multiple of the settings'.
    exposure_times: f64,
    memory: FrameMemory,
}

/// An open camera. Dropping it stops the stream.
struct Open {
    camera: aravis::Camera,
    device: Device,
    stream: Stream,
    is_lost: Arc<AtomicBool>,
    /// Number of the pixel format in the Pixel Format Naming Convention.
    pixel_format: aravis::PixelFormat,
}

impl Drop for Open {
    /// Errors are ignored, since the camera may be gone.
    fn drop(&mut self) {
        let _ = self.camera.stop_acquisition();
    }
}

impl GenicamCamera {
    /// Finds, configures and starts the camera.
    ///
    /// # Errors
    /// [`RigError::Gone`] if there is no such camera, [`RigError::Held`] while another program uses
    /// it, [`RigError::Refused`] if it refuses the format or a feature.
    pub fn open(settings: GenicamSettings) -> Result<Self, RigError> {
        let open = Some(start(&settings)?);
        let memory = FrameMemory::new(settings.size);
        Ok(GenicamCamera { settings, open, exposure_times: 1.0, memory })
    }

    /// Unpacks `buffer`; the error says why it is not a picture of the rig's format and size.
    fn read(
        &mut self,
        buffer: &Buffer,
        pixel_format: aravis::PixelFormat,
    ) -> Result<Counts, String> {
        let GenicamSettings { size, format, device, .. } = &self.settings;
        if buffer.status() != BufferStatus::Success {
            return Err(format!("{:?}", buffer.status()));
        }
        if buffer.payload_type() != BufferPayloadType::Image {
            return Err(format!("a payload of {:?}", buffer.payload_type()));
        }
        let found = (buffer.image_width(), buffer.image_height());
        if found != (size.width as i32, size.height as i32) {
            return Err(format!("{}×{} pixels instead of {size}", found.0, found.1));
        }
        let found = buffer.image_pixel_format();
        if found != pixel_format {
            return Err(format!("pixel format {:#010x} instead of {}", found.raw(), device.format));
        }
        let padding = usize::try_from(buffer.image_padding().0).unwrap_or_default();
        let mut counts = self.memory.take();
        let stride_bytes = format.row_bytes(size.width) + padding;
        let (bytes, sites) = (buffer.image_data(), &mut self.memory.sites);
        match format.unpack(&bytes, stride_bytes, &mut counts, sites) {
            Ok(()) => Ok(counts),
            Err(bad) => {
                self.give_back(counts);
                Err(bad.to_string())
            }
        }
    }

    /// Earliest possible start of the exposure of `buffer`.
    fn began(&self, open: &Open, buffer: &Buffer) -> Moment {
        let GenicamSettings { device, exposure_ms, .. } = &self.settings;
        let runs_free = device.trigger_source.is_none();
        let exposure_s = exposure_ms * self.exposure_times / 1e3;
        let interval_s = || open.camera.frame_rate().map_or(0.0, |rate| 1.0 / rate.max(1e-3));
        let by = StampedBy {
            driver: "",
            states_start: !runs_free,
            exposure_s,
            interval_s: runs_free.then(|| interval_s().max(exposure_s)),
        };
        match clock::stamped_s(&open.device, buffer) {
            Some(stamp_s) => earliest_start(device.stamps, &by, stamp_s),
            None => earliest_start(Stamps::FirstPacket, &by, clock::arrived_s(buffer)),
        }
    }
}

impl Camera for GenicamCamera {
    fn size(&self) -> Size {
        self.settings.size
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        let began = Monotonic.now();
        let open = self.open.take().ok_or_else(not_open)?;
        loop {
            let remaining_s = (deadline.0 - Monotonic.now().0).clamp(0.0, LOOK_S);
            let buffer = open.stream.timeout_pop_buffer((remaining_s * 1e6) as u64);
            let read = buffer.map(|buffer| {
                let read = self.read(&buffer, open.pixel_format).map(|counts| Exposed {
                    counts,
                    sequence: buffer.frame_id() as u32,
                    at: self.began(&open, &buffer),
                });
                open.stream.push_buffer(buffer);
                read
            });
            match read {
                Some(Ok(exposed)) => {
                    self.open = Some(open);
                    return Ok(exposed);
                }
                Some(Err(fault)) => log::warn!("skipped a frame of the camera: {fault}"),
                None => {}
            }
            if open.is_lost.load(Ordering::Acquire) {
                return Err(gone("it no longer answers"));
            }
            if Monotonic.now() >= deadline {
                // A camera that sends no frames may have been disconnected without notice.
                open.camera.payload().map_err(|error| gone(error.message()))?;
                self.open = Some(open);
                return Err(RigError::NoFrame { waited_ms: (Monotonic.now().0 - began.0) * 1e3 });
            }
        }
    }

    fn give_back(&mut self, counts: Counts) {
        self.memory.give_back(counts);
    }

    fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        let open = self.open.as_ref().ok_or_else(not_open)?;
        let is_set = expose(&open.device, &self.settings, times)?;
        if is_set {
            self.exposure_times = times;
        }
        Ok(is_set)
    }

    fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        let open = self.open.as_ref().ok_or_else(not_open)?;
        let device = &self.settings.device;
        let gain = device.features.get("Gain");
        let (Some(FeatureValue::Number(gain)), Some(step_db)) = (gain, device.gain_step_db) else {
            return Ok(None);
        };
        let wanted = gain + 20.0 * times.log10() / step_db;
        features::hold(&open.device, "Gain", &wanted.into())?;
        let found = features::number(&open.device, "Gain").unwrap_or(wanted);
        Ok(Some(10f64.powf((found - gain) * step_db / 20.0)))
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        self.open = None;
        (self.open, self.exposure_times) = (Some(start(&self.settings)?), 1.0);
        Ok(())
    }
}

/// Sets the exposure to `times` the settings'; an exposure by pulse follows the pulse and needs no
/// setting. Returns false if the exposure is set outside this program.
fn expose(device: &Device, settings: &GenicamSettings, times: f64) -> Result<bool, RigError> {
    if settings.device.exposure_by != ExposureBy::Control {
        return Ok(settings.device.exposure_by == ExposureBy::Pulse);
    }
    let exposure_us = settings.exposure_ms * times * 1e3;
    match features::hold_any(device, &["ExposureTime", "ExposureTimeAbs"], exposure_us)? {
        true => Ok(true),
        false => Err(refused(
            "exposure-by = \"control\" with a camera without ExposureTime",
            "\"pulse\" or \"elsewhere\"",
        )),
    }
}

fn start(settings: &GenicamSettings) -> Result<Open, RigError> {
    let found = choose(list(), &settings.device)?;
    let camera = aravis::Camera::new(Some(&found.id)).map_err(|e| failed(&e, "open"))?;
    let device = camera.device().ok_or_else(|| gone("it has no description"))?;
    // Another program may have ended without stopping the acquisition.
    let _ = camera.stop_acquisition();
    configure(&device, settings)?;
    let frame_bytes = camera.payload().map_err(|e| failed(&e, "read its frame size"))? as usize;
    let pixel_format = camera.pixel_format().map_err(|e| failed(&e, "read its format"))?;
    let buffers = settings.device.buffers;
    if camera.is_uv_device() {
        usb::check_memory(Path::new("/"), buffers, frame_bytes)?;
    }
    let is_lost = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&is_lost);
    device.connect_control_lost(move |_| flag.store(true, Ordering::Release));
    let stream = camera.create_stream().map_err(|e| failed(&e, "make a stream"))?;
    for _ in 0..buffers {
        stream.push_buffer(Buffer::new_allocate(frame_bytes));
    }
    camera.start_acquisition().map_err(|e| failed(&e, "start the stream"))?;
    Ok(Open { camera, device, stream, is_lost, pixel_format })
}

/// Sets format, size, trigger, exposure and the rig file's features, each read back.
fn configure(device: &Device, settings: &GenicamSettings) -> Result<(), RigError> {
    let GenicamSettings { device: keys, size, .. } = settings;
    features::settle(device)?;
    features::hold(device, "PixelFormat", &keys.format.as_str().into())?;
    features::hold_any(device, &["OffsetX"], 0.0)?;
    features::hold_any(device, &["OffsetY"], 0.0)?;
    features::hold(device, "Width", &(size.width as f64).into())?;
    features::hold(device, "Height", &(size.height as f64).into())?;
    features::hold_any(device, &["AcquisitionMode"], "Continuous")?;
    features::switch_triggers_off(device)?;
    let is_pulse = keys.exposure_by == ExposureBy::Pulse;
    let mode = if is_pulse { "TriggerWidth" } else { "Timed" };
    let has_mode = features::hold_any(device, &["ExposureMode"], mode)?;
    if is_pulse && !has_mode {
        return Err(refused(
            "exposure-by = \"pulse\" with a camera without ExposureMode",
            "\"control\"",
        ));
    }
    expose(device, settings, 1.0)?;
    if let Some(source) = &keys.trigger_source {
        features::hold_any(device, &["TriggerSelector"], "FrameStart")?;
        features::hold(device, "TriggerSource", &source.as_str().into())?;
        if !keys.features.contains_key("TriggerActivation") {
            features::hold_any(device, &["TriggerActivation"], "RisingEdge")?;
        }
        features::hold(device, "TriggerMode", &"On".into())?;
    }
    let (selectors, others): (Vec<_>, Vec<_>) =
        keys.features.iter().partition(|(name, _)| name.ends_with("Selector"));
    let mut each = selectors.into_iter().chain(others);
    each.try_for_each(|(name, value)| features::hold(device, name, value))
}
