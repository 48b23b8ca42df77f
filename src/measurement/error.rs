//! Why a rig could not be calibrated, told apart by what the operator has to do.

use crate::calibration::CorrectionError;
use crate::calibration::lens_blur::LensBlurError;
use crate::calibration::surface::SurfaceError;
use crate::remedy::{Remediable, Remedy};
use crate::rig::RigError;

/// Why a calibration was given up. The calibration kept before stays.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// Somebody asked that it be given up.
    #[error("given up when asked to")]
    GivenUp,
    /// The system gives no thread.
    #[error("the system has no thread left to compute with")]
    NoThread(#[source] std::io::Error),
    /// The rig brought no capture.
    #[error("calibration step `{step}` got no capture")]
    Rig {
        /// The step.
        step: &'static str,
        /// The cause.
        #[source]
        source: RigError,
    },
    /// The camera does not see the panel, or not everywhere.
    #[error(
        "panel not in view: {found}; aim the camera so that the panel fills its picture, and \
         switch the panel on"
    )]
    NotInView {
        /// What was seen instead.
        found: String,
    },
    /// White saturates the sensor.
    #[error(
        "over-exposed: {found_percent:.0} % of the pixels of the brightest part of white are \
         saturated, {allowed_percent:.0} % are allowed; shorten the exposure, dim the panel, or \
         keep other light away"
    )]
    OverExposed {
        /// Saturated share there.
        found_percent: f64,
        /// Largest share allowed.
        allowed_percent: f64,
    },
    /// White is hardly brighter than black.
    #[error(
        "too dark: white is {found_percent:.1} % of full scale above black, {allowed_percent:.0} \
         % are needed; lengthen the exposure, brighten the panel, or see in the rig file whether \
         camera.bits is more than the sensor has"
    )]
    TooDark {
        /// White over black.
        found_percent: f64,
        /// Least share allowed.
        allowed_percent: f64,
    },
    /// Frames show the picture before their own.
    #[error(
        "panel.settle-ms is too short: {found_percent:.1} % of the picture before is left in a \
         frame, {allowed_percent:.0} % is allowed; `relens check` says what to set it to"
    )]
    TooSoon {
        /// What was left of white in black.
        found_percent: f64,
        /// Largest share allowed.
        allowed_percent: f64,
    },
    /// Two captures of one picture disagree.
    #[error(
        "moving: {found} between two captures of the same picture; {allowed} allowed; bolt panel \
         and camera down and let the table rest"
    )]
    Moving {
        /// What moved and how far.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The picture is blurred beyond what can be worked with.
    #[error("wrong focus: {found}; {allowed} allowed; focus the camera on the panel")]
    WrongFocus {
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The response of a channel cannot be a panel's.
    #[error(
        "the {channel} channel does not answer to the panel: {found}; `relens check` says whether \
         panel.settle-ms is too short, or the camera does not see the panel"
    )]
    Response {
        /// The channel.
        channel: &'static str,
        /// What was found.
        found: String,
    },
    /// The camera bends its counts.
    #[error(
        "the camera's counts are not straight in light: in the {channel} channel {found}, \
         {allowed} are allowed; switch its gamma and its contrast off, or take its raw pictures"
    )]
    NotLinear {
        /// The channel.
        channel: &'static str,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The sensor has more bad sites than can be done without.
    #[error(
        "{found_percent:.1} % of the sensor's sites are hot or dead, {allowed_percent:.0} % are \
         allowed; clean the sensor's window, cool the camera, or shorten the exposure"
    )]
    BadSites {
        /// Share found.
        found_percent: f64,
        /// Largest share allowed.
        allowed_percent: f64,
    },
    /// A smooth surface does not fit.
    #[error(
        "calibration step `{step}` cannot be fitted; `relens check` says whether panel.settle-ms \
         is too short"
    )]
    Fit {
        /// The step.
        step: &'static str,
        /// The cause.
        #[source]
        source: SurfaceError,
    },
    /// The lens functions cannot be fitted.
    #[error("the lens functions cannot be measured; `relens check` looks at panel and camera")]
    Lens(#[source] LensBlurError),
    /// What was measured contradicts itself.
    #[error("what was measured cannot be put to work")]
    Correction(#[source] CorrectionError),
}

impl Remediable for CalibrateError {
    fn remedy(&self) -> Remedy {
        match self {
            CalibrateError::Rig { source, .. } => source.remedy(),
            // Someone may have knocked at the table: it is worth another try by itself.
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
    fn a_settle_time_that_is_too_short_leads_to_the_check_that_finds_it() {
        let tried = |settle_ms: f64| {
            let mut hasty = config::load(Path::new("small.toml")).unwrap();
            hasty.panel.settle_ms = settle_ms;
            let mut rig = open(&hasty).unwrap().0;
            calibrate(&mut rig, &hasty, None, &mut to_the_end)
        };
        // At 40 ms little of the picture before is left, and all else can be fitted.
        for settle_ms in [10.0, 25.0, 40.0] {
            let said = full_message(&tried(settle_ms).unwrap_err());
            assert!(said.contains("panel.settle-ms is too short"), "{settle_ms} ms: {said}");
            assert!(said.contains("`relens check` says what"), "{settle_ms} ms: {said}");
        }
        // What the check says to write is taken.
        assert!(tried(50.0).is_ok());
    }
}
