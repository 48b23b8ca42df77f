//! A simulated builder follows the advice of `relens align` until the rig calibrates.

// Shared test functions may panic as tests do.
#![allow(clippy::unwrap_used)]

use std::ops::ControlFlow;
use std::path::Path;

use relens::alignment::{Action, Advice, AlignmentReport, FocusTurn, RigView};
use relens::config::{self, Kind, RigFile};
use relens::frame::Mosaic;
use relens::measurement;
use relens::rig::exposure::Devices;
use relens::rig::simulated::{self, Witness};

/// small.toml behind colour filters.
fn filtered() -> RigFile {
    let mut rig = config::load(Path::new("small.toml")).expect("a built-in rig");
    if let Kind::Simulated(simulation) = &mut rig.kind {
        simulation.sensor.mosaic = Some(Mosaic::Rggb);
    }
    rig
}

/// The rig of [`filtered`] with the panel too far away, rotated, tilted and off centre, the lens
/// focused far in front of it, and the exposure too short.
fn misaligned() -> RigFile {
    let mut rig = filtered();
    if let Kind::Simulated(simulation) = &mut rig.kind {
        simulation.sensor.white_share = 0.25;
        simulation.pose.rotation_deg = 7.0;
        simulation.pose.shift_x_px = 24.0;
        simulation.pose.shift_y_px = -17.0;
        simulation.pose.tilt_y_deg = -9.0;
        simulation.pose.sensor_px_per_panel_px = 0.66;
        let lens = &mut simulation.lens;
        lens.object_distance_mm = 5200.0;
        lens.focus_distance_mm = Some(2900.0);
    }
    rig
}

fn calibrates(devices: &mut Devices, rig: &RigFile) -> Result<f32, String> {
    let done = measurement::calibrate(devices, rig, None, &mut |_| ControlFlow::Continue(()));
    done.map(|calibration| calibration.operator_error[1]).map_err(|error| error.to_string())
}

/// A builder who carries out nine tenths of each movement advised.
struct Builder {
    witness: Witness,
    pose: config::Pose,
    distance_mm: f64,
    focus_dioptres: f64,
    white_share: f64,
    exposure_ms: f64,
    /// The focus ring's next step, dioptres.
    turn: f64,
    is_reversing: bool,
}

impl Builder {
    fn follow(&mut self, advice: &Advice) {
        match advice.action {
            Action::Move([x, y]) => {
                self.pose.shift_x_px += 0.9 * x;
                self.pose.shift_y_px += 0.9 * y;
            }
            Action::Rotate(clockwise) => self.pose.rotation_deg += 0.9 * clockwise,
            Action::Distance(times) => {
                self.distance_mm *= times;
                self.pose.sensor_px_per_panel_px /= times;
            }
            // The advice states no angle: two degrees at a time until it is no longer given.
            Action::Nearer([right, below]) => {
                let step = |share: f64| if share == 0.0 { 0.0 } else { 2.0 * share.signum() };
                self.pose.tilt_y_deg += step(right);
                self.pose.tilt_x_deg -= step(below);
            }
            Action::Expose(exposure_ms) => {
                self.white_share *= exposure_ms / self.exposure_ms;
                self.exposure_ms = exposure_ms;
                self.witness.change_sensor(|sensor| sensor.white_share = self.white_share);
                return;
            }
            Action::Focus(turn) => {
                // The advice repeats until the picture gets sharper: reverse once.
                let back = turn == FocusTurn::Reverse;
                if back && !self.is_reversing {
                    self.turn *= -0.5;
                }
                self.is_reversing = back;
                self.focus_dioptres += self.turn;
                self.witness.refocus(1000.0 / self.focus_dioptres).unwrap();
                return;
            }
            _ => panic!("unexpected advice: {advice}"),
        }
        self.witness.move_panel(self.pose.clone(), self.distance_mm).unwrap();
    }
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_misaligned_rig_calibrates_after_following_the_advice() {
    let rig = misaligned();
    let (mut devices, witness) = simulated::open(&rig).unwrap();
    let refused = calibrates(&mut devices, &rig).expect_err("out of focus and tilted");
    println!("before: {refused}");

    let mut builder = Builder {
        witness,
        pose: rig.simulation().unwrap().pose.clone(),
        distance_mm: 5200.0,
        focus_dioptres: 1000.0 / 2900.0,
        white_share: 0.25,
        exposure_ms: rig.camera.exposure_ms,
        turn: 0.02,
        is_reversing: false,
    };
    let mut view = RigView::new(&mut devices, &rig).unwrap();
    let mut report = AlignmentReport::new(&rig);
    let mut steps = 0;
    loop {
        report.add_aim(view.measure_aim().unwrap());
        report.add_brightness(view.measure_brightness().unwrap());
        report.add_focus(&view.measure_focus().unwrap());
        let advice = report.advice().remove(0);
        println!("{steps}: {advice}");
        if advice.action == Action::Focus(FocusTurn::Stay) {
            break;
        }
        builder.follow(&advice);
        steps += 1;
        assert!(steps < 60, "the advice never ends");
    }
    println!("{}", report.lines().join("\n"));
    // Half the depth of focus: 0.16 mm behind a lens of f/4 and 75 mm, with sites of 40 µm; in
    // dioptres.
    let panel = 1000.0 / builder.distance_mm;
    assert!((builder.focus_dioptres - panel).abs() < 0.16 / 75.0 / 75.0 * 1000.0 + 0.002);
    let error = calibrates(&mut devices, &rig).unwrap_or_else(|error| panic!("{error}"));
    println!("after {steps} steps: an operator error of {error:.2} grey levels");
    let filed = filtered();
    let (mut devices, _) = simulated::open(&filed).unwrap();
    let well = calibrates(&mut devices, &filed).unwrap();
    assert!(error < 1.3 * well, "{error}, while a well aligned rig has {well}");
}
