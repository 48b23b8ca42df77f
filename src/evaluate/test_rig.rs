//! A calibrated rig, ready to be scored on scenes whose truth is known: photographed by the witness
//! to a simulated rig, or shown on the panel of any rig and photographed there.

use std::sync::Arc;

use super::peers::PeerError;
use super::scenes::Scene;
use crate::calibration::Calibration;
use crate::config;
use crate::deconvolution::lens_model::{LensModel, LensModelError};
use crate::deconvolution::method::{Method, MethodError, Watch};
use crate::deconvolution::quality::{psnr, ssim};
use crate::frame::{Channel, Channels, Frame, Plane, Work};
use crate::light_path::LightPath;
use crate::measurement::{CalibrateError, calibrate};
use crate::picture::Tone;
use crate::pipeline::{Bench, BenchError, Request, Restored};
use crate::remedy::{Remediable, Remedy};
use crate::rig::RigError;
use crate::rig::exposure::Rig;
use crate::rig::simulated::{Witness, open};

/// Seed of the photographs' noise; a scene's own number is added.
const PHOTO_SEED: u64 = 20_261_121;

/// Seconds on a clock of the caller's.
pub type Stopwatch = fn() -> f64;

/// A calibrated rig.
pub struct TestRig {
    stopwatch: Stopwatch,
    config: config::Rig,
    rig: Rig,
    photos: Photos,
    calibration: Calibration,
    bench: Bench,
}

/// Where photos of scenes come from.
enum Photos {
    /// The scene lies in front of the camera of a simulated rig.
    Witnessed(Arc<Witness>),
    /// The panel shows the scene, and the camera of the rig photographs it.
    Shown,
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
    /// The photo restored.
    pub restored: Restored,
}

impl TestRig {
    /// Opens the simulated rig of `config` and calibrates it from its own captures.
    ///
    /// # Errors
    /// When the rig cannot be opened or calibrated.
    pub fn open(config: config::Rig, stopwatch: Stopwatch) -> Result<TestRig, TestRigError> {
        TestRig::open_witnessed(config, stopwatch).map(|(test_rig, _)| test_rig)
    }

    /// [`TestRig::open`], and the witness: for scores, and for changing the rig while it runs.
    ///
    /// # Errors
    /// When the rig cannot be opened or calibrated.
    pub(super) fn open_witnessed(
        config: config::Rig,
        stopwatch: Stopwatch,
    ) -> Result<(TestRig, Arc<Witness>), TestRigError> {
        let (mut rig, witness) = open(&config)?;
        let calibration = calibrate(&mut rig, &config, None, &mut |_| {})?;
        let mut test_rig = TestRig::on(config, rig, calibration, stopwatch)?;
        let witness = Arc::new(witness);
        test_rig.photos = Photos::Witnessed(Arc::clone(&witness));
        Ok((test_rig, witness))
    }

    /// The simulated rig of `now` with the calibration that it had when it was as `then`.
    ///
    /// # Errors
    /// When either cannot be opened, or `then` not calibrated.
    pub(super) fn open_changed(
        then: &config::Rig,
        now: config::Rig,
        stopwatch: Stopwatch,
    ) -> Result<TestRig, TestRigError> {
        let calibration = calibrate(&mut open(then)?.0, then, None, &mut |_| {})?;
        let (rig, witness) = open(&now)?;
        let mut test_rig = TestRig::on(now, rig, calibration, stopwatch)?;
        test_rig.photos = Photos::Witnessed(Arc::new(witness));
        Ok(test_rig)
    }

    /// A stand on the open devices `rig`, of which nothing is known but their `calibration`: scenes
    /// are shown to them.
    ///
    /// # Errors
    /// When the calibration does not fit the rig file.
    pub fn on(
        config: config::Rig,
        rig: Rig,
        calibration: Calibration,
        stopwatch: Stopwatch,
    ) -> Result<TestRig, TestRigError> {
        let bench = Bench::new(&config, &calibration)?;
        Ok(TestRig { stopwatch, config, rig, photos: Photos::Shown, calibration, bench })
    }

    /// The devices, when all is done.
    pub fn into_devices(self) -> Rig {
        self.rig
    }

    /// The rig file.
    pub fn config(&self) -> &config::Rig {
        &self.config
    }

    /// What was measured.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The photo the rig's camera takes of `scene` (linear light, photo-sized), as linear light.
    ///
    /// # Errors
    /// When the scene is shown and its capture fails.
    pub fn photograph(
        &mut self,
        scene: Scene,
        light: &Frame<Work>,
    ) -> Result<Frame<Work>, TestRigError> {
        let tone = Tone::of_curve(self.config.photo.curve, 8);
        let codes = match &self.photos {
            Photos::Witnessed(witness) => witness.photograph(light, PHOTO_SEED + scene as u64),
            Photos::Shown => {
                let taken =
                    self.bench.photograph(&mut self.rig, light).map_err(TestRigError::Shown)?;
                Frame::from_fn(|c| tone.display(c, taken.plane(c)).map(|v: f32| v.round() as u8))
            }
        };
        Ok(Frame::from_fn(|c| tone.plane(c, codes.plane(c))))
    }

    /// The lens as measured.
    pub(super) fn model(&self) -> &LensModel {
        self.bench.model()
    }

    /// Forward convolution through the rig as calibrated.
    pub(super) fn light_path(&mut self) -> LightPath<'_> {
        LightPath::new(&mut self.rig, self.bench.correction(), &self.stopwatch)
    }

    /// The grey `scene` in light, and the photo taken of it in green alone.
    ///
    /// # Errors
    /// When the scene is shown and its capture fails.
    pub(super) fn take_grey(&mut self, scene: Scene) -> Result<(Plane, Frame<Work>), TestRigError> {
        let truth = scene.grey(self.config.photo.size());
        let mut light = Frame::zeros(truth.size());
        *light.plane_mut(Channel::Green) = truth.clone();
        let photo = self.photograph(scene, &light)?;
        Ok((truth, photo))
    }

    /// `method` on the grey `scene` in the green channel alone, scored in light as the study did.
    ///
    /// # Errors
    /// When the method fails.
    pub fn score_grey(
        &mut self,
        scene: Scene,
        name: &str,
        method: &dyn Method,
    ) -> Result<Score, TestRigError> {
        self.score_grey_watched(scene, name, method, &mut |_, _| {})
    }

    /// [`TestRig::score_grey`] with `watch` called after every step.
    ///
    /// # Errors
    /// When the method fails.
    pub fn score_grey_watched(
        &mut self,
        scene: Scene,
        name: &str,
        method: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<Score, TestRigError> {
        let (truth, photo) = self.take_grey(scene)?;
        let (restored, computing_seconds) = self.run(&photo, Channels::Green, method, watch)?;
        let shown =
            |frame: &Frame<Work>| frame.plane(Channel::Green).map(|v: f32| v.clamp(0.0, 255.0));
        Ok(Score {
            scene,
            method: name.to_owned(),
            computing_seconds,
            ssim: ssim(&shown(&restored.picture), &truth),
            psnr_db: psnr(&shown(&restored.picture), &truth),
            blurred_ssim: ssim(&shown(&photo), &truth),
            blurred_psnr_db: psnr(&shown(&photo), &truth),
            restored,
        })
    }

    /// `method` on `scene` in colour, scored in luminance of display values (Rec. 709 weights of
    /// codes).
    ///
    /// # Errors
    /// When the method fails.
    pub fn score_colour(
        &mut self,
        scene: Scene,
        name: &str,
        method: &dyn Method,
    ) -> Result<Score, TestRigError> {
        let tone = Tone::of_curve(self.config.photo.curve, 8);
        let codes = scene.codes(self.config.photo.size());
        let light = Frame::from_fn(|c| {
            tone.plane(c, &codes.plane(c).map(|v: f32| v.round().clamp(0.0, 255.0) as u8))
        });
        let photo = self.photograph(scene, &light)?;
        let (restored, computing_seconds) =
            self.run(&photo, Channels::Colour, method, &mut |_, _| {})?;
        let [truth, before, after] =
            [&light, &photo, &restored.picture].map(|frame| display_luminance(&tone, frame));
        Ok(Score {
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

    /// Restores and times; the time of simulating the captures is taken out.
    ///
    /// # Errors
    /// When the method fails.
    pub(super) fn run(
        &mut self,
        photo: &Frame<Work>,
        channels: Channels,
        method: &dyn Method,
        watch: &mut Watch<'_>,
    ) -> Result<(Restored, f64), TestRigError> {
        let begun = (self.stopwatch)();
        let request = Request { photo, channels, method, stopwatch: &self.stopwatch };
        let restored = self.bench.restore(&mut self.rig, &request, watch)?;
        let computing = (self.stopwatch)() - begun - restored.waited_seconds;
        Ok((restored, computing))
    }
}

/// Luminance of display values 0..255: the codes' sum by the weights of Rec. 709, as screens show
/// it.
pub fn display_luminance(tone: &Tone, light: &Frame<Work>) -> Plane {
    let mut sum = Plane::zeros(light.size());
    for (c, weight) in Channel::ALL.into_iter().zip([0.2126, 0.7152, 0.0722]) {
        sum.add_scaled(weight, &tone.display(c, light.plane(c)));
    }
    sum
}

/// Why a stand gave no score.
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
    Bench(#[from] BenchError),
    /// The functions of a lens.
    #[error("the lens's functions make no operator")]
    Lens(#[from] LensModelError),
    /// What peers from outside made.
    #[error("the peers' rows cannot be taken")]
    Peers(#[from] PeerError),
    /// A scene on the panel.
    #[error("a scene was shown and not photographed")]
    Shown(#[source] RigError),
    /// The method.
    #[error("the method gave no picture")]
    Method(#[from] MethodError),
    /// The photo as a JPEG.
    #[error("the photo cannot be made a JPEG")]
    Jpeg(#[from] image::ImageError),
}

impl Remediable for TestRigError {
    fn remedy(&self) -> Remedy {
        match self {
            TestRigError::Rig(error) | TestRigError::Shown(error) => error.remedy(),
            TestRigError::Calibrate(error) => error.remedy(),
            TestRigError::Bench(error) => error.remedy(),
            TestRigError::Lens(error) => error.remedy(),
            TestRigError::Peers(error) => error.remedy(),
            TestRigError::Method(error) => error.remedy(),
            TestRigError::Jpeg(_) => Remedy::SkipPhoto,
        }
    }
}
