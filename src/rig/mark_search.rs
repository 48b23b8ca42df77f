//! Locates the frame marks of a rig: a coarse geometry from dots, then the contrast of the marks.
//!
//! No frame can be identified yet, and frames may be stale, torn or missing. Every step therefore
//! decides by majority, and the last one verifies that known marks are read.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::RigError;
use super::coarse_geometry::{CoarseGeometry, Place};
use super::frame_mark::{FrameMarks, MarkPlace, MarkReading};
use crate::frame::{Codes, Counts, Plane, Size};

/// Dots across and down the panel. The sensor sees some of them; five that agree suffice.
const DOTS: [usize; 2] = [5, 4];
/// Dots across and down the sensor, once its place on the panel is known.
const SENSOR_DOTS: [usize; 2] = [4, 3];
const ORDER_SEED: u64 = 20;
/// Side of a dot as a share of the panel's height: wider than the blur of any usable lens.
const DOT_SHARE: f64 = 0.05;
/// Minimum brightness of a dot relative to the brightest; dimmer spots are glare.
const DOT_BRIGHTNESS_MIN: f64 = 0.25;
/// Tolerance of a dot's place as a share of the sensor's width: the distortion of a cheap lens, far
/// less than the distance to the next dot.
const TOLERANCE_SHARE: f64 = 0.01;
/// Number of marks shown to learn the contrast of the bits.
const LEARNED: usize = 7;
/// Attempts per step.
const ROUNDS: usize = 4;

/// Shows a picture and returns a frame, probably of that picture.
pub type Shoot<'a> = dyn FnMut(&Codes) -> Result<Counts, RigError> + 'a;

/// Locates the marks of a rig.
///
/// # Errors
/// [`RigError::NoMarks`] if the panel or the marks are not visible; errors of `shoot`.
pub fn find_marks(
    place: MarkPlace,
    panel: Size,
    shoot: &mut Shoot,
) -> Result<FrameMarks, RigError> {
    let geometry = find_geometry(place.sensor, panel, shoot)?;
    learn_marks(place, &geometry, panel, shoot)
}

/// Learns the contrast of the marks at `place`, and verifies that they can be read.
fn learn_marks(
    place: MarkPlace,
    geometry: &CoarseGeometry,
    panel: Size,
    shoot: &mut Shoot,
) -> Result<FrameMarks, RigError> {
    let mut marks = FrameMarks::new(place, geometry, panel).ok_or_else(|| {
        let what = "the panel does not fill the sensor's upper and lower edge, where the marks are";
        RigError::NoMarks { what: what.to_owned() }
    })?;
    for round in 0..ROUNDS {
        // Each bit is light in some of these numbers and dark in others.
        let number = |n: usize| (n * 37 + round * 101) as u8;
        let mut frames = Vec::with_capacity(LEARNED);
        for number in (0..LEARNED).map(number) {
            let seen = show_mark(&marks, panel, number, shoot)?;
            frames.extend(seen.map(|counts| (number, counts)));
        }
        if frames.len() * 2 <= LEARNED || !marks.learn(&frames) {
            continue;
        }
        let mut right = 0;
        for n in 0..LEARNED {
            let number = number(n).wrapping_add(128);
            let seen = show_mark(&marks, panel, number, shoot)?;
            let is_read = |counts| marks.read(&counts) == MarkReading::Number(number);
            right += usize::from(seen.is_some_and(is_read));
        }
        if right * 2 > LEARNED {
            return Ok(marks);
        }
    }
    let what = "the marks at the sensor's upper and lower edge cannot be read. Is the picture \
                sharp and bright enough there?";
    Err(RigError::NoMarks { what: what.to_owned() })
}

fn show_mark(
    marks: &FrameMarks,
    panel: Size,
    number: u8,
    shoot: &mut Shoot,
) -> Result<Option<Counts>, RigError> {
    let mut codes = Codes::zeros(panel);
    marks.paint(&mut codes, number);
    if_any(shoot(&codes))
}

/// Turns missing and wrong frames into `None`.
fn if_any(shot: Result<Counts, RigError>) -> Result<Option<Counts>, RigError> {
    match shot {
        Ok(counts) => Ok(Some(counts)),
        Err(RigError::NoFrame { .. } | RigError::NotThisPicture { .. }) => Ok(None),
        Err(grave) => Err(grave),
    }
}

/// Finds the sensor's view with dots over the whole panel, then fits a homography to dots over the
/// sensor, since a homography is accurate only near its dots.
fn find_geometry(sensor: Size, panel: Size, shoot: &mut Shoot) -> Result<CoarseGeometry, RigError> {
    let over_panel: Vec<Place> = grid(DOTS, panel).collect();
    let tolerance_px = (TOLERANCE_SHARE * sensor.width as f64).max(3.0);
    // The wider tolerance covers perspective, which an affine map lacks.
    let affine = |dots: &[(Place, Place)]| CoarseGeometry::fit_affine(dots, 3.0 * tolerance_px);
    let rough = fit_dots(sensor, panel, &over_panel, shoot, &affine)?;
    let is_shown = |[x, y]: &Place| {
        (0.0..panel.width as f64).contains(x) && (0.0..panel.height as f64).contains(y)
    };
    let on_panel = grid(SENSOR_DOTS, sensor).map(|at| rough.panel_at(at));
    let over_sensor: Vec<Place> = on_panel.filter(is_shown).collect();
    fit_dots(sensor, panel, &over_sensor, shoot, &|dots| CoarseGeometry::fit(dots, tolerance_px))
}

/// Centres of `columns` × `rows` equal parts of an area of `size`, row by row.
fn grid([columns, rows]: [usize; 2], size: Size) -> impl Iterator<Item = Place> {
    let middle =
        |n: usize, of: usize, length: usize| (n as f64 + 0.5) / of as f64 * length as f64 - 0.5;
    (0..columns * rows).map(move |n| {
        [middle(n % columns, columns, size.width), middle(n / columns, rows, size.height)]
    })
}

/// Fits a geometry to dots, given by their panel and sensor places; `None` if too few agree.
type FitDots<'a> = dyn Fn(&[(Place, Place)]) -> Option<CoarseGeometry> + 'a;

/// Shows the dots, several times if necessary, until enough of them agree.
fn fit_dots(
    sensor: Size,
    panel: Size,
    places: &[Place],
    shoot: &mut Shoot,
    fit: &FitDots,
) -> Result<CoarseGeometry, RigError> {
    let side = (DOT_SHARE * panel.height as f64).max(4.0);
    let mut dots: Vec<(Place, Place)> = Vec::new();
    for round in 0..ROUNDS {
        let mut frames = Vec::new();
        for n in shuffled(places.len(), round) {
            let centre = places[n];
            if let Some(counts) = if_any(shoot(&dot(panel, centre, side)))? {
                let [_, green, _] = counts.into_planes();
                frames.push((centre, green));
            }
        }
        dots.extend(spots(sensor, &frames));
        if let Some(geometry) = fit(&dots) {
            return Ok(geometry);
        }
        if dots.len() < 2 {
            break;
        }
    }
    Err(RigError::NoMarks {
        what: format!(
            "of dots shown at {} places {} were seen, but no five of them fit a flat panel. \
             Is the panel in view and lit, and the camera's exposure right?",
            places.len(),
            dots.len()
        ),
    })
}

/// Random order of dots: in a regular one, frames one picture late would look like a displaced
/// panel.
fn shuffled(count: usize, round: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(ORDER_SEED + round as u64));
    order
}

/// Panel and sensor places of the dots that are wholly in view.
fn spots(sensor: Size, frames: &[(Place, Plane<u16>)]) -> Vec<(Place, Place)> {
    // The minimum over all frames contains no dot.
    let mut dark = Plane::filled(sensor, u16::MAX);
    for (_, frame) in frames {
        dark.update(frame, |least, count| *least = count.min(*least));
    }
    let spot = |(at, frame): &(Place, _)| Some((*at, BrightSpot::in_frame(frame, &dark)?));
    let seen: Vec<(Place, BrightSpot)> = frames.iter().filter_map(spot).collect();
    let brightest = seen.iter().map(|(_, spot)| spot.height).fold(0.0, f64::max);
    let bright = |spot: &BrightSpot| spot.whole && spot.height > DOT_BRIGHTNESS_MIN * brightest;
    let all = seen.into_iter().filter(|(_, spot)| bright(spot));
    all.map(|(at, spot)| (at, spot.centre)).collect()
}

fn dot(panel: Size, centre: Place, side: f64) -> Codes {
    let near = |at: usize, centre: f64| (at as f64 - centre).abs() <= side / 2.0;
    let lit = |x, y| if near(x, centre[0]) && near(y, centre[1]) { 255 } else { 0 };
    let plane = Plane::from_fn(panel, lit);
    Codes::from_fn(|_| plane.clone())
}

struct BrightSpot {
    centre: Place,
    /// Peak counts above the dark level.
    height: f64,
    /// Whether the spot is clear of the frame's border.
    whole: bool,
}

impl BrightSpot {
    fn in_frame(frame: &Plane<u16>, dark: &Plane<u16>) -> Option<BrightSpot> {
        let above = |x: usize, y: usize| f64::from(frame.at(x, y) - dark.at(x, y));
        let (width, height) = (frame.width(), frame.height());
        // Means of 3 × 3 pixels suppress hot pixels.
        let smooth = |x: usize, y: usize| {
            (0..9).map(|n| above(x + n % 3 - 1, y + n / 3 - 1)).sum::<f64>() / 9.0
        };
        let inner = (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y)));
        let peak = inner.clone().map(|(x, y)| smooth(x, y)).fold(0.0, f64::max);
        let (mut mass, mut sum, mut whole) = (0.0, [0.0, 0.0], true);
        for (x, y) in inner {
            let value = smooth(x, y);
            if value > 0.5 * peak {
                mass += value;
                sum = [sum[0] + value * x as f64, sum[1] + value * y as f64];
                whole &= x > 1 && y > 1 && x + 2 < width && y + 2 < height;
            }
        }
        let centre = [sum[0] / mass, sum[1] / mass];
        (mass > 0.0).then_some(BrightSpot { centre, height: peak, whole })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that sees the middle of the panel, whose frames are `late` pictures late.
    fn camera(late: usize) -> impl FnMut(&Codes) -> Result<Counts, RigError> {
        let (panel, sensor) = (Size::new(240, 180), Size::new(160, 128));
        let mut pipe = std::collections::VecDeque::from(vec![Codes::zeros(panel); late]);
        move |codes| {
            pipe.push_back(codes.clone());
            let seen = pipe.pop_front().unwrap_or_else(|| codes.clone());
            let counts = |plane: &Plane<u8>| {
                Plane::from_fn(sensor, |x, y| {
                    16 + u16::from(plane.at(35 + x * 107 / 100, 20 + y * 107 / 100))
                })
            };
            let [red, green, blue] = seen.planes().each_ref().map(counts);
            Ok(Counts::from_planes([red, green, blue]))
        }
    }

    fn place() -> MarkPlace {
        MarkPlace::still(Size::new(160, 128), 2, 6, 2)
    }

    #[test]
    fn marks_are_found_through_a_prompt_camera() {
        find_marks(place(), Size::new(240, 180), &mut camera(0)).unwrap_or_else(|e| panic!("{e}"));
    }

    #[test]
    fn late_frames_give_no_geometry() {
        for late in 1..4 {
            let found = find_marks(place(), Size::new(240, 180), &mut camera(late));
            let Err(RigError::NoMarks { what }) = found else { panic!("{late} late: {found:?}") };
            assert!(what.contains("no five of them fit a flat panel"), "{late} late: {what}");
        }
    }
}
