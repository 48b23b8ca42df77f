//! What is said of simulated rigs out of focus, askew and too dark, behind colour filters.

use std::path::Path;

use super::*;
use crate::config::{self, Kind};
use crate::rig::simulated;

/// small.toml behind colour filters, changed.
fn rig(change: impl FnOnce(&mut config::Simulation)) -> RigFile {
    let mut rig = config::load(Path::new("small.toml")).expect("a built-in rig");
    if let Kind::Simulated(simulation) = &mut rig.kind {
        simulation.sensor.mosaic = Some(Mosaic::Rggb);
        change(simulation);
    }
    rig
}

#[test]
fn sharpness_is_largest_where_the_panel_is_in_focus() {
    let rig = rig(|_| {});
    let (mut devices, mut witness) = simulated::open(&rig).unwrap();
    // The depth of focus at f/4 with sites of 40 µm is 0.32 mm behind a lens of 75 mm: panels from
    // 3.6 to 4.5 m are in focus of a lens set to 4 m. The image is curved, so the mean counts.
    let distances = [2600.0, 3100.0, 3600.0, 4000.0, 4500.0, 5500.0, 7500.0];
    let mut seen = Vec::new();
    for distance_mm in distances {
        witness.refocus(distance_mm).unwrap();
        let mut alignment = RigView::new(&mut devices, &rig).unwrap();
        let sharpness = alignment.sharpness().unwrap();
        println!("{distance_mm} mm: {:.4} of {:.4?}", sharpness.mean(), sharpness.0);
        seen.push(sharpness.mean());
    }
    let best = (0..seen.len()).max_by(|&a, &b| seen[a].total_cmp(&seen[b])).unwrap();
    assert!((2..=4).contains(&best), "{seen:?}");
    // And it falls on both sides.
    assert!(seen[0] < 0.8 * seen[best] && seen[6] < 0.8 * seen[best], "{seen:?}");
}

#[test]
fn a_rig_as_filed_is_well_and_its_aim_is_its_pose() {
    let rig = rig(|_| {});
    let pose = rig.simulation().unwrap().pose.clone();
    let (mut devices, _) = simulated::open(&rig).unwrap();
    let mut alignment = RigView::new(&mut devices, &rig).unwrap();
    let aim = alignment.aim().unwrap().unwrap();
    println!("{aim:?}");
    assert!((aim.turned_deg - pose.rotation_deg).abs() < 0.3, "{aim:?}");
    assert!((aim.magnification / pose.sensor_px_per_panel_px - 1.0).abs() < 0.03, "{aim:?}");
    assert!((aim.offset_px[0] - pose.shift_x_px).abs() < 2.0, "{aim:?}");
    assert!((aim.offset_px[1] - pose.shift_y_px).abs() < 2.0, "{aim:?}");
    assert!(!aim.mirrored && aim.advice(rig.camera.width_px).is_empty());
    let light = alignment.brightness().unwrap();
    println!("{light:?}");
    assert!(light.advice(rig.camera.exposure_ms, rig.panel.refresh_hz).is_empty(), "{light:?}");
}

#[test]
fn what_is_askew_or_dark_or_out_of_view_is_said_and_what_to_do() {
    let crooked = rig(|simulation| {
        simulation.pose.rotation_deg = 8.0;
        simulation.pose.shift_x_px = 40.0;
        simulation.sensor.white_share = 0.2;
    });
    let (mut devices, _) = simulated::open(&crooked).unwrap();
    let mut alignment = RigView::new(&mut devices, &crooked).unwrap();
    let aim = alignment.aim().unwrap().unwrap();
    let said = aim.advice(crooked.camera.width_px).join("; ");
    assert!(said.contains("px left") && said.contains("anticlockwise"), "{said}");
    let light = alignment.brightness().unwrap();
    let said = light.advice(crooked.camera.exposure_ms, crooked.panel.refresh_hz).join("; ");
    // White of 0.2 times 1.15 at 50 ms is 0.8 at 174; refreshes take 16.7 ms.
    assert!(said.contains("white is dark") && said.contains("exposure-ms = 1"), "{said}");

    let away = rig(|simulation| simulation.pose.shift_x_px = 1000.0);
    let (mut devices, _) = simulated::open(&away).unwrap();
    assert_eq!(RigView::new(&mut devices, &away).unwrap().aim().unwrap(), None);
}
