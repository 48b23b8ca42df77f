//! Scenes out of focus, moving panels and cameras, measured from the frames.

use super::tests::grey;
use super::truth_tests::*;
use super::*;
use crate::frame::{Channel, Codes, Counts, Frame, Plane, Size, Work};
use crate::rig::Moment;

/// Distance behind a thin lens of this focal length at which an object is sharp, in mm.
fn image_mm(object_mm: f64) -> f64 {
    1.0 / (1.0 / 74.68 - 1.0 / object_mm)
}

#[test]
fn a_scene_out_of_focus_is_blurred_by_the_cone_of_light() {
    let (config, _, sharp) = quiet_with(&[NO_GLARE]);
    let (_, _, blurred) = quiet_simulated_with(&[NO_GLARE], |simulation| {
        simulation.lens.scene_distance_mm = Some(3200.0);
    });
    let size = config.canvas_size();
    let [across, down] = [size.width / 2, size.height / 2];
    let mut scene: Frame<Work> = Frame::zeros(size);
    scene.planes_mut().iter_mut().for_each(|plane| plane.set(across, down, 1e4));
    let [before, after] = [&sharp, &blurred].map(|witness| {
        let plane = witness.forward(&scene, Light::Scene);
        let green = plane.plane(Channel::Green).clone();
        moments_of(green.data().iter().map(|&v| f64::from(v)), size.width).1
    });
    // The sensor cuts the cone of light, 18.75 mm wide at the lens, in a disc whose second moment
    // is half its radius squared. Moments add, because the sharp image has the least one.
    let [v, sharp_v] = [3200.0, 4000.0].map(image_mm);
    let radius_px = 18.75 / 2.0 * (v - sharp_v) / v / 0.04;
    let grown = after - before;
    assert!((grown / (radius_px.powi(2) / 2.0) - 1.0).abs() < 0.06, "{before} {after} {radius_px}");
}

#[test]
fn a_lens_focused_nearer_magnifies_the_panel_and_blurs_it() {
    let quiet = [NO_LEAKAGE, NO_GLARE];
    let (config, _, sharp) = quiet_with(&quiet);
    let (_, _, near) = quiet_simulated_with(&quiet, |simulation| {
        simulation.lens.focus_distance_mm = Some(3200.0);
    });
    let [left, right] = [[150.0, 100.0], [330.0, 160.0]].map(|at| spot(config.panel.size(), at));
    let apart_and_wide = |witness: &Witness| {
        let [a, b] = [&left, &right].map(|c| moments(&witness.light_on_sensor(c), witness)[1]);
        ((a.0[0] - b.0[0]).hypot(a.0[1] - b.0[1]), a.1)
    };
    let ((before, narrow), (after, wide)) = (apart_and_wide(&sharp), apart_and_wide(&near));
    let grown = image_mm(3200.0) / image_mm(4000.0);
    assert!((after / before / grown - 1.0).abs() < 5e-4, "{before} {after} {grown}");
    assert!(wide - narrow * grown.powi(2) > 0.3, "{narrow} {wide}");

    // Refocusing has the same effect as opening a rig with that focus, and can be undone.
    let (_, _, mut turned) = quiet_with(&quiet);
    let first = turned.light_on_sensor(&left);
    turned.refocus(3200.0).expect("a traced lens");
    assert_eq!(turned.light_on_sensor(&left), near.light_on_sensor(&left));
    turned.refocus(4000.0).expect("a traced lens");
    let again = turned.light_on_sensor(&left);
    let mut off = again[1].clone();
    off.add_scaled(-1.0, &first[1]);
    assert!(off.rms() < 1e-3, "{}", off.rms());
}

/// Displacement of `seen` against `still` by least squares on the gradients of `still`, green.
fn displacement(seen: &[f64], still: &[f64], width: usize) -> [f64; 2] {
    let (mut xx, mut xy, mut yy, mut xd, mut yd) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for y in 8..still.len() / width - 8 {
        for n in y * width + 8..(y + 1) * width - 8 {
            let right = (still[n + 1] - still[n - 1]) / 2.0;
            let down = (still[n + width] - still[n - width]) / 2.0;
            let off = still[n] - seen[n];
            (xx, xy, yy) = (xx + right * right, xy + right * down, yy + down * down);
            (xd, yd) = (xd + right * off, yd + down * off);
        }
    }
    let det = xx * yy - xy * xy;
    [(yy * xd - xy * yd) / det, (xx * yd - xy * xd) / det]
}

/// Light without sharp edges, so that gradients measure displacements.
fn soft(size: Size) -> Codes {
    Frame::from_fn(|_| {
        Plane::from_fn(size, |x, y| {
            let wave = (x as f64 / 5.0).sin() * (y as f64 / 6.0).sin();
            (130.0 + 90.0 * wave) as u8
        })
    })
}

fn green_of(counts: &Counts) -> Vec<f64> {
    counts.plane(Channel::Green).data().iter().map(|&v| f64::from(v)).collect()
}

/// Displacements of `captures` captures against a rig at rest.
fn displacements(unrest: config::Unrest, captures: usize) -> Vec<[f64; 2]> {
    let (config, mut still, _) = quiet_with(&[]);
    let (_, mut rig, _) = quiet_simulated_with(&[], |simulation| simulation.unrest = unrest);
    let codes = soft(config.panel.size());
    let at_rest = green_of(&still.capture(&codes).expect("no faults").counts);
    (0..captures)
        .map(|_| {
            let seen = green_of(&rig.capture(&codes).expect("no faults").counts);
            displacement(&seen, &at_rest, config.camera.width_px)
        })
        .collect()
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn captures_are_displaced_as_much_as_stated() {
    let vibrating = config::Unrest { vibration_px: 0.05, ..Default::default() };
    let shaken = displacements(vibrating, 150);
    let wandered = displacements(config::Unrest { wander_px: 0.03, ..Default::default() }, 150);
    for axis in 0..2 {
        let (_, sigma) = mean_and_sigma(shaken.iter().map(|at| at[axis]));
        // A standard deviation of 150 values has an error of 6 %.
        assert!((sigma / 0.05 - 1.0).abs() < 0.2, "{axis}: {sigma}");
        let steps = wandered.windows(2).map(|two| two[1][axis] - two[0][axis]);
        let (_, step) = mean_and_sigma(steps);
        assert!((step / 0.03 - 1.0).abs() < 0.2, "{axis}: {step}");
        let far = wandered.iter().map(|at| at[axis].abs()).fold(0.0, f64::max);
        assert!((0.06..0.5).contains(&far), "{axis}: {far}");
    }
    assert_eq!(shaken[..20], displacements(vibrating, 20)[..]);
}

#[test]
fn a_panel_drifts_and_flickers_as_much_as_stated() {
    let unrest = config::Unrest {
        flicker_share: 0.003,
        drift_px_per_h: [0.4, -0.2],
        drift_share_per_h: -0.03,
        ..Default::default()
    };
    let (config, mut still, _) = quiet_with(&[]);
    let (_, mut rig, _) = quiet_simulated_with(&[], |simulation| simulation.unrest = unrest);
    let (codes, flat) = (soft(config.panel.size()), grey(&config, 200));
    let at_rest = green_of(&still.capture(&codes).expect("no faults").counts);
    let light = middle_of(&still.capture(&flat).expect("no faults").counts);
    let mut shares: Vec<f64> = Vec::new();
    for _ in 0..120 {
        shares.push(middle_of(&rig.capture(&flat).expect("no faults").counts) / light);
    }
    let (mean, sigma) = mean_and_sigma(shares.iter().copied());
    assert!((sigma / 0.003 - 1.0).abs() < 0.25 && (mean - 1.0).abs() < 1e-3, "{mean} {sigma}");
    rig.clock.wait_until(Moment(3600.0));
    let late = rig.capture(&codes).expect("no faults").counts;
    let [across, down] = displacement(&green_of(&late), &at_rest, config.camera.width_px);
    assert!((across - 0.4).abs() < 0.02 && (down + 0.2).abs() < 0.02, "{across} {down}");
    let later: Vec<f64> = (0..40)
        .map(|_| middle_of(&rig.capture(&flat).expect("no faults").counts) / light)
        .collect();
    let (mean, _) = mean_and_sigma(later.iter().copied());
    assert!((mean - 0.97).abs() < 0.002, "{mean}");
}

#[test]
fn a_drifted_panel_looks_like_one_that_was_moved() {
    // The hardest case: edges at every panel pixel.
    let (config, mut rig, mut witness) = quiet_with(&[]);
    let codes = Frame::from_fn(|c| {
        Plane::from_fn(config.panel.size(), |x, y| {
            ((x * 7919 + y * 104_729 + x * y * 31 + c.index()) % 256) as u8
        })
    });
    let mut at_rest = rig.capture(&codes).expect("no faults").counts;
    rig.clock.wait_until(Moment(3600.0));
    for [across, down] in [[0.05, -0.03], [0.4, 0.3]] {
        witness.knock_panel(across, down);
        let knocked = rig.capture(&codes).expect("no faults").counts;
        witness.knock_panel(-across, -down);
        let drift_px_per_h = [across, down];
        witness.set_unrest(config::Unrest { drift_px_per_h, ..Default::default() });
        // The same picture as before must be displaced, too.
        let crept = rig.capture(&codes).expect("no faults").counts;
        witness.set_unrest(config::Unrest::default());
        let rms = |counts: &Counts| {
            let squares = green_of(counts).into_iter().zip(green_of(&knocked));
            (squares.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / at_rest.size().area() as f64)
                .sqrt()
        };
        let (off, change) = (rms(&crept), rms(&at_rest));
        assert!(off < 0.02 * change + 0.5, "{across} {down}: {off} of {change} counts");
        at_rest = rig.capture(&codes).expect("no faults").counts;
    }
}
