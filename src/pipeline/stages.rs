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

/// Expected z from which a photo without the pattern is attributed to another sensor. On the
/// laboratory's group of limits the rig's own photos, down to JPEGs of quality 60, have 1.4 times
/// the expected z on average, with a standard error of 1: 0.4 % of those with this expected z have
/// less than half of it. Raised from 2.5 because of one own photo in the group of rates.
const EXPECTED_MIN: f64 = 3.0;
/// z from which a photo has the pattern, whatever its expected z. Of 215 photos of other sensors in
/// the group of limits none exceeds 3.1.
const Z_MIN: f64 = 4.0;
/// [`Z_MIN`] for the best of many places: 1 of 3 million exceeds it by chance, and 1000 are tried.
const Z_MIN_OF_PLACES: f64 = 5.0;

/// A photo made ready for the methods.
#[derive(Clone)]
pub struct Prepared<'a> {
    /// The photo, photo-sized, linear light 0..255; raw sites are divided by the sensor's gain
    /// pattern.
    pub photo: Cow<'a, Frame<Work>>,
    /// The photo's data on the canvas.
    pub observation: Observation,
    /// Focus of the photo, if it differs from the panel's.
    pub focus: Option<PhotoFocus>,
    /// Lens of the photo, if it differs from the one measured at the panel.
    pub(super) lens: Option<BoundedLens>,
    /// Whether a raw photo's spectrum shows a lens much sharper than the measured one.
    pub is_of_sharper_lens: bool,
    /// Match with the gain pattern of the rig's sensor; `None` if that was not measured.
    pub sensor: Option<SensorMatch>,
    /// Outliers that are masked, if any.
    pub outliers: Option<Outliers>,
    /// Notes for the report.
    pub notes: Vec<String>,
    /// Finding of the measured lens alone, computed when first needed.
    pub(super) lens_alone: OnceLock<LensAlone>,
    /// RMS of K̂B − B per channel, grey levels, computed when first needed.
    pub(super) untouched: OnceLock<[f32; 3]>,
}

/// Match of a photo with the gain pattern of the rig's sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorMatch {
    /// Measured z, in standard errors.
    pub found: f64,
    /// Expected z of a photo that this sensor took.
    pub expected: f64,
}

/// The sensor that took a photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TakenBy {
    /// The rig's sensor.
    Own,
    /// Another sensor.
    Another,
    /// Unknown: the photo shows too little of any pattern.
    Either,
}

impl SensorMatch {
    /// Attributes the photo to another sensor if z is nearer to 0 than to what is expected.
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
    /// Norms for data at all pixels.
    pub(super) norms: OperatorNorms,
    /// Norms for data at raw sites, computed when first needed.
    pub(super) at_sites: OnceLock<OperatorNorms>,
}

impl BoundedLens {
    /// Bounds on the norms for data at raw sites.
    pub(super) fn norms_at_sites(&self) -> &OperatorNorms {
        once(&self.at_sites, || OperatorNorms::at_sites(&self.model, self.norms.levels[0].levels()))
    }
}

/// A focus other than the panel's.
#[derive(Debug, Clone, Copy)]
pub struct PhotoFocus {
    /// 1/distance of the scene − 1/distance of the panel, dioptres; positive is nearer.
    pub offset: f32,
    /// Whether this is the nearest or farthest offset measured, and the true one may lie beyond.
    pub at_end: bool,
}

impl PhotoFocus {
    /// Note for the user on the focus.
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
    /// The sensor that took the photo; `None` if the rig's gain pattern was not measured.
    pub(super) fn taken_by(&self) -> Option<TakenBy> {
        self.sensor.map(SensorMatch::taken_by)
    }

    /// Whether the photo shows the gain pattern of the rig's sensor.
    pub fn shows_sensor(&self) -> bool {
        self.taken_by() == Some(TakenBy::Own)
    }

    /// Whether the photo's place in the `field` of the lens is known; a part of the field is placed
    /// by the sensor's gain pattern.
    pub(super) fn is_placed(&self, field: Rect) -> bool {
        let shows_place = |sensor: SensorMatch| sensor.found >= Z_MIN_OF_PLACES;
        self.observation.rect == field || self.sensor.is_some_and(shows_place)
    }

    /// The same photo without cached findings.
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
    /// Number of captures made.
    pub captures: usize,
    /// Duration of the captures on the rig's clock, seconds.
    pub capture_seconds: f64,
    /// Stopwatch seconds spent waiting for captures; a simulated rig computes them meanwhile.
    pub waited_seconds: f64,
}

impl Solved {
    /// The same result with the captures of `another` result of the same photo added.
    pub(super) fn with_captures_of(self, another: &Solved) -> Solved {
        Solved {
            captures: self.captures + another.captures,
            capture_seconds: self.capture_seconds + another.capture_seconds,
            waited_seconds: self.waited_seconds + another.waited_seconds,
            ..self
        }
    }
}

/// Finding of the lens model alone on a photo.
#[derive(Clone)]
pub(super) enum LensAlone {
    /// No scene gives the photo through the lens; with the residuals of the channels examined.
    Foreign(Vec<Residuals>),
    /// Some scene may give the photo; with the reference solution and its evidence.
    Fitting(Box<Reference>),
}

/// The reference solution with its evidence.
#[derive(Clone)]
pub(super) struct Reference {
    pub(super) solved: Solved,
    pub(super) evidence: Evidence,
}
