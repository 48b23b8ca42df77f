//! Measurement of a panel's range: whether codes near its lower and its upper end differ.

use std::fmt;

use super::{exposed_at, mean};
use crate::config::RigFile;
use crate::frame::{Channel, Codes, Plane};
use crate::rig::exposure::Devices;
use crate::rig::{Moment, RigError};

/// Contrasts of codes at the ends of the panel's range, relative to black and white. A monitor that
/// takes full-range codes for limited ones shows the lowest 16 and the highest 16 alike.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredRange {
    /// Contrast of codes 0 and 16: 0.0023 at gamma 2.2.
    pub dark: f64,
    /// Contrast of codes 239 and 255: 0.13 at gamma 2.2.
    pub light: f64,
    /// Contrast of black and white, in counts.
    pub span: f64,
    /// Whether white saturates the camera, which hides the upper end.
    pub is_saturated: bool,
}

/// Least contrasts: a quarter of those at gamma 2.2; gammas of 1.8 to 2.6 exceed them. Guess.
const CONTRAST_MIN: [f64; 2] = [0.0006, 0.033];
/// Least span at which the lower end is judged: its contrast is then one count. Computed.
const SPAN_MIN: f64 = 440.0;

/// Measures the contrasts of neighbouring codes. They are shown side by side and then exchanged, so
/// that neither shading nor a backlight that follows the picture affects the result.
///
/// # Errors
/// When a device fails.
pub fn measure_range(rig: &mut Devices, file: &RigFile) -> Result<MeasuredRange, RigError> {
    let mut most = 0.0;
    let mut contrast = |left: u8, right: u8| -> Result<f64, RigError> {
        let [one, other] = [(left, right), (right, left)].map(|sides| quarters(rig, sides));
        let (one, other) = (one?, other?);
        most = one.iter().fold(most, |most, &level| f64::max(most, level));
        let differences = one.iter().zip(&other).map(|(a, b)| (a - b).abs());
        Ok(differences.fold(0.0, f64::max))
    };
    let [span, dark, light] = [contrast(0, 255)?, contrast(0, 16)?, contrast(239, 255)?];
    let share = |of: f64| of / span.max(1.0);
    let is_saturated = most > 0.97 * f64::from(file.camera.count_max());
    Ok(MeasuredRange { dark: share(dark), light: share(light), span, is_saturated })
}

/// Levels of the sensor's quarters while the panel shows two codes side by side.
fn quarters(rig: &mut Devices, (left, right): (u8, u8)) -> Result<[f64; 4], RigError> {
    let size = rig.panel.size();
    let side = |x: usize, _: usize| if x < size.width / 2 { left } else { right };
    let codes = Codes::from_planes([0; 3].map(|_| Plane::from_fn(size, side)));
    let flip = rig.panel.show(&codes)?;
    let exposed = exposed_at(rig, Moment(flip.at.0 + rig.timing.settle_ms / 1e3))?;
    let plane = exposed.counts.plane(Channel::Green);
    let part = |n: usize, whole: usize| (whole * (1 + 4 * n)) / 8..(whole * (3 + 4 * n)) / 8;
    let quarter = |n: usize| mean(plane, part(n / 2, plane.height()), part(n % 2, plane.width()));
    Ok(std::array::from_fn(quarter))
}

impl MeasuredRange {
    /// The fault and its remedy, if the range is clipped.
    pub fn fault(&self) -> Option<String> {
        let is_dark_alike = self.span >= SPAN_MIN && self.dark < CONTRAST_MIN[0];
        let is_light_alike = !self.is_saturated && self.light < CONTRAST_MIN[1];
        let alike = match (is_dark_alike, is_light_alike) {
            (_, true) => "239 and 255",
            (true, false) => "0 and 16",
            _ => return None,
        };
        Some(format!(
            "clipped range: the codes {alike} look alike; set the monitor's HDMI range (black \
             level) to full, or choose a PC video mode such as 2560×1440"
        ))
    }
}

impl fmt::Display for MeasuredRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (dark, light) = (1e2 * self.dark, 1e2 * self.light);
        write!(f, "0 to 16 is {dark:.2} % of white, 239 to 255 is {light:.1} %")?;
        if self.is_saturated { f.write_str(" (white saturates the sensor)") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{config, rig};

    /// A monitor that takes full-range codes for limited ones.
    struct Clipping(Box<dyn rig::Panel + Send>);

    impl rig::Panel for Clipping {
        fn size(&self) -> crate::frame::Size {
            self.0.size()
        }

        fn show(&mut self, codes: &Codes) -> Result<rig::Flip, RigError> {
            let stretched = |code: u8| {
                ((f64::from(code) - 16.0) * 255.0 / 219.0).round().clamp(0.0, 255.0) as u8
            };
            let planes = codes
                .planes()
                .each_ref()
                .map(|plane| Plane::from_fn(plane.size(), |x, y| stretched(plane.at(x, y))));
            self.0.show(&Codes::from_planes(planes))
        }
    }

    #[test]
    fn a_monitor_that_clips_the_range_is_a_fault() {
        let text = include_str!("../../rig-config/small.toml");
        let config = config::parse(text, "small.toml").unwrap_or_else(|e| panic!("{e}"));
        for clips in [false, true] {
            let mut devices = rig::open(&config).unwrap_or_else(|e| panic!("{e}"));
            if clips {
                let plain = std::mem::replace(&mut devices.panel, Box::new(NoPanel));
                devices.panel = Box::new(Clipping(plain));
            }
            let range = measure_range(&mut devices, &config).unwrap_or_else(|e| panic!("{e}"));
            let fault = range.fault();
            assert_eq!(fault.is_some(), clips, "{range}: {fault:?}");
            assert!(fault.is_none_or(|words| words.starts_with("clipped range: the codes 239")));
            assert_eq!(range.light > 0.1, !clips, "{range}");
        }
        let range = MeasuredRange { dark: 0.0001, light: 0.13, span: 600.0, is_saturated: false };
        assert!(range.fault().is_some_and(|words| words.contains("0 and 16")), "crushed blacks");
        assert!(MeasuredRange { span: 200.0, ..range }.fault().is_none(), "too few bits");
        let white = MeasuredRange { dark: 0.002, light: 0.01, is_saturated: true, ..range };
        assert!(white.fault().is_none() && white.to_string().contains("saturates"));
    }

    /// Stands in while another panel is wrapped.
    struct NoPanel;

    impl rig::Panel for NoPanel {
        fn size(&self) -> crate::frame::Size {
            crate::frame::Size::new(1, 1)
        }

        fn show(&mut self, _: &Codes) -> Result<rig::Flip, RigError> {
            Err(RigError::NoFrame { waited_ms: 0.0 })
        }
    }
}
