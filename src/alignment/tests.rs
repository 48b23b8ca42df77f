//! Advice for simulated rigs that are out of focus, tilted or too dark, behind colour filters.

use std::path::Path;

use super::*;
use crate::config::{self, Kind};
use crate::frame::{Frame, Mosaic, Plane, Size};
use crate::rig::simulated;

/// small.toml behind colour filters, with a change.
fn rig(change: impl FnOnce(&mut config::Simulation)) -> RigFile {
    let mut rig = config::load(Path::new("small.toml")).expect("a built-in rig");
    if let Kind::Simulated(simulation) = &mut rig.kind {
        simulation.sensor.mosaic = Some(Mosaic::Rggb);
        change(simulation);
    }
    rig
}

fn aim_of(rig: &RigFile) -> Option<Aim> {
    let (mut devices, _) = simulated::open(rig).unwrap();
    RigView::new(&mut devices, rig).unwrap().measure_aim().unwrap()
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn sharpness_is_largest_where_the_panel_is_in_focus() {
    let rig = rig(|_| {});
    let (mut devices, mut witness) = simulated::open(&rig).unwrap();
    // A 75 mm lens at f/4 has a depth of focus of 0.32 mm on sites of 40 µm. Focused at 4 m, it
    // shows panels from 3.6 to 4.5 m sharply. The mean is taken because the image is curved.
    let distances = [2600.0, 3100.0, 3600.0, 4000.0, 4500.0, 5500.0, 7500.0];
    let mut seen = Vec::new();
    for distance_mm in distances {
        witness.refocus(distance_mm).unwrap();
        let mut view = RigView::new(&mut devices, &rig).unwrap();
        let sharpness = view.measure_focus().unwrap().sharpness;
        println!("{distance_mm} mm: {:.4} of {:.4?}", sharpness.mean(), sharpness.0);
        seen.push(sharpness.mean());
    }
    let best = (0..seen.len()).max_by(|&a, &b| seen[a].total_cmp(&seen[b])).unwrap();
    assert!((2..=4).contains(&best), "{seen:?}");
    // Sharpness falls on both sides of the best distance.
    assert!(seen[0] < 0.8 * seen[best] && seen[6] < 0.8 * seen[best], "{seen:?}");
}

#[test]
fn a_well_aligned_rig_gets_no_advice_and_its_aim_equals_its_pose() {
    let rig = rig(|_| {});
    let pose = rig.simulation().unwrap().pose.clone();
    let aim = aim_of(&rig).unwrap();
    println!("{aim:?}");
    assert!((aim.rotation_deg - pose.rotation_deg).abs() < 0.1, "{aim:?}");
    assert!((aim.magnification / pose.sensor_px_per_panel_px - 1.0).abs() < 0.02, "{aim:?}");
    assert!((aim.offset_px[0] - pose.shift_x_px).abs() < 0.5, "{aim:?}");
    assert!((aim.offset_px[1] - pose.shift_y_px).abs() < 0.5, "{aim:?}");
    assert!(!aim.mirrored && aim.covers(), "{aim:?}");
    let (panel, sensor) = (rig.panel.size(), rig.photo_grid().sensor);
    assert_eq!(aim.advice(panel, sensor), []);
    let (mut devices, _) = simulated::open(&rig).unwrap();
    let light = RigView::new(&mut devices, &rig).unwrap().measure_brightness().unwrap();
    println!("{light:?}");
    assert_eq!(light.advice(rig.panel.refresh_hz), []);
    assert!(light.clipped_share < 1e-3 && light.white > 0.6, "{light:?}");
}

#[test]
fn tilt_shows_as_keystone() {
    for (tilt_x_deg, tilt_y_deg) in [(0.0, 0.0), (3.0, -2.0), (-1.0, 4.0)] {
        let rig = rig(|simulation| {
            simulation.pose.tilt_x_deg = tilt_x_deg;
            simulation.pose.tilt_y_deg = tilt_y_deg;
        });
        let aim = aim_of(&rig).unwrap();
        // The image lies 75 mm behind the lens, or 1875 sites of 40 µm.
        let sensor = rig.photo_grid().sensor;
        let tilt = |keystone: f64, side: usize| (keystone * 1875.0 / side as f64).atan();
        let right = tilt(aim.keystone[0], sensor.width).to_degrees();
        let below = tilt(aim.keystone[1], sensor.height).to_degrees();
        println!("{tilt_x_deg} {tilt_y_deg}: {right:.2} {below:.2}, {:?}", aim.keystone);
        // tilt-y brings the right side nearer, tilt-x moves the lower side away.
        assert!((right - tilt_y_deg).abs() < 0.4 && (below + tilt_x_deg).abs() < 0.4, "{aim:?}");
        let mut report = AlignmentReport::new(&rig);
        report.add_aim(Some(aim));
        let lines = report.lines().join("\n");
        for (tilt, side) in [(tilt_y_deg, "on the right"), (-tilt_x_deg, "below")] {
            let how = if tilt > 0.0 { "nearer" } else { "farther" };
            assert!(tilt == 0.0 || lines.contains(&format!(" % {how} {side}")), "{lines}");
        }
        assert!(!lines.contains("-0 px"), "{lines}");
    }
}

#[test]
fn a_mirrored_picture_is_recognised_with_and_without_colours() {
    let panel = Size::new(480, 270);
    let shown = dots::picture(panel);
    for (filters, mirrored) in [(None, false), (None, true), (Some(Mosaic::Gbrg), true)] {
        let counts: Counts = Frame::from_fn(|c| {
            Plane::from_fn(Size::new(400, 240), |x, y| {
                let x = if mirrored { 399 - x } else { x };
                u16::from(shown.plane(c).at(x + 40, y + 10))
            })
        });
        let sites = GreenSites::behind(filters);
        let light = sites.light(&counts, 0.0);
        let found = dots::find(&light, sites, 255.0, panel).unwrap();
        assert_eq!(found.mirrored, mirrored);
        let aim = Aim::of(&found.pairs, mirrored, panel, counts.size()).unwrap();
        println!("{aim:?}");
        let [left, right, top, bottom] = aim.reserve_px;
        for (reserve, wanted) in [(left, 40.0), (right, 40.0), (top, 10.0), (bottom, 20.0)] {
            assert!((reserve - wanted).abs() < 0.5, "{aim:?}");
        }
        assert!(aim.rotation_deg.abs() < 0.1 && (aim.magnification - 1.0).abs() < 1e-3, "{aim:?}");
    }
}

#[test]
fn advice_covers_rotation_tilt_and_darkness() {
    let crooked = rig(|simulation| {
        simulation.pose.rotation_deg = 8.0;
        simulation.pose.shift_x_px = 40.0;
        simulation.pose.tilt_y_deg = 8.0;
        simulation.sensor.white_share = 0.2;
    });
    let (mut devices, _) = simulated::open(&crooked).unwrap();
    let mut view = RigView::new(&mut devices, &crooked).unwrap();
    let mut report = AlignmentReport::new(&crooked);
    report.add_aim(view.measure_aim().unwrap());
    report.add_brightness(view.measure_brightness().unwrap());
    report.add_focus(&view.measure_focus().unwrap());
    let lines = report.lines().join("\n");
    println!("{lines}");
    assert!(lines.contains("px left") && lines.contains("anticlockwise"), "{lines}");
    assert!(lines.contains("left side of the panel") && lines.contains("the sensor sees past it"));
    // White of 0.2 × 1.15 at 50 ms becomes 0.8 at 174 ms; a refresh takes 16.7 ms.
    assert!(lines.contains("white is too dark") && lines.contains("exposure-ms = 1"), "{lines}");
    assert_eq!(aim_of(&rig(|simulation| simulation.pose.shift_x_px = 1000.0)), None);
}

#[test]
fn advice_distinguishes_a_panel_too_far_too_near_or_too_coarse() {
    let (panel, sensor) = (Size::new(480, 270), Size::new(288, 224));
    let actions = |magnification: f64, pixels: Size| {
        let span_px = [288.0 / magnification, 224.0 / magnification];
        let reserve = |k: usize, n: usize| (n as f64 - span_px[k]) / 2.0;
        let (across, down) = (reserve(0, pixels.width), reserve(1, pixels.height));
        let aim = Aim {
            offset_px: [0.0; 2],
            rotation_deg: 0.0,
            magnification,
            mirrored: false,
            keystone: [0.0; 2],
            span_px,
            reserve_px: [across, across, down, down],
        };
        aim.advice(pixels, sensor).into_iter().map(|row| row.action).collect::<Vec<Action>>()
    };
    assert_eq!(actions(0.86, panel), []);
    assert!(matches!(actions(0.7, panel)[..], [Action::Distance(times)] if times < 0.85));
    assert!(matches!(actions(1.3, panel)[..], [Action::Distance(times)] if times > 1.2));
    // 200 panel rows cannot both cover 224 sensor rows and be finer than them.
    let coarse = Size::new(480, 200);
    assert_eq!(actions(0.9, coarse), [Action::ReplacePanel]);
}

#[test]
fn exposures_are_whole_refreshes_and_too_bright_a_panel_is_dimmed() {
    let seen = |white: f64, clipped_share: f64, exposed_ms: f64| {
        let light = Brightness { clipped_share, white, places: [1.0; PLACES], exposed_ms };
        light.advice(60.0)
    };
    let exposure = |rows: Vec<Advice>| match rows[..] {
        [Advice { action: Action::Expose(exposure_ms), .. }] => {
            (exposure_ms * 0.06 * 1e6).round() / 1e6
        }
        _ => panic!("{rows:?}"),
    };
    assert_eq!(exposure(seen(0.2, 0.0, 50.0)), 12.0);
    assert_eq!(exposure(seen(1.0, 0.02, 50.0)), 2.0);
    assert_eq!(exposure(seen(1.0, 0.9, 200.0)), 4.0);
    let darker = seen(1.0, 0.05, 1000.0 / 60.0);
    assert!(
        matches!(darker[..], [Advice { action: Action::Dim(times), .. }] if times < 0.9),
        "{darker:?}"
    );
    assert_eq!(seen(0.7, 0.0, 50.0), []);
}

#[test]
fn the_best_focus_is_known_after_passing_it_on_both_sides() {
    let mut history = FocusHistory::default();
    use FocusTurn::{Continue, PassBest, Reverse, Stay};
    let figures = [0.30, 0.27, 0.28, 0.30, 0.36, 0.40, 0.39, 0.36, 0.38, 0.40];
    let found = figures.map(|figure| history.add(figure));
    let wanted = [
        PassBest, Reverse, Continue, PassBest, PassBest, PassBest, PassBest, Reverse, Continue,
        Stay,
    ];
    assert_eq!(found, wanted);
}

#[test]
fn flicker_is_reported_live() {
    let advised = [0.0, 0.03].map(|share| {
        let rig = rig(|simulation| simulation.unrest.flicker_share = share);
        let (mut devices, _) = simulated::open(&rig).unwrap();
        let mut view = RigView::new(&mut devices, &rig).unwrap();
        let mut report = AlignmentReport::new(&rig);
        (0..20).for_each(|_| report.add_focus(&view.measure_focus().unwrap()));
        report.advice().iter().any(|advice| advice.to_string().contains("the light changes"))
    });
    assert_eq!(advised, [false, true]);
}
