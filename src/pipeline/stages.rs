//! Intermediate results of the pipeline: [`Prepared`] and [`Solved`].

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use super::judging::{Evidence, Residuals};
use super::outliers::Outliers;
use crate::calibration::OperatorNorms;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::method::{About, Solution};
use crate::deconvolution::observation::Observation;
use crate::frame::{Frame, Rect, Work, once};

/// Expected z from which a photo without the pattern is another sensor's. Own photos of the limits,
/// down to JPEGs of quality 60, have 1.4 times what is expected on average, with a standard error
/// of 1: 0.4 % of those with this much have less than half. Raised from 2.5 for an own photo of the
/// rates.
const EXPECTED_MIN: f64 = 3.0;
/// z from which a photo has the pattern, whatever is expected. Of 215 photos of other sensors z is
/// 3.1 at most (limits).
const Z_MIN: f64 = 4.0;
/// The same at the best of many places: 1 of 3 million is above by chance, and 1000 are tried.
const Z_MIN_OF_PLACES: f64 = 5.0;

/// A photo made ready for the methods.
#[derive(Clone)]
pub struct Prepared<'a> {
    /// The photo, photo-sized, linear light 0..255; of raw sites divided by the sensor's gain
    /// pattern.
    pub photo: Cow<'a, Frame<Work>>,
    /// Its data on the canvas.
    pub observation: Observation,
    /// Its focus, if it is not the panel's.
    pub focus: Option<PhotoFocus>,
    /// Its lens, if it is not the one measured at the panel.
    pub(super) lens: Option<BoundedLens>,
    /// Whether its spectrum shows a lens much sharper than the measured one; of raw photos.
    pub is_of_sharper_lens: bool,
    /// How clearly it shows the pattern of the rig's sensor; `None` where that was not measured.
    pub sensor: Option<SensorMatch>,
    /// Its outliers, where it is solved without them.
    pub outliers: Option<Outliers>,
    /// Notes for the report.
    pub notes: Vec<String>,
    /// The verdict of the measured lens alone, computed when first needed.
    pub(super) lens_alone: OnceLock<LensAlone>,
    /// RMS of K̂B − B by the measured lens, likewise.
    pub(super) untouched: OnceLock<[f32; 3]>,
}

/// How clearly a photo has the gain pattern of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorMatch {
    /// z, in standard errors.
    pub found: f64,
    /// z that this sensor's photos have on average.
    pub expected: f64,
}

/// The sensor that took a photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TakenBy {
    /// The rig's.
    Own,
    /// Another.
    Another,
    /// Either: the photo shows too little of any pattern.
    Either,
}

impl SensorMatch {
    /// Of another sensor if that is likelier, z being nearer to 0 than to what is expected.
    pub(super) fn taken_by(self) -> TakenBy {
        let is_unlikely = self.found < (0.5 * self.expected).min(Z_MIN);
        if self.found >= Z_MIN {
            TakenBy::Own
        } else if self.expected >= EXPECTED_MIN && is_unlikely {
            TakenBy::Another
        } else {
            TakenBy::Either
        }
    }
}

/// A lens model with bounds on its norms.
#[derive(Clone)]
pub(super) struct BoundedLens {
    pub(super) model: Arc<LensModel>,
    /// At all pixels.
    pub(super) norms: OperatorNorms,
    /// The same at raw sites, computed when first needed.
    pub(super) at_sites: OnceLock<OperatorNorms>,
}

impl BoundedLens {
    /// The bounds at raw sites.
    pub(super) fn norms_at_sites(&self) -> &OperatorNorms {
        once(&self.at_sites, || OperatorNorms::at_sites(&self.model, self.norms.levels[0].levels()))
    }
}

/// A focus other than the panel's.
#[derive(Debug, Clone, Copy)]
pub struct PhotoFocus {
    /// 1/distance of the scene − 1/distance of the panel, dioptres; positive is nearer.
    pub offset: f32,
    /// Whether it is the nearest or farthest measured: the photo's may lie beyond.
    pub at_end: bool,
}

impl PhotoFocus {
    /// The user's note on it.
    pub fn note(&self) -> String {
        let side = if self.offset > 0.0 { "nearer" } else { "farther" };
        let distance = match self.offset.abs() < 0.005 {
            true => "as far as the panel".to_owned(),
            false => format!("{side} than the panel by {:.2} dioptres (1/m)", self.offset.abs()),
        };
        let beyond = match self.at_end {
            true => ", the most that the lens was measured for; it may be more",
            false => "",
        };
        format!(
            "the scene was {distance}{beyond}: it was restored with the lens as measured for that \
             focus, and its photograph was computed for that focus"
        )
    }
}

impl Prepared<'_> {
    /// The sensor that took it; `None` where the pattern of the rig's was not measured.
    pub(super) fn taken_by(&self) -> Option<TakenBy> {
        self.sensor.map(SensorMatch::taken_by)
    }

    /// Whether it shows the pattern of the rig's sensor.
    pub fn shows_sensor(&self) -> bool {
        self.taken_by() == Some(TakenBy::Own)
    }

    /// Whether its place in the `field` of the lens is known: that of a part by the sensor's
    /// pattern.
    pub(super) fn is_placed(&self, field: Rect) -> bool {
        let shows_place = |sensor: SensorMatch| sensor.found >= Z_MIN_OF_PLACES;
        self.observation.rect == field || self.sensor.is_some_and(shows_place)
    }

    /// The same photo, without findings on it.
    pub(super) fn unjudged(&self) -> Self {
        Prepared { lens_alone: OnceLock::new(), untouched: OnceLock::new(), ..self.clone() }
    }

    /// The photo as if taken at the panel's focus.
    pub(super) fn at_panel(&self) -> Self {
        Prepared { focus: None, lens: None, ..self.unjudged() }
    }
}

/// A method's result, not yet judged.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The picture, photo-sized, linear light 0..255.
    pub picture: Frame<Work>,
    /// The method's solution, on its canvas.
    pub solution: Solution,
    /// The method.
    pub about: &'static About,
    /// Captures made.
    pub captures: usize,
    /// Their seconds on the rig's clock.
    pub capture_seconds: f64,
    /// Seconds waited for them on the stopwatch; on a simulated rig they are computed meanwhile.
    pub waited_seconds: f64,
}

impl Solved {
    /// The same result with the captures of `another` one of the same photo.
    pub(super) fn with_captures_of(self, another: &Solved) -> Solved {
        Solved {
            captures: self.captures + another.captures,
            capture_seconds: self.capture_seconds + another.capture_seconds,
            waited_seconds: self.waited_seconds + another.waited_seconds,
            ..self
        }
    }
}

/// What the lens model alone shows of a photo.
#[derive(Clone)]
pub(super) enum LensAlone {
    /// No scene gives the photo: the residuals of the channels that show it.
    Foreign(Vec<Residuals>),
    /// Some scene may.
    Fitting(Box<Reference>),
}

/// The reference solution with its evidence.
#[derive(Clone)]
pub(super) struct Reference {
    pub(super) solved: Solved,
    pub(super) evidence: Evidence,
}
