//! A rig file after validation.

use super::appliance::{DiskTable, Nights, RunTable};
use super::hardware::Hardware;
use super::parts::{
    CalibrationTable, CameraTable, CanvasTable, Marks, PanelTable, PaperTable, PhotoTable, Restore,
};
use super::simulation::Simulation;
use crate::frame::{Mosaic, PhotoGrid, Rect, Size};

/// A validated rig file.
#[derive(Debug, Clone)]
#[allow(missing_docs)] // The tables are described with their types.
pub struct RigFile {
    /// Name in reports.
    pub name: String,
    pub kind: Kind,
    pub photo: PhotoTable,
    pub panel: PanelTable,
    /// Sensor, and the photo's place on it, in binned pixels like all lengths of this struct.
    pub camera: CameraTable,
    pub canvas: CanvasTable,
    /// Frame marks; without them frames are matched to pictures by time alone.
    pub marks: Option<Marks>,
    pub calibration: CalibrationTable,
    pub restore: Restore,
    pub paper: PaperTable,
    pub run: RunTable,
    pub nights: Option<Nights>,
    pub disk: DiskTable,
    /// Hash of everything that a calibration depends on; a calibration with another identity is not
    /// of this rig. Seeds, faults and restoration are not part of it. A default is hashed alike
    /// whether written or left out.
    pub identity: u64,
}

/// Refreshes of the panel per exposure, if that is not a whole number. Tolerates the 0.3 % by which
/// a control in steps of 100 µs rounds at 60 Hz.
pub(super) fn broken_refreshes(panel: &PanelTable, camera: &CameraTable) -> Option<f64> {
    let refreshes = camera.exposure_ms * panel.refresh_hz / 1e3;
    ((refreshes - refreshes.round().max(1.0)).abs() > 0.01).then_some(refreshes)
}

/// Kind of a rig with its tables.
#[derive(Debug, Clone)]
pub enum Kind {
    /// Simulated by ray tracing.
    Simulated(Box<Simulation>),
    /// Real devices.
    Hardware(Box<Hardware>),
}

impl RigFile {
    /// The rig focused `offset` dioptres farther than the panel. A real rig is returned unchanged,
    /// since its ring is turned by hand. `None` beyond infinity.
    pub fn refocused(&self, offset: f32) -> Option<RigFile> {
        let mut turned = self.clone();
        if let Kind::Simulated(simulation) = &mut turned.kind {
            let lens = &mut simulation.lens;
            let before = lens.focus_distance_mm.unwrap_or(lens.object_distance_mm);
            let dioptres = 1000.0 / before - f64::from(offset);
            if dioptres <= 0.0 {
                return None;
            }
            lens.focus_distance_mm = Some(1000.0 / dioptres);
        }
        Some(turned)
    }

    /// Place of the photo on the sensor.
    pub fn photo_on_sensor(&self) -> Rect {
        Rect { x: self.camera.photo_x_px, y: self.camera.photo_y_px, size: self.photo.size() }
    }

    /// Grid of the rig's photos, in the camera's own pixels.
    pub fn photo_grid(&self) -> PhotoGrid {
        let by = self.camera.binning;
        let own = |size: Size| Size::new(by * size.width, by * size.height);
        let Rect { x, y, size } = self.photo_on_sensor();
        let photo = Rect { x: by * x, y: by * y, size: own(size) };
        let pattern_px = (self.calibration.response_flats > 0).then_some(by);
        PhotoGrid { sensor: own(self.camera.size()), photo, pattern_px }
    }

    /// The same rig without binning: the solver's pixels are the camera's own.
    #[must_use]
    pub fn unbinned(&self) -> RigFile {
        let PhotoGrid { sensor, photo, .. } = self.photo_grid();
        let mut own = self.clone();
        own.canvas.margin_px *= own.camera.binning;
        (own.photo.width_px, own.photo.height_px) = (photo.size.width, photo.size.height);
        let camera = &mut own.camera;
        (camera.width_px, camera.height_px) = (sensor.width, sensor.height);
        (camera.photo_x_px, camera.photo_y_px, camera.binning) = (photo.x, photo.y, 1);
        own
    }

    /// Size of the canvas: the photo with its margins.
    pub fn canvas_size(&self) -> Size {
        let margin = 2 * self.canvas.margin_px;
        Size::new(self.photo.width_px + margin, self.photo.height_px + margin)
    }

    /// Place of the canvas on the sensor.
    pub fn canvas_on_sensor(&self) -> Rect {
        let margin = self.canvas.margin_px;
        let (x, y) = (self.camera.photo_x_px - margin, self.camera.photo_y_px - margin);
        Rect { x, y, size: self.canvas_size() }
    }

    /// Place of the photo on the canvas.
    pub fn photo_on_canvas(&self) -> Rect {
        Rect { x: self.canvas.margin_px, y: self.canvas.margin_px, size: self.photo.size() }
    }

    /// Serial number of the camera, as far as the file names it.
    pub fn camera_serial(&self) -> Option<&str> {
        match &self.kind {
            Kind::Hardware(hardware) => hardware.camera.serial(),
            Kind::Simulated(_) => None,
        }
    }

    /// Colour filters of the sensor's sites. `None` if the sensor has none or does not send them
    /// raw, and for binned pixels, which have all colours.
    pub fn mosaic(&self) -> Option<Mosaic> {
        if self.camera.binning > 1 {
            return None;
        }
        match &self.kind {
            Kind::Simulated(simulation) => simulation.sensor.mosaic,
            Kind::Hardware(hardware) => Mosaic::of_format(hardware.camera.format()),
        }
    }

    /// Colour filters of the photo's pixels.
    pub fn photo_mosaic(&self) -> Option<Mosaic> {
        let (x, y) = (self.camera.photo_x_px, self.camera.photo_y_px);
        self.mosaic().map(|mosaic| mosaic.from_place(x, y))
    }

    /// Warning about an exposure of no whole number of refreshes; a real rig is refused instead.
    pub fn warning(&self) -> Option<String> {
        let refreshes = broken_refreshes(&self.panel, &self.camera)?;
        Some(format!(
            "camera.exposure-ms = {} is {refreshes:.3} refreshes of the panel, allowed a whole \
             number of them, or its flicker shows: set it to {:.2}",
            self.camera.exposure_ms,
            refreshes.round().max(1.0) * 1e3 / self.panel.refresh_hz
        ))
    }

    /// Tables of a simulated rig.
    pub fn simulation(&self) -> Option<&Simulation> {
        match &self.kind {
            Kind::Simulated(simulation) => Some(simulation),
            Kind::Hardware(_) => None,
        }
    }
}
