//! The rig as checked.

use super::appliance::{DiskTable, Keep, Nights, RunTable};
use super::hardware::{CameraDevice, Hardware};
use super::methods::Numbers;
use super::parts::{
    CalibrationTable, CameraTable, CanvasTable, Marks, PanelTable, PaperTable, PhotoTable, Restore,
};
use super::simulation::{Lens, Simulation};
use crate::deconvolution::method::hybrid;
use crate::frame::{Mosaic, PhotoGrid, Rect, Size};

/// A rig as checked: whoever holds one need not doubt its numbers.
#[derive(Debug, Clone)]
pub struct RigFile {
    /// The rig's name, for reports.
    pub name: String,
    /// Simulated or made of hardware.
    pub kind: Kind,
    /// The customer's photos.
    pub photo: PhotoTable,
    /// The display.
    pub panel: PanelTable,
    /// The sensor, and where the photo lies on it.
    pub camera: CameraTable,
    /// How far the solver's canvas reaches beyond the photo.
    pub canvas: CanvasTable,
    /// Where the frame marks are; without them a frame is trusted by its time alone.
    pub marks: Option<Marks>,
    /// How the rig is calibrated.
    pub calibration: CalibrationTable,
    /// How photos are restored.
    pub restore: Restore,
    /// The paper's own parameters.
    pub paper: PaperTable,
    /// Who says when photos are restored.
    pub run: RunTable,
    /// When, if only at night; and how drift is watched.
    pub nights: Option<Nights>,
    /// How much of the disk is left free.
    pub disk: DiskTable,
    /// How long results and originals are kept.
    pub keep: Keep,
    /// A hash of everything a calibration depends on: a calibration of another identity is not this
    /// rig's. Seeds, faults, and how photos are restored are not part of it; a default said and a
    /// default left out are the same.
    pub identity: u64,
}

/// What the rig is made of.
#[derive(Debug, Clone)]
pub enum Kind {
    /// Physics by computing.
    Simulated(Box<Simulation>),
    /// Devices.
    Hardware(Box<Hardware>),
}

impl RigFile {
    /// The same rig with its focus ring turned until the panel is seen as a scene `offset` dioptres
    /// nearer would be; the rig itself where a hand turns the ring, or the blur was measured.
    /// `None` where the ring ends: a simulated one at infinity.
    pub fn refocused(&self, offset: f32) -> Option<RigFile> {
        let mut turned = self.clone();
        if let Kind::Simulated(simulation) = &mut turned.kind
            && let Lens::Prescription(lens, _) = &mut simulation.lens
        {
            let before = lens.focus_distance_mm.unwrap_or(lens.object_distance_mm);
            let dioptres = 1000.0 / before - f64::from(offset);
            if dioptres <= 0.0 {
                return None;
            }
            lens.focus_distance_mm = Some(1000.0 / dioptres);
        }
        Some(turned)
    }

    /// The photo's part of the sensor.
    pub fn photo_on_sensor(&self) -> Rect {
        Rect { x: self.camera.photo_x_px, y: self.camera.photo_y_px, size: self.photo.size() }
    }

    /// What photos the rig takes.
    pub fn photo_grid(&self) -> PhotoGrid {
        let sensor = Size::new(self.camera.width_px, self.camera.height_px);
        PhotoGrid { sensor, photo: self.photo_on_sensor() }
    }

    /// The canvas: the photo with the margin around it.
    pub fn canvas_size(&self) -> Size {
        let margin = 2 * self.canvas.margin_px;
        Size::new(self.photo.width_px + margin, self.photo.height_px + margin)
    }

    /// The canvas's part of the sensor.
    pub fn canvas_on_sensor(&self) -> Rect {
        let margin = self.canvas.margin_px;
        let (x, y) = (self.camera.photo_x_px - margin, self.camera.photo_y_px - margin);
        Rect { x, y, size: self.canvas_size() }
    }

    /// The photo's part of the canvas.
    pub fn photo_on_canvas(&self) -> Rect {
        Rect { x: self.canvas.margin_px, y: self.canvas.margin_px, size: self.photo.size() }
    }

    /// What methods are made of, as the file has it.
    pub fn numbers(&self) -> Numbers<'_> {
        let RigFile { restore, paper, .. } = self;
        Numbers {
            restore,
            paper,
            steps: restore.steps as u32,
            correction_steps: hybrid::CORRECTION_STEPS,
            captures_max: 1 + restore.corrections_max as u32,
            rounds: restore.block_rounds as u32,
        }
    }

    /// The serial number that the link to the camera ends in (`/dev/v4l/by-id/…_SERIAL-video-…`).
    pub fn camera_serial(&self) -> Option<&str> {
        let Kind::Hardware(hardware) = &self.kind else { return None };
        let CameraDevice::V4l2(device) = &hardware.camera;
        let name = device.device.as_ref()?.file_name()?.to_str()?;
        let (name, _) = name.rsplit_once("-video-index")?;
        name.rsplit_once('_').map(|(_, serial)| serial)
    }

    /// The colours of the camera's sites, if it has colour filters and sends them raw.
    pub fn mosaic(&self) -> Option<Mosaic> {
        match &self.kind {
            Kind::Simulated(simulation) => simulation.sensor.mosaic,
            Kind::Hardware(hardware) => match &hardware.camera {
                CameraDevice::V4l2(device) => Mosaic::of_format(device.format.trim_end()),
            },
        }
    }

    /// The same of the photo's pixels.
    pub fn photo_mosaic(&self) -> Option<Mosaic> {
        let (x, y) = (self.camera.photo_x_px, self.camera.photo_y_px);
        self.mosaic().map(|mosaic| mosaic.from_place(x, y))
    }

    /// What of the file can hardly be meant, and what to set instead; a sentence each.
    pub fn doubts(&self) -> Vec<String> {
        let (exposure_ms, refresh_hz) = (self.camera.exposure_ms, self.panel.refresh_hz);
        let refreshes = exposure_ms * refresh_hz / 1e3;
        let whole = refreshes.round().max(1.0);
        // As near as a real rig's must be.
        let doubt = (refreshes - whole).abs() > 0.01;
        let words = || {
            format!(
                "camera.exposure-ms = {exposure_ms} is {refreshes:.3} refreshes of the panel, \
                 allowed a whole number of them, or its flicker shows: set it to {:.2}",
                whole * 1e3 / refresh_hz
            )
        };
        doubt.then(words).into_iter().collect()
    }

    /// The simulation's tables, if the rig is a simulated one.
    pub fn simulation(&self) -> Option<&Simulation> {
        match &self.kind {
            Kind::Simulated(simulation) => Some(simulation),
            Kind::Hardware(_) => None,
        }
    }
}
