//! From the rig file as written to the rig as checked: the rules within and across tables.

use std::fmt::Display as Show;
use std::path::Path;

use serde::Serialize;

use super::appliance::check_appliance;
use super::hardware::check_hardware;
use super::simulation::{
    Display, Glare, Lens, LensGeometry, Prescription, Primaries, Sensor, Simulation,
};
use super::written::{KindWord, LensTable, Written};
use super::{BlurGrid, ConfigError, Geometry, Kind, Rig};

/// Says what was found and what is allowed, for one file.
pub(super) struct Rules<'a> {
    pub(super) file: &'a str,
}

impl Rules<'_> {
    pub(super) fn broken(&self, key: &str, found: impl Show, allowed: impl Show) -> ConfigError {
        ConfigError::Value {
            file: self.file.to_owned(),
            key: key.to_owned(),
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }

    pub(super) fn hold(
        &self,
        rule: bool,
        key: &str,
        found: impl Show,
        allowed: impl Show,
    ) -> Result<(), ConfigError> {
        if rule { Ok(()) } else { Err(self.broken(key, found, allowed)) }
    }

    /// `found` in `low..=high`; NaN is in no range.
    pub(super) fn within(
        &self,
        key: &str,
        found: f64,
        low: f64,
        high: f64,
    ) -> Result<(), ConfigError> {
        self.hold((low..=high).contains(&found), key, found, format_args!("{low} to {high}"))
    }

    pub(super) fn above(&self, key: &str, found: f64, low: f64) -> Result<(), ConfigError> {
        self.hold(found > low, key, found, format_args!("more than {low}"))
    }

    pub(super) fn needed<T>(&self, key: &str, value: Option<T>) -> Result<T, ConfigError> {
        value.ok_or_else(|| {
            self.broken(key, "nothing", "a value; no physical quantity has a default")
        })
    }
}

/// Checks everything and derives the identity.
pub(super) fn check(written: Written, file: &str, base_dir: &Path) -> Result<Rig, ConfigError> {
    let rules = Rules { file };
    if written.rig.kind == KindWord::Hardware && !cfg!(feature = "hardware") {
        return Err(ConfigError::NoHardware { file: file.to_owned() });
    }
    check_sizes(&rules, &written)?;
    check_times(&rules, &written)?;
    check_methods(&rules, &written)?;
    let (run, nights) = (written.run.unwrap_or_default(), written.nights.clone());
    let (disk, keep) = (written.disk.unwrap_or_default(), written.keep.unwrap_or_default());
    let share = written.share.unwrap_or_default();
    check_appliance(&rules, run, nights.as_ref(), disk, keep, share)?;
    let Written { rig, photo, panel, camera, canvas, marks, calibration, restore, paper, .. } =
        &written;
    let (rig_name, parts) = (rig.name.clone(), (photo.clone(), panel.clone(), camera.clone()));
    let geometry_parts = (
        (photo.width_px, photo.height_px, photo.curve),
        (panel.width_px, panel.height_px),
        (camera.width_px, camera.height_px, camera.photo_x_px, camera.photo_y_px, camera.bits),
        camera.exposure_ms,
        (canvas, calibration, marks),
    );
    let mut identity = Identity::default();
    identity.take(&geometry_parts);
    let (canvas, marks, calibration) = (canvas.clone(), marks.clone(), calibration.clone());
    let (restore, paper) = (restore.clone(), paper.clone());
    let kind = match written.rig.kind {
        KindWord::Hardware => {
            let hardware = rules.needed("[hardware]", written.hardware.clone())?;
            check_hardware(&rules, &hardware, panel, camera)?;
            identity.take(&(&hardware.panel, &hardware.camera));
            Kind::Hardware(Box::new(hardware))
        }
        KindWord::Simulated => {
            let simulation = check_simulation(&rules, written, base_dir)?;
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
    let (photo, panel, camera) = parts;
    let identity = identity.0;
    Ok(Rig {
        name: rig_name,
        kind,
        photo,
        panel,
        camera,
        canvas,
        marks,
        calibration,
        restore,
        paper,
        run,
        nights,
        disk,
        keep,
        share,
        identity,
    })
}

fn check_sizes(rules: &Rules, written: &Written) -> Result<(), ConfigError> {
    let Written { photo, panel, camera, canvas, calibration, .. } = written;
    for (key, found) in [
        ("photo.width-px", photo.width_px),
        ("photo.height-px", photo.height_px),
        ("panel.width-px", panel.width_px),
        ("panel.height-px", panel.height_px),
        ("camera.width-px", camera.width_px),
        ("camera.height-px", camera.height_px),
    ] {
        // The upper limit is a guess at the largest panel and sensor one will meet.
        rules.hold((16..=16384).contains(&found), key, found, "16 to 16384")?;
    }
    let margin = canvas.margin_px;
    for (axis, place, length, whole) in [
        ("x", camera.photo_x_px, photo.width_px, camera.width_px),
        ("y", camera.photo_y_px, photo.height_px, camera.height_px),
    ] {
        rules.hold(
            place.checked_add(length).is_some_and(|end| end <= whole),
            &format!("camera.photo-{axis}-px"),
            format_args!("a photo from {place}, {length} long"),
            format_args!("a photo inside the sensor's {whole}"),
        )?;
        let room = place.min(whole - place - length);
        let allowed =
            format_args!("0 to {room}, so that the canvas stays on the sensor along {axis}")
                .to_string();
        rules.hold(margin <= room, "canvas.margin-px", margin, allowed)?;
    }
    rules.hold(
        matches!(camera.bits, 8 | 10 | 12 | 16),
        "camera.bits",
        camera.bits,
        "8, 10, 12 or 16",
    )?;
    if let Some(marks) = &written.marks {
        // What is left above and below the canvas, and room for the smallest strip a blurred edge
        // leaves readable.
        let below = camera.height_px - camera.photo_y_px - photo.height_px - margin;
        let room = (camera.photo_y_px - margin).min(below);
        let found = marks.from_edge_px.saturating_add(marks.height_px);
        let allowed = format!(
            "at most {room} together with marks.from-edge-px, so that the canvas stays free"
        );
        rules.hold(
            found <= room && marks.height_px >= 2,
            "marks.height-px",
            marks.height_px,
            allowed,
        )?;
    }
    if calibration.geometry == Geometry::OneToOne {
        rules.hold(
            panel.size() == camera.size(),
            "calibration.geometry",
            format_args!(
                "one-to-one with a panel of {} and a sensor of {}",
                panel.size(),
                camera.size()
            ),
            "one-to-one only when panel and sensor have one size",
        )?;
    }
    rules.hold(
        calibration.function_support_px % 2 == 1
            && (3..=255).contains(&calibration.function_support_px),
        "calibration.function-support-px",
        calibration.function_support_px,
        "an odd number, 3 to 255",
    )?;
    for (key, found, high) in [
        ("calibration.function-columns", calibration.function_columns, 64),
        ("calibration.function-rows", calibration.function_rows, 64),
        ("calibration.patterns", calibration.patterns, 100),
        ("calibration.captures-averaged", calibration.captures_averaged, 100),
    ] {
        rules.hold((1..=high).contains(&found), key, found, format_args!("1 to {high}"))?;
    }
    let square = calibration.checker_square_px;
    rules.hold((4..=400).contains(&square), "calibration.checker-square-px", square, "4 to 400")
}

fn check_times(rules: &Rules, written: &Written) -> Result<(), ConfigError> {
    let Written { panel, camera, .. } = written;
    rules.within("panel.refresh-hz", panel.refresh_hz, 1.0, 1000.0)?;
    rules.within("panel.settle-ms", panel.settle_ms, 0.0, 10_000.0)?;
    if let Some(latency_ms) = panel.latency_ms {
        rules.within("panel.latency-ms", latency_ms, 0.0, panel.settle_ms)?;
    }
    rules.within("camera.exposure-ms", camera.exposure_ms, 0.001, 60_000.0)?;
    rules.within("camera.deadline-ms", camera.deadline_ms, 1.0, 600_000.0)?;
    rules.hold(
        camera.deadline_ms > camera.exposure_ms,
        "camera.deadline-ms",
        camera.deadline_ms,
        format_args!("more than the exposure of {} ms", camera.exposure_ms),
    )?;
    rules.hold(
        (1..=100).contains(&camera.exposures_max),
        "camera.exposures-max",
        camera.exposures_max,
        "1 to 100",
    )
}

fn check_methods(rules: &Rules, written: &Written) -> Result<(), ConfigError> {
    let Written { restore, paper, .. } = written;
    rules.hold(
        (1..=10_000).contains(&restore.steps),
        "restore.steps",
        restore.steps,
        "1 to 10000",
    )?;
    let shrinkage = f64::from(restore.shrinkage_at_one_grey_level);
    rules.within("restore.shrinkage-at-one-grey-level", shrinkage, 0.0, 255.0)?;
    rules.hold((1..=8).contains(&restore.levels), "restore.levels", restore.levels, "1 to 8")?;
    let corrections = restore.corrections_max;
    rules.hold(corrections <= 100, "restore.corrections-max", corrections, "0 to 100")?;
    rules.hold(paper.iterations <= 10_000, "paper.iterations", paper.iterations, "0 to 10000")?;
    // Above 1/‖K‖² the step diverges; the chart shows that on purpose, so it may be written.
    rules.within("paper.tau", f64::from(paper.tau), 1e-6, 10.0)?;
    rules.within("paper.lambda", f64::from(paper.lambda), 0.0, 1e4)?;
    rules.hold(paper.patch_px >= 4, "paper.patch-px", paper.patch_px, "4 or more")?;
    rules.hold(paper.margin_px <= 1024, "paper.margin-px", paper.margin_px, "0 to 1024")
}

fn check_simulation(
    rules: &Rules,
    written: Written,
    base_dir: &Path,
) -> Result<Simulation, ConfigError> {
    let table = rules.needed("[simulation]", written.simulation)?;
    let lens = rules.needed("[lens]", written.lens)?;
    let pose = rules.needed("[pose]", written.pose)?;
    let display = rules.needed("[display]", written.display)?;
    let sensor = rules.needed("[sensor]", written.sensor)?;
    let faults = rules.needed("[faults]", written.faults)?;
    let lens = check_lens(rules, lens, base_dir)?;

    // Area weights of the simulated panel reach over three panel pixels (guess at what a rig
    // needs).
    rules.within("pose.sensor-px-per-panel-px", pose.sensor_px_per_panel_px, 0.5, 1.0)?;
    for (key, found) in [("pose.shift-x-px", pose.shift_x_px), ("pose.shift-y-px", pose.shift_y_px)]
    {
        rules.within(key, found, -1e4, 1e4)?;
    }
    for (key, found) in [
        ("pose.rotation-deg", pose.rotation_deg),
        ("pose.tilt-x-deg", pose.tilt_x_deg),
        ("pose.tilt-y-deg", pose.tilt_y_deg),
    ] {
        // A sensor pixel's footprint on the panel is taken as upright; beyond 5° that is no longer
        // true.
        rules.within(key, found, -5.0, 5.0)?;
    }
    let tilted = pose.tilt_x_deg != 0.0 || pose.tilt_y_deg != 0.0;
    rules.hold(
        !(tilted && matches!(lens, Lens::Measured(..))),
        "pose.tilt-x-deg, pose.tilt-y-deg",
        "a tilted panel with lens.blur",
        "0 with lens.blur: perspective needs a prescription's object distance",
    )?;
    check_display(rules, &display)?;
    check_sensor(rules, &sensor, f64::from(written.camera.count_max()))?;
    let each = [faults.stale, faults.duplicate, faults.missing, faults.mixed, faults.unplugged];
    let names = ["stale", "duplicate", "missing", "mixed", "unplugged"];
    for (name, found) in names.iter().zip(each) {
        rules.within(&format!("faults.{name}"), found, 0.0, 1.0)?;
    }
    rules.within("faults, all together", each.iter().sum(), 0.0, 1.0)?;
    rules.within("faults.unplugged-ms", faults.unplugged_ms, 0.0, 1e9)?;
    let simulation = Simulation {
        seed: table.seed,
        surround: table.surround,
        lens,
        pose,
        display,
        sensor,
        faults,
        unrest: table.unrest,
    };
    check_departures(rules, &simulation)?;
    Ok(simulation)
}

fn check_lens(rules: &Rules, table: LensTable, base_dir: &Path) -> Result<Lens, ConfigError> {
    let glare = Glare { share: table.glare_share, radius_px: table.glare_radius_px };
    rules.within("lens.glare-share", f64::from(glare.share), 0.0, 0.9)?;
    rules.within("lens.glare-radius-px", f64::from(glare.radius_px), 1.0, 1e4)?;
    if let Some(blur) = table.blur {
        rules.hold(
            table.surface.is_none(),
            "lens",
            "both blur and a prescription",
            "one of them: blur = \"grid.npy\", or [[lens.surface]] and its keys",
        )?;
        return Ok(Lens::Measured(BlurGrid::read(&base_dir.join(blur), rules.file)?, glare));
    }
    let lens = Prescription {
        surfaces: rules.needed("[[lens.surface]] (or lens.blur)", table.surface)?,
        stop_at_surface: rules.needed("lens.stop-at-surface", table.stop_at_surface)?,
        stop_diameter_mm: rules.needed("lens.stop-diameter-mm", table.stop_diameter_mm)?,
        object_distance_mm: rules.needed("lens.object-distance-mm", table.object_distance_mm)?,
        pixel_pitch_um: rules.needed("lens.pixel-pitch-um", table.pixel_pitch_um)?,
        support_px: rules.needed("lens.support-px", table.support_px)?,
        node_columns: rules.needed("lens.node-columns", table.node_columns)?,
        node_rows: rules.needed("lens.node-rows", table.node_rows)?,
        geometry: rules.needed("lens.geometry", table.geometry)?,
        dark_corner: rules.needed("lens.dark-corner", table.dark_corner)?,
        axis_offset_px: table.axis_offset_px.unwrap_or_default(),
        focus_distance_mm: table.focus_distance_mm,
        scene_distance_mm: table.scene_distance_mm,
    };
    for offset in lens.axis_offset_px {
        rules.within("lens.axis-offset-px", offset, -1e4, 1e4)?;
    }
    rules.hold(
        lens.axis_offset_px == [0.0; 2] || lens.geometry == LensGeometry::Centred,
        "lens.axis-offset-px",
        format!("{:?} of a lens that distorts", lens.axis_offset_px),
        "with geometry = \"centred\" alone",
    )?;
    rules.hold(
        lens.stop_at_surface < lens.surfaces.len()
            && lens.surfaces[..lens.stop_at_surface]
                .iter()
                .all(|s| s.radius_mm.is_infinite() && s.glass == "air"),
        "lens.stop-at-surface",
        lens.stop_at_surface,
        "a surface with nothing but flat rims in air before it",
    )?;
    for (n, surface) in lens.surfaces.iter().enumerate() {
        rules.hold(
            surface.radius_mm.abs() > 0.0,
            &format!("lens.surface {n}: radius-mm"),
            surface.radius_mm,
            "anything but 0",
        )?;
        rules.within(&format!("lens.surface {n}: thickness-mm"), surface.thickness_mm, 0.0, 1e4)?;
        rules.above(
            &format!("lens.surface {n}: clear-diameter-mm"),
            surface.clear_diameter_mm,
            0.0,
        )?;
    }
    rules.above("lens.stop-diameter-mm", lens.stop_diameter_mm, 0.0)?;
    for (key, distance) in [
        ("lens.object-distance-mm", Some(lens.object_distance_mm)),
        ("lens.focus-distance-mm", lens.focus_distance_mm),
        ("lens.scene-distance-mm", lens.scene_distance_mm),
    ] {
        distance.map_or(Ok(()), |found| rules.within(key, found, 1.0, 1e7))?;
    }
    rules.within("lens.pixel-pitch-um", lens.pixel_pitch_um, 0.1, 1000.0)?;
    let odd = lens.support_px % 2 == 1 && (3..=255).contains(&lens.support_px);
    rules.hold(odd, "lens.support-px", lens.support_px, "an odd number, 3 to 255")?;
    for (key, found) in
        [("lens.node-columns", lens.node_columns), ("lens.node-rows", lens.node_rows)]
    {
        rules.hold((2..=128).contains(&found), key, found, "2 to 128")?;
    }
    Ok(Lens::Prescription(lens, glare))
}

fn check_primaries(rules: &Rules, key: &str, primaries: &Primaries) -> Result<(), ConfigError> {
    for (name, list) in ["red-nm", "green-nm", "blue-nm"].iter().zip(primaries.lists()) {
        let key = format!("{key}.{name}");
        rules.hold(!list.is_empty(), &key, "no wavelength", "one or more [nm, weight]")?;
        for wavelength in list {
            // The catalogue's Sellmeier coefficients hold from 365 to 1014 nm and beyond.
            rules.within(&key, wavelength.0, 365.0, 1014.0)?;
            rules.above(&format!("{key}, weight"), wavelength.1, 0.0)?;
        }
    }
    Ok(())
}

fn check_display(rules: &Rules, display: &Display) -> Result<(), ConfigError> {
    check_primaries(rules, "display.primaries", &display.primaries)?;
    for n in 0..3 {
        rules.within("display.gamma", display.gamma[n], 0.2, 5.0)?;
        rules.within("display.toe", display.toe[n], 0.0, 1.0)?;
    }
    rules.within("display.leakage-share", display.leakage_share, 0.0, 0.5)?;
    rules.hold(
        display.latency_refreshes <= 100,
        "display.latency-refreshes",
        display.latency_refreshes,
        "0 to 100",
    )?;
    rules.within("display.response-ms", display.response_ms, 0.0, 10_000.0)
}

fn check_sensor(rules: &Rules, sensor: &Sensor, count_max: f64) -> Result<(), ConfigError> {
    check_primaries(rules, "sensor.filters", &sensor.filters)?;
    for (n, row) in sensor.cross_channel.iter().enumerate() {
        rules.hold((row[n] - 1.0).abs() < 1e-12, "sensor.cross-channel, diagonal", row[n], "1")?;
        for &entry in row {
            rules.within("sensor.cross-channel", entry, 0.0, 1.0)?;
        }
    }
    rules.within("sensor.black-level-counts", sensor.black_level_counts, 0.0, count_max / 2.0)?;
    rules.within("sensor.white-share", sensor.white_share, 0.01, 10.0)?;
    rules.above("sensor.full-well-electrons", sensor.full_well_electrons, 1.0)?;
    rules.within("sensor.read-noise-levels", sensor.read_noise_levels, 0.0, 255.0)?;
    for &ambient in &sensor.ambient_levels {
        rules.within("sensor.ambient-levels", ambient, 0.0, 255.0)?;
    }
    rules.within("sensor.readout-ms", sensor.readout_ms, 0.0, 10_000.0)
}

/// The rules of the keys that may be left out.
fn check_departures(rules: &Rules, simulation: &Simulation) -> Result<(), ConfigError> {
    let Simulation { display, sensor, unrest, .. } = simulation;
    let uneven = display.uneven;
    for (key, found, high) in [
        ("display.uneven.corner-loss", uneven.corner_loss, 0.9),
        ("display.uneven.corner-tint", uneven.corner_tint, 0.5),
        ("display.uneven.loss-at-10-deg", uneven.loss_at_10_deg, 0.5),
        ("display.uneven.leakage-at-10-deg", uneven.leakage_at_10_deg, 0.5),
        ("sensor.gain-deviation", sensor.gain_deviation, 0.2),
        ("sensor.hot-pixel-share", sensor.hot_pixel_share, 0.1),
        ("sensor.hot-pixel-levels", sensor.hot_pixel_levels, 1e4),
        ("simulation.unrest.wander-px", unrest.wander_px, 1.0),
        ("simulation.unrest.vibration-px", unrest.vibration_px, 1.0),
        ("simulation.unrest.flicker-share", unrest.flicker_share, 0.2),
    ] {
        rules.within(key, found, 0.0, high)?;
    }
    for drift in unrest.drift_px_per_h {
        rules.within("simulation.unrest.drift-px-per-h", drift, -100.0, 100.0)?;
    }
    rules.within("simulation.unrest.drift-share-per-h", unrest.drift_share_per_h, -1.0, 1.0)?;
    rules.within("sensor.curve.gamma", sensor.curve.gamma, 0.2, 5.0)?;
    rules.within("sensor.curve.knee-share", sensor.curve.knee_share, 0.01, 1.0)?;
    rules.within("sensor.curve.knee-slope", sensor.curve.knee_slope, 0.01, 1.0)
}

/// FNV-1a over the parts, as text: stable across machines and compilers.
struct Identity(u64);

impl Default for Identity {
    fn default() -> Self {
        Identity(0xcbf2_9ce4_8422_2325)
    }
}

impl Identity {
    fn take(&mut self, part: &impl Serialize) {
        // Plain structs of numbers and words always serialise; if one did not, its error is what
        // counts.
        let text = serde_json::to_string(part).unwrap_or_else(|error| error.to_string());
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
