//! A free-running camera that stamps its first packet but declares start of exposure: no frame
//! exposed before its picture was shown is accepted.

use std::sync::{Arc, Mutex};

use super::*;
use crate::frame::{Channel, Codes, Counts, Size};
use crate::rig::exposure::{Devices, Timing};
use crate::rig::{Camera, Clock, Exposed, Flip, Panel, RigError, Trigger};

const INTERVAL_S: f64 = 1.0 / 30.0;
const EXPOSURE_S: f64 = 0.02;
const READ_OUT_S: f64 = 0.01;
const REFRESH_S: f64 = 1.0 / 60.0;

fn size() -> Size {
    Size::new(4, 2)
}

/// A panel that changes at once, before a camera whose frame n begins at `phase_s` + n intervals.
struct StampedScene {
    now_s: f64,
    /// Codes shown, each with the time from which it was shown.
    shown: Vec<(f64, u8)>,
    next: u32,
    phase_s: f64,
    /// Delay from the exposure's end to the first packet.
    held_back_s: f64,
    read_as: Stamps,
}

#[derive(Clone)]
struct View(Arc<Mutex<StampedScene>>);

impl View {
    fn with<T>(&self, act: impl FnOnce(&mut StampedScene) -> T) -> T {
        act(&mut self.0.lock().unwrap())
    }
}

impl Clock for View {
    fn now(&self) -> Moment {
        self.with(|scene| Moment(scene.now_s))
    }

    fn wait_until(&self, moment: Moment) {
        self.with(|scene| scene.now_s = scene.now_s.max(moment.0));
    }
}

impl Panel for View {
    fn size(&self) -> Size {
        size()
    }

    fn show(&mut self, codes: &Codes) -> Result<Flip, RigError> {
        self.with(|scene| {
            let vblank = (scene.now_s / REFRESH_S).floor() + 1.0;
            scene.now_s = vblank * REFRESH_S;
            scene.shown.push((scene.now_s, codes.plane(Channel::Green).at(0, 0)));
            Ok(Flip { at: Moment(scene.now_s), vblank: vblank as u64 })
        })
    }
}

impl Trigger for View {
    fn fire(&mut self) -> Result<Moment, RigError> {
        Ok(self.now())
    }
}

impl StampedScene {
    /// Mean code shown from `from_s` to `to_s`.
    fn mean_code(&self, from_s: f64, to_s: f64) -> f64 {
        let ends = self.shown.iter().skip(1).map(|&(at_s, _)| at_s).chain([f64::INFINITY]);
        let parts = self.shown.iter().zip(ends).map(|(&(begin_s, code), end_s)| {
            (end_s.min(to_s) - begin_s.max(from_s)).max(0.0) * f64::from(code)
        });
        parts.sum::<f64>() / (to_s - from_s)
    }
}

impl Camera for View {
    fn size(&self) -> Size {
        size()
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        self.with(|scene| {
            let begun_s = scene.phase_s + f64::from(scene.next) * INTERVAL_S;
            let stamp_s = begun_s + EXPOSURE_S + scene.held_back_s;
            let there_s = stamp_s + READ_OUT_S;
            if there_s > deadline.0 {
                scene.now_s = scene.now_s.max(deadline.0);
                return Err(RigError::NoFrame { waited_ms: 0.0 });
            }
            scene.now_s = scene.now_s.max(there_s);
            scene.next += 1;
            let mut counts = Counts::zeros(size());
            let level = scene.mean_code(begun_s, begun_s + EXPOSURE_S).round() as u16;
            counts.planes_mut().iter_mut().for_each(|plane| plane.data_mut().fill(level));
            let by = StampedBy {
                driver: "uvcvideo",
                states_start: true,
                exposure_s: EXPOSURE_S,
                interval_s: Some(INTERVAL_S),
            };
            Ok(Exposed {
                counts,
                sequence: scene.next,
                at: earliest_start(scene.read_as, &by, stamp_s),
            })
        })
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        Ok(())
    }
}

/// Takes 200 captures with stamps read as `read_as`; returns the number of captures that show
/// anything but their own picture, and the seconds per capture.
fn wrong_of_200(read_as: Stamps, phase_s: f64, held_back_s: f64) -> (usize, f64) {
    let scene =
        StampedScene { now_s: 0.1, shown: vec![(0.0, 0)], next: 0, phase_s, held_back_s, read_as };
    let view = View(Arc::new(Mutex::new(scene)));
    let timing = Timing {
        settle_ms: 0.0,
        exposure_ms: EXPOSURE_S * 1e3,
        deadline_ms: 500.0,
        exposures_max: 3,
    };
    let boxed = || Box::new(view.clone());
    let mut rig = Devices::new(boxed(), boxed(), boxed(), boxed(), timing);
    let wrong = (0..200).filter(|n| {
        let code = [30, 200, 90, 150, 240][n % 5];
        let exposed = rig.capture(&Codes::filled(size(), code)).unwrap();
        exposed.counts.plane(Channel::Green).at(0, 0) != u16::from(code)
    });
    let wrong = wrong.count();
    (wrong, rig.seconds() / 200.0)
}

#[test]
fn no_frame_exposed_before_its_picture_is_accepted() {
    for phase in 0..7 {
        for share in [0.0, 0.03, 0.4, 1.0] {
            let phase_s = f64::from(phase) * INTERVAL_S / 7.0;
            let (wrong, each_s) = wrong_of_200(Stamps::Driver, phase_s, share * INTERVAL_S);
            assert_eq!(wrong, 0, "phase {phase}, held back {share} of an interval");
            assert!(each_s < 4.0 * INTERVAL_S + REFRESH_S, "{each_s} s a capture");
        }
    }
}

#[test]
fn wrong_kinds_of_stamps_accept_such_frames() {
    let wrong = |read_as, held_back_s| -> usize {
        let phases = (0..7).map(|n| f64::from(n) * INTERVAL_S / 7.0);
        phases.map(|phase_s| wrong_of_200(read_as, phase_s, held_back_s).0).sum()
    };
    assert!(wrong(Stamps::ExposureStart, 0.0) > 100, "the test above would pass without care");
    assert!(wrong(Stamps::FrameEnd, 0.4 * INTERVAL_S) > 100, "delayed frames");
}

#[test]
fn a_triggered_frame_is_never_early() {
    let by = StampedBy {
        driver: "uvcvideo",
        states_start: true,
        exposure_s: EXPOSURE_S,
        interval_s: None,
    };
    for held_back_s in [0.0, 0.001, 0.05] {
        let at = earliest_start(Stamps::Driver, &by, 7.0 + EXPOSURE_S + held_back_s);
        assert!(at.0 >= 7.0 - 1e-9);
    }
}

#[test]
fn the_rig_file_overrides_the_driver() {
    let by =
        StampedBy { driver: "vivid", states_start: true, exposure_s: 0.5, interval_s: Some(1.0) };
    assert_eq!(earliest_start(Stamps::Driver, &by, 9.0), Moment(9.0));
    assert_eq!(
        earliest_start(Stamps::Driver, &StampedBy { states_start: false, ..by }, 9.0),
        Moment(8.5)
    );
    assert_eq!(earliest_start(Stamps::FirstPacket, &by, 9.0), Moment(7.5));
    assert_eq!(
        earliest_start(Stamps::ExposureStart, &StampedBy { driver: "uvcvideo", ..by }, 9.0),
        Moment(9.0)
    );
}
