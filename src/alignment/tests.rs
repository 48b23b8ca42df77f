//! What is said of simulated rigs out of focus, askew and too dark, behind colour filters.

use std::path::Path;

use super::*;
use crate::config::{self, Kind};
use crate::frame::{Frame, Mosaic, Plane, Size};
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

fn aim_of(rig: &RigFile) -> Option<Aim> {
    let (mut devices, _) = simulated::open(rig).unwrap();
    RigView::new(&mut devices, rig).unwrap().aim().unwrap().0
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn sharpness_is_largest_where_the_panel_is_in_focus() {
    let rig = rig(|_| {});
    let (mut devices, mut witness) = simulated::open(&rig).unwrap();
    // The depth of focus at f/4 with sites of 40 µm is 0.32 mm behind a lens of 75 mm: panels from
    // 3.6 to 4.5 m are in focus of a lens set to 4 m. The image is curved, so the mean counts.
    let distances = [2600.0, 3100.0, 3600.0, 4000.0, 4500.0, 5500.0, 7500.0];
    let mut seen = Vec::new();
    for distance_mm in distances {
        witness.refocus(distance_mm).unwrap();
        let mut view = RigView::new(&mut devices, &rig).unwrap();
        let sharpness = view.look().unwrap().sharpness;
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
    let aim = aim_of(&rig).unwrap();
    println!("{aim:?}");
    assert!((aim.turned_deg - pose.rotation_deg).abs() < 0.1, "{aim:?}");
    assert!((aim.magnification / pose.sensor_px_per_panel_px - 1.0).abs() < 0.02, "{aim:?}");
    assert!((aim.offset_px[0] - pose.shift_x_px).abs() < 0.5, "{aim:?}");
    assert!((aim.offset_px[1] - pose.shift_y_px).abs() < 0.5, "{aim:?}");
    assert!(!aim.mirrored && aim.covers(), "{aim:?}");
    let (panel, sensor) = (rig.panel.size(), rig.photo_grid().sensor);
    assert_eq!(aim.adjustments(panel, sensor), []);
    let (mut devices, _) = simulated::open(&rig).unwrap();
    let light = RigView::new(&mut devices, &rig).unwrap().brightness().unwrap();
    println!("{light:?}");
    assert_eq!(light.adjustments(rig.panel.refresh_hz), []);
    // A white panel's data are bright, all of them.
    assert_eq!(light.histogram.0.iter().sum::<u64>(), sensor.area() as u64);
    assert_eq!(light.histogram.0[..10].iter().sum::<u64>(), 0, "{:?}", light.histogram);
}

#[test]
fn tilt_is_seen_as_keystone_and_told_in_degrees_where_the_lens_is_known() {
    for (tilt_x_deg, tilt_y_deg) in [(0.0, 0.0), (3.0, -2.0), (-1.0, 4.0)] {
        let rig = rig(|simulation| {
            simulation.pose.tilt_x_deg = tilt_x_deg;
            simulation.pose.tilt_y_deg = tilt_y_deg;
        });
        let aim = aim_of(&rig).unwrap();
        let [right, below] = aim.tilt_deg(75.0 * 1000.0 / 40.0, rig.photo_grid().sensor);
        println!("{tilt_x_deg} {tilt_y_deg}: {right:.2} {below:.2}, {:?}", aim.keystone);
        // The panel's right side comes nearer with tilt-y, its lower side goes away with tilt-x.
        assert!((right - tilt_y_deg).abs() < 0.4 && (below + tilt_x_deg).abs() < 0.4, "{aim:?}");
        let mut report = AlignmentReport::new(&rig, None);
        report.aimed(Some(aim), Plane::zeros(rig.photo_grid().sensor));
        let told = report.lines().join("\n");
        for (tilt, side) in [(tilt_y_deg, "on the right"), (-tilt_x_deg, "below")] {
            let how = if tilt > 0.0 { "nearer" } else { "farther" };
            assert!(tilt == 0.0 || told.contains(&format!(" % {how} {side}")), "{told}");
        }
        assert!(!told.contains("-0 px"), "{told}");
    }
}

#[test]
fn a_mirrored_picture_and_a_camera_without_colours_are_known() {
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
        let [left, right, top, bottom] = aim.spare_px;
        for (spare, wanted) in [(left, 40.0), (right, 40.0), (top, 10.0), (bottom, 20.0)] {
            assert!((spare - wanted).abs() < 0.5, "{aim:?}");
        }
        assert!(aim.turned_deg.abs() < 0.1 && (aim.magnification - 1.0).abs() < 1e-3, "{aim:?}");
    }
}

#[test]
fn what_is_askew_or_dark_or_out_of_view_is_said_and_what_to_do() {
    let crooked = rig(|simulation| {
        simulation.pose.rotation_deg = 8.0;
        simulation.pose.shift_x_px = 40.0;
        simulation.pose.tilt_y_deg = 8.0;
        simulation.sensor.white_share = 0.2;
    });
    let (mut devices, _) = simulated::open(&crooked).unwrap();
    let mut view = RigView::new(&mut devices, &crooked).unwrap();
    let mut report = AlignmentReport::new(&crooked, Some(75.0 * 1000.0 / 40.0));
    let (aim, seen) = view.aim().unwrap();
    report.aimed(aim, seen);
    report.lit(view.brightness().unwrap());
    report.looked(&view.look().unwrap(), view.now_s());
    let said = report.lines().join("\n");
    println!("{said}");
    assert!(said.contains("px left") && said.contains("anticlockwise"), "{said}");
    assert!(said.contains("left side of the panel") && said.contains("the sensor sees past it"));
    // White of 0.2 times 1.15 at 50 ms is 0.8 at 174; refreshes take 16.7 ms.
    assert!(said.contains("white is dark") && said.contains("exposure-ms = 1"), "{said}");
    let page = report.page("seen.png");
    assert_eq!(page.matches(" of 100</text>").count(), PLACES);
    assert!(page.contains("<li>turn the panel in the picture") && page.ends_with("</html>\n"));
    let picture = report.picture().unwrap();
    // Half of the sensor's 288 by 224, for one phase of green.
    assert_eq!(picture.size(), Size::new(144, 112));

    assert_eq!(aim_of(&rig(|simulation| simulation.pose.shift_x_px = 1000.0)), None);
}

#[test]
fn a_panel_too_far_too_near_or_too_coarse_is_told_apart() {
    let (panel, sensor) = (Size::new(480, 270), Size::new(288, 224));
    let at = |magnification: f64, pixels: Size| {
        let span_px = [288.0 / magnification, 224.0 / magnification];
        let spare = |k: usize, n: usize| (n as f64 - span_px[k]) / 2.0;
        let (across, down) = (spare(0, pixels.width), spare(1, pixels.height));
        let aim = Aim {
            offset_px: [0.0; 2],
            turned_deg: 0.0,
            magnification,
            mirrored: false,
            keystone: [0.0; 2],
            span_px,
            spare_px: [across, across, down, down],
        };
        aim.adjustments(pixels, sensor)
    };
    assert_eq!(at(0.86, panel), []);
    assert!(matches!(at(0.7, panel)[..], [Adjustment::Distance { times, .. }] if times < 0.85));
    assert!(matches!(at(1.3, panel)[..], [Adjustment::Distance { times, .. }] if times > 1.2));
    // 200 rows cannot be finer than 224 and fill them.
    let coarse = Size::new(480, 200);
    assert!(
        matches!(at(0.9, coarse)[..], [Adjustment::OtherPanel { .. }]),
        "{:?}",
        at(0.9, coarse)
    );
}

#[test]
fn exposures_are_whole_refreshes_and_a_panel_too_bright_for_one_is_to_be_darker() {
    let seen = |white: f64, clipped_share: f64, exposed_ms: f64| {
        let light = Brightness {
            clipped_share,
            white,
            places: [1.0; PLACES],
            histogram: Histogram([0; 32]),
            exposed_ms,
        };
        light.adjustments(60.0)
    };
    let exposure = |adjustments: Vec<Adjustment>| match adjustments[..] {
        [Adjustment::Expose { exposure_ms, .. }] => (exposure_ms * 0.06 * 1e6).round() / 1e6,
        _ => panic!("{adjustments:?}"),
    };
    assert_eq!(exposure(seen(0.2, 0.0, 50.0)), 12.0);
    assert_eq!(exposure(seen(1.0, 0.02, 50.0)), 2.0);
    assert_eq!(exposure(seen(1.0, 0.9, 200.0)), 4.0);
    let darker = seen(1.0, 0.05, 1000.0 / 60.0);
    assert!(matches!(darker[..], [Adjustment::Darken { times }] if times < 0.9), "{darker:?}");
    assert_eq!(seen(0.7, 0.0, 50.0), []);
}

#[test]
fn the_ring_s_best_is_known_once_it_was_passed_on_both_sides() {
    let mut history = FocusHistory::default();
    let mut turn = |figure: f64| match history.turned(figure) {
        Adjustment::Focus(turn) => turn,
        other => panic!("{other:?}"),
    };
    use FocusTurn::{Back, On, PastTheBest, There};
    let figures = [0.30, 0.27, 0.28, 0.30, 0.36, 0.40, 0.39, 0.36, 0.38, 0.40];
    let said = figures.map(&mut turn);
    let wanted = [
        PastTheBest,
        Back,
        On,
        PastTheBest,
        PastTheBest,
        PastTheBest,
        PastTheBest,
        Back,
        On,
        There,
    ];
    assert_eq!(said, wanted);
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn flicker_and_bent_counts_are_measured() {
    let steady = rig(|_| {});
    let flickering = rig(|simulation| {
        simulation.unrest.flicker_share = 0.03;
        simulation.sensor.curve.gamma = 0.6;
    });
    let measured = [steady, flickering].map(|rig| {
        let (mut devices, _) = simulated::open(&rig).unwrap();
        let mut view = RigView::new(&mut devices, &rig).unwrap();
        let mut taken = 0;
        let steady = view.steadiness(&mut |n| taken = n).unwrap();
        assert_eq!(taken, GREYS);
        let linear = view.linearity(0.88).unwrap().unwrap();
        println!("{steady:?} {linear:?}");
        assert!((devices.timing.exposure_ms - rig.camera.exposure_ms).abs() < 1e-6);
        (steady, linear)
    });
    let [(steady, straight), (flickering, bent)] = measured;
    assert_eq!((steady.adjustments(), straight.adjustments()), (vec![], vec![]));
    // Counts go with the light's power of 0.6, and so does their flicker.
    assert!((flickering.flicker / (0.6 * 0.03) - 1.0).abs() < 0.15, "{flickering:?}");
    assert!((straight.times[1] / 3.0 - 1.0).abs() < 0.01, "{straight:?}");
    assert!((bent.times[1] / 3f64.powf(0.6) - 1.0).abs() < 0.02, "{bent:?}");
    assert_eq!(bent.adjustments().len() + flickering.adjustments().len(), 2, "{flickering:?}");
}

#[test]
fn light_that_comes_in_is_seen_and_noise_is_none() {
    let rig = rig(|_| {});
    let (mut devices, witness) = simulated::open(&rig).unwrap();
    let mut view = RigView::new(&mut devices, &rig).unwrap();
    let dark = view.darkness().unwrap();
    let more = |now: [f64; PLACES]| std::array::from_fn::<f64, PLACES, _>(|n| now[n] - dark[n]);
    for _ in 0..5 {
        assert_eq!(leaks(&more(view.darkness().unwrap())), None);
    }
    // Half a grey level of 255.
    let ambient = rig.simulation().unwrap().sensor.ambient_levels;
    witness.set_ambient_levels(ambient.map(|level| level + 0.5));
    let leaking = leaks(&more(view.darkness().unwrap()));
    assert!(matches!(&leaking, Some(Adjustment::Seal(places)) if places.len() == PLACES));
    // Other looks between do not mislead it.
    view.look().unwrap();
    witness.set_ambient_levels(ambient);
    assert_eq!(leaks(&more(view.darkness().unwrap())), None);
}
