//! Someone who never built a rig follows `relens align`, one piece of advice after the other.

// The functions below stop the test as it does itself.
#![allow(clippy::unwrap_used)]

use std::ops::ControlFlow;
use std::path::Path;

use relens::alignment::{Adjustment, AlignmentReport, FocusTurn, PictureSide, RigView};
use relens::config::{self, Kind, Lens, RigFile};
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

/// The same, whose panel is too far away, turned, tilted and aside, the lens focused far before it,
/// the exposure too short.
fn bolted_by_eye() -> RigFile {
    let mut rig = filtered();
    if let Kind::Simulated(simulation) = &mut rig.kind {
        simulation.sensor.white_share = 0.25;
        simulation.pose.rotation_deg = 7.0;
        simulation.pose.shift_x_px = 24.0;
        simulation.pose.shift_y_px = -17.0;
        simulation.pose.tilt_y_deg = -9.0;
        simulation.pose.sensor_px_per_panel_px = 0.66;
        if let Lens::Prescription(lens, _) = &mut simulation.lens {
            lens.object_distance_mm = 5200.0;
            lens.focus_distance_mm = Some(2900.0);
        }
    }
    rig
}

fn calibrates(devices: &mut Devices, rig: &RigFile) -> Result<f32, String> {
    let done = measurement::calibrate(devices, rig, None, &mut |_| ControlFlow::Continue(()));
    done.map(|calibration| calibration.operator_error[1]).map_err(|error| error.to_string())
}

/// Whose hands are nine tenths as good as they should be, and who knows no lens.
struct Builder {
    witness: Witness,
    pose: config::Pose,
    distance_mm: f64,
    focus_dioptres: f64,
    white_share: f64,
    exposure_ms: f64,
    /// The ring's next step in dioptres, and which way.
    turn: f64,
    turning_back: bool,
}

impl Builder {
    fn do_it(&mut self, advice: &Adjustment) {
        match advice {
            Adjustment::Move([x, y]) => {
                self.pose.shift_x_px += 0.9 * x;
                self.pose.shift_y_px += 0.9 * y;
            }
            Adjustment::Turn(clockwise) => self.pose.rotation_deg += 0.9 * clockwise,
            Adjustment::Distance { times, .. } => {
                self.distance_mm *= times;
                self.pose.sensor_px_per_panel_px /= times;
            }
            // Nobody sees by how many degrees: two at a time, until it is no longer said.
            Adjustment::Nearer { side, .. } => match side {
                PictureSide::Right => self.pose.tilt_y_deg += 2.0,
                PictureSide::Left => self.pose.tilt_y_deg -= 2.0,
                PictureSide::Lower => self.pose.tilt_x_deg -= 2.0,
                PictureSide::Upper => self.pose.tilt_x_deg += 2.0,
            },
            Adjustment::Expose { exposure_ms, .. } => {
                self.white_share *= exposure_ms / self.exposure_ms;
                self.exposure_ms = *exposure_ms;
                self.witness.set_white_share(self.white_share);
                return;
            }
            Adjustment::Focus(turn) => {
                // Back is said until it gets sharper: one turns round once.
                let back = *turn == FocusTurn::Back;
                if back && !self.turning_back {
                    self.turn *= -0.5;
                }
                self.turning_back = back;
                self.focus_dioptres += self.turn;
                self.witness.refocus(1000.0 / self.focus_dioptres).unwrap();
                return;
            }
            other => panic!("nothing was done to make it say: {other}"),
        }
        self.witness.move_panel(self.pose.clone(), self.distance_mm).unwrap();
    }
}

#[test]
#[ignore = "a minute: the gate runs it"]
fn a_rig_bolted_by_eye_calibrates_once_the_advice_was_followed_step_by_step() {
    let rig = bolted_by_eye();
    let (mut devices, witness) = simulated::open(&rig).unwrap();
    let refused = calibrates(&mut devices, &rig).expect_err("it is out of focus and askew");
    println!("before: {refused}");

    let mut builder = Builder {
        witness,
        pose: rig.simulation().unwrap().pose.clone(),
        distance_mm: 5200.0,
        focus_dioptres: 1000.0 / 2900.0,
        white_share: 0.25,
        exposure_ms: rig.camera.exposure_ms,
        turn: 0.02,
        turning_back: false,
    };
    let mut view = RigView::new(&mut devices, &rig).unwrap();
    let mut report = AlignmentReport::new(&rig, None);
    let mut steps = 0;
    loop {
        let (aim, seen) = view.aim().unwrap();
        report.aimed(aim, seen);
        report.lit(view.brightness().unwrap());
        report.looked(&view.look().unwrap(), view.now_s());
        let advice = report.adjustments().remove(0);
        println!("{steps}: {advice}");
        if advice == Adjustment::Focus(FocusTurn::There) {
            break;
        }
        builder.do_it(&advice);
        steps += 1;
        assert!(steps < 60, "it never ends");
    }
    println!("{}", report.lines().join("\n"));
    // In dioptres, half the depth of focus of f/4 at 75 mm with sites of 40 µm: 0.16 mm behind the
    // lens.
    let panel = 1000.0 / builder.distance_mm;
    assert!((builder.focus_dioptres - panel).abs() < 0.16 / 75.0 / 75.0 * 1000.0 + 0.002);
    let error = calibrates(&mut devices, &rig).unwrap_or_else(|error| panic!("{error}"));
    println!("after {steps} steps: an operator error of {error:.2} grey levels");
    let filed = filtered();
    let (mut devices, _) = simulated::open(&filed).unwrap();
    let well = calibrates(&mut devices, &filed).unwrap();
    assert!(error < 1.3 * well, "{error} where the rig as filed has {well}");
}
