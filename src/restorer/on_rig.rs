//! The restorer on a calibrated rig.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::binned::BinnedPhoto;
use super::photo_file::{self, SensorFacts, TakenPhoto};
use super::progress::{ProgressCounter, STARTED};
use super::{PanelView, Progress, Restorer, baseline, diffuser, operating_point, provenance};
use crate::calibration::{Calibration, store};
use crate::config;
use crate::deconvolution::method::{Method, Step};
use crate::frame::{Channel, Frame, Work};
use crate::kiosk::screen::{PhotoPair, Screen, draw};
use crate::measurement::{CalibrationProgress, calibrate};
use crate::nights::pilot::{self, Drift, PilotReading};
use crate::picture::{Photo, PictureError};
use crate::pipeline::{
    Interruption, Outcome, Pipeline, Prepared, Restoration, Setting, Stopwatch, Verdict,
};
use crate::remedy::{AnyFailure, Remedy};
use crate::rig::exposure::Devices;
use crate::rig::frame_mark::MarkPlace;
use crate::rig::{RigError, presence};

/// A rig, its calibration on flash, and the method for its photos.
pub struct OnRig {
    config: config::RigFile,
    devices: Devices,
    slots: PathBuf,
    method: Box<dyn Method + Send + Sync>,
    /// Settings of the method, from the rig file or the operating point.
    setting: Setting,
    pipeline: Pipeline,
    calibrating: fn(CalibrationProgress),
    interruption: Option<Interruption>,
    /// The pilot's reading right after the calibration.
    baseline: Option<PilotReading>,
    /// Properties of the camera's sensor, from the calibration.
    sensor: SensorFacts,
    /// Vignetting of the lens alone, if it is to be removed and was measured.
    lens_flat: Option<diffuser::LensFlat>,
    /// The last restored photo and its result, to be shown on the panel.
    last: Option<(Frame<Work>, Frame<Work>)>,
}

/// Calibrates `devices` and keeps the result in the folder `slots`, which is made if missing. If
/// the measurement fails or `interrupted` cancels it, the previous calibration stays.
///
/// # Errors
/// When the rig cannot be calibrated, the result cannot be kept, or the calibration is cancelled.
pub fn measure(
    config: &config::RigFile,
    devices: &mut Devices,
    slots: &Path,
    calibrating: fn(CalibrationProgress),
    interrupted: Option<&Interruption>,
) -> Result<Calibration, AnyFailure> {
    store::make_folder(slots)?;
    let previous = store::load(slots, config.identity).ok();
    let mut measured =
        calibrate(devices, config, previous.as_ref(), &mut watch(calibrating, interrupted))?;
    if let Some(previous) = &previous {
        measured = measured.with_focuses_of(previous);
    }
    store::save(slots, &measured)?;
    measured.warning().into_iter().for_each(|warning| log::warn!("{warning}"));
    let pipeline = Pipeline::new(config, &measured)?;
    let reading = read_pilot(config, devices, &pipeline)?;
    baseline::save(slots, measured.generation, &reading);
    Ok(measured)
}

/// Creates an observer that passes the progress of a calibration to `calibrating`, and cancels the
/// calibration once `interrupted` returns true.
pub(super) fn watch(
    calibrating: fn(CalibrationProgress),
    interrupted: Option<&Interruption>,
) -> impl FnMut(CalibrationProgress) -> ControlFlow<()> {
    let mut last = None;
    move |progress| {
        // Only changed progress is a sign of life for the watchdog.
        if last.replace(progress) != Some(progress) {
            calibrating(progress);
        }
        match interrupted {
            Some(asked) if asked() => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    }
}

fn read_pilot(
    config: &config::RigFile,
    devices: &mut Devices,
    pipeline: &Pipeline,
) -> Result<PilotReading, AnyFailure> {
    pilot::read(&mut pipeline.light_path(devices), pipeline.model(), config.photo_on_canvas())
}

impl OnRig {
    /// Creates the restorer on `devices`, described by `config`, with the calibration in `slots`.
    /// Without a `method` it uses that of the operating point or the rig file.
    ///
    /// # Errors
    /// When there is no valid calibration of this rig.
    pub fn new(
        config: &config::RigFile,
        devices: Devices,
        slots: PathBuf,
        method: Option<config::MethodName>,
        stopwatch: Stopwatch,
        calibrating: fn(CalibrationProgress),
    ) -> Result<Self, AnyFailure> {
        let calibration = store::load(&slots, config.identity)?;
        let pipeline = Pipeline::new(config, &calibration)?.timed_by(stopwatch);
        let asked = config.restore.remove_vignetting;
        let setting = operating_point::setting(&slots, config, method);
        Ok(OnRig {
            lens_flat: if asked { diffuser::load(config, &slots) } else { None },
            config: config.clone(),
            devices,
            method: setting.method(config),
            setting,
            pipeline,
            calibrating,
            interruption: None,
            baseline: baseline::load(&slots, calibration.generation),
            sensor: SensorFacts::of(config, &calibration),
            slots,
            last: None,
        })
    }

    /// The same restorer, which cancels a photo or a calibration before its next capture once
    /// `interruption` returns true.
    #[must_use]
    pub fn interruptible(self, interruption: Interruption) -> Self {
        let pipeline = self.pipeline.interruptible(Arc::clone(&interruption));
        OnRig { pipeline, interruption: Some(interruption), ..self }
    }

    /// Removes the lens's dark corners from a result, which starts at column and row `from` of the
    /// rig's photo, if the rig file sets `remove-vignetting`; returns a note.
    fn remove_vignetting(&self, picture: &mut Frame<Work>, from: (usize, usize)) -> Option<String> {
        if !self.config.restore.remove_vignetting {
            return None;
        }
        let Some(flat) = &self.lens_flat else {
            let note = "the dark corners are as in the photo: those of the lens were not measured \
                        on this rig; run `relens calibrate --diffuser`";
            return Some(note.to_owned());
        };
        flat.remove_from(picture, from);
        let most = 1.0 / flat.darkest();
        Some(format!("the lens's dark corners were removed: up to {most:.2} times the light"))
    }
}

/// Reason for returning a photo in portrait unchanged.
const UPRIGHT: &str = "the photo is in portrait, and neither its file nor the pattern of this \
    camera's pixels shows which way the camera was turned; drop the camera's original file, or \
    turn the photo to landscape";
/// Note for a photo that was turned after it was taken.
const TURNED: &str = "the photo was turned after it was taken, as the pattern of the camera's \
    pixels shows: it is restored from its decoded pixels";

impl OnRig {
    /// Copy of `photo` turned by 180°, if the sensor's pattern shows that the photo was turned so.
    fn turned_by_half(&self, photo: &Photo) -> Option<Photo> {
        if photo.raw.is_some() || self.config.photo_grid().pattern_px.is_none() {
            return None;
        }
        let mut turned = photo.clone();
        turned.turn_by_half();
        let by = self.config.camera.binning;
        let shows_sensor = match by {
            1 => self.pipeline.shows_sensor(&turned),
            _ => self.pipeline.shows_sensor(BinnedPhoto::of(&turned, by).data()),
        };
        shows_sensor.then_some(turned)
    }

    /// Restores `turned`, a photo turned by 180°, and turns its result back.
    fn restore_turned(
        &mut self,
        turned: &Photo,
        is_side_guessed: bool,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        let mut outcome = self.restore(turned, progress)?;
        outcome.turn_by_half();
        if outcome.verdict != Verdict::Untouched && !is_side_guessed {
            outcome.notes.push(TURNED.to_owned());
        }
        Ok(outcome)
    }

    /// Removes the lens's dark corners from the result of `photo`, and adds notes on what was done.
    fn finish(&self, outcome: &mut Outcome, photo: &Photo, prepared: &Prepared<'_>) {
        outcome.notes.extend(photo.is_side_guessed.then(|| TURNED.to_owned()));
        let (field, rect) = (self.config.photo_on_canvas(), prepared.observation.rect);
        let from = (rect.x - field.x, rect.y - field.y);
        if rect != field {
            let by = self.config.camera.binning;
            let (x, y) = (by * from.0, by * from.1);
            outcome.notes.push(format!(
                "the photo was cropped: by the pattern of the camera's pixels, its upper left \
                 corner is column {x}, row {y} of the rig's photo"
            ));
        }
        outcome.notes.extend(self.remove_vignetting(&mut outcome.picture, from));
        let noise = prepared.observation.noise[Channel::Green.index()];
        outcome.notes.push(format!("noise of the photo: {noise:.2} grey levels"));
    }
}

impl Restorer for OnRig {
    fn restore(
        &mut self,
        photo: &Photo,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Outcome, AnyFailure> {
        // Even if this photo fails, the panel must not show the previous one's pictures with it.
        self.last = None;
        progress(STARTED);
        let camera = photo.camera.as_ref();
        if let Some(raw) = photo.raw
            && let Some(flaw) = provenance::other_camera(&self.config, camera, raw)
        {
            return Err(AnyFailure::from(PictureError::Refused { name: photo.name.clone(), flaw }));
        }
        let by = self.config.camera.binning;
        let binned = (by > 1).then(|| BinnedPhoto::of(photo, by));
        let solved = binned.as_ref().map_or(&photo.light, |binned| &binned.light);
        let unlisted = provenance::unlisted_camera(&self.config, camera);
        if let Some(reason) = unlisted.or_else(|| photo.why_too_small()) {
            return Ok(Outcome::untouched(solved.clone(), reason));
        }
        let prepared = match &binned {
            Some(binned) => self.pipeline.prepare(binned.data()),
            None => self.pipeline.prepare(photo),
        };
        if !prepared.shows_sensor() {
            if let Some(turned) = self.turned_by_half(photo) {
                return self.restore_turned(&turned, photo.is_side_guessed, progress);
            }
            if photo.is_side_guessed {
                return Ok(Outcome::untouched(solved.clone(), UPRIGHT));
            }
        }
        let steps = prepared.observation.sampling.solve_steps(self.setting.steps, false);
        let mut counter =
            ProgressCounter::new(&Setting { steps, ..self.setting }, self.method.as_ref());
        let mut watch = |step: &Step, _: Option<&Frame<Work>>| progress(counter.count(step));
        let Restoration { mut outcome, .. } =
            self.pipeline.restore(&mut self.devices, &prepared, &*self.method, &mut watch)?;
        if photo.raw.is_some() {
            outcome.notes.extend(provenance::camera_note(&self.config, camera));
        }
        outcome.notes.extend_from_slice(&prepared.notes);
        if outcome.verdict != Verdict::Untouched {
            self.finish(&mut outcome, photo, &prepared);
            let pair = [solved, &outcome.picture].map(|light| photo.for_display(light));
            self.last = Some(pair.into());
        }
        let noise = prepared.observation.noise;
        // Freed first, since a large result needs the memory.
        drop(prepared);
        if let Some(binned) = &binned {
            binned.carry(&mut outcome, photo, noise);
        }
        Ok(outcome)
    }

    fn mend(&mut self, remedy: Remedy) -> Result<(), AnyFailure> {
        if remedy == Remedy::Recalibrate {
            // A box that takes photos opens without the panel in view, so its marks may be unknown.
            if let Some(place) = MarkPlace::of(&self.config)
                && !self.devices.has_marks()
            {
                self.devices.find_marks(place)?;
            }
            let calibration = measure(
                &self.config,
                &mut self.devices,
                &self.slots,
                self.calibrating,
                self.interruption.as_ref(),
            )?;
            self.pipeline = self.pipeline.calibrated(&self.config, &calibration)?;
            self.baseline = baseline::load(&self.slots, calibration.generation);
            self.sensor = SensorFacts::of(&self.config, &calibration);
        } else {
            self.devices.reopen()?;
        }
        Ok(())
    }

    fn show(&mut self, screen: &Screen) {
        let pair = self.last.as_ref().map(|(before, after)| PhotoPair { before, after });
        let codes = draw(screen, self.devices.panel.size(), pair);
        if let Err(error) = self.devices.panel.show(&codes) {
            log::debug!("cannot show the screen on the panel: {error}");
        }
    }

    fn take(&mut self) -> Result<Option<TakenPhoto>, AnyFailure> {
        let own = self.config.unbinned();
        self.devices.camera.deliver_own(true);
        let taken = photo_file::take(&mut self.devices, &own, &self.sensor);
        self.devices.camera.deliver_own(false);
        taken.map(Some)
    }

    fn look_for_panel(&mut self) -> Result<PanelView, AnyFailure> {
        let mosaic = self.config.mosaic();
        if !presence::is_panel_there(&mut self.devices, mosaic, self.sensor.range)? {
            return Ok(PanelView::Absent);
        }
        let Some(place) = MarkPlace::of(&self.config) else { return Ok(PanelView::There) };
        match self.devices.find_marks(place) {
            Ok(()) => Ok(PanelView::There),
            Err(RigError::NoMarks { what }) => Ok(PanelView::Askew(what)),
            Err(grave) => Err(AnyFailure::from(grave)),
        }
    }

    fn pilot(&mut self) -> Result<Option<Drift>, AnyFailure> {
        let reading = read_pilot(&self.config, &mut self.devices, &self.pipeline)?;
        if self.baseline.is_none() {
            // No baseline was kept: drift is measured from this reading on.
            let generation = store::load(&self.slots, self.config.identity)?.generation;
            baseline::save(&self.slots, generation, &reading);
        }
        Ok(Some(reading.since(self.baseline.get_or_insert(reading))))
    }
}
