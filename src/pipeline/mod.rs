//! One photo restored on a calibrated rig: prepare B, solve, line the colours up, cut to the photo.
//!
//! What the photo goes through before the solver sees it, in this order, with the reason of each:
//!
//! | step | why |
//! |---|---|
//! | dark corner divided out | the light path divides it out of every capture, so B must match |
//! | saturated pixels marked | a full pixel is only a lower bound |
//! | placed on the canvas | light from outside the frame fell into it |
//! | noise measured | the shrinkage follows the noise; nothing else is tuned per photo |

mod dot_test;
mod evidence;
mod learning;
mod methods;
mod setting;
mod shown;
mod verdict;

pub use dot_test::BackwardCheck;
pub use evidence::{Evidence, Residuals, distance};
pub use methods::{block_matching, digital, hybrid, method, paper, reference_solution};
pub(crate) use setting::counted;
pub use setting::{Chosen, Setting};
pub use verdict::{Judged, Verdict};

use std::sync::Arc;

use crate::calibration::correction::{Correction, CorrectionError, Layout};
use crate::calibration::photo_side::PhotoSide;
use crate::calibration::{Calibration, Noise};
use crate::config;
use crate::deconvolution::blocking::blocking_of;
use crate::deconvolution::data_term::{self, MISSING, SATURATED, TRUSTED};
use crate::deconvolution::forward_convolution::ForwardConvolution;
use crate::deconvolution::ladder::is_blank;
use crate::deconvolution::lens_model::{LensModel, LensModelError};
use crate::deconvolution::level_norms::LevelNorms;
use crate::deconvolution::method::{Method, MethodError, Problem, Solution, Watch};
use crate::frame::{Channel, Channels, FULL_SCALE, Frame, Plane, Work};
use crate::light_path::LightPath;
use crate::remedy::{Remediable, Remedy};
use crate::rig::exposure::Rig;
use learning::Learning;

/// A photo value at or above this share of full scale counts as saturated (8-bit files clip at 255;
/// the code below it is kept as data).
const SATURATION_SHARE: f32 = 0.998;

/// Of so many pixels one is looked at for the photo's median level; prime, so that no pattern is
/// met in step.
const NOISE_SAMPLE: usize = 31;

/// Everything that a calibrated rig needs to restore photos, made once and used for many.
pub struct Bench {
    correction: Correction,
    photo_side: PhotoSide,
    model: Arc<LensModel>,
    norm_squared: [f32; 3],
    level_norms: [LevelNorms; 3],
    capture_noise: [f32; 3],
    noise: [Noise; 3],
    black_surround: bool,
    learning: Learning,
    interrupted: Option<Interruption>,
}

/// Asked before each capture: whether the photo is to be given up.
pub type Interruption = Box<dyn Fn() -> bool + Send + Sync>;

/// A photo to be restored, and by what.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    /// The photo, photo-sized, linear light 0..255.
    pub photo: &'a Frame<Work>,
    /// The channels it has.
    pub channels: Channels,
    /// The method.
    pub method: &'a dyn Method,
    /// Seconds on a clock of the caller's.
    pub stopwatch: &'a (dyn Fn() -> f64 + Sync),
}

/// A photo restored.
#[derive(Debug, Clone)]
pub struct Restored {
    /// The picture, photo-sized, linear light 0..255.
    pub picture: Frame<Work>,
    /// What the method returned, on its canvas.
    pub solution: Solution,
    /// Captures this photo cost.
    pub captures: usize,
    /// Seconds of those captures on the rig's clock.
    pub capture_seconds: f64,
    /// Seconds on the stopwatch spent waiting for captures (and, on a simulated rig, computing
    /// them).
    pub waited_seconds: f64,
    /// The photo's noise per channel as measured, grey levels.
    pub photo_noise: [f32; 3],
    /// The lens by which the result is judged: as measured, or as the photo's captures say it is.
    pub lens: Arc<LensModel>,
}

impl Bench {
    /// The bench of a rig and its calibration.
    ///
    /// # Errors
    /// When the calibration does not fit the rig file.
    pub fn new(rig: &config::Rig, calibration: &Calibration) -> Result<Self, BenchError> {
        let layout = layout(rig);
        let found = calibration.level_norms[0].levels();
        if found != rig.restore.levels {
            return Err(BenchError::Levels { found, wanted: rig.restore.levels });
        }
        // First, because it looks at the sizes.
        let correction = Correction::new(calibration, layout)?;
        Ok(Bench {
            model: Arc::new(calibration.lens_model()?),
            photo_side: PhotoSide::new(calibration, &layout),
            norm_squared: norm_bound(calibration),
            level_norms: calibration.level_norms.clone(),
            noise: calibration.noise,
            capture_noise: calibration.noise.map(|noise| noise.sigma(FULL_SCALE / 2.0)),
            black_surround: layout.margin_px == 0,
            learning: Learning::default(),
            interrupted: None,
            correction,
        })
    }

    /// The same bench, which gives a photo up before its next capture once `interrupted` says so.
    #[must_use]
    pub fn interruptible(mut self, interrupted: Interruption) -> Self {
        self.interrupted = Some(interrupted);
        self
    }

    /// The measured lens.
    pub fn model(&self) -> &Arc<LensModel> {
        &self.model
    }

    /// The path between Work and the devices.
    pub fn correction(&self) -> &Correction {
        &self.correction
    }

    /// B on its canvas and what each of its pixels is worth.
    pub fn prepare(&self, photo: &Frame<Work>) -> (Frame<Work>, Frame<Work, u8>) {
        let (canvas, rect) = data_term::canvas_of(photo.size(), self.correction.layout().margin_px);
        let mut flat = photo.clone();
        self.photo_side.undo_dark_corner(&mut flat);
        let trust = Frame::from_fn(|c| {
            let full = SATURATION_SHARE * FULL_SCALE;
            let inner = photo.plane(c).map(|v: f32| if v >= full { SATURATED } else { TRUSTED });
            data_term::place(&inner, canvas, rect, MISSING)
        });
        let placed = Frame::from_fn(|c| {
            if self.black_surround {
                data_term::place(flat.plane(c), canvas, rect, 0.0)
            } else {
                data_term::place_with_edges(flat.plane(c), canvas, rect)
            }
        });
        (placed, trust)
    }

    /// The photo's noise in one channel, grey levels: as measured, and at least what this camera
    /// has at the photo's median level. A JPEG's noise is flattened where it is measured and still
    /// in the picture, and its coding adds to it: without that, the hybrid's mean SSIM of four
    /// scenes on small.toml is 0.829 at quality 70 in place of 0.878, and 0.917 at 95 in place of
    /// 0.940; the photos have 0.805 and 0.826 (2026-11-21).
    fn noise_of(&self, channel: Channel, photo: &Plane) -> f32 {
        let mut sample: Vec<f32> = photo.data().iter().step_by(NOISE_SAMPLE).copied().collect();
        let middle = sample.len() / 2;
        let median = *sample.select_nth_unstable_by(middle, f32::total_cmp).1;
        let of_light = data_term::noise_of(photo).max(self.noise[channel.index()].sigma(median));
        of_light.hypot(blocking_of(photo))
    }

    /// Whether nothing in `photo` rises above its noise.
    pub fn is_blank(&self, photo: &Frame<Work>, channels: Channels) -> bool {
        let (placed, trust) = self.prepare(photo);
        let of = |&c: &Channel| (placed.plane(c), trust.plane(c), self.noise_of(c, photo.plane(c)));
        is_blank(&channels.list().iter().map(of).collect::<Vec<_>>())
    }

    fn finished(&self, picture: &Frame<Work>, channels: Channels) -> Frame<Work> {
        match channels {
            Channels::Colour => self.photo_side.line_up_colours(picture),
            Channels::Green => picture.clone(),
        }
    }

    /// Restores what is asked for on `rig`; `watch` is called after every step.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn restore(
        &self,
        rig: &mut Rig,
        request: &Request<'_>,
        watch: &mut Watch<'_>,
    ) -> Result<Restored, MethodError> {
        self.restore_through(&self.model, rig, request, watch)
    }

    /// [`Bench::restore`] with another `lens` than the measured one, of the same sizes.
    ///
    /// # Errors
    /// When a capture fails.
    pub fn restore_through(
        &self,
        lens: &Arc<LensModel>,
        rig: &mut Rig,
        request: &Request<'_>,
        watch: &mut Watch<'_>,
    ) -> Result<Restored, MethodError> {
        let &Request { photo, channels, method, stopwatch } = request;
        let interrupted = self.interrupted.as_deref();
        let mut path = LightPath::new(rig, &self.correction, stopwatch).interruptible(interrupted);
        let (captures, seconds) = (path.captures(), path.seconds());
        let (placed, trust) = self.prepare(photo);
        let of = |c: Channel| self.noise_of(c, photo.plane(c));
        let (red, (green, blue)) = rayon::join(
            || of(Channel::Red),
            || rayon::join(|| of(Channel::Green), || of(Channel::Blue)),
        );
        let photo_noise = [red, green, blue];
        let (_, rect) = data_term::canvas_of(photo.size(), self.correction.layout().margin_px);
        let problem = Problem {
            photo: &placed,
            trust: &trust,
            rect,
            channels,
            model: Some(lens),
            norm_squared: self.norm_squared,
            level_norms: &self.level_norms,
            learnt: self.learning.lens(),
            photo_noise,
            capture_noise: self.capture_noise,
            stopwatch,
        };
        let solution = method.solve(&problem, &mut path, watch)?;
        let refined = solution.look.refined.as_ref();
        let refined =
            refined.and_then(|of| lens.with_functions(rect.size, rect.x, &of.functions).ok());
        let picture = self.finished(&solution.picture, channels).crop(rect);
        Ok(Restored {
            picture,
            captures: path.captures() - captures,
            capture_seconds: path.seconds() - seconds,
            waited_seconds: path.waited_seconds(),
            photo_noise,
            lens: refined.map_or_else(|| Arc::clone(lens), Arc::new),
            solution,
        })
    }
}

/// ‖K‖² of each channel with its uncertainty on top: by as much as the light's own ‖K‖² differs
/// from the model's.
fn norm_bound(calibration: &Calibration) -> [f32; 3] {
    let of_model = calibration.norm_squared[Channel::Green.index()].max(f32::MIN_POSITIVE);
    let uncertainty = (calibration.norm_squared_seen / of_model - 1.0).abs();
    calibration.norm_squared.map(|norm| norm * (1.0 + uncertainty))
}

/// The devices' sizes of a rig file, as a calibration needs them.
pub fn layout(rig: &config::Rig) -> Layout {
    Layout {
        panel: rig.panel.size(),
        sensor: rig.camera.size(),
        photo: rig.photo.size(),
        photo_x_px: rig.camera.photo_x_px,
        photo_y_px: rig.camera.photo_y_px,
        margin_px: rig.canvas.margin_px,
        saturated: rig.camera.count_max(),
    }
}

/// Why a rig and a calibration do not go together.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The lens was measured for another number of levels.
    #[error(
        "the calibration measured {found} wavelet levels of the lens; the rig file's [restore] \
         levels is {wanted}"
    )]
    Levels {
        /// Levels measured.
        found: usize,
        /// Levels wanted.
        wanted: usize,
    },
    /// The lens functions do not fit.
    #[error("the calibration's lens functions cannot be used")]
    Lens(#[from] LensModelError),
    /// The corrections do not fit.
    #[error("the calibration cannot be put to work")]
    Correction(#[from] CorrectionError),
}

impl Remediable for BenchError {
    fn remedy(&self) -> Remedy {
        Remedy::Recalibrate
    }
}
