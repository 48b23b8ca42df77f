//! What to turn, move or set, in an order in which one does not undo the other, and in words.

use std::fmt;

use super::steadiness::{Linearity, Steadiness};
use super::{Aim, Brightness, PLACES};
use crate::frame::Size;

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
/// A light that goes by more over the captures has not warmed up. Guess.
const DRIFT_MAX: f64 = 0.01;
/// Counts this far from so many times the exposure's are refused by `relens calibrate`.
const BENT_MAX: f64 = 0.1;
/// A place that sees more light than in the dark, as a share of the range, sees a leak. Guess.
const LEAK_MAX: f64 = 0.001;
/// Sensor pixels a panel pixel, at most: the panel is to be finer than the sensor, so that it shows
/// all that the sensor resolves.
const MAGNIFICATION_MAX: f64 = 1.0;
/// Where a panel that must come nearer or go away is put, and how much of it is spared all around.
const SPARE: f64 = 1.03;
/// Angles that the pose of a calibration takes up by itself. Guess.
const TURNED_MAX_DEG: f64 = 3.0;
/// Share of the sensor's width by which the panel may be off the middle. Guess.
const OFFSET_MAX: f64 = 0.05;
/// Sides of the panel that differ by more in distance, as a share of it, are not in focus together.
/// Guess: of 25 mm at f/4 on 6 µm that is a fifth of a pixel of blur at the rims.
const KEYSTONE_MAX: f64 = 0.01;

/// What to do about the focus ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FocusTurn {
    /// It gets sharper.
    On,
    /// The best was passed.
    Back,
    /// Whether this is the best shows only when it was passed on both sides.
    PastTheBest,
    /// This is the best.
    There,
}

/// A side of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureSide {
    /// Left.
    Left,
    /// Right.
    Right,
    /// Upper.
    Upper,
    /// Lower.
    Lower,
}

impl PictureSide {
    fn name(self) -> &'static str {
        match self {
            PictureSide::Left => "left",
            PictureSide::Right => "right",
            PictureSide::Upper => "upper",
            PictureSide::Lower => "lower",
        }
    }
}

/// One thing to do. Left, right, up, down and clockwise are the picture's.
#[derive(Debug, Clone, PartialEq)]
pub enum Adjustment {
    /// The panel's middle is not seen.
    Find,
    /// These places see no panel.
    Light(Vec<usize>),
    /// Left and right are swapped.
    Unmirror,
    /// The exposure time to set, in whole refreshes.
    Expose {
        /// It.
        exposure_ms: f64,
        /// White now, as a share of the range.
        white: f64,
        /// Share of the data that is full.
        clipped_share: f64,
    },
    /// Even one refresh is too long: times the light.
    Darken {
        /// So many times the light that is there.
        times: f64,
    },
    /// Bring the panel to so many times its distance.
    Distance {
        /// So many times the distance.
        times: f64,
        /// Why.
        because: Because,
    },
    /// At no distance is the panel finer than the sensor and fills it.
    OtherPanel {
        /// Panel pixels that it should have, across and down.
        pixels: [f64; 2],
    },
    /// Move the panel in the picture, sensor pixels to the right and down.
    Move([f64; 2]),
    /// Turn the panel in the picture, degrees clockwise.
    Turn(f64),
    /// Turn this side of the panel nearer.
    Nearer {
        /// Which.
        side: PictureSide,
        /// By how much it is farther away than the opposite side, as a share of the distance.
        share: f64,
    },
    /// The light changes from exposure to exposure by this share.
    Flicker(f64),
    /// Bands of light change by this share.
    Bands(f64),
    /// The light went by this share over the captures.
    WarmUp(f64),
    /// Twice and three times the exposure bring so many times the counts.
    Straighten([f64; 2]),
    /// Light comes in, seen at these places.
    Seal(Vec<usize>),
    /// Turn the focus ring.
    Focus(FocusTurn),
}

/// Why the panel should stand at another distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Because {
    /// The sensor sees past it.
    SeesPast,
    /// A panel pixel covers so many of the sensor's.
    Coarse(f64),
}

fn names(places: &[usize]) -> String {
    places.iter().map(|&n| NAMES[n]).collect::<Vec<&str>>().join(", ")
}

impl Brightness {
    /// What to do with a panel of `refresh_hz`.
    pub fn adjustments(&self, refresh_hz: f64) -> Vec<Adjustment> {
        let mut all = Vec::new();
        let refresh_ms = 1000.0 / refresh_hz;
        let refreshes = |ms: f64| (ms / refresh_ms).round().max(1.0);
        let (white, clipped_share) = (self.white, self.clipped_share);
        if clipped_share > CLIPPED_MAX || white > WHITE.1 {
            // What is clipped is brighter than it looks.
            let times = WHITE_PROPOSED / if clipped_share > 0.1 { 2.0 } else { white.max(WHITE.1) };
            let fewer = (self.exposed_ms * times / refresh_ms).floor().max(1.0);
            all.push(match refreshes(self.exposed_ms) {
                1.0 => Adjustment::Darken { times },
                _ => Adjustment::Expose { exposure_ms: fewer * refresh_ms, white, clipped_share },
            });
        } else if white < WHITE.0 {
            let more = refreshes(self.exposed_ms * WHITE_PROPOSED / white.max(0.01));
            let exposure_ms = more * refresh_ms;
            all.push(Adjustment::Expose { exposure_ms, white, clipped_share });
        }
        let unlit: Vec<usize> = (0..PLACES).filter(|&n| self.places[n] < UNLIT_SHARE).collect();
        if !unlit.is_empty() {
            all.push(Adjustment::Light(unlit));
        }
        all
    }
}

impl Aim {
    /// What to do about a `panel` on a `sensor`.
    pub fn adjustments(&self, panel: Size, sensor: Size) -> Vec<Adjustment> {
        let mut all = Vec::new();
        if self.mirrored {
            all.push(Adjustment::Unmirror);
        }
        if self.turned_deg.abs() > TURNED_MAX_DEG {
            all.push(Adjustment::Turn(-self.turned_deg));
        }
        let sides = [panel.width, panel.height].map(|pixels| pixels as f64);
        // How many times larger the panel must be seen, to fill the sensor.
        let larger = (0..2).map(|k| self.span_px[k] * SPARE / sides[k]).fold(0.0, f64::max);
        let largest = MAGNIFICATION_MAX / self.magnification;
        if larger > largest * SPARE {
            let pixels = self.span_px.map(|span| span * self.magnification * SPARE);
            all.push(Adjustment::OtherPanel { pixels });
        } else if larger > SPARE {
            all.push(Adjustment::Distance { times: 1.0 / larger, because: Because::SeesPast });
        } else if largest < 1.0 {
            let times = 1.0 / largest.max(larger);
            let because = Because::Coarse(self.magnification);
            all.push(Adjustment::Distance { times, because });
        }
        // As much to spare on one side as on the other.
        let [left, right, top, bottom] = self.spare_px;
        let [x, y] = [left - right, top - bottom].map(|more| 0.5 * more * self.magnification);
        if x.hypot(y) > OFFSET_MAX * sensor.width as f64 || !self.covers() && larger <= SPARE {
            all.push(Adjustment::Move([x, y]));
        }
        let farther =
            [[PictureSide::Left, PictureSide::Right], [PictureSide::Upper, PictureSide::Lower]];
        for (share, sides) in self.keystone.into_iter().zip(farther) {
            if share.abs() > KEYSTONE_MAX {
                let side = sides[usize::from(share < 0.0)];
                all.push(Adjustment::Nearer { side, share: share.abs() });
            }
        }
        all
    }
}

impl Steadiness {
    /// What to do about it.
    pub fn adjustments(&self) -> Vec<Adjustment> {
        let flicker = (self.flicker > FLICKER_MAX).then_some(Adjustment::Flicker(self.flicker));
        let bands = (self.bands > FLICKER_MAX).then_some(Adjustment::Bands(self.bands));
        let drift = (self.drift.abs() > DRIFT_MAX).then_some(Adjustment::WarmUp(self.drift));
        flicker.into_iter().chain(bands).chain(drift).collect()
    }
}

impl Linearity {
    /// What to do about it.
    pub fn adjustments(&self) -> Vec<Adjustment> {
        let [twice, thrice] = self.times;
        let straight = |found: f64, times: f64| (found / times - 1.0).abs() <= BENT_MAX;
        let bent = !(straight(twice, 2.0) && straight(thrice, 3.0));
        bent.then_some(Adjustment::Straighten(self.times)).into_iter().collect()
    }
}

/// What to do about a `flicker` seen from exposure to exposure.
pub fn flickers(flicker: f64) -> Option<Adjustment> {
    (flicker > FLICKER_MAX).then_some(Adjustment::Flicker(flicker))
}

/// What to do about places that see so much `more` than in the dark, as a share of the range.
pub fn leaks(more: &[f64; PLACES]) -> Option<Adjustment> {
    let leaking: Vec<usize> = (0..PLACES).filter(|&n| more[n] > LEAK_MAX).collect();
    (!leaking.is_empty()).then_some(Adjustment::Seal(leaking))
}

impl fmt::Display for Adjustment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Adjustment::Find => {
                write!(
                    f,
                    "the panel's middle is not in view: aim the camera at it, or turn the \
                           focus ring a good deal"
                )
            }
            Adjustment::Light(places) => {
                write!(
                    f,
                    "no panel is seen at the {}: move the panel there, or nearer",
                    names(places)
                )
            }
            Adjustment::Seal(places) => {
                write!(f, "light comes in, seen at the {}: felt over that seam", names(places))
            }
            Adjustment::Unmirror => {
                write!(f, "left and right are swapped: a mirror, or a setting of the camera")
            }
            Adjustment::Expose { exposure_ms, white, clipped_share } => {
                let what = if *white < WHITE.0 { "white is dark" } else { "white is too bright" };
                write!(
                    f,
                    "{what} ({:.0} % of the range, {:.2} % of the sites full): set exposure-ms = \
                     {exposure_ms:.2} (whole refreshes)",
                    100.0 * white,
                    100.0 * clipped_share
                )
            }
            Adjustment::Darken { times } => write!(
                f,
                "white is too bright, and one refresh is the shortest exposure without flicker: \
                 set less gain, or the panel to {:.0} % of the light it gives",
                100.0 * times
            ),
            Adjustment::Distance { times, because } => {
                let way = if *times < 1.0 { "nearer" } else { "away" };
                match because {
                    Because::SeesPast => write!(f, "the sensor sees past the panel")?,
                    Because::Coarse(found) => write!(
                        f,
                        "a panel pixel covers {found:.2} of the sensor's, allowed \
                         {MAGNIFICATION_MAX}"
                    )?,
                }
                write!(f, ": bring the panel {way}, to {:.0} % of its distance", 100.0 * times)
            }
            Adjustment::OtherPanel { pixels: [across, down] } => write!(
                f,
                "at no distance the panel both fills the sensor and is finer than it: take one of \
                 {across:.0}×{down:.0} pixels or more"
            ),
            Adjustment::Move([x, y]) => {
                let across = if *x < 0.0 { "left" } else { "right" };
                let down = if *y < 0.0 { "up" } else { "down" };
                let (x, y) = (x.abs(), y.abs());
                write!(f, "move the panel in the picture {x:.0} px {across} and {y:.0} px {down}")
            }
            Adjustment::Turn(degrees) => {
                let way = if *degrees < 0.0 { "anticlockwise" } else { "clockwise" };
                write!(f, "turn the panel in the picture {:.1}° {way}", degrees.abs())
            }
            Adjustment::Nearer { side, share } => write!(
                f,
                "the picture's {} side of the panel is {:.1} % farther away than the opposite one: \
                 turn it nearer",
                side.name(),
                100.0 * share
            ),
            Adjustment::Flicker(share) => write!(
                f,
                "the light changes by {:.1} % from one exposure to the next: expose for whole \
                 refreshes, and set the panel's brightness to its largest",
                100.0 * share
            ),
            Adjustment::Bands(share) => write!(
                f,
                "bands across the picture change by {:.1} %: the exposure is no whole number of \
                 the backlight's periods; set the panel's brightness to its largest",
                100.0 * share
            ),
            Adjustment::WarmUp(share) => write!(
                f,
                "the light went {} by {:.1} %: let the panel warm up, and switch its automatic \
                 brightness off",
                if *share < 0.0 { "down" } else { "up" },
                100.0 * share.abs()
            ),
            Adjustment::Straighten([twice, thrice]) => write!(
                f,
                "2 and 3 times the exposure bring {twice:.2} and {thrice:.2} times the counts: \
                 switch the camera's gamma, contrast and automatic gain off"
            ),
            Adjustment::Focus(FocusTurn::On) => write!(f, "focus: it gets sharper, turn on"),
            Adjustment::Focus(FocusTurn::Back) => {
                write!(f, "focus: less sharp than the best, turn back")
            }
            Adjustment::Focus(FocusTurn::PastTheBest) => {
                write!(f, "focus: turn the ring past the best on both sides, then back to it")
            }
            Adjustment::Focus(FocusTurn::There) => {
                write!(f, "focus: this is the best; tape ring and aperture")
            }
        }
    }
}
