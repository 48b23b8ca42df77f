//! Errors of a calibration, each with what the operator has to do.

use crate::calibration::CorrectionError;
use crate::calibration::lens_blur::LensBlurError;
use crate::calibration::response_pattern::BAD_SHARE_MAX;
use crate::calibration::surface::SurfaceError;
use crate::frame::Channel;
use crate::remedy::{Remediable, Remedy};
use crate::rig::RigError;

/// Largest share of saturated pixels in the brightest cell of white. White may reach the largest
/// count; noise then saturates half of the pixels, and rounding some more.
pub(super) const SATURATED_MAX: f64 = 0.98;
/// Least white over black, as a share of full scale: 38 counts of an 8-bit camera. Guess.
pub(super) const CONTRAST_MIN: f64 = 0.15;
/// Largest residual of the previous picture in a frame, as a share: one grey level of 255;
/// `relens check` allows half.
pub(super) const RESIDUAL_MAX: f64 = 0.004;

/// Why a calibration failed. The stored calibration stays as it was.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // The sentences describe them.
pub enum CalibrateError {
    #[error("cancelled")]
    GivenUp,
    #[error("cannot start a thread to compute")]
    NoThread(#[source] std::io::Error),
    #[error("a capture failed in calibration step `{step}`")]
    Rig { step: &'static str, source: RigError },
    #[error(
        "panel not in view: {0}; switch the panel on, and aim the camera so that the panel fills \
         its picture"
    )]
    NotInView(String),
    #[error(
        "over-exposed: {:.0} % of the pixels in the brightest part of white are saturated, allowed \
         {:.0} %; shorten the exposure, dim the panel, or keep other light away",
        100.0 * .0, 100.0 * SATURATED_MAX
    )]
    OverExposed(f64),
    #[error(
        "too dark: white is {:.1} % of full scale above black, at least {:.0} % are needed; \
         lengthen the exposure, brighten the panel, or check that camera.bits in the rig file is \
         not more than the sensor has",
        100.0 * .0, 100.0 * CONTRAST_MIN
    )]
    TooDark(f64),
    #[error(
        "panel.settle-ms is too short: a frame still shows {:.1} % of the previous picture, \
         allowed {:.1} %; run `relens check` for the right value",
        100.0 * .0, 100.0 * RESIDUAL_MAX
    )]
    TooSoon(f64),
    #[error(
        "the rig is not steady: {0}, allowed {1}; bolt down panel and camera, and keep the \
         table still"
    )]
    Moving(String, String),
    #[error("wrong focus: {0}, allowed {1}; focus the camera on the panel")]
    WrongFocus(String, String),
    #[error(
        "the {name} channel does not respond to the panel: {found}; run `relens check` to see \
         whether panel.settle-ms is too short or the panel is out of view",
        name = .0.name(), found = .1
    )]
    Response(Channel, String),
    #[error(
        "the camera's counts are not linear in light: in the {name} channel {found}; switch off \
         its gamma and contrast, or use its raw pictures",
        name = .0.name(), found = .1
    )]
    NotLinear(Channel, String),
    #[error(
        "{:.1} % of the sensor's sites are hot or dead, allowed {:.0} %; clean the sensor's \
         window, cool the camera, or shorten the exposure",
        100.0 * .0, 100.0 * BAD_SHARE_MAX
    )]
    BadSites(f64),
    #[error(
        "the fit of calibration step `{step}` failed; run `relens check` to see whether \
         panel.settle-ms is too short"
    )]
    Fit { step: &'static str, source: SurfaceError },
    #[error("the lens functions cannot be measured; run `relens check` on panel and camera")]
    Lens(#[source] LensBlurError),
    #[error("the measurements are inconsistent")]
    Correction(#[source] CorrectionError),
}

impl Remediable for CalibrateError {
    fn remedy(&self) -> Remedy {
        match self {
            CalibrateError::Rig { source, .. } => source.remedy(),
            // The table may have been knocked: worth another try.
            CalibrateError::Moving { .. }
            | CalibrateError::GivenUp
            | CalibrateError::NoThread(_) => Remedy::RetryLater,
            _ => Remedy::CallOperator,
        }
    }

    fn was_asked_for(&self) -> bool {
        matches!(self, CalibrateError::GivenUp)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::config;
    use crate::measurement::{calibrate, to_the_end};
    use crate::remedy::full_message;
    use crate::rig::simulated::open;

    #[test]
    #[ignore = "a minute: the gate runs it"]
    fn too_short_a_settle_time_points_to_relens_check() {
        let calibrate_with = |settle_ms: f64| {
            let mut hasty = config::load(Path::new("small.toml")).unwrap();
            hasty.panel.settle_ms = settle_ms;
            let mut rig = open(&hasty).unwrap().0;
            calibrate(&mut rig, &hasty, None, &mut to_the_end)
        };
        // At 40 ms little of the previous picture remains, and everything else can be fitted.
        for settle_ms in [10.0, 25.0, 40.0] {
            let message = full_message(&calibrate_with(settle_ms).unwrap_err());
            assert!(message.contains("panel.settle-ms is too short"), "{settle_ms} ms: {message}");
            assert!(message.contains("run `relens check`"), "{settle_ms} ms: {message}");
        }
        // The value that the check proposes works.
        assert!(calibrate_with(50.0).is_ok());
    }
}
