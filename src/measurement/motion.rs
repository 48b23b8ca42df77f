//! Motion of the panel during a calibration.
//!
//! On a table that gives, the panel's picture moves as a whole from capture to capture. Captures of
//! patterns are registered to their predictions by the fitted functions; what was shown is moved to
//! the place found, never the capture, and the functions are fitted again
//! ([`super::series::Series::follow`]). Centring folds the mean place into the geometry. Motion is
//! checked within each series, and overall between the first and the last checkerboard.

use super::CalibrateError;

/// Displacement below which the panel counts as still, sensor pixels: a spread of this size widens
/// a function of one pixel RMS by 0.0002 px.
pub(super) const STILL_PX: f64 = 0.02;
/// Largest distance between any two places, sensor pixels.
const FAR_MAX_PX: f64 = 2.0;
/// Largest distance between the places in two consecutive captures, sensor pixels; over more
/// captures it grows with the root of their number, as in a random walk. 4.6 deviations for a panel
/// that wanders by 0.1 px per capture and axis and vibrates by 0.03 px.
const STEP_MAX_PX: f64 = 0.5;

/// Place of the panel in a capture.
#[derive(Debug, Clone, Copy)]
pub(super) struct PanelPlace {
    /// Number of the capture.
    pub(super) capture: u32,
    /// Displacement to the right and down, sensor pixels.
    pub(super) at_px: (f64, f64),
}

/// Checks that the panel moved neither too far nor too fast between `places`, in order of capture.
pub(super) fn check(places: &[PanelPlace]) -> Result<(), CalibrateError> {
    let distance =
        |a: &PanelPlace, b: &PanelPlace| (a.at_px.0 - b.at_px.0).hypot(a.at_px.1 - b.at_px.1);
    let pairs = places.iter().flat_map(|a| places.iter().map(move |b| distance(a, b)));
    let far = pairs.fold(0.0, f64::max);
    let step = |two: &[PanelPlace]| {
        let captures = two[1].capture.saturating_sub(two[0].capture).max(1);
        distance(&two[0], &two[1]) / f64::from(captures).sqrt()
    };
    let fast = places.windows(2).map(step).fold(0.0, f64::max);
    if far > FAR_MAX_PX || fast > STEP_MAX_PX {
        return Err(CalibrateError::Moving(
            format!(
                "the panel's picture moved by {far:.2} px in all and by up to {fast:.2} px from \
                 one capture to the next"
            ),
            format!("{FAR_MAX_PX} px and {STEP_MAX_PX} px"),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remedy::full_message;

    /// The error message for a panel at `places` (capture, right, down).
    fn refusal(places: &[(u32, f64, f64)]) -> Option<String> {
        let place = |&(capture, x, y)| PanelPlace { capture, at_px: (x, y) };
        let places: Vec<PanelPlace> = places.iter().map(place).collect();
        check(&places).err().map(|error| full_message(&error))
    }

    #[test]
    fn a_panel_that_moves_too_far_or_too_fast_is_refused_with_both_numbers() {
        let slow: Vec<_> = (0..50).map(|n| (n, 0.04 * f64::from(n), 0.0)).collect();
        assert_eq!(refusal(&slow), None);
        // A table that wanders by 0.1 px per capture may move it by 0.72 px over 14 captures.
        assert_eq!(refusal(&[(8, 0.0, 0.0), (22, 0.6, -0.4)]), None);
        let cases: [(&[_], _, _); 3] = [
            (&[(8, 0.0, 0.0), (9, 0.6, -0.4)], "0.72 px in all", "up to 0.72 px from one"),
            (&[(8, 0.0, 0.0), (10, 0.6, -0.4)], "0.72 px in all", "up to 0.51 px from one"),
            (&[(8, 0.0, 0.0), (99, 1.8, -1.2)], "2.16 px in all", "up to 0.23 px from one"),
        ];
        for (places, far, fast) in cases {
            let found = refusal(places).expect("a refusal");
            let words = [far, fast, "allowed 2 px and 0.5 px", "bolt down panel and camera"];
            assert!(words.iter().all(|words| found.contains(words)), "{found}");
        }
        assert!(refusal(&[(8, 0.0, 0.0), (9, f64::INFINITY, 0.0)]).is_some());
    }
}
