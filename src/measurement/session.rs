//! Captures of a running calibration, counted and averaged.

use std::ops::ControlFlow;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::Builder;
use std::time::Duration;

use super::CalibrateError;
use crate::calibration::surface::Surface;
use crate::calibration::{CameraCurve, Correction, Layout, dark_corner};
use crate::config;
use crate::deconvolution::forward_convolution::Seen;
use crate::frame::{Codes, Counts, Frame, Plane, SensorSpace, Work};
use crate::rig::RigError;
use crate::rig::exposure::Devices;

/// Interval between checks for cancellation during a computation.
const POLL: Duration = Duration::from_millis(5);

/// Progress of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CalibrationProgress {
    /// Current step.
    pub step: &'static str,
    /// Number of captures made so far.
    pub captures: u32,
    /// Number of captures of the whole calibration.
    pub total: u32,
}

/// Callback for [`super::calibrate`] that never cancels.
pub fn to_the_end(_: CalibrationProgress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

pub(super) struct Session<'a> {
    pub(super) rig: &'a mut Devices,
    pub(super) config: &'a config::RigFile,
    pub(super) layout: Layout,
    /// Linearisation of the camera's counts; straight until it is measured.
    pub(super) curve: CameraCurve,
    watch: &'a mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>,
    given_up: bool,
    progress: CalibrationProgress,
}

impl<'a> Session<'a> {
    pub(super) fn new(
        rig: &'a mut Devices,
        config: &'a config::RigFile,
        watch: &'a mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>,
        total: u32,
    ) -> Self {
        Session {
            rig,
            config,
            layout: Layout::of(config),
            curve: CameraCurve::straight(),
            watch,
            given_up: false,
            progress: CalibrationProgress { step: "begin", captures: 0, total },
        }
    }

    pub(super) fn step(&mut self, step: &'static str) {
        self.progress.step = step;
        self.report();
    }

    fn report(&mut self) {
        self.given_up |= (self.watch)(self.progress).is_break();
    }

    /// Reports progress, and fails if the calibration was cancelled.
    pub(super) fn go_on(&mut self) -> Result<(), CalibrateError> {
        self.report();
        if self.given_up { Err(CalibrateError::GivenUp) } else { Ok(()) }
    }

    /// Runs `work` on a thread of its own, which is abandoned after a cancellation. If `work`
    /// hangs, the watchdog notices that progress is missing.
    pub(super) fn computed<T: Send + 'static>(
        &mut self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, CalibrateError> {
        let (running, ended) = channel::<()>();
        let thread = Builder::new().name("calibration".to_owned()).spawn(move || {
            let _running = running;
            work()
        });
        let thread = thread.map_err(CalibrateError::NoThread)?;
        while ended.recv_timeout(POLL) == Err(RecvTimeoutError::Timeout) {
            self.go_on()?;
        }
        thread.join().map_err(|panic| std::panic::resume_unwind(panic))
    }

    pub(super) fn captures(&self) -> u32 {
        self.progress.captures
    }

    /// Converts errors of the rig to errors of the current step.
    fn failed(&self) -> impl Fn(RigError) -> CalibrateError + use<> {
        let step = self.progress.step;
        move |source| CalibrateError::Rig { step, source }
    }

    pub(super) fn raw(&mut self, codes: &Codes) -> Result<Counts, CalibrateError> {
        let failed = self.failed();
        let exposed = self.rig.capture(codes).map_err(failed)?;
        self.progress.captures += 1;
        self.go_on()?;
        Ok(exposed.counts)
    }

    /// Sets the exposure to `times` that of the rig file; returns false if the camera cannot.
    pub(super) fn expose_times(&mut self, times: f64) -> Result<bool, CalibrateError> {
        let failed = self.failed();
        self.rig.expose_times(times).map_err(failed)
    }

    /// Captures `codes` as often as the rig file asks; returns the linearised mean.
    pub(super) fn counts(&mut self, codes: &Codes) -> Result<Frame<SensorSpace>, CalibrateError> {
        let times = self.config.calibration.captures_averaged.max(1);
        let mut sum = Frame::<SensorSpace>::zeros(self.layout.sensor);
        for _ in 0..times {
            let counts = self.raw(codes)?;
            sum.update(&counts, |sum, count| *sum += f32::from(count) / times as f32);
        }
        for plane in sum.planes_mut() {
            plane.data_mut().iter_mut().for_each(|count| *count = self.curve.count(*count));
        }
        Ok(sum)
    }

    /// Shows `codes` once; returns the linearised mean of `exposures`, at least one.
    pub(super) fn mean(
        &mut self,
        codes: &Codes,
        exposures: usize,
    ) -> Result<Frame<SensorSpace>, CalibrateError> {
        let first = self.raw(codes)?;
        let mut sums: Frame<SensorSpace, u32> =
            Frame::from_planes(first.into_planes().map(|p| p.map(u32::from)));
        for _ in 1..exposures {
            let failed = self.failed();
            let more = self.rig.expose().map_err(failed)?.counts;
            sums.update(&more, |sum, count| *sum += u32::from(count));
            self.rig.camera.give_back(more);
            self.progress.captures += 1;
            self.go_on()?;
        }
        let share = 1.0 / exposures.max(1) as f32;
        let mean = |sum: &Plane<u32>| sum.map(|v| self.curve.count(v as f32 * share));
        Ok(Frame::from_planes(sums.planes().each_ref().map(mean)))
    }

    /// Captures `picture` (canvas-sized light) as often as the rig file asks; returns the mean. A
    /// pixel is trusted if it is trusted in all captures.
    pub(super) fn seen(
        &mut self,
        correction: &Correction,
        picture: &Frame<Work>,
    ) -> Result<Seen, CalibrateError> {
        let codes = correction.show(picture);
        let times = self.config.calibration.captures_averaged.max(1);
        let mut sum = correction.see(&self.raw(&codes)?);
        for _ in 1..times {
            let next = correction.see(&self.raw(&codes)?);
            sum.light.update(&next.light, |sum, light| *sum += light);
            sum.trusted.update(&next.trusted, |all, trusted| *all &= trusted);
        }
        for plane in sum.light.planes_mut() {
            plane.data_mut().iter_mut().for_each(|v| *v /= times as f32);
        }
        Ok(sum)
    }
}

pub(super) fn difference(a: &Plane, b: &Plane) -> Plane {
    let mut out = a.clone();
    out.add_scaled(-1.0, b);
    out
}

/// Width of the border dimmed by the dark beyond the canvas: half a lens function if the panel ends
/// with the canvas, else zero.
pub(super) fn rim_px(config: &config::RigFile) -> usize {
    if config.panel.size() == config.canvas_size() {
        config.calibration.function_support_px / 2
    } else {
        0
    }
}

/// Fits a smooth surface to a flat capture, ignoring `rim_px` at the canvas's border.
pub(super) fn smooth(
    plane: &Plane,
    layout: &Layout,
    rim_px: usize,
    step: &'static str,
) -> Result<Surface, CalibrateError> {
    dark_corner::smooth(plane, (layout.photo_x_px, layout.photo_y_px), layout.domain(), rim_px)
        .map_err(|source| CalibrateError::Fit { step, source })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::simulated;
    use std::cell::Cell;
    use std::path::Path;

    #[test]
    fn cancelling_a_calibration_abandons_its_computation() {
        let config = config::load(Path::new("small.toml")).unwrap();
        let (mut rig, _) = simulated::open(&config).unwrap();
        let asked = Cell::new(false);
        let mut watch = |_: CalibrationProgress| match asked.get() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let mut session = Session::new(&mut rig, &config, &mut watch, 1);
        assert_eq!(session.computed(|| 7).unwrap(), 7);
        asked.set(true);
        // The computation ends when the test drops `_held`.
        let (_held, end) = channel::<()>();
        let given_up = session.computed(move || end.recv().is_err());
        assert!(matches!(given_up, Err(CalibrateError::GivenUp)), "{given_up:?}");
    }
}
