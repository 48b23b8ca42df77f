//! The four devices of a simulated rig, which share one bench.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::bench::OpticalBench;
use crate::frame::{Codes, Size};
use crate::rig::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger};

/// The bench shared by devices and witness.
#[derive(Clone)]
pub(super) struct Shared(Arc<Mutex<OpticalBench>>);

impl Shared {
    pub(super) fn new(bench: OpticalBench) -> Shared {
        Shared(Arc::new(Mutex::new(bench)))
    }

    /// The bench, even after a panic in another thread, since its state remains valid.
    pub(super) fn bench(&self) -> MutexGuard<'_, OpticalBench> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Simulated display.
pub(super) struct SimulatedPanel(pub(super) Shared);

impl Panel for SimulatedPanel {
    fn size(&self) -> Size {
        self.0.bench().panel.size()
    }

    fn show(&mut self, codes: &Codes) -> Result<Flip, RigError> {
        self.0.bench().show(codes)
    }
}

/// Simulated trigger.
pub(super) struct SimulatedTrigger(pub(super) Shared);

impl Trigger for SimulatedTrigger {
    fn fire(&mut self) -> Result<Moment, RigError> {
        Ok(self.0.bench().fire())
    }
}

/// Simulated camera.
pub(super) struct SimulatedCamera(pub(super) Shared);

impl Camera for SimulatedCamera {
    fn size(&self) -> Size {
        self.0.bench().camera.size()
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        self.0.bench().frame(deadline)
    }

    fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        self.0.bench().expose_times(times);
        Ok(true)
    }

    fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        self.0.bench().amplify_times(times);
        Ok(Some(times))
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        self.0.bench().reopen()
    }
}

/// Simulated clock, advanced by waiting.
pub(super) struct SimulatedClock(pub(super) Shared);

impl Clock for SimulatedClock {
    fn now(&self) -> Moment {
        self.0.bench().now()
    }

    fn wait_until(&self, moment: Moment) {
        self.0.bench().wait_until(moment);
    }
}
