//! The restorer that stands on a calibrated rig.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::restorer::{Certificate, Iteration, Progress, Restored, Restorer};
use super::{baseline, operating_point};
use crate::calibration::{Calibration, store};
use crate::config;
use crate::deconvolution::ladder::Rung;
use crate::deconvolution::lens_model::LensFunctions;
use crate::deconvolution::method::{Method, Step};
use crate::frame::{Channel, Frame, Work};
use crate::kiosk::screen::{Screen, draw};
use crate::light_path::LightPath;
use crate::measurement::{self, calibrate};
use crate::nights::pilot::{self, Drift, Reading};
use crate::picture::Photo;
use crate::pipeline::{
    self, Bench, Interruption, Judged, Request, Setting, Verdict, reference_solution,
};
use crate::remedy::{AnyFailure, Remediable, Remedy, full_message};
use crate::rig::exposure::Rig;

/// A rig, its calibration on flash, and how its photos are restored.
pub struct OnRig {
    config: config::Rig,
    devices: Rig,
    slots: PathBuf,
    setting: Setting,
    bench: Bench,
    stopwatch: Stopwatch,
    calibrating: fn(measurement::Progress),
    /// The pilot's reading right after the calibration.
    baseline: Option<Reading>,
    /// The photo restored last and its result, for the panel.
    last: Option<(Frame<Work>, Frame<Work>)>,
    interrupted: Option<Arc<dyn Fn() -> bool + Send + Sync>>,
}

/// Seconds on a clock of the caller's.
pub type Stopwatch = Box<dyn Fn() -> f64 + Send + Sync>;

/// Calibrates `devices` and keeps the result in `slots`; what was kept before stays if this fails.
///
/// # Errors
/// When the rig is not fit to be calibrated or the result cannot be kept.
pub fn measure(
    config: &config::Rig,
    devices: &mut Rig,
    slots: &Path,
    calibrating: fn(measurement::Progress),
) -> Result<Calibration, AnyFailure> {
    let previous = store::load(slots, config.identity).ok();
    let measured =
        calibrate(devices, config, previous.as_ref(), &mut { calibrating }).map_err(boxed)?;
    store::save(slots, &measured).map_err(boxed)?;
    let bench = Bench::new(config, &measured).map_err(boxed)?;
    let reading = read_pilot(config, devices, &bench, &|| 0.0)?;
    baseline::save(slots, measured.generation, &reading);
    Ok(measured)
}

/// One pilot, as it is.
fn read_pilot(
    config: &config::Rig,
    devices: &mut Rig,
    bench: &Bench,
    stopwatch: &(dyn Fn() -> f64 + Sync),
) -> Result<Reading, AnyFailure> {
    let mut path = LightPath::new(devices, bench.correction(), stopwatch);
    pilot::read(&mut path, bench.model(), config.photo_on_canvas())
}

fn boxed(error: impl Remediable + Send + Sync + 'static) -> AnyFailure {
    Box::new(error)
}

impl OnRig {
    /// The restorer of `devices`, described by `config`, with the calibration kept in `slots`; by
    /// `method`, or by the operating point.
    ///
    /// # Errors
    /// When there is no whole calibration of this rig.
    pub fn new(
        config: &config::Rig,
        devices: Rig,
        slots: PathBuf,
        method: Option<config::Method>,
        stopwatch: Stopwatch,
        calibrating: fn(measurement::Progress),
    ) -> Result<Self, AnyFailure> {
        let calibration = store::load(&slots, config.identity).map_err(boxed)?;
        let bench = Bench::new(config, &calibration).map_err(boxed)?;
        let baseline = baseline::load(&slots, calibration.generation);
        let setting = operating_point::setting(&slots, config, method);
        Ok(OnRig {
            config: config.clone(),
            devices,
            slots,
            setting,
            bench,
            stopwatch,
            calibrating,
            baseline,
            last: None,
            interrupted: None,
        })
    }

    /// The same restorer, which gives a photo up before its next capture once `interrupted` says
    /// so.
    #[must_use]
    pub fn interruptible(mut self, interrupted: Interruption) -> Self {
        let interrupted: Arc<dyn Fn() -> bool + Send + Sync> = Arc::from(interrupted);
        let asked = Arc::clone(&interrupted);
        self.interrupted = Some(interrupted);
        self.bench = self.bench.interruptible(Box::new(move || asked()));
        self
    }

    /// Takes down what the photo taught of the lens. What enough photos have proved takes the
    /// measured lens's place, also on flash; says so then.
    fn learn(&mut self, photo: &Frame<Work>, restored: &pipeline::Restored) -> Option<String> {
        let functions = self.bench.learn(photo, restored)?;
        match self.adopt(functions) {
            Ok(calibration) => {
                let generation = calibration.generation;
                let told = format!(
                    "the lens as this photo and those before it show it has taken the measured \
                     one's place (generation \
                     {generation} of the calibration)"
                );
                log::info!("{told}");
                Some(told)
            }
            Err(error) => {
                log::warn!("what photos taught of the lens is not kept: {}", full_message(&*error));
                None
            }
        }
    }

    fn adopt(&mut self, functions: LensFunctions) -> Result<Calibration, AnyFailure> {
        let before = store::load(&self.slots, self.config.identity).map_err(boxed)?;
        let after = before.with_lens(functions).map_err(boxed)?;
        let bench = self.bench_of(&after)?;
        store::save(&self.slots, &after).map_err(boxed)?;
        // The rig has not moved by this: what drifts, drifts from where it did.
        if let Some(reading) = &self.baseline {
            baseline::save(&self.slots, after.generation, reading);
        }
        self.bench = bench;
        Ok(after)
    }

    /// A bench with `calibration` that is interrupted as this one is.
    fn bench_of(&self, calibration: &Calibration) -> Result<Bench, AnyFailure> {
        let bench = Bench::new(&self.config, calibration).map_err(boxed)?;
        Ok(match self.interrupted.clone() {
            Some(interrupted) => bench.interruptible(Box::new(move || interrupted())),
            None => bench,
        })
    }

    fn untouched(&self, photo: &Photo, rung_reason: String, begun: f64) -> Restored {
        Restored {
            picture: photo.light.clone(),
            untouched: true,
            method: "none".to_owned(),
            rung: Rung::LeaveIt.number(),
            rung_reason,
            captures: 0,
            seconds: (self.stopwatch)() - begun,
            certificate: None,
            notes: Vec::new(),
            iterations: Vec::new(),
        }
    }
}

impl Restorer for OnRig {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Restored, AnyFailure> {
        let begun = (self.stopwatch)();
        let channels = photo.channels;
        if self.bench.is_blank(&photo.light, channels) {
            return Ok(self.untouched(photo, Rung::LeaveIt.reason().to_owned(), begun));
        }
        let solver = self.setting.method(&self.config);
        let captures_max = self.setting.captures_max as usize;
        let mut shown = Progress { done: 0.0, doing: "solving", captures: 0 };
        progress(shown);
        let mut watch = |step: &Step, _: Option<&Frame<Work>>| {
            if step.captures > 0 {
                let captures = step.captures as usize;
                let done = 0.5 + 0.5 * captures as f32 / captures_max.max(captures) as f32;
                shown = Progress { done, doing: "showing and seeing", captures };
            }
            // A step of computing changes nothing that is shown, and says that the solve is alive.
            progress(shown);
        };
        let lens_alone = reference_solution(&self.config);
        let request = Request {
            photo: &photo.light,
            channels,
            method: &*solver,
            stopwatch: &*self.stopwatch,
        };
        let Judged { restored, verdict } = self
            .bench
            .restore_judged(&mut self.devices, &request, &lens_alone, &mut watch)
            .map_err(boxed)?;
        let mut notes: Vec<String> = Vec::new();
        if restored.solution.look.refined.is_some() {
            notes.push(
                "the lens is another than was measured: it was refined by this photo's captures"
                    .to_owned(),
            );
        }
        notes.extend(self.learn(&photo.light, &restored));
        // No harm: what harms is not delivered.
        let mut method = solver.name();
        match verdict {
            Verdict::Sound => {}
            Verdict::Repaired(reason) => {
                method = lens_alone.name();
                notes.push(reason);
            }
            Verdict::Untouched(reason) => {
                let captures = restored.captures;
                return Ok(Restored { captures, ..self.untouched(photo, reason, begun) });
            }
        }
        let certificate = restored.solution.certificate;
        self.last = Some((photo.light.clone(), restored.picture.clone()));
        let rung = Rung::of(&certificate);
        notes.push(format!(
            "noise of the photo: {:.2} grey levels",
            restored.photo_noise[Channel::Green.index()]
        ));
        Ok(Restored {
            picture: restored.picture,
            untouched: false,
            method: method.to_owned(),
            rung: rung.number(),
            rung_reason: rung.reason().to_owned(),
            captures: restored.captures,
            seconds: (self.stopwatch)() - begun,
            certificate: certificate.optical_residual.map(|residual| Certificate {
                residual_grey_levels: residual.into(),
                floor_grey_levels: certificate.noise_floor.into(),
            }),
            notes,
            iterations: restored
                .solution
                .record
                .steps()
                .iter()
                .map(|step| Iteration {
                    residual_grey_levels: step.residual.into(),
                    captures: step.captures as usize,
                    seconds: step.seconds,
                })
                .collect(),
        })
    }

    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        if remedy == Remedy::Recalibrate {
            let calibration =
                measure(&self.config, &mut self.devices, &self.slots, self.calibrating)?;
            self.bench = self.bench_of(&calibration)?;
            self.baseline = baseline::load(&self.slots, calibration.generation);
        } else {
            self.devices.reopen().map_err(boxed)?;
        }
        Ok(())
    }

    fn show(&mut self, screen: &Screen) {
        let pictures = self.last.as_ref().map(|(before, after)| (before, after));
        let codes = draw(screen, self.devices.panel.size(), pictures);
        if let Err(error) = self.devices.panel.show(&codes) {
            log::debug!("the panel does not show the screen: {error}");
        }
    }

    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        let reading = read_pilot(&self.config, &mut self.devices, &self.bench, &*self.stopwatch)?;
        if self.baseline.is_none() {
            // A calibration from before there were pilots: drift counts from now on.
            let generation =
                store::load(&self.slots, self.config.identity).map_err(boxed)?.generation;
            baseline::save(&self.slots, generation, &reading);
        }
        Ok(Some(reading.since(self.baseline.get_or_insert(reading))))
    }
}
