//! What was seen of a rig, in words: the numbers, and what to turn.

use super::{Aim, Brightness, PLACES, Sharpness};

/// Names of the nine places.
const NAMES: [&str; PLACES] = [
    "upper left",
    "upper middle",
    "upper right",
    "left",
    "middle",
    "right",
    "lower left",
    "lower middle",
    "lower right",
];
/// A place with less of the brightest one's light sees no panel. Guess: no backlight is as uneven.
const UNLIT_SHARE: f64 = 0.3;
/// Where white should be, as a share of the camera's range: bright, and full nowhere.
const WHITE: (f64, f64) = (0.5, 0.95);
/// Where an exposure is proposed to put it.
const WHITE_PROPOSED: f64 = 0.8;
/// Share of full sites above which white is too bright.
const CLIPPED_MAX: f64 = 0.001;
/// A light that changes by more from one exposure to the next is not exposed for whole periods.
/// Guess: three times what a good backlight does.
const FLICKER_MAX: f64 = 0.01;
/// Sensor pixels a panel pixel, at most: the panel is to be finer than the sensor, so that it shows
/// all that the sensor resolves.
const MAGNIFICATION_MAX: f64 = 1.0;
/// Angles that the pose of a calibration takes up by itself. Guess.
const TURNED_MAX_DEG: f64 = 3.0;
/// Share of the sensor's width by which the panel may be off the middle. Guess.
const OFFSET_MAX: f64 = 0.05;

impl Sharpness {
    /// Three rows of three: contrast in per cent, and how much of `best` that is.
    pub fn table(&self, best: &Sharpness) -> String {
        let cell = |n: usize| {
            let of_best = 100.0 * self.0[n] / best.0[n].max(f64::MIN_POSITIVE);
            format!("{:5.1} % ({of_best:3.0})", 100.0 * self.0[n])
        };
        let row =
            |first: usize| format!("  {}  {}  {}", cell(first), cell(first + 1), cell(first + 2));
        format!("{}\n{}\n{}", row(0), row(3), row(6))
    }

    /// The larger of both at each place.
    #[must_use]
    pub fn or_better(&self, other: &Sharpness) -> Sharpness {
        Sharpness(std::array::from_fn(|n| self.0[n].max(other.0[n])))
    }
}

impl Brightness {
    /// What to do, a sentence each, on a camera exposed for `exposure_ms` with a panel of
    /// `refresh_hz`; nothing where all is well.
    pub fn advice(&self, exposure_ms: f64, refresh_hz: f64) -> Vec<String> {
        let mut said = Vec::new();
        let refresh_ms = 1000.0 / refresh_hz;
        let whole = |ms: f64| refresh_ms * (ms / refresh_ms).round().max(1.0);
        if self.clipped_share > CLIPPED_MAX || self.white > WHITE.1 {
            let wanted = whole(exposure_ms * WHITE_PROPOSED / self.white.clamp(WHITE.1, 1.0));
            said.push(format!(
                "white is too bright ({:.0} % of the range, {:.2} % of the sites full): \
                 exposure-ms = {wanted:.1}, less gain, or a darker panel",
                100.0 * self.white,
                100.0 * self.clipped_share
            ));
        } else if self.white < WHITE.0 {
            let wanted = whole(exposure_ms * WHITE_PROPOSED / self.white.max(0.01));
            said.push(format!(
                "white is dark ({:.0} % of the range): exposure-ms = {wanted:.1} (whole refreshes)",
                100.0 * self.white
            ));
        }
        let unlit: Vec<&str> =
            (0..PLACES).filter(|&n| self.places[n] < UNLIT_SHARE).map(|n| NAMES[n]).collect();
        if !unlit.is_empty() {
            said.push(format!(
                "the sensor sees no panel at the {}: come nearer, or move the panel there",
                unlit.join(", ")
            ));
        }
        if self.flicker > FLICKER_MAX {
            said.push(format!(
                "the light changes by {:.1} % from one exposure to the next: expose for whole \
                 refreshes, and set the panel's brightness to its largest",
                100.0 * self.flicker
            ));
        }
        said
    }
}

impl Aim {
    /// What to do, a sentence each, on a sensor `width_px` wide; nothing where all is well.
    pub fn advice(&self, width_px: usize) -> Vec<String> {
        let mut said = Vec::new();
        if self.mirrored {
            said.push("left and right are swapped: a mirror, or a setting of the camera".into());
        }
        let [x, y] = self.offset_px;
        if x.hypot(y) > OFFSET_MAX * width_px as f64 {
            let (across, down) =
                (if x > 0.0 { "left" } else { "right" }, if y > 0.0 { "up" } else { "down" });
            said.push(format!(
                "move the panel in the picture {:.0} px {across} and {:.0} px {down}",
                x.abs(),
                y.abs()
            ));
        }
        if self.turned_deg.abs() > TURNED_MAX_DEG {
            let way = if self.turned_deg > 0.0 { "anticlockwise" } else { "clockwise" };
            said.push(format!("turn the panel in the picture {:.1}° {way}", self.turned_deg.abs()));
        }
        if self.magnification > MAGNIFICATION_MAX {
            said.push(format!(
                "a panel pixel covers {:.2} of the sensor's, allowed {MAGNIFICATION_MAX}: move \
                 away, or take a finer panel",
                self.magnification
            ));
        }
        said
    }
}
