//! The restoration of one photo on a calibrated rig: prepare, solve, judge, [`Outcome`].
//!
//! [`Pipeline::prepare`] turns a photo of any file format into an observation;
//! [`Pipeline::restore`] solves and judges it, for the box, the charts and the laboratory alike.
//! [`Pipeline::solve`] alone returns a method's result before it is judged.

mod find_outliers;
mod focus;
mod hot_pixels;
mod judging;
mod methods;
mod model_error;
mod optical_residual;
mod outcome;
mod outliers;
mod own_sensor;
mod photo_data;
mod prepare;
mod raw_noise;
mod setting;
mod shown;
mod solve;
mod stages;

pub use judging::{
    Case, Evidence, FOREIGN, FineColour, Grain, Measures, NO_GAIN, Residuals, Unit, WITNESSES,
    WitnessRow, harm, is_suspect, unexplained_product,
};
pub use methods::{hybrid, method, paper};
pub use optical_residual::{CertifiedFocus, Confirmation, OpticalResidual};
pub use outcome::{Iteration, Outcome, Restoration, Verdict};
pub use outliers::{Outliers, areas};
pub use photo_data::{PhotoData, Recorded};
pub use prepare::SATURATION_SHARE;
pub use raw_noise::AVERAGED_MIN;
pub(crate) use setting::counted;
pub use setting::{Chosen, Setting};
pub use stages::{PhotoFocus, Prepared, SensorMatch, Solved};

use std::sync::{Arc, OnceLock};

use crate::calibration::correction::{Correction, CorrectionError, Layout};
use crate::calibration::photo_side::PhotoSide;
use crate::calibration::{Calibration, CrossChannel, Noise, OperatorNorms};
use crate::config;
use crate::deconvolution::lens_model::{Beyond, Halo, LensModel, LensModelError};
use crate::deconvolution::method::WAVELET_LEVELS;
use crate::deconvolution::method::digital::Digital;
use crate::deconvolution::method::total_variation::TotalVariation;
use crate::frame::{Channel, FULL_SCALE, RawSites, Size};
use crate::light_path::LightPath;
use crate::remedy::{Remediable, Remedy};
use crate::rig::exposure::Devices;
use crate::rig::shoot::SiteNoise;
use focus::Focuses;
use model_error::ModelError;
use stages::BoundedLens;

/// A calibrated rig's models, corrections and limits, made once for many photos.
pub struct Pipeline {
    correction: Correction,
    photo_side: PhotoSide,
    /// The lens as measured at the panel.
    lens: BoundedLens,
    focuses: Focuses,
    capture_noise: [f32; 3],
    noise: [Noise; 3],
    site_noise: [Noise; 3],
    counts_per_level: [f32; 3],
    /// Counts of the rig's camera per grey level, where white is the camera's largest count.
    own_counts_per_level: f32,
    halos: [Vec<Halo>; 3],
    beyond: Beyond,
    model_error: ModelError,
    reference: TotalVariation,
    digital: Digital,
    stopwatch: Stopwatch,
    interruption: Option<Interruption>,
}

/// A clock of the caller's; returns seconds.
pub type Stopwatch = Arc<dyn Fn() -> f64 + Send + Sync>;

/// Called before each capture; cancels the photo by returning true.
pub type Interruption = Arc<dyn Fn() -> bool + Send + Sync>;

impl Pipeline {
    /// The pipeline of a rig and its calibration.
    ///
    /// # Errors
    /// When the calibration does not fit the rig file.
    pub fn new(rig: &config::RigFile, calibration: &Calibration) -> Result<Self, PipelineError> {
        let layout = Layout::of(rig);
        let found = calibration.norms.levels[0].levels();
        if found != WAVELET_LEVELS {
            return Err(PipelineError::Levels(found));
        }
        // First, because it checks the sizes.
        let correction = Correction::new(calibration, layout)?;
        let norms = &calibration.norms;
        Ok(Pipeline {
            lens: BoundedLens {
                model: Arc::new(calibration.lens_model()?),
                norms: OperatorNorms {
                    squared: norms.squared.map(|norm| norm * norm_excess(calibration)),
                    levels: norms.levels.clone(),
                },
                at_sites: calibration.at_sites.clone().map_or_else(OnceLock::new, OnceLock::from),
            },
            photo_side: PhotoSide::new(calibration),
            focuses: Focuses::of(calibration),
            noise: calibration.noise,
            site_noise: site_noise(calibration),
            counts_per_level: calibration.counts_per_level,
            own_counts_per_level: own_counts_per_level(rig, calibration),
            capture_noise: calibration.noise.map(|noise| noise.sigma(FULL_SCALE / 2.0)),
            halos: calibration.broad.clone(),
            beyond: calibration.beyond(),
            model_error: ModelError::of(calibration),
            reference: TotalVariation::default(),
            digital: Digital::default(),
            stopwatch: Arc::new(|| 0.0),
            interruption: None,
            correction,
        })
    }

    /// The same pipeline with the clock `stopwatch`.
    #[must_use]
    pub fn timed_by(self, stopwatch: Stopwatch) -> Self {
        Pipeline { stopwatch, ..self }
    }

    /// The same pipeline, which cancels a photo before its next capture once `interruption` returns
    /// true.
    #[must_use]
    pub fn interruptible(self, interruption: Interruption) -> Self {
        Pipeline { interruption: Some(interruption), ..self }
    }

    /// The pipeline of the same rig and another calibration.
    ///
    /// # Errors
    /// When the calibration does not fit the rig file.
    pub fn calibrated(
        &self,
        rig: &config::RigFile,
        calibration: &Calibration,
    ) -> Result<Self, PipelineError> {
        let interruption = self.interruption.clone();
        let fresh = Pipeline::new(rig, calibration)?.timed_by(Arc::clone(&self.stopwatch));
        Ok(Pipeline { interruption, ..fresh })
    }

    /// Noise of one exposure at the sites `raw`, per channel, in the photo's own grey levels; their
    /// white may differ from the calibration's.
    pub fn noise_at(&self, raw: &RawSites) -> [Noise; 3] {
        Channel::ALL.map(|c| {
            let noise = self.site_noise[c.index()];
            let levels = self.counts_per_level[c.index()] / raw.counts_per_level;
            let at_black = noise.at_black * levels.powi(2);
            Noise { at_black, per_level: noise.per_level * levels }
        })
    }

    /// The measured lens.
    pub fn model(&self) -> &Arc<LensModel> {
        &self.lens.model
    }

    /// Forward convolution through `rig`.
    pub fn light_path<'a>(&'a self, rig: &'a mut Devices) -> LightPath<'a> {
        LightPath::new(rig, (&self.correction, &self.lens.model), &*self.stopwatch)
    }
}

/// The noise of one exposure at the sites of a rig with this `calibration`, in counts.
pub fn site_noise_of(calibration: &Calibration) -> SiteNoise {
    let noise = site_noise(calibration);
    let each = [0, 1, 2].map(|c| (noise[c], f64::from(calibration.counts_per_level[c])));
    SiteNoise {
        at_black: each.map(|(noise, counts)| f64::from(noise.at_black) * counts.powi(2)),
        per_count: each.map(|(noise, counts)| f64::from(noise.per_level) * counts),
    }
}

/// Noise of each channel before unmixing. The calibration has the noise of captures, measured after
/// unmixing, on greys, to which all of the panel's primaries contribute.
fn site_noise(calibration: &Calibration) -> [Noise; 3] {
    let unmix = calibration.cross_channel.inverse().unwrap_or(CrossChannel::IDENTITY.c);
    Channel::ALL.map(|channel| {
        let n = channel.index();
        let (found, own) = (calibration.noise[n], unmix[n][n].powi(2));
        let grey: f32 = calibration.cross_channel.c.iter().map(|primary| primary[n]).sum();
        Noise { at_black: found.at_black / own, per_level: found.per_level / (own * grey) }
    })
}

fn own_counts_per_level(rig: &config::RigFile, calibration: &Calibration) -> f32 {
    let Size { width, height } = rig.canvas_size();
    let black = &calibration.black[Channel::Green.index()];
    let black = black.at(width as f64 / 2.0, height as f64 / 2.0);
    (f64::from(rig.camera.count_max()) - black) as f32 / FULL_SCALE
}

/// Factor from ‖K‖² of the lens model to an upper bound: 1 plus its error relative to a capture.
fn norm_excess(calibration: &Calibration) -> f32 {
    let of_model = calibration.norms.squared[Channel::Green.index()].max(f32::MIN_POSITIVE);
    1.0 + (calibration.norm_squared_seen / of_model - 1.0).abs()
}

/// Error of a calibration that does not fit the rig file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The messages describe them.
pub enum PipelineError {
    #[error("the calibration measured {0} wavelet levels of the lens, allowed {WAVELET_LEVELS}")]
    Levels(usize),
    #[error("the calibration's lens functions cannot be used")]
    Lens(#[from] LensModelError),
    #[error("the calibration's corrections cannot be used")]
    Correction(#[from] CorrectionError),
}

impl Remediable for PipelineError {
    fn remedy(&self) -> Remedy {
        Remedy::Recalibrate
    }
}

#[cfg(test)]
mod tests;
