//! The four devices of a simulated rig, which share one bench.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::bench::OpticalBench;
use crate::frame::{Codes, Size};
use crate::rig::{Camera, Clock, Exposed, Flip, Moment, Panel, RigError, Trigger};

/// The bench shared by devices and witness: panel, trigger, camera and clock.
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

impl Panel for Shared {
    fn size(&self) -> Size {
        self.bench().panel.size()
    }

    fn show(&mut self, codes: &Codes) -> Result<Flip, RigError> {
        self.bench().show(codes)
    }
}

impl Trigger for Shared {
    fn fire(&mut self) -> Result<Moment, RigError> {
        Ok(self.bench().fire())
    }
}

impl Camera for Shared {
    fn size(&self) -> Size {
        self.bench().camera.size()
    }

    fn frame(&mut self, deadline: Moment) -> Result<Exposed, RigError> {
        self.bench().frame(deadline)
    }

    fn expose_times(&mut self, times: f64) -> Result<bool, RigError> {
        self.bench().expose_times(times);
        Ok(true)
    }

    fn amplify_times(&mut self, times: f64) -> Result<Option<f64>, RigError> {
        self.bench().amplify_times(times);
        Ok(Some(times))
    }

    fn reopen(&mut self) -> Result<(), RigError> {
        self.bench().reopen()
    }
}

impl Clock for Shared {
    fn now(&self) -> Moment {
        self.bench().now()
    }

    fn wait_until(&self, moment: Moment) {
        self.bench().wait_until(moment);
    }
}
