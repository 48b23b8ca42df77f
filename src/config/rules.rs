//! From the rig file as written to the rig as checked: the rules across keys, and the identity.

use std::path::Path;

use serde::Serialize;

use super::blur::BlurGrid;
use super::error::ConfigError;
use super::hardware::{ExposureBy, Hardware, PulseLine, TriggerDevice};
use super::parts::{Alignment, CameraTable, PanelTable};
use super::places::Places;
use super::rig::{Kind, RigFile};
use super::simulation::{
    Glare, Lens, LensGeometry, LensTable, Prescription, Simulation, SimulationTable,
};
use super::written::{KindWord, RigTables};

/// Checks everything and derives the identity.
pub(super) fn check(
    written: RigTables,
    places: &Places,
    base_dir: &Path,
) -> Result<RigFile, ConfigError> {
    if written.rig.kind == KindWord::Hardware && !cfg!(feature = "hardware") {
        return Err(ConfigError::NoHardware { at: places.file.clone() });
    }
    check_canvas(places, &written)?;
    check_marks(places, &written)?;
    check_times(places, &written)?;
    let RigTables { photo, panel, camera, canvas, calibration, marks, .. } = written.clone();
    let mut identity = IdentityHash::default();
    identity.take(&(
        (photo.width_px, photo.height_px, photo.curve),
        (panel.width_px, panel.height_px),
        (camera.width_px, camera.height_px, camera.photo_x_px, camera.photo_y_px, camera.bits),
        camera.exposure_ms,
        (&canvas, &calibration, &marks),
    ));
    // Rig files that say nothing of it keep their identity.
    if let Some(focus) = &camera.focus {
        identity.take(focus);
    }
    let kind = match written.rig.kind {
        KindWord::Hardware => {
            let hardware = needed(places, "[hardware]", written.hardware)?;
            check_hardware(places, &hardware, &panel, &camera)?;
            identity.take(&(&hardware.panel, &hardware.camera));
            Kind::Hardware(Box::new(hardware))
        }
        KindWord::Simulated => {
            let simulation = check_simulation(places, written.clone(), base_dir)?;
            identity.take(&(&simulation.pose, &simulation.display, &simulation.sensor));
            match &simulation.lens {
                Lens::Prescription(prescription, glare) => identity.take(&(prescription, glare)),
                Lens::Measured(blur, glare) => {
                    identity.take(&(blur.rows, blur.columns, &blur.functions, glare));
                }
            }
            Kind::Simulated(Box::new(simulation))
        }
    };
    Ok(RigFile {
        name: written.rig.name,
        kind,
        photo,
        panel,
        camera,
        canvas,
        marks,
        calibration,
        restore: written.restore,
        paper: written.paper,
        run: written.run,
        nights: written.nights,
        disk: written.disk,
        keep: written.keep.unwrap_or_default(),
        identity: identity.0,
    })
}

fn needed<T>(places: &Places, key: &str, value: Option<T>) -> Result<T, ConfigError> {
    value
        .ok_or_else(|| places.broken(key, "nothing", "a value; no physical quantity has a default"))
}

fn check_canvas(places: &Places, written: &RigTables) -> Result<(), ConfigError> {
    let RigTables { photo, panel, camera, canvas, calibration, .. } = written;
    let margin = canvas.margin_px;
    for (axis, place, length, whole) in [
        ("x", camera.photo_x_px, photo.width_px, camera.width_px),
        ("y", camera.photo_y_px, photo.height_px, camera.height_px),
    ] {
        places.hold(
            place + length <= whole,
            &format!("camera.photo-{axis}-px"),
            format_args!("a photo from {place}, {length} long"),
            format_args!("a photo inside the sensor's {whole}"),
        )?;
        let room = place.min(whole - place - length);
        places.hold(
            margin <= room,
            "canvas.margin-px",
            margin,
            format_args!("0 to {room}, so that the canvas stays on the sensor along {axis}"),
        )?;
    }
    places.hold(
        calibration.geometry == Alignment::Checkerboard || panel.size() == camera.size(),
        "calibration.geometry",
        format_args!(
            "one-to-one with a panel of {} and a sensor of {}",
            panel.size(),
            camera.size()
        ),
        "one-to-one only when panel and sensor have one size",
    )
}

/// After [`check_canvas`]: the canvas is on the sensor.
fn check_marks(places: &Places, written: &RigTables) -> Result<(), ConfigError> {
    let RigTables { photo, camera, canvas, calibration, marks: Some(marks), .. } = written else {
        return Ok(());
    };
    if marks.vanish {
        // Black around the strips, as far as the blur reaches.
        let needed = marks.from_edge_px + marks.height_px + calibration.function_support_px / 2;
        let half = camera.height_px / 2;
        return places.hold(
            needed <= half,
            "marks.height-px",
            marks.height_px,
            format_args!(
                "one that needs up to {half} rows with marks.from-edge-px and the blur, here \
                 {needed}"
            ),
        );
    }
    let below = camera.height_px - camera.photo_y_px - photo.height_px - canvas.margin_px;
    let room = (camera.photo_y_px - canvas.margin_px).min(below);
    places.hold(
        marks.from_edge_px + marks.height_px <= room,
        "marks.height-px",
        marks.height_px,
        format_args!(
            "at most {room} together with marks.from-edge-px, so that the canvas stays free"
        ),
    )
}

fn check_times(places: &Places, written: &RigTables) -> Result<(), ConfigError> {
    let RigTables { panel, camera, .. } = written;
    places.hold(
        panel.latency_ms.is_none_or(|latency_ms| latency_ms <= panel.settle_ms),
        "panel.latency-ms",
        panel.latency_ms.unwrap_or_default(),
        format_args!("0 to {}, which is panel.settle-ms", panel.settle_ms),
    )?;
    places.hold(
        camera.deadline_ms > camera.exposure_ms,
        "camera.deadline-ms",
        camera.deadline_ms,
        format_args!("more than the exposure of {} ms", camera.exposure_ms),
    )
}

/// The rules of `[hardware]`, and what the other tables must be on a real rig.
fn check_hardware(
    places: &Places,
    hardware: &Hardware,
    panel: &PanelTable,
    camera: &CameraTable,
) -> Result<(), ConfigError> {
    let refreshes = camera.exposure_ms * panel.refresh_hz / 1e3;
    // Within a hundredth of a refresh: a control in steps of 100 µs rounds by 0.3 % at 60 Hz.
    places.hold(
        refreshes > 0.5 && (refreshes - refreshes.round()).abs() <= 0.01,
        "camera.exposure-ms",
        format_args!("{} ms, which is {refreshes:.3} refreshes", camera.exposure_ms),
        "a whole number of refreshes, or the backlight's flicker shows",
    )?;
    hardware.camera.check(places)?;
    let pulsed = hardware.camera.exposure_by() == ExposureBy::Pulse;
    match &hardware.trigger {
        TriggerDevice::Line(PulseLine { pulse_us, .. }) => {
            let as_long = (f64::from(*pulse_us) / 1e3 / camera.exposure_ms - 1.0).abs() <= 0.01;
            places.hold(
                !pulsed || as_long,
                "hardware.trigger.pulse-us",
                pulse_us,
                format_args!(
                    "camera.exposure-ms, {} ms, when the pulse sets the exposure",
                    camera.exposure_ms
                ),
            )
        }
        TriggerDevice::FreeRunning(_) => places.hold(
            !pulsed,
            "hardware.camera.exposure-by",
            "pulse",
            "control or elsewhere with a free-running camera",
        ),
    }
}

fn check_simulation(
    places: &Places,
    written: RigTables,
    base_dir: &Path,
) -> Result<Simulation, ConfigError> {
    let table = needed(places, "[simulation]", written.simulation)?;
    let lens = needed(places, "[lens]", written.lens)?;
    let pose = needed(places, "[pose]", written.pose)?;
    let display = needed(places, "[display]", written.display)?;
    let sensor = needed(places, "[sensor]", written.sensor)?;
    let lens = check_lens(places, lens, base_dir)?;
    let tilted = pose.tilt_x_deg != 0.0 || pose.tilt_y_deg != 0.0;
    places.hold(
        !(tilted && matches!(lens, Lens::Measured(..))),
        "pose.tilt-x-deg",
        "a tilted panel with lens.blur",
        "0, and pose.tilt-y-deg too: perspective needs a prescription's object distance",
    )?;
    let half = f64::from(written.camera.count_max()) / 2.0;
    places.hold(
        sensor.black_level_counts <= half,
        "sensor.black-level-counts",
        sensor.black_level_counts,
        format_args!("0 to {half}, half of the largest count"),
    )?;
    places.hold(
        sensor.jpeg_quality.is_none() || (written.camera.bits == 8 && sensor.mosaic.is_none()),
        "sensor.jpeg-quality",
        format_args!("frames coded as JPEG of a camera of {} bits", written.camera.bits),
        "a camera of 8 bits without sensor.mosaic",
    )?;
    let faults = written.faults;
    let together =
        faults.stale + faults.duplicate + faults.missing + faults.mixed + faults.unplugged;
    places.hold(together <= 1.0, "faults", together, "at most 1 for all together")?;
    let SimulationTable { seed, surround, unrest } = table;
    Ok(Simulation { unrest, seed, surround, lens, pose, display, sensor, faults })
}

fn check_lens(places: &Places, table: LensTable, base_dir: &Path) -> Result<Lens, ConfigError> {
    let glare = Glare { share: table.glare_share, radius_px: table.glare_radius_px };
    if let Some(blur) = table.blur {
        places.hold(
            table.surface.is_none(),
            "lens",
            "both blur and a prescription",
            "one of them: blur = \"grid.npy\", or [[lens.surface]] and its keys",
        )?;
        return Ok(Lens::Measured(BlurGrid::read(&base_dir.join(blur), places)?, glare));
    }
    let lens = Prescription {
        surfaces: needed(places, "[[lens.surface]] (or lens.blur)", table.surface)?,
        stop_at_surface: needed(places, "lens.stop-at-surface", table.stop_at_surface)?,
        stop_diameter_mm: needed(places, "lens.stop-diameter-mm", table.stop_diameter_mm)?,
        object_distance_mm: needed(places, "lens.object-distance-mm", table.object_distance_mm)?,
        pixel_pitch_um: needed(places, "lens.pixel-pitch-um", table.pixel_pitch_um)?,
        support_px: needed(places, "lens.support-px", table.support_px)?,
        node_columns: needed(places, "lens.node-columns", table.node_columns)?,
        node_rows: needed(places, "lens.node-rows", table.node_rows)?,
        geometry: needed(places, "lens.geometry", table.geometry)?,
        dark_corner: needed(places, "lens.dark-corner", table.dark_corner)?,
        focus_distance_mm: table.focus_distance_mm,
        scene_distance_mm: table.scene_distance_mm,
        axis_offset_px: table.axis_offset_px.unwrap_or_default(),
    };
    places.hold(
        lens.axis_offset_px == [0.0; 2] || lens.geometry == LensGeometry::Centred,
        "lens.axis-offset-px",
        format!("{:?} of a lens that distorts", lens.axis_offset_px),
        "with geometry = \"centred\" alone",
    )?;
    places.hold(
        lens.stop_at_surface < lens.surfaces.len()
            && lens.surfaces[..lens.stop_at_surface]
                .iter()
                .all(|s| s.radius_mm.is_infinite() && s.glass == "air"),
        "lens.stop-at-surface",
        lens.stop_at_surface,
        "a surface with nothing but flat rims in air before it",
    )?;
    Ok(Lens::Prescription(lens, glare))
}

/// FNV-1a over the parts, as text: stable across machines and compilers.
struct IdentityHash(u64);

impl Default for IdentityHash {
    fn default() -> Self {
        IdentityHash(0xcbf2_9ce4_8422_2325)
    }
}

impl IdentityHash {
    fn take(&mut self, part: &impl Serialize) {
        // Plain structs of numbers and words always serialise; if one did not, its error is what
        // counts.
        let text = serde_json::to_string(part).unwrap_or_else(|error| error.to_string());
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
