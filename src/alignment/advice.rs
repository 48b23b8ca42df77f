//! Advice of `relens align` as rows of a condition, an action and a sentence, ordered so that no
//! action undoes an earlier one.

use std::fmt;

use super::{Aim, Brightness, PLACES};
use crate::frame::Size;

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
/// Least light of a place that counts as seeing the panel, as a share of the brightest place.
/// Guess: no backlight is as uneven.
const LIT_SHARE: f64 = 0.3;
/// Allowed range of the level of white, as a share of the camera's range.
const WHITE: (f64, f64) = (0.5, 0.95);
/// Level of white that a proposed exposure aims for.
const WHITE_PROPOSED: f64 = 0.8;
/// Largest allowed share of saturated sites.
const CLIPPED_MAX: f64 = 0.001;
/// Largest change of light between exposures of whole refreshes. Guess: three times that of a good
/// backlight.
const FLICKER_MAX: f64 = 0.01;
/// Most sensor pixels per panel pixel: the panel must resolve all that the sensor resolves.
const MAGNIFICATION_MAX: f64 = 1.0;
/// Size of a well-placed panel in the picture, relative to the sensor.
const REACH: f64 = 1.03;
/// Largest allowed rotation, degrees, which calibration corrects. Guess.
const ROTATION_MAX_DEG: f64 = 3.0;
/// Largest allowed offset of the panel's middle, as a share of the sensor's width. Guess.
const OFFSET_MAX: f64 = 0.05;
/// Largest difference in distance between opposite sides of the panel, as a share of the distance.
/// Guess: with a 25 mm lens at f/4 and 6 µm pixels it costs a fifth of a pixel of blur at the rims.
const KEYSTONE_MAX: f64 = 0.01;

/// What to do about the focus ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FocusTurn {
    /// Keep turning: the picture gets sharper.
    Continue,
    /// Turn back: the best focus was passed.
    Reverse,
    /// Turn past the best focus on both sides, since it is known only then.
    PassBest,
    /// Leave the ring: the focus is at its best.
    Stay,
}

/// Action recommended by a piece of advice. Directions are those of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// Move the panel so that it is seen at the unlit places, too.
    Cover,
    /// Set the exposure time, ms.
    Expose(f64),
    /// Multiply the panel's light by this factor.
    Dim(f64),
    /// Multiply the panel's distance by this factor.
    Distance(f64),
    /// Use a panel with more pixels.
    ReplacePanel,
    /// Move the panel right and down, sensor pixels.
    Move([f64; 2]),
    /// Rotate the panel clockwise, degrees.
    Rotate(f64),
    /// Turn the right (negative: left) or the lower (negative: upper) side nearer, by a share of
    /// the distance.
    Nearer([f64; 2]),
    /// Turn the focus ring.
    Focus(FocusTurn),
    /// Another action, which the sentence describes.
    Other,
}

/// An action and the sentence for the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// The action.
    pub action: Action,
    sentence: String,
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.sentence)
    }
}

impl Advice {
    /// Advice if `condition` holds.
    fn when(condition: bool, action: Action, sentence: impl Into<String>) -> Option<Advice> {
        condition.then(|| Advice { action, sentence: sentence.into() })
    }

    /// Advice for a panel whose middle is not in view.
    pub fn find() -> Advice {
        let sentence = "the panel's middle is not in view: aim the camera at it, or turn the \
                        focus ring a good deal";
        Advice { action: Action::Other, sentence: sentence.to_owned() }
    }

    /// Advice on the focus ring.
    pub fn focus(turn: FocusTurn) -> Advice {
        let sentence = match turn {
            FocusTurn::Continue => "focus: getting sharper, keep turning",
            FocusTurn::Reverse => "focus: past the best, turn back",
            FocusTurn::PassBest => "focus: turn past the best on both sides, then back to it",
            FocusTurn::Stay => "focus: this is the best; tape ring and aperture",
        };
        Advice { action: Action::Focus(turn), sentence: sentence.to_owned() }
    }

    /// Advice on a change of light between exposures, as a share.
    pub fn flicker(share: f64) -> Option<Advice> {
        Advice::when(
            share > FLICKER_MAX,
            Action::Other,
            format!(
                "the light changes by {:.1} % from one exposure to the next: expose for whole \
                 refreshes, and set the panel to its full brightness",
                100.0 * share
            ),
        )
    }
}

/// Names of the places where `condition` holds.
fn names(values: &[f64; PLACES], condition: impl Fn(f64) -> bool) -> String {
    let found = NAMES.iter().zip(values).filter(|(_, value)| condition(**value));
    found.map(|(name, _)| *name).collect::<Vec<&str>>().join(", ")
}

impl Brightness {
    /// Advice for a panel of `refresh_hz`.
    pub fn advice(&self, refresh_hz: f64) -> Vec<Advice> {
        let refresh_ms = 1000.0 / refresh_hz;
        let Brightness { white, clipped_share, exposed_ms, .. } = *self;
        let is_bright = clipped_share > CLIPPED_MAX || white > WHITE.1;
        let is_dark = !is_bright && white < WHITE.0;
        // Clipped light is brighter than its counts.
        let level = match (is_bright, clipped_share > 0.1) {
            (true, true) => 2.0,
            (true, false) => white.max(WHITE.1),
            (false, _) => white.max(0.01),
        };
        let times = WHITE_PROPOSED / level;
        let refreshes = exposed_ms * times / refresh_ms;
        let refreshes = if is_bright { refreshes.floor() } else { refreshes.round() }.max(1.0);
        let exposure_ms = refreshes * refresh_ms;
        let is_shortest = (exposed_ms / refresh_ms).round() <= 1.0;
        let fault = if is_dark { "white is too dark" } else { "white is too bright" };
        let unlit = names(&self.places, |light| light < LIT_SHARE);
        let rows = [
            Advice::when(
                is_bright && is_shortest,
                Action::Dim(times),
                format!(
                    "white is too bright, and one refresh is the shortest exposure without \
                     flicker: reduce the gain, or dim the panel to {:.0} %",
                    100.0 * times
                ),
            ),
            Advice::when(
                is_dark || is_bright && !is_shortest,
                Action::Expose(exposure_ms),
                format!(
                    "{fault} ({:.0} % of the range, {:.2} % of the sites saturated): set \
                     exposure-ms = {exposure_ms:.2} (whole refreshes)",
                    100.0 * white,
                    100.0 * clipped_share
                ),
            ),
            Advice::when(
                !unlit.is_empty(),
                Action::Cover,
                format!(
                    "the camera sees past the panel at the {unlit}: move the panel there, or \
                     nearer"
                ),
            ),
        ];
        rows.into_iter().flatten().collect()
    }
}

impl Aim {
    /// Advice for a `panel` on a `sensor`, both in pixels.
    pub fn advice(&self, panel: Size, sensor: Size) -> Vec<Advice> {
        let rotate = -self.rotation_deg;
        let way = if rotate < 0.0 { "anticlockwise" } else { "clockwise" };
        let mut rows = vec![
            Advice::when(
                self.mirrored,
                Action::Other,
                "left and right are swapped: remove the mirror, or change the camera's setting",
            ),
            Advice::when(
                rotate.abs() > ROTATION_MAX_DEG,
                Action::Rotate(rotate),
                format!("rotate the panel in the picture by {:.1}° {way}", rotate.abs()),
            ),
        ];
        let sides = [panel.width, panel.height].map(|pixels| pixels as f64);
        // Factors by which the panel has to grow in the picture, and by which it may at most.
        let needed = (0..2).map(|k| self.span_px[k] * REACH / sides[k]).fold(0.0, f64::max);
        let most = MAGNIFICATION_MAX / self.magnification;
        rows.extend(self.distance_advice(needed, most));
        // Centring the panel equalises the reserves on opposite sides.
        let [left, right, top, bottom] = self.reserve_px;
        let [x, y] = [left - right, top - bottom].map(|more| 0.5 * more * self.magnification);
        let across = if x < 0.0 { "left" } else { "right" };
        let down = if y < 0.0 { "up" } else { "down" };
        rows.push(Advice::when(
            x.hypot(y) > OFFSET_MAX * sensor.width as f64 || !self.covers() && needed <= REACH,
            Action::Move([x, y]),
            format!(
                "move the panel in the picture by {:.0} px {across} and {:.0} px {down}",
                x.abs(),
                y.abs()
            ),
        ));
        let [across, down] = self.keystone;
        for (share, action, names) in
            [(across, [-across, 0.0], ["left", "right"]), (down, [0.0, -down], ["upper", "lower"])]
        {
            rows.push(Advice::when(
                share.abs() > KEYSTONE_MAX,
                Action::Nearer(action),
                format!(
                    "the {} side of the panel in the picture is {:.1} % farther away than the \
                     opposite one: turn it nearer",
                    names[usize::from(share < 0.0)],
                    100.0 * share.abs()
                ),
            ));
        }
        rows.into_iter().flatten().collect()
    }

    /// Advice on the panel's distance, from the factor by which it needs to grow in the picture,
    /// and the `most` by which it may.
    fn distance_advice(&self, needed: f64, most: f64) -> [Option<Advice>; 2] {
        let is_unsuitable = needed > most * REACH;
        let sees_past = needed > REACH;
        let times = if sees_past { 1.0 / needed } else { 1.0 / most.max(needed) };
        let why = if sees_past {
            "the sensor sees past the panel".to_owned()
        } else {
            format!(
                "a panel pixel covers {:.2} of the sensor's, allowed {MAGNIFICATION_MAX}",
                self.magnification
            )
        };
        let way = if times < 1.0 { "nearer" } else { "away" };
        let [across, down] = self.span_px.map(|span| span * self.magnification * REACH);
        [
            Advice::when(
                is_unsuitable,
                Action::ReplacePanel,
                format!(
                    "no distance lets this panel both fill the camera's view and be finer than the \
                     sensor: use a panel of {across:.0}×{down:.0} pixels or more"
                ),
            ),
            Advice::when(
                !is_unsuitable && (sees_past || most < 1.0),
                Action::Distance(times),
                format!("{why}: move the panel {way}, to {:.0} % of its distance", 100.0 * times),
            ),
        ]
    }
}
