//! A calibrated rig to score methods on, with scenes whose truth is known: photographed by the
//! witness of a simulated rig, or shown on the panel of any rig and photographed there.

use std::sync::Arc;

use super::appearance::{display_luminance, edge_difference};
use super::scenes::Scene;
use crate::calibration::Calibration;
use crate::config::{Curve, RigFile};
use crate::deconvolution::method::{Method, MethodError, Watch};
use crate::deconvolution::quality::{psnr, ssim};
use crate::frame::{Channel, Channels, Coding, FULL_SCALE, Frame, Plane, RawSites, Work};
use crate::measurement::{CalibrateError, calibrate, to_the_end};
use crate::picture::{Photo, Tone};
use crate::pipeline::{PhotoData, Pipeline, PipelineError, Prepared, Recorded, Solved};
use crate::remedy::{Remediable, Remedy};
use crate::rig::RigError;
use crate::rig::exposure::Devices;
use crate::rig::simulated::{Witness, open};

/// Seed of the photographs' noise; the scene's number is added.
pub const PHOTO_SEED: u64 = 20_261_121;
/// Difference between the seeds of two photos of a scene.
const SEED_STEP: u64 = 1000;

/// A calibrated rig.
pub struct TestRig {
    stopwatch: fn() -> f64,
    config: RigFile,
    rig: Devices,
    /// Witness that photographs scenes; if `None`, scenes are shown on the panel.
    witness: Option<Arc<Witness>>,
    pipeline: Pipeline,
}

/// A photo of a known scene.
#[derive(Debug, Clone)]
pub struct TestPhoto {
    /// Linear light, 0..255; interpolated between the sites of a raw photo.
    pub light: Frame<Work>,
    /// The sites of a raw photo.
    pub raw: Option<RawSites>,
    /// Coefficients and tone curve of a JPEG.
    pub coded: Option<(Coding, Tone)>,
}

impl From<Photo> for TestPhoto {
    fn from(photo: Photo) -> TestPhoto {
        let Photo { light, raw, coding, manner, .. } = photo;
        TestPhoto { light, raw, coded: coding.map(|coding| (coding, manner.tone)) }
    }
}

impl TestPhoto {
    /// A photo developed by its camera.
    pub fn developed(light: Frame<Work>) -> TestPhoto {
        TestPhoto { light, raw: None, coded: None }
    }

    /// Photographs `scene` with the camera of `witness`: as raw sites if its sensor has colour
    /// filters, else developed in `curve`.
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
            coded: None,
        }
    }

    /// Prepares the photo for the methods of `pipeline`.
    pub fn prepared(&self, pipeline: &Pipeline, channels: Channels) -> Prepared<'_> {
        let coded = self.coded.as_ref().map(|(coding, tone)| (coding, tone));
        let recorded = Recorded::of(self.raw, coded);
        let channels = if self.raw.is_some() { Channels::Colour } else { channels };
        pipeline.prepare(PhotoData { light: &self.light, channels, recorded })
    }
}

/// Quality of a picture against its scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureQuality {
    /// SSIM of the scored plane ([`seen`]).
    pub ssim: f64,
    /// PSNR of the scored plane, dB.
    pub psnr_db: f64,
    /// ΔE at edges ([`edge_difference`]); `None` for photos scored in green alone.
    pub edge_difference: Option<f64>,
}

/// Score of one method on one photo.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// The scene.
    pub scene: Scene,
    /// Number of the photo among those of its scene.
    pub take: u64,
    /// Number of captures taken.
    pub captures: usize,
    /// Time that the captures took on the rig's clock, seconds.
    pub capture_seconds: f64,
    /// Time of computing on the test rig's stopwatch, seconds; without the simulation.
    pub computing_seconds: f64,
    /// Ratio of the measured residual to the noise; `None` if no capture measured it.
    pub certificate: Option<f32>,
    /// Quality of the result.
    pub result: PictureQuality,
    /// Quality of the untouched photo.
    pub photo: PictureQuality,
}

impl TestRig {
    /// Opens the simulated rig of `config` and calibrates it from its own captures.
    ///
    /// # Errors
    /// When the rig cannot be opened or calibrated.
    pub fn open(config: RigFile, stopwatch: fn() -> f64) -> Result<TestRig, TestRigError> {
        let (mut rig, witness) = open(&config)?;
        let calibration = calibrate(&mut rig, &config, None, &mut to_the_end)?;
        let test_rig = TestRig::on(config, rig, &calibration, stopwatch)?;
        Ok(test_rig.witnessed(Arc::new(witness)))
    }

    /// A test rig of open devices and their `calibration`; scenes are shown on the panel.
    ///
    /// # Errors
    /// When the calibration does not fit the rig file.
    pub fn on(
        config: RigFile,
        rig: Devices,
        calibration: &Calibration,
        stopwatch: fn() -> f64,
    ) -> Result<TestRig, TestRigError> {
        let pipeline = Pipeline::new(&config, calibration)?.timed_by(Arc::new(stopwatch));
        Ok(TestRig { stopwatch, config, rig, witness: None, pipeline })
    }

    /// This test rig with photos by the simulated camera of `witness`. On a rig that bins, scenes
    /// stay on the panel: methods take binned photos, and the witness's are not.
    #[must_use]
    pub fn witnessed(self, witness: Arc<Witness>) -> TestRig {
        match self.config.camera.binning {
            1 => TestRig { witness: Some(witness), ..self },
            _ => self,
        }
    }

    /// The rig file.
    pub fn config(&self) -> &RigFile {
        &self.config
    }

    /// The pipeline and the devices.
    pub fn parts(&mut self) -> (&Pipeline, &mut Devices) {
        (&self.pipeline, &mut self.rig)
    }

    /// Channels that are scored: green alone for linear photos, as in the study.
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

    /// Light of `scene` with the lens's dark corners: the ideal result.
    pub fn truth(&self, scene: Scene) -> Frame<Work> {
        let light = self.light(scene);
        match &self.witness {
            Some(witness) => witness.shaded(&light),
            None => light,
        }
    }

    /// Photographs `scene`; on a simulated rig, `take` determines the noise.
    ///
    /// # Errors
    /// When the capture of a shown scene fails.
    pub fn photograph(&mut self, scene: Scene, take: u64) -> Result<TestPhoto, TestRigError> {
        let curve = self.config.photo.curve;
        let light = self.light(scene);
        if let Some(witness) = &self.witness {
            let seed = PHOTO_SEED + scene as u64 + SEED_STEP * take;
            return Ok(TestPhoto::taken(witness, curve, &light, seed));
        }
        let taken = self.pipeline.photograph(&mut self.rig, &light).map_err(TestRigError::Shown)?;
        let tone = Tone::of_curve(curve, 8);
        let rounded = |c| tone.display(c, taken.plane(c)).map(|v: f32| v.round() as u8);
        Ok(TestPhoto::developed(Frame::from_fn(|c| tone.plane(c, &rounded(c)))))
    }

    /// Restores a photo of `scene` with `method` and scores it.
    ///
    /// # Errors
    /// When a scene cannot be shown, or the method fails.
    pub fn score(
        &mut self,
        scene: Scene,
        take: u64,
        method: &dyn Method,
    ) -> Result<Score, TestRigError> {
        let (photo, truth) = (self.photograph(scene, take)?, self.truth(scene));
        Ok(Score { take, ..self.score_photo(scene, &photo, &truth, method)? })
    }

    /// Restores `photo` of `scene` with `method` and scores it against `truth`.
    ///
    /// # Errors
    /// When the method fails.
    pub fn score_photo(
        &mut self,
        scene: Scene,
        photo: &TestPhoto,
        truth: &Frame<Work>,
        method: &dyn Method,
    ) -> Result<Score, TestRigError> {
        let (solved, computing_seconds) =
            self.solve(photo, self.channels(), method, &mut |_, _| {})?;
        Ok(Score {
            scene,
            take: 0,
            captures: solved.captures,
            capture_seconds: solved.capture_seconds,
            computing_seconds,
            certificate: solved.solution.certificate.ratio(),
            result: self.quality(&solved.picture, truth),
            photo: self.quality(&photo.light, truth),
        })
    }

    /// Quality of `picture` against `truth`.
    pub fn quality(&self, picture: &Frame<Work>, truth: &Frame<Work>) -> PictureQuality {
        let (curve, channels) = (self.config.photo.curve, self.channels());
        let [own, wanted] = [picture, truth].map(|frame| seen(curve, channels, frame));
        PictureQuality {
            ssim: ssim(&own, &wanted),
            psnr_db: psnr(&own, &wanted),
            edge_difference: (channels == Channels::Colour)
                .then(|| edge_difference(&Tone::of_curve(curve, 8), picture, truth)),
        }
    }

    /// Solves `photo` with `method`; also returns the seconds of computing, without the simulation.
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

/// The plane that is scored, 0..255: luminance of display values for colour; for green alone, its
/// display values, or its light if photos are linear.
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

/// Why a test rig failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum TestRigError {
    #[error("the rig cannot be opened")]
    Rig(#[from] RigError),
    #[error("the rig cannot be calibrated")]
    Calibrate(#[from] CalibrateError),
    #[error("the calibration does not fit the rig file")]
    Pipeline(#[from] PipelineError),
    #[error("a scene shown on the panel could not be photographed")]
    Shown(#[source] RigError),
    #[error("the method failed")]
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
