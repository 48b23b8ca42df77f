//! Calibration from captures alone; its errors against the simulator's truth stay within bounds.

use std::ops::ControlFlow;

use relens::calibration::{Calibration, Correction, Layout};
use relens::chart::scenes::Scene;
use relens::config;
use relens::frame::{Channel, Frame, Plane, Work};
use relens::measurement::{CalibrateError, calibrate, captures, to_the_end};
use relens::patterns;
use relens::remedy::full_message;
use relens::rig::exposure::Devices;
use relens::rig::simulated::{self, Light, Witness};

use crate::{load, measured};

/// A calibrated simulated rig.
struct Calibrated {
    rig: Devices,
    witness: Witness,
    calibration: Calibration,
}

fn calibrated(config: &config::RigFile) -> Calibrated {
    let (rig, witness) = simulated::open(config).expect("a simulated rig");
    let calibration = measured(config).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(calibration.captures, captures(config), "the number of captures is as announced");
    Calibrated { rig, witness, calibration }
}

/// RMS distance over the photo, in sensor pixels, between Work positions and the centroids of the
/// green light that the panel shows for them.
fn geometry_error_px(
    config: &config::RigFile,
    witness: &Witness,
    calibration: &Calibration,
) -> f64 {
    let photo = config.photo.size();
    let (mut squared, mut count) = (0.0, 0.0);
    for j in 0..25 {
        for i in 0..33 {
            let x = (photo.width - 1) as f64 * f64::from(i) / 32.0;
            let y = (photo.height - 1) as f64 * f64::from(j) / 24.0;
            let (u, v) = calibration.geometry.work_to_panel.at(x, y);
            let [sx, sy] = witness.panel_to_sensor(Channel::Green, [u, v]);
            let (dx, dy) = (
                sx - x - config.camera.photo_x_px as f64,
                sy - y - config.camera.photo_y_px as f64,
            );
            squared += dx * dx + dy * dy;
            count += 1.0;
        }
    }
    f64::sqrt(squared / count)
}

/// Relative RMS error of the dark corner over the photo; measurement and truth have mean 1.
fn dark_corner_error(
    config: &config::RigFile,
    witness: &Witness,
    calibration: &Calibration,
    c: Channel,
) -> f64 {
    let truth = witness.dark_corner(c).crop(config.photo_on_sensor());
    let mean = truth.mean();
    let surface = &calibration.dark_corner[c.index()];
    let mut squared = 0.0;
    for y in 0..truth.height() {
        for x in 0..truth.width() {
            let wanted = f64::from(truth.at(x, y)) / mean;
            squared += (surface.at(x as f64, y as f64) / wanted - 1.0).powi(2);
        }
    }
    (squared / truth.size().area() as f64).sqrt()
}

/// `scene` (photo-sized) on the canvas: its border is repeated over the margin, and the outermost
/// two pixels are black, so that the panel is black outside the canvas as in the witness's
/// operator.
pub(crate) fn on_canvas(config: &config::RigFile, scene: [Plane; 3]) -> Frame<Work> {
    let (canvas, margin) = (config.canvas_size(), config.canvas.margin_px);
    Frame::from_planes(scene.map(|scene| {
        Plane::from_fn(canvas, |x, y| {
            let rim =
                margin > 0 && (x < 2 || y < 2 || x + 2 >= canvas.width || y + 2 >= canvas.height);
            let at = |p: usize, side: usize| p.saturating_sub(margin).min(side - 1);
            if rim { 0.0 } else { scene.at(at(x, scene.width()), at(y, scene.height())) }
        })
    }))
}

struct Errors {
    /// RMS of (capture through the light path − true K·L), per channel.
    operator: [f64; 3],
    /// RMS of (lens model − true K·L), per channel.
    model: [f64; 3],
}

fn operator_error(
    config: &config::RigFile,
    rig: &mut Devices,
    witness: &Witness,
    calibration: &Calibration,
    scene: [Plane; 3],
) -> Errors {
    let correction = Correction::new(calibration, Layout::of(config)).expect("sizes that fit");
    let shown = on_canvas(config, scene);
    let truth = witness.forward(&shown, Light::Panel);
    let seen = correction.see(&rig.capture(&correction.show(&shown)).expect("a capture").counts);
    let model = calibration.lens_model().expect("a model");
    let rect = config.photo_on_canvas();
    let mut errors = Errors { operator: [0.0; 3], model: [0.0; 3] };
    for c in Channel::ALL {
        let truth = truth.plane(c).crop(rect);
        let mut off = seen.light.plane(c).crop(rect);
        off.add_scaled(-1.0, &truth);
        errors.operator[c.index()] = off.rms();
        let mut predicted = Plane::zeros(model.canvas());
        model.forward(c, shown.plane(c), &mut predicted);
        let mut off = predicted.crop(rect);
        off.add_scaled(-1.0, &truth);
        errors.model[c.index()] = off.rms();
    }
    errors
}

/// Checks all bounds of a calibration except that of the operator error.
fn score(config: &config::RigFile, witness: &Witness, calibration: &Calibration) {
    let mixing = witness.cross_channel();
    let geometry = geometry_error_px(config, witness, calibration);
    println!("geometry {geometry:.3} px");
    assert!(geometry <= 0.15, "geometry is {geometry:.3} px off");
    for c in Channel::ALL {
        let i = c.index();
        let dark = dark_corner_error(config, witness, calibration, c);
        let mut c_error = 0.0f64;
        for (to, row) in mixing.iter().enumerate() {
            let truth = row[i] / mixing[i][i];
            c_error = c_error.max((f64::from(calibration.cross_channel.c[i][to]) - truth).abs());
        }
        let response = witness.panel_response(c);
        let scale = 255.0 / (response[255] - response[0]);
        let curve = (0..256)
            .map(|n| (calibration.curves[i].table()[n] - scale * (response[n] - response[0])).abs())
            .fold(0.0, f32::max);
        let gain =
            f64::from(calibration.counts_per_level[i]) / witness.counts_per_level() / mixing[i][i];
        println!(
            "{:5}: dark corner {:.3} %, C {c_error:.4}, curve \
             {curve:.3}, gain {gain:.4}, \
             ‖K‖² {:.4} seen {:.4}, noise {:.2} (truth {:.2}), own operator error {:.2}",
            c.name(),
            100.0 * dark,
            calibration.norms.squared[i],
            calibration.norm_squared_seen,
            calibration.noise[i].sigma(128.0),
            witness.noise_levels(128.0),
            calibration.operator_error[i],
        );
        assert!(dark <= 0.005, "dark corner of {} is {:.2} % off", c.name(), 100.0 * dark);
        assert!(c_error <= 0.01, "C from {} is {c_error:.4} off", c.name());
        assert!(curve <= 0.5, "curve of {} is {curve:.3} off", c.name());
    }
}

/// Checks the broad light against the simulator's glare. Blue is out of focus, so its share
/// includes blur beyond the functions.
fn score_broad_light(config: &config::RigFile, calibration: &Calibration) {
    let glare = config.simulation().expect("simulated").glare;
    println!(
        "glare of {} over {} px: found {:.4?}",
        glare.share, glare.radius_px, calibration.broad
    );
    let [red, green, blue] = calibration.scattered();
    for share in [red, green] {
        assert!((share - glare.share).abs() <= 0.25 * glare.share, "{share} of {}", glare.share);
    }
    assert!(blue >= 0.75 * glare.share, "{blue} of {}", glare.share);
}

/// Checks that the operator error of the chart and of photographs is at most `factor` times the
/// default rig's bounds, 2 and 1 grey levels.
fn score_operator(
    config: &config::RigFile,
    rig: &mut Devices,
    witness: &Witness,
    calibration: &Calibration,
    factor: f64,
) {
    let chart = patterns::chart(config.photo.size());
    let photograph = |scene: Scene| scene.light(config.photo.size()).into_planes();
    let scenes = [
        ("chart", [chart.clone(), chart.clone(), chart], 2.0),
        ("astronaut", photograph(Scene::Astronaut), 1.0),
        ("coffee", photograph(Scene::Coffee), 1.0),
        ("rocket", photograph(Scene::Rocket), 1.0),
    ];
    // The operator error excludes noise, which is switched off here.
    witness.change_sensor(|sensor| sensor.read_noise_levels = 0.0);
    witness.change_sensor(|sensor| sensor.full_well_electrons = f64::INFINITY);
    for (name, scene, bound) in scenes {
        let errors = operator_error(config, rig, witness, calibration, scene);
        println!("{name}: operator {:.2?}, lens model alone {:.2?}", errors.operator, errors.model);
        let bound = factor * bound;
        for (c, error) in Channel::ALL.iter().zip(errors.operator) {
            assert!(
                error <= bound,
                "operator error of {name} in {} is {error:.2}, {bound} allowed",
                c.name()
            );
        }
    }
}

#[test]
fn the_small_rig_is_calibrated_within_bounds() {
    let config = load("small.toml");
    let Calibrated { mut rig, witness, calibration } = calibrated(&config);
    score(&config, &witness, &calibration);
    // The bounds are the default rig's. The pixels here are four times as wide under the same blur,
    // so resampling to the panel loses fine detail that the lens passes.
    score_operator(&config, &mut rig, &witness, &calibration, 2.5);
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn the_default_rig_is_calibrated_within_the_bounds() {
    let config = load("ideal.toml");
    let Calibrated { mut rig, witness, calibration } = calibrated(&config);
    score(&config, &witness, &calibration);
    score_broad_light(&config, &calibration);
    score_operator(&config, &mut rig, &witness, &calibration, 1.0);
}

#[test]
#[ignore = "calibrates the default rig three times"]
fn the_default_rig_keeps_the_bounds_with_other_noise() {
    for seed in 2..=4 {
        let mut config = load("ideal.toml");
        if let config::Kind::Simulated(simulation) = &mut config.kind {
            simulation.seed = seed;
        }
        let Calibrated { mut rig, witness, calibration } = calibrated(&config);
        score(&config, &witness, &calibration);
        score_operator(&config, &mut rig, &witness, &calibration, 1.0);
    }
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn the_studys_rig_is_calibrated_without_a_checkerboard() {
    let config = load("study.toml");
    let Calibrated { mut rig, witness, calibration } = calibrated(&config);
    score(&config, &witness, &calibration);
    score_operator(&config, &mut rig, &witness, &calibration, 1.0);
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn responses_of_sites_and_bad_sites_are_found() {
    let mut config = load("truthful.toml");
    // The panel's stripes beat with pixels as coarse as these, and part of the beat resembles the
    // sites' responses.
    score_pattern(&config, 0.0027);
    config.panel.subpixels = config::Subpixels::Whole;
    score_pattern(&config, 0.0);
}

/// Checks responses and bad sites. `more` is added in quadrature to the error allowed for noise.
fn score_pattern(config: &config::RigFile, more: f64) {
    let Calibrated { witness, calibration, .. } = calibrated(config);
    let layout = Layout::of(config);
    let correction = Correction::new(&calibration, layout).expect("sizes that fit");
    let (sites, mosaic) = (correction.sites().expect("a pattern"), layout.canvas_mosaic());
    let (mut missed, mut hot) = (0, 0);
    for c in Channel::ALL {
        let [gain, own] = witness.fixed_pattern(c);
        let (mut squared, mut truth, mut count, mut bad) = (0.0, 0.0, 0.0, 0);
        for y in 0..layout.canvas().height {
            for x in 0..layout.canvas().width {
                if mosaic.expect("filters").colour_at(x, y) != c {
                    continue;
                }
                let at = |plane: &Plane| {
                    f64::from(plane.at(
                        x + layout.photo_x_px - layout.margin_px,
                        y + layout.photo_y_px - layout.margin_px,
                    ))
                };
                let is_hot = at(&own) > 2.0;
                hot += usize::from(is_hot);
                match sites.response(c, x, y) {
                    Some(found) => {
                        missed += usize::from(is_hot);
                        squared += (f64::from(found) - at(&gain)).powi(2);
                        truth += (at(&gain) - 1.0).powi(2);
                        count += 1.0;
                    }
                    None => bad += usize::from(at(&own) == 0.0),
                }
            }
        }
        let (off, was) = (f64::sqrt(squared / count), f64::sqrt(truth / count));
        // A tenth of the noise of one exposure in bright parts, and a fifth of the sites' own
        // deviations, which also change the mean of their surroundings.
        let allowed = f64::hypot(0.1 * witness.noise_levels(230.0) / 230.0, was / 5.0).hypot(more);
        println!(
            "{}: responses differ by {:.3} %, found to {:.3} % ({:.3} allowed), {bad} of {count} \
             marked bad",
            c.name(),
            100.0 * was,
            100.0 * off,
            100.0 * allowed
        );
        assert!(off <= allowed, "{c:?}: {off}");
        assert!(bad as f64 <= 1e-4 * count, "{bad} of {count} good sites are marked bad");
    }
    println!("{missed} of {hot} sites with more than two grey levels of their own are not found");
    assert!(hot > 5 && missed == 0);
}

/// Error of calibrating the small rig with the fault that `change` introduces.
fn failure(change: impl FnOnce(&mut Witness)) -> CalibrateError {
    let config = load("small.toml");
    let (mut rig, mut witness) = simulated::open(&config).expect("a simulated rig");
    change(&mut witness);
    let error = calibrate(&mut rig, &config, None, &mut to_the_end)
        .expect_err("a rig that cannot be calibrated");
    println!("{}", full_message(&error));
    error
}

#[test]
fn faults_of_a_rig_have_their_own_errors() {
    let error = failure(|w| w.change_sensor(|sensor| sensor.white_share = 2.5));
    assert!(matches!(error, CalibrateError::OverExposed { .. }), "{error}");
    let error = failure(|w| w.change_sensor(|sensor| sensor.white_share = 0.05));
    assert!(matches!(error, CalibrateError::TooDark { .. }), "{error}");
    let error = failure(|w| w.change_sensor(|sensor| sensor.white_share = 0.0));
    assert!(matches!(error, CalibrateError::NotInView { .. }), "{error}");
    let error = failure(|w| w.knock_panel(140.0, 0.0));
    assert!(matches!(error, CalibrateError::NotInView { .. }), "{error}");
    let error = failure(|w| w.knock_panel(2000.0, 0.0));
    assert!(matches!(error, CalibrateError::NotInView { .. }), "{error}");
}

#[test]
fn a_rig_out_of_focus_is_refused() {
    // A little out of focus, corners are still found and the lens functions reveal the defocus; far
    // out of focus, no corner is found.
    for focus_mm in [1800.0, 900.0] {
        let mut config = load("small.toml");
        if let config::Kind::Simulated(simulation) = &mut config.kind {
            let lens = &mut simulation.lens;
            (lens.focus_distance_mm, lens.support_px) = (Some(focus_mm), 63);
        }
        let (mut rig, _) = simulated::open(&config).expect("a simulated rig");
        let error =
            calibrate(&mut rig, &config, None, &mut to_the_end).expect_err("a rig out of focus");
        println!("{focus_mm} mm: {}", full_message(&error));
        assert!(matches!(error, CalibrateError::WrongFocus { .. }), "{error}");
    }
}

/// Calibrates the small rig and knocks its panel by (`x_px`, `y_px`) after `when` captures.
fn knocked(when: u32, (x_px, y_px): (f64, f64)) -> Result<Calibration, CalibrateError> {
    let config = load("small.toml");
    let (mut rig, mut witness) = simulated::open(&config).expect("a simulated rig");
    let mut is_done = false;
    calibrate(&mut rig, &config, None, &mut |p| {
        if p.captures >= when && !is_done {
            witness.knock_panel(x_px, y_px);
            is_done = true;
        }
        ControlFlow::Continue(())
    })
}

#[test]
#[ignore = "minutes: the long gate runs it"]
fn a_knock_is_followed_or_refused_at_any_time() {
    let still = measured(&load("small.toml")).expect("a calibration").operator_error;
    // Between checkerboards, gradations and series of patterns.
    for when in [8, 24, 30] {
        let found = knocked(when, (0.6, -0.4)).expect("a knock that can be followed");
        let found = found.operator_error;
        println!("knocked after {when} captures: {found:.3?}, {still:.3?} without");
        assert!(found.iter().zip(still).all(|(found, still)| *found < 1.1 * still));
    }
    // A knock within a series is too fast to follow; a large knock is too far at any time.
    let fast = [22, 33].map(|when| (when, (0.6, -0.4)));
    let far = [8, 22, 24, 33].map(|when| (when, (1.8, -1.2)));
    for (when, knock) in fast.into_iter().chain(far) {
        let error = knocked(when, knock).expect_err("a rig that moved");
        println!("after {when} captures: {}", full_message(&error));
        assert!(matches!(error, CalibrateError::Moving { .. }), "{error}");
    }
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_calibration_is_cancelled_after_the_current_capture() {
    let config = load("small.toml");
    let (mut rig, _) = simulated::open(&config).expect("a simulated rig");
    // During the trials, during longer exposures, and among the patterns.
    for when in [1, 14, captures(&config) - 8] {
        let (before, mut asked) = (rig.captures(), 0);
        let end = calibrate(&mut rig, &config, None, &mut |p| {
            asked += 1;
            if p.captures >= when { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let error = end.expect_err("cancelled");
        assert!(matches!(error, CalibrateError::GivenUp), "{error}");
        // One more capture restores the exposure.
        let taken = rig.captures() - before;
        assert!((when as usize..=when as usize + 1).contains(&taken), "{taken} of {when}");
        assert!(asked > when);
    }
    calibrate(&mut rig, &config, None, &mut to_the_end).expect("exposed as before");
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_calibration_is_reproducible_and_increments_the_generation() {
    let config = load("small.toml");
    let first = calibrated(&config).calibration;
    let (mut rig, _) = simulated::open(&config).expect("a simulated rig");
    let second =
        calibrate(&mut rig, &config, Some(&first), &mut to_the_end).expect("a calibration");
    assert_eq!(second.generation, first.generation + 1);
    assert_eq!(Calibration { generation: first.generation, ..second }, first);
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_gamma_is_refused_and_a_sensor_s_knee_is_linearised() {
    let mut config = load("small.toml");
    config.calibration.linearity = true;
    let bent = |gamma: f64, knee_share: f64| {
        let mut config = config.clone();
        if let config::Kind::Simulated(simulation) = &mut config.kind {
            let curve = &mut simulation.sensor.curve;
            (curve.gamma, curve.knee_share, curve.knee_slope) = (gamma, knee_share, 0.7);
        }
        let (mut rig, _) = simulated::open(&config).expect("a simulated rig");
        calibrate(&mut rig, &config, None, &mut to_the_end)
    };
    let knee = bent(0.98, 0.85).expect("a truthful rig's camera");
    assert_eq!(knee.captures, captures(&config));
    assert!(knee.camera_curve.bend() > 0.02, "{:?}", knee.camera_curve);
    assert!(bent(1.0, 1.0).expect("a straight camera").camera_curve.is_straight());
    for gamma in [0.6, 0.45, 1.5] {
        let error = bent(gamma, 1.0).expect_err("a camera with a gamma");
        println!("{gamma}: {}", full_message(&error));
        assert!(matches!(error, CalibrateError::NotLinear { .. }), "{error}");
    }
}
