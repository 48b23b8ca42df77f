//! Errors of a calibration, by what the operator has to do.

use crate::calibration::CorrectionError;
use crate::calibration::lens_blur::LensBlurError;
use crate::calibration::surface::SurfaceError;
use crate::remedy::{Remediable, Remedy};
use crate::rig::RigError;

/// Why a calibration failed. The stored calibration stays.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// The calibration was cancelled.
    #[error("cancelled")]
    GivenUp,
    /// No thread could be started.
    #[error("cannot start a thread to compute")]
    NoThread(#[source] std::io::Error),
    /// A capture failed.
    #[error("a capture failed in calibration step `{step}`")]
    Rig {
        /// The step.
        step: &'static str,
        /// The cause.
        #[source]
        source: RigError,
    },
    /// The panel does not fill the camera's view.
    #[error(
        "panel not in view: {found}; switch the panel on, and aim the camera so that the panel \
         fills its picture"
    )]
    NotInView {
        /// The finding.
        found: String,
    },
    /// White saturates the sensor.
    #[error(
        "over-exposed: {found_percent:.0} % of the pixels in the brightest part of white are \
         saturated, allowed {allowed_percent:.0} %; shorten the exposure, dim the panel, or keep \
         other light away"
    )]
    OverExposed {
        /// Saturated share in the brightest cell.
        found_percent: f64,
        /// Largest allowed share.
        allowed_percent: f64,
    },
    /// White has too little contrast to black.
    #[error(
        "too dark: white is {found_percent:.1} % of full scale above black, at least \
         {allowed_percent:.0} % are needed; lengthen the exposure, brighten the panel, or check \
         that camera.bits in the rig file is not more than the sensor has"
    )]
    TooDark {
        /// White over black, of full scale.
        found_percent: f64,
        /// Least allowed share.
        allowed_percent: f64,
    },
    /// Frames still show the previous picture.
    #[error(
        "panel.settle-ms is too short: a frame still shows {found_percent:.1} % of the previous \
         picture, allowed {allowed_percent:.1} %; run `relens check` for the right value"
    )]
    TooSoon {
        /// Residual of white in black.
        found_percent: f64,
        /// Largest allowed share.
        allowed_percent: f64,
    },
    /// Two captures of one picture differ.
    #[error(
        "moving: {found} between two captures of the same picture, allowed {allowed}; bolt panel \
         and camera down and let the table rest"
    )]
    Moving {
        /// The motion found.
        found: String,
        /// The allowed value.
        allowed: String,
    },
    /// The picture is too blurred.
    #[error("wrong focus: {found}, allowed {allowed}; focus the camera on the panel")]
    WrongFocus {
        /// The finding.
        found: String,
        /// The allowed value.
        allowed: String,
    },
    /// A channel does not respond to the panel.
    #[error(
        "the {channel} channel does not respond to the panel: {found}; run `relens check` to see \
         whether panel.settle-ms is too short or the panel is out of view"
    )]
    Response {
        /// The channel.
        channel: &'static str,
        /// The finding.
        found: String,
    },
    /// The camera's counts are not linear in light.
    #[error(
        "the camera's counts are not linear in light: in the {channel} channel {found}, allowed \
         {allowed}; switch off its gamma and contrast, or use its raw pictures"
    )]
    NotLinear {
        /// The channel.
        channel: &'static str,
        /// The finding.
        found: String,
        /// The allowed value.
        allowed: String,
    },
    /// The sensor has too many bad sites.
    #[error(
        "{found_percent:.1} % of the sensor's sites are hot or dead, allowed \
         {allowed_percent:.0} %; clean the sensor's window, cool the camera, or shorten the \
         exposure"
    )]
    BadSites {
        /// Share of bad sites.
        found_percent: f64,
        /// Largest allowed share.
        allowed_percent: f64,
    },
    /// A smooth surface cannot be fitted.
    #[error(
        "the fit of calibration step `{step}` failed; run `relens check` to see whether \
         panel.settle-ms is too short"
    )]
    Fit {
        /// The step.
        step: &'static str,
        /// The cause.
        #[source]
        source: SurfaceError,
    },
    /// The lens functions cannot be fitted.
    #[error("the lens functions cannot be measured; run `relens check` on panel and camera")]
    Lens(#[source] LensBlurError),
    /// The measurements are inconsistent.
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
        // At 40 ms little of the previous picture remains, and all else can be fitted.
        for settle_ms in [10.0, 25.0, 40.0] {
            let message = full_message(&calibrate_with(settle_ms).unwrap_err());
            assert!(message.contains("panel.settle-ms is too short"), "{settle_ms} ms: {message}");
            assert!(message.contains("run `relens check`"), "{settle_ms} ms: {message}");
        }
        // The value that the check proposes works.
        assert!(calibrate_with(50.0).is_ok());
    }
}
