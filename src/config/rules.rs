//! Rules across keys, and the identity of a rig.

use serde::Serialize;

use super::error::ConfigError;
use super::hardware::{CameraDevice, ExposureBy, Hardware, TriggerDevice};
use super::parts::{Alignment, CameraTable, PanelTable};
use super::places::Places;
use super::rig::{Kind, RigFile};
use super::simulation::{Simulation, SimulationTable};
use super::written::RigTables;

/// Checks the rules across keys and computes the identity.
pub(super) fn check(mut written: RigTables, places: &Places) -> Result<RigFile, ConfigError> {
    if written.hardware.is_some() && !cfg!(feature = "hardware") {
        return Err(ConfigError::NoHardware(places.file.clone()));
    }
    bin(places, &mut written)?;
    check_canvas(places, &written)?;
    check_marks(places, &written)?;
    check_times(places, &written)?;
    let RigTables { photo, panel, camera, canvas, calibration, marks, .. } = written.clone();
    let mut identity = IdentityHash::default();
    identity.take(&(
        (photo.width_px, photo.height_px, photo.curve),
        (panel.width_px, panel.height_px, panel.subpixels),
        (camera.width_px, camera.height_px, camera.photo_x_px, camera.photo_y_px, camera.bits),
        camera.exposure_ms,
        (&canvas, &calibration, &marks),
    ));
    if let Some(focus) = &camera.focus {
        identity.take(focus);
    }
    if camera.binning > 1 {
        identity.take(&camera.binning);
    }
    let kind = match written.hardware.clone() {
        Some(hardware) => {
            check_hardware(places, &hardware, &panel, &camera)?;
            match &hardware.camera {
                CameraDevice::V4l2(camera) => identity.take(&(&hardware.panel, camera)),
                CameraDevice::Genicam(camera) => identity.take(&(&hardware.panel, camera)),
            }
            Kind::Hardware(Box::new(hardware))
        }
        None => {
            let simulation = check_simulation(places, written.clone())?;
            identity.take(&(&simulation.pose, &simulation.display, &simulation.sensor));
            identity.take(&(&simulation.lens.prescription, &simulation.lens.glare));
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
        identity: identity.0,
    })
}

/// Converts sizes and places of sensor and photo to binned pixels.
fn bin(places: &Places, written: &mut RigTables) -> Result<(), ConfigError> {
    let RigTables { photo, camera, .. } = written;
    let by = camera.binning;
    for (key, px) in [
        ("camera.width-px", &mut camera.width_px),
        ("camera.height-px", &mut camera.height_px),
        ("camera.photo-x-px", &mut camera.photo_x_px),
        ("camera.photo-y-px", &mut camera.photo_y_px),
        ("photo.width-px", &mut photo.width_px),
        ("photo.height-px", &mut photo.height_px),
    ] {
        let allowed = format_args!("a multiple of camera.binning, which is {by}");
        places.hold(*px % by == 0, key, *px, allowed)?;
        *px /= by;
    }
    Ok(())
}

fn needed<T>(places: &Places, table: &str, value: Option<T>) -> Result<T, ConfigError> {
    value.ok_or_else(|| places.broken(table, "nothing", "a table; it has no default"))
}

fn check_canvas(places: &Places, written: &RigTables) -> Result<(), ConfigError> {
    let RigTables { photo, panel, camera, canvas, calibration, .. } = written;
    let margin = canvas.margin_px;
    for (axis, place, length, whole) in [
        ("x", camera.photo_x_px, photo.width_px, camera.width_px),
        ("y", camera.photo_y_px, photo.height_px, camera.height_px),
    ] {
        places.hold(
            length > 0,
            "canvas.margin-px",
            margin,
            format_args!("one that leaves room for a photo on the sensor's {whole} pixels"),
        )?;
        places.hold(
            place + length <= whole,
            &format!("camera.photo-{axis}-px"),
            format_args!("a photo of {length} pixels from {place} on"),
            format_args!("a photo inside the sensor's {whole} pixels"),
        )?;
        let room = place.min(whole - place - length);
        places.hold(
            margin <= room,
            "canvas.margin-px",
            margin,
            format_args!("0 to {room}, which keeps the canvas on the sensor along {axis}"),
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
        "one-to-one only with panel and sensor of the same size",
    )
}

/// Checks the strips of the frame marks on a sensor that holds the canvas.
fn check_marks(places: &Places, written: &RigTables) -> Result<(), ConfigError> {
    let RigTables { photo, camera, canvas, calibration, marks: Some(marks), .. } = written else {
        return Ok(());
    };
    if marks.vanish {
        // The strips are surrounded by black as far as the blur reaches.
        let needed = marks.from_edge_px + marks.height_px + calibration.function_support_px / 2;
        let half = camera.height_px / 2;
        return places.hold(
            needed <= half,
            "marks.height-px",
            marks.height_px,
            format_args!(
                "a height that together with marks.from-edge-px and the blur needs at most {half} \
                 rows, not {needed}"
            ),
        );
    }
    let below = camera.height_px - camera.photo_y_px - photo.height_px - canvas.margin_px;
    let room = (camera.photo_y_px - canvas.margin_px).min(below);
    places.hold(
        marks.from_edge_px + marks.height_px <= room,
        "marks.height-px",
        marks.height_px,
        format_args!("at most {room} together with marks.from-edge-px, clear of the canvas"),
    )
}

fn check_times(places: &Places, written: &RigTables) -> Result<(), ConfigError> {
    let camera = &written.camera;
    places.hold(
        camera.deadline_ms > camera.exposure_ms,
        "camera.deadline-ms",
        camera.deadline_ms,
        format_args!("more than the exposure of {} ms", camera.exposure_ms),
    )
}

/// Checks `[hardware]`, and the other tables for a real rig.
fn check_hardware(
    places: &Places,
    hardware: &Hardware,
    panel: &PanelTable,
    camera: &CameraTable,
) -> Result<(), ConfigError> {
    let refreshes = camera.exposure_ms * panel.refresh_hz / 1e3;
    // A control in steps of 100 µs rounds by 0.3 % at 60 Hz.
    places.hold(
        refreshes > 0.5 && (refreshes - refreshes.round()).abs() <= 0.01,
        "camera.exposure-ms",
        format_args!("{} ms, which is {refreshes:.3} refreshes", camera.exposure_ms),
        "a whole number of refreshes, or the backlight's flicker shows",
    )?;
    match &hardware.camera {
        CameraDevice::V4l2(device) => device.check(places)?,
        CameraDevice::Genicam(device) => device.check(places, &hardware.trigger)?,
    }
    let pulsed = hardware.camera.exposure_by() == ExposureBy::Pulse;
    places.hold(
        !pulsed || !matches!(hardware.trigger, TriggerDevice::FreeRunning(_)),
        "hardware.camera.exposure-by",
        "pulse",
        "control or elsewhere with a free-running camera",
    )?;
    places.hold(
        pulsed || !matches!(hardware.trigger, TriggerDevice::Pwm(_)),
        "hardware.trigger.kind",
        "pwm",
        "line, unless the pulse is the exposure",
    )
}

fn check_simulation(places: &Places, written: RigTables) -> Result<Simulation, ConfigError> {
    let table = needed(places, "[simulation]", written.simulation)?;
    let lens = needed(places, "[lens]", written.lens)?;
    let pose = needed(places, "[pose]", written.pose)?;
    let mut display = needed(places, "[display]", written.display)?;
    display.primaries = table.light.primaries();
    let sensor = needed(places, "[sensor]", written.sensor)?.completed(table.light);
    let lens = lens.into_lens(&written.camera);
    let half = f64::from(written.camera.count_max()) / 2.0;
    places.hold(
        sensor.black_level_counts <= half,
        "sensor.black-level-counts",
        sensor.black_level_counts,
        format_args!("0 to {half}, half of the largest count"),
    )?;
    let faults = written.faults;
    let together =
        faults.stale + faults.duplicate + faults.missing + faults.mixed + faults.unplugged;
    places.hold(together <= 1.0, "faults", together, "at most 1 for all together")?;
    let SimulationTable { seed, surround, unrest, .. } = table;
    Ok(Simulation { unrest, seed, surround, lens, pose, display, sensor, faults })
}

/// FNV-1a hash of the parts as text, which is stable across machines and compilers.
struct IdentityHash(u64);

impl Default for IdentityHash {
    fn default() -> Self {
        IdentityHash(0xcbf2_9ce4_8422_2325)
    }
}

impl IdentityHash {
    fn take(&mut self, part: &impl Serialize) {
        // Structs of numbers and words always serialise; otherwise the error text is hashed.
        let text = serde_json::to_string(part).unwrap_or_else(|error| error.to_string());
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
