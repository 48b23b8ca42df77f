//! A capture allocates nothing: its picture is marked, shown, triggered, received and identified in
//! memory allocated before. The devices here exist only in memory; allocations with the kernel's
//! devices are tested in `real_rig`.

mod counted;

use relens::frame::{Codes, Counts, Size};
use relens::rig::exposure::{Devices, Timing};
use relens::rig::frame_mark::MarkPlace;
use relens::rig::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger};
use std::sync::{Arc, Mutex};

const PANEL: Size = Size { width: 240, height: 180 };
const SENSOR: Size = Size { width: 160, height: 128 };

/// A panel, and a camera that sees the panel's middle without delay.
struct Bench {
    shown: Codes,
    now_s: f64,
    frames: u32,
    spare: Option<Counts>,
}

#[derive(Clone)]
struct Shared(Arc<Mutex<Bench>>);

impl Shared {
    fn bench(&self) -> std::sync::MutexGuard<'_, Bench> {
        self.0.lock().expect("no other thread")
    }
}

impl Panel for Shared {
    fn size(&self) -> Size {
        PANEL
    }

    fn show(&mut self, codes: &Codes) -> Result<Flip, RigError> {
        let mut bench = self.bench();
        for (to, from) in bench.shown.planes_mut().iter_mut().zip(codes.planes()) {
            to.data_mut().copy_from_slice(from.data());
        }
        bench.now_s += 0.016;
        Ok(Flip { at: Moment(bench.now_s), vblank: 0 })
    }
}

impl Trigger for Shared {
    fn fire(&mut self) -> Result<Moment, RigError> {
        Ok(self.now())
    }
}

impl Camera for Shared {
    fn size(&self) -> Size {
        SENSOR
    }

    fn frame(&mut self, _: Moment) -> Result<Exposed, RigError> {
        let mut bench = self.bench();
        let mut counts = bench.spare.take().unwrap_or_else(|| Counts::zeros(SENSOR));
        for (to, from) in counts.planes_mut().iter_mut().zip(bench.shown.planes()) {
            for y in 0..SENSOR.height {
                for (x, count) in to.row_mut(y).iter_mut().enumerate() {
                    *count = 16 + u16::from(from.at(35 + x * 107 / 100, 20 + y * 107 / 100));
                }
            }
        }
        bench.frames += 1;
        bench.now_s += 0.016;
        Ok(Exposed { counts, sequence: bench.frames, at: Moment(bench.now_s) })
    }

    fn give_back(&mut self, counts: Counts) {
        self.bench().spare = Some(counts);
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        Ok(())
    }
}

impl Clock for Shared {
    fn now(&self) -> Moment {
        Moment(self.bench().now_s)
    }

    fn wait_until(&self, moment: Moment) {
        let mut bench = self.bench();
        bench.now_s = bench.now_s.max(moment.0);
    }
}

#[test]
fn a_capture_allocates_nothing() {
    let bench = Bench { shown: Codes::zeros(PANEL), now_s: 0.0, frames: 0, spare: None };
    let devices = Shared(Arc::new(Mutex::new(bench)));
    let timing =
        Timing { settle_ms: 40.0, exposure_ms: 16.0, deadline_ms: 500.0, exposures_max: 3 };
    let boxed = || Box::new(devices.clone());
    let mut rig = Devices::new(boxed(), boxed(), boxed(), boxed(), timing);
    rig.find_marks(MarkPlace::still(SENSOR, 2, 6, 2)).unwrap_or_else(|error| panic!("{error}"));
    let pictures = [40, 200].map(|code| Codes::filled(PANEL, code));
    for n in 0..10 {
        let (exposed, allocations) = counted::allocations(|| rig.capture(&pictures[n % 2]));
        let exposed = exposed.unwrap_or_else(|error| panic!("{error}"));
        rig.camera.give_back(exposed.counts);
        // The first frame is allocated, and reused from then on.
        assert!(n == 0 || allocations == 0, "capture {n}: {allocations} allocations");
    }
}
