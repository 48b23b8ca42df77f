//! Rules across keys, and the identity of a rig.

use serde::Serialize;

use super::error::ConfigError;
use super::hardware::{CameraDevice, ExposureBy, Hardware, TriggerDevice};
use super::parts::{Alignment, CameraTable, PanelTable};
use super::places::Places;
use super::rig::{Kind, RigFile, broken_refreshes};
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
    let mut identity = IdentityHash(0xcbf2_9ce4_8422_2325);
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
            identity.take(&(&simulation.lens, &simulation.glare));
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
        let allowed =
            format_args!("one that leaves room for a photo on the sensor's {whole} pixels");
        places.hold(length > 0, "canvas.margin-px", margin, allowed)?;
        let key = format!("camera.photo-{axis}-px");
        let found = format_args!("a photo of {length} pixels from {place} on");
        let allowed = format_args!("a photo inside the sensor's {whole} pixels");
        places.hold(place + length <= whole, &key, found, allowed)?;
        let room = place.min(whole - place - length);
        let allowed =
            format_args!("0 to {room}, which keeps the canvas on the sensor along {axis}");
        places.hold(margin <= room, "canvas.margin-px", margin, allowed)?;
    }
    let (panel, sensor) = (panel.size(), camera.size());
    places.hold(
        calibration.geometry == Alignment::Checkerboard || panel == sensor,
        "calibration.geometry",
        format_args!("one-to-one with a panel of {panel} and a sensor of {sensor}"),
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
        let allowed = format_args!(
            "a height that together with marks.from-edge-px and the blur needs at most {half} \
             rows, not {needed}"
        );
        return places.hold(needed <= half, "marks.height-px", marks.height_px, allowed);
    }
    let below = camera.height_px - camera.photo_y_px - photo.height_px - canvas.margin_px;
    let room = (camera.photo_y_px - canvas.margin_px).min(below);
    let fits = marks.from_edge_px + marks.height_px <= room;
    let allowed =
        format_args!("at most {room} together with marks.from-edge-px, clear of the canvas");
    places.hold(fits, "marks.height-px", marks.height_px, allowed)
}

fn check_times(places: &Places, written: &RigTables) -> Result<(), ConfigError> {
    let CameraTable { deadline_ms, exposure_ms, .. } = written.camera;
    let allowed = format_args!("more than the exposure of {exposure_ms} ms");
    places.hold(deadline_ms > exposure_ms, "camera.deadline-ms", deadline_ms, allowed)
}

/// Checks `[hardware]`, and the other tables for a real rig.
fn check_hardware(
    places: &Places,
    hardware: &Hardware,
    panel: &PanelTable,
    camera: &CameraTable,
) -> Result<(), ConfigError> {
    if let Some(refreshes) = broken_refreshes(panel, camera) {
        let found = format_args!("{} ms, which is {refreshes:.3} refreshes", camera.exposure_ms);
        let allowed = "a whole number of refreshes, or the backlight's flicker shows";
        return Err(places.broken("camera.exposure-ms", found, allowed));
    }
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
    let (lens, glare) = lens.into_lens(&written.camera);
    let half = f64::from(written.camera.count_max()) / 2.0;
    let black = sensor.black_level_counts;
    let allowed = format_args!("0 to {half}, half of the largest count");
    places.hold(black <= half, "sensor.black-level-counts", black, allowed)?;
    let faults = written.faults;
    let together =
        faults.stale + faults.duplicate + faults.missing + faults.mixed + faults.unplugged;
    places.hold(together <= 1.0, "faults", together, "at most 1 for all together")?;
    let SimulationTable { seed, surround, unrest, .. } = table;
    Ok(Simulation { unrest, seed, surround, lens, glare, pose, display, sensor, faults })
}

/// FNV-1a hash of the parts as text, which is stable across machines and compilers.
struct IdentityHash(u64);

impl IdentityHash {
    fn take(&mut self, part: &impl Serialize) {
        // Structs of numbers and words always serialise; otherwise the error text is hashed.
        let text = serde_json::to_string(part).unwrap_or_else(|error| error.to_string());
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
