//! A calibrated rig, ready to be scored on scenes whose truth is known: photographed by the witness
//! to a simulated rig, or shown on the panel of any rig and photographed there.

use std::sync::Arc;

use super::looks::{Looks, display_luminance};
use super::scenes::Scene;
use crate::calibration::Calibration;
use crate::config::{self, Curve};
use crate::deconvolution::method::{Method, MethodError, Watch};
use crate::deconvolution::quality::{psnr, ssim};
use crate::frame::{Channel, Channels, FULL_SCALE, Frame, Plane, RawSites, Size, Work};
use crate::measurement::{CalibrateError, calibrate, to_the_end};
use crate::picture::Tone;
use crate::pipeline::{PhotoData, Pipeline, PipelineError, Prepared, Solved};
use crate::remedy::{Remediable, Remedy};
use crate::rig::RigError;
use crate::rig::exposure::Devices;
use crate::rig::simulated::{Witness, open};

/// Seed of the photographs' noise; a scene's own number is added.
pub const PHOTO_SEED: u64 = 20_261_121;
/// Between the seeds of two photos of a scene.
const SEEDS_APART: u64 = 1000;

/// A calibrated rig.
pub struct TestRig {
    /// Seconds on a clock of the caller's.
    stopwatch: fn() -> f64,
    config: config::RigFile,
    rig: Devices,
    photos: Photos,
    pipeline: Pipeline,
}

/// Where photos of scenes come from.
enum Photos {
    /// The scene lies in front of the camera of a simulated rig.
    Witnessed(Arc<Witness>),
    /// The panel shows the scene, and the camera of the rig photographs it.
    Shown,
}

/// A photo with a truth.
#[derive(Debug, Clone)]
pub struct TestPhoto {
    /// Linear light; filled between the sites of a raw one.
    pub light: Frame<Work>,
    /// What is known of its sites, where it is raw.
    pub raw: Option<RawSites>,
}

impl TestPhoto {
    /// A photo that its camera developed, as linear light.
    pub fn developed(light: Frame<Work>) -> TestPhoto {
        TestPhoto { light, raw: None }
    }

    /// The photo that the camera of `witness`, which writes `curve`, takes of `scene`: raw where
    /// its sensor has colour filters, for that is what such a rig wants.
    pub fn taken(witness: &Witness, curve: Curve, scene: &Frame<Work>, seed: u64) -> TestPhoto {
        let Some(raw) = witness.photograph_raw(scene, seed) else {
            let tone = Tone::of_curve(curve, 8);
            let codes = witness.photograph(scene, seed);
            return TestPhoto::developed(Frame::from_fn(|c| tone.plane(c, codes.plane(c))));
        };
        let black = witness.black_level_counts();
        let per_level = (witness.white_count() - black) / f64::from(FULL_SCALE);
        let sites = raw.sites.map(|count| ((f64::from(count) - black) / per_level) as f32);
        TestPhoto {
            light: raw.mosaic.interpolated(&sites),
            raw: Some(RawSites::new(raw.mosaic, per_level as f32)),
        }
    }

    /// Made ready for the methods of `pipeline`.
    pub fn prepared(&self, pipeline: &Pipeline, channels: Channels) -> Prepared<'_> {
        pipeline.prepare(match self.raw {
            Some(raw) => PhotoData::raw(&self.light, raw),
            None => PhotoData::developed(&self.light, channels),
        })
    }
}

/// One method on one scene, scored against the scene.
#[derive(Debug, Clone)]
pub struct Score {
    /// The scene.
    pub scene: Scene,
    /// The method, with what sets it apart from the rig file's settings.
    pub method: String,
    /// Seconds of computing, simulated captures not counted.
    pub computing_seconds: f64,
    /// SSIM against the scene.
    pub ssim: f64,
    /// PSNR against the scene, dB.
    pub psnr_db: f64,
    /// SSIM of the untouched photo.
    pub blurred_ssim: f64,
    /// PSNR of the untouched photo, dB.
    pub blurred_psnr_db: f64,
    /// ΔE at the edges of result and untouched photo ([`Looks::scores`]); of photos in colour.
    pub edge_differences: Option<[f64; 2]>,
    /// Which photo of the scene it is.
    pub take: u64,
    /// The photo restored.
    pub restored: Solved,
}

impl Score {
    /// The numbers alone: hundreds of pictures would fill the memory.
    #[must_use]
    pub fn without_pictures(mut self) -> Score {
        self.restored.picture = Frame::zeros(Size::new(0, 0));
        self.restored.solution.picture = Frame::zeros(Size::new(0, 0));
        self
    }
}

impl TestRig {
    /// Opens the simulated rig of `config` and calibrates it from its own captures.
    ///
    /// # Errors
    /// When the rig cannot be opened or calibrated.
    pub fn open(config: config::RigFile, stopwatch: fn() -> f64) -> Result<TestRig, TestRigError> {
        let (mut rig, witness) = open(&config)?;
        let calibration = calibrate(&mut rig, &config, None, &mut to_the_end)?;
        let test_rig = TestRig::on(config, rig, &calibration, stopwatch)?;
        Ok(test_rig.witnessed(Arc::new(witness)))
    }

    /// A test rig of the open devices `rig`, of which nothing is known but their `calibration`:
    /// scenes are shown to them.
    ///
    /// # Errors
    /// When the calibration does not fit the rig file.
    pub fn on(
        config: config::RigFile,
        rig: Devices,
        calibration: &Calibration,
        stopwatch: fn() -> f64,
    ) -> Result<TestRig, TestRigError> {
        let pipeline = Pipeline::new(&config, calibration)?.timed_by(Arc::new(stopwatch));
        Ok(TestRig { stopwatch, config, rig, photos: Photos::Shown, pipeline })
    }

    /// The same, with photos taken by the camera of a simulated rig, which `witness` sees through.
    #[must_use]
    pub fn witnessed(self, witness: Arc<Witness>) -> TestRig {
        TestRig { photos: Photos::Witnessed(witness), ..self }
    }

    /// The rig file.
    pub fn config(&self) -> &config::RigFile {
        &self.config
    }

    /// What restores on it, and its devices.
    pub fn parts(&mut self) -> (&Pipeline, &mut Devices) {
        (&self.pipeline, &mut self.rig)
    }

    /// The channels it is scored in: green alone where photos are linear, as the study did.
    pub fn channels(&self) -> Channels {
        match self.config.photo.curve {
            Curve::Linear => Channels::Green,
            Curve::Srgb => Channels::Colour,
        }
    }

    /// The light of `scene`, in [`TestRig::channels`].
    pub fn light(&self, scene: Scene) -> Frame<Work> {
        let size = self.config.photo.size();
        match self.channels() {
            Channels::Green => {
                let mut light = Frame::zeros(size);
                *light.plane_mut(Channel::Green) = scene.grey(size);
                light
            }
            Channels::Colour => {
                let tone = Tone::of_curve(self.config.photo.curve, 8);
                let codes = scene.codes(size);
                Frame::from_fn(|c| {
                    let rounded = codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8);
                    tone.plane(c, &rounded)
                })
            }
        }
    }

    /// What a photo of `scene` is to become: its light, shaded as the photo is.
    pub fn truth(&self, scene: Scene) -> Frame<Work> {
        let light = self.light(scene);
        match &self.photos {
            Photos::Witnessed(witness) => witness.shaded(&light),
            Photos::Shown => light,
        }
    }

    /// The photo the rig's camera takes of `scene`; on a simulated rig the noise is that of `take`.
    ///
    /// # Errors
    /// When the scene is shown and its capture fails.
    pub fn photograph(&mut self, scene: Scene, take: u64) -> Result<TestPhoto, TestRigError> {
        let curve = self.config.photo.curve;
        let light = self.light(scene);
        if let Photos::Witnessed(witness) = &self.photos {
            let seed = PHOTO_SEED + scene as u64 + SEEDS_APART * take;
            return Ok(TestPhoto::taken(witness, curve, &light, seed));
        }
        let taken = self.pipeline.photograph(&mut self.rig, &light).map_err(TestRigError::Shown)?;
        let tone = Tone::of_curve(curve, 8);
        let rounded = |c| tone.display(c, taken.plane(c)).map(|v: f32| v.round() as u8);
        Ok(TestPhoto::developed(Frame::from_fn(|c| tone.plane(c, &rounded(c)))))
    }

    /// `method` on a photo of `scene`, the `take`-th, scored as [`seen`].
    ///
    /// # Errors
    /// When a scene cannot be shown, or the method fails.
    pub fn score(
        &mut self,
        scene: Scene,
        take: u64,
        name: &str,
        method: &dyn Method,
    ) -> Result<Score, TestRigError> {
        let (photo, truth) = (self.photograph(scene, take)?, self.truth(scene));
        Ok(Score { take, ..self.score_photo(scene, (&photo, &truth), name, method)? })
    }

    /// [`TestRig::score`] on a photo of the scene that was taken elsewhere, and what it is to
    /// become.
    ///
    /// # Errors
    /// When the method fails.
    pub fn score_photo(
        &mut self,
        scene: Scene,
        (photo, truth): (&TestPhoto, &Frame<Work>),
        name: &str,
        method: &dyn Method,
    ) -> Result<Score, TestRigError> {
        let channels = self.channels();
        let (restored, computing_seconds) = self.solve(photo, channels, method, &mut |_, _| {})?;
        let curve = self.config.photo.curve;
        let frames = [truth, &photo.light, &restored.picture];
        let edge_differences = (channels == Channels::Colour).then(|| {
            let tone = Tone::of_curve(curve, 8);
            let [truth, before, after] = frames.map(|frame| Looks::of(&tone, frame));
            [after, before].map(|looks| looks.scores(&truth).edge_difference)
        });
        let [truth, before, after] = frames.map(|frame| seen(curve, channels, frame));
        Ok(Score {
            edge_differences,
            take: 0,
            scene,
            method: name.to_owned(),
            computing_seconds,
            ssim: ssim(&after, &truth),
            psnr_db: psnr(&after, &truth),
            blurred_ssim: ssim(&before, &truth),
            blurred_psnr_db: psnr(&before, &truth),
            restored,
        })
    }

    /// What `method` makes of `photo`, and seconds of computing; the time of simulating captures is
    /// taken out.
    ///
    /// # Errors
    /// When the method fails.
    pub fn solve(
        &mut self,
        photo: &TestPhoto,
        channels: Channels,
        method: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<(Solved, f64), TestRigError> {
        let begun = (self.stopwatch)();
        let prepared = photo.prepared(&self.pipeline, channels);
        let solved = self.pipeline.solve(&mut self.rig, &prepared, method, watch)?;
        let computing = (self.stopwatch)() - begun - solved.waited_seconds;
        Ok((solved, computing))
    }
}

/// A picture as it is scored, 0..255: luminance of display values; of green alone, display values,
/// or light where the photo is linear.
pub fn seen(curve: Curve, channels: Channels, picture: &Frame<Work>) -> Plane {
    let tone = Tone::of_curve(curve, 8);
    match (channels, curve) {
        (Channels::Colour, _) => display_luminance(&tone, picture),
        (Channels::Green, Curve::Srgb) => {
            tone.display(Channel::Green, picture.plane(Channel::Green))
        }
        (Channels::Green, Curve::Linear) => {
            picture.plane(Channel::Green).map(|v: f32| v.clamp(0.0, 255.0))
        }
    }
}

/// Why a test rig gave no score.
#[derive(Debug, thiserror::Error)]
pub enum TestRigError {
    /// The rig.
    #[error("the rig cannot be opened")]
    Rig(#[from] RigError),
    /// The calibration.
    #[error("the rig cannot be calibrated")]
    Calibrate(#[from] CalibrateError),
    /// Rig file and calibration.
    #[error("the calibration does not fit the rig file")]
    Pipeline(#[from] PipelineError),
    /// A scene on the panel.
    #[error("a scene was shown and not photographed")]
    Shown(#[source] RigError),
    /// The method.
    #[error("the method gave no picture")]
    Method(#[from] MethodError),
}

impl Remediable for TestRigError {
    fn remedy(&self) -> Remedy {
        match self {
            TestRigError::Rig(error) | TestRigError::Shown(error) => error.remedy(),
            TestRigError::Calibrate(error) => error.remedy(),
            TestRigError::Pipeline(error) => error.remedy(),
            TestRigError::Method(error) => error.remedy(),
        }
    }
}
