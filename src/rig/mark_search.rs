//! Finds out where the frame marks go on this rig: dots for the coarse geometry, then the marks
//! themselves.
//!
//! Runs before any frame can be proven, on a rig whose frames may be stale, torn or missing: so it
//! asks for a majority at every step, and ends by reading marks it knows.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::RigError;
use super::coarse_geometry::{CoarseGeometry, Place};
use super::frame_mark::{FrameMarks, MarkPlace, MarkReading};
use crate::frame::{Codes, Counts, Plane, Size};

/// Dots across and down the panel. The sensor sees only some; five that agree are enough.
const DOTS: [usize; 2] = [5, 4];
/// Dots across and down the sensor, once it is known where it looks.
const SENSOR_DOTS: [usize; 2] = [4, 3];
/// Seed of the order in which dots are shown.
const ORDER_SEED: u64 = 20;
/// A dot's side as a share of the panel's height: wider than any blur a lens worth restoring has.
const DOT_SHARE: f64 = 0.05;
/// A dot dimmer than this share of the brightest one is taken for glare.
const DOT_BRIGHTNESS_MIN: f64 = 0.25;
/// How far a dot may be from its place as a share of the sensor's width: a cheap lens's distortion,
/// and far less than the way to the next dot.
const TOLERANCE_SHARE: f64 = 0.01;
/// Marks shown to learn their contrast, and how often that is tried.
const LEARNED: usize = 7;
const ROUNDS: usize = 4;

/// Shows one picture and returns a frame that is probably its own.
pub type Shoot<'a> = dyn FnMut(&Codes) -> Result<Counts, RigError> + 'a;

/// The marks of this rig.
///
/// # Errors
/// [`RigError::NoMarks`] when panel and sensor do not see eye to eye; else whatever `shoot` fails
/// with.
pub fn find_marks(
    place: MarkPlace,
    panel: Size,
    shoot: &mut Shoot,
) -> Result<FrameMarks, RigError> {
    let geometry = find_geometry(place.sensor, panel, shoot)?;
    learned(place, &geometry, panel, shoot)
}

/// Marks at `place`, whose contrast is known and which were read.
fn learned(
    place: MarkPlace,
    geometry: &CoarseGeometry,
    panel: Size,
    shoot: &mut Shoot,
) -> Result<FrameMarks, RigError> {
    let mut marks = FrameMarks::new(place, geometry, panel).ok_or_else(|| RigError::NoMarks {
        what: "the panel does not fill the sensor's upper and lower edge, where the marks go"
            .to_owned(),
    })?;
    for round in 0..ROUNDS {
        // Every bit is light in some of these and dark in others.
        let number = |n: usize| (n * 37 + round * 101) as u8;
        let mut frames = Vec::with_capacity(LEARNED);
        for n in 0..LEARNED {
            if let Some(counts) = show_mark(&marks, panel, number(n), shoot)? {
                frames.push((number(n), counts));
            }
        }
        if frames.len() * 2 <= LEARNED || !marks.learn(&frames) {
            continue;
        }
        let mut right = 0;
        for n in 0..LEARNED {
            let number = number(n).wrapping_add(128);
            let seen = show_mark(&marks, panel, number, shoot)?;
            right += usize::from(
                seen.is_some_and(|counts| marks.read(&counts) == MarkReading::Number(number)),
            );
        }
        if right * 2 > LEARNED {
            return Ok(marks);
        }
    }
    Err(RigError::NoMarks {
        what: "the marks at the sensor's upper and lower edge cannot be read; is the picture \
         sharp and bright enough there?"
            .to_owned(),
    })
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

/// A missing frame is no reason to give up here.
fn if_any(shot: Result<Counts, RigError>) -> Result<Option<Counts>, RigError> {
    match shot {
        Ok(counts) => Ok(Some(counts)),
        Err(RigError::NoFrame { .. } | RigError::NotThisPicture { .. }) => Ok(None),
        Err(grave) => Err(grave),
    }
}

/// Looks for the sensor on the panel with dots all over the panel, then measures with dots all over
/// the sensor: a homography is only good where its dots were.
fn find_geometry(sensor: Size, panel: Size, shoot: &mut Shoot) -> Result<CoarseGeometry, RigError> {
    let middle =
        |n: usize, of: usize, length: usize| (n as f64 + 0.5) / of as f64 * length as f64 - 0.5;
    let over_panel: Vec<Place> = (0..DOTS[0] * DOTS[1])
        .map(|n| {
            [middle(n % DOTS[0], DOTS[0], panel.width), middle(n / DOTS[0], DOTS[1], panel.height)]
        })
        .collect();
    let tolerance_px = (TOLERANCE_SHARE * sensor.width as f64).max(3.0);
    // Perspective is not in an affine map; what it leaves is still far less than the way to the
    // next dot.
    let affine = |dots: &[(Place, Place)]| CoarseGeometry::fit_affine(dots, 3.0 * tolerance_px);
    let rough = fit_dots(sensor, panel, &over_panel, shoot, &affine)?;
    let over_sensor: Vec<Place> = (0..SENSOR_DOTS[0] * SENSOR_DOTS[1])
        .map(|n| {
            let (column, row) = (n % SENSOR_DOTS[0], n / SENSOR_DOTS[0]);
            let at = [
                middle(column, SENSOR_DOTS[0], sensor.width),
                middle(row, SENSOR_DOTS[1], sensor.height),
            ];
            rough.panel_at(at)
        })
        .filter(|[x, y]| {
            (0.0..panel.width as f64).contains(x) && (0.0..panel.height as f64).contains(y)
        })
        .collect();
    fit_dots(sensor, panel, &over_sensor, shoot, &|dots| CoarseGeometry::fit(dots, tolerance_px))
}

/// A geometry that the dots agree on, if there is one.
type FitDots<'a> = dyn Fn(&[(Place, Place)]) -> Option<CoarseGeometry> + 'a;

/// Shows dots until five agree. Frames of other dots are outvoted as long as they are few; one more
/// pass over all dots makes them fewer.
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
        let seen = spots(sensor, &frames);
        for (at, spot) in &seen {
            log::debug!(
                "dot at panel {:.0}, {:.0} seen at sensor {:.1}, {:.1}",
                at[0],
                at[1],
                spot[0],
                spot[1]
            );
        }
        dots.extend(seen);
        if let Some(geometry) = fit(&dots) {
            return Ok(geometry);
        }
        if dots.len() < 2 {
            break;
        }
    }
    Err(RigError::NoMarks {
        what: format!(
            "dots shown at {} places were seen {} times, and no five of them lie as on a flat \
             panel; is the \
             panel in view, lit, and the camera's exposure right?",
            places.len(),
            dots.len()
        ),
    })
}

/// An order without any: frames that come one picture late must not look like a panel elsewhere, as
/// they do when every dot is the same step away from the one before.
fn shuffled(count: usize, round: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    order.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(ORDER_SEED + round as u64));
    order
}

/// Where the dots shown are in their frames: panel place and sensor place of those seen whole.
fn spots(sensor: Size, frames: &[(Place, Plane<u16>)]) -> Vec<(Place, Place)> {
    // What is the same in all frames is not the dot; the least value of each pixel is free of any.
    let mut dark = Plane::filled(sensor, u16::MAX);
    for (_, frame) in frames {
        dark.data_mut()
            .iter_mut()
            .zip(frame.data())
            .for_each(|(least, &count)| *least = (*least).min(count));
    }
    let seen: Vec<(Place, BrightSpot)> = frames
        .iter()
        .filter_map(|(centre, frame)| Some((*centre, BrightSpot::in_frame(frame, &dark)?)))
        .collect();
    let brightest = seen.iter().map(|(_, spot)| spot.height).fold(0.0, f64::max);
    seen.iter()
        .filter(|(_, spot)| spot.whole && spot.height > DOT_BRIGHTNESS_MIN * brightest)
        .map(|(centre, spot)| (*centre, spot.centre))
        .collect()
}

fn dot(panel: Size, centre: Place, side: f64) -> Codes {
    let near = |at: usize, centre: f64| (at as f64 - centre).abs() <= side / 2.0;
    let plane =
        Plane::from_fn(
            panel,
            |x, y| if near(x, centre[0]) && near(y, centre[1]) { 255 } else { 0 },
        );
    Codes::from_planes([plane.clone(), plane.clone(), plane])
}

/// A bright spot in a frame.
struct BrightSpot {
    centre: Place,
    /// Counts above the dark at its brightest.
    height: f64,
    /// Whether it keeps clear of the frame's border.
    whole: bool,
}

impl BrightSpot {
    fn in_frame(frame: &Plane<u16>, dark: &Plane<u16>) -> Option<BrightSpot> {
        let above = |x: usize, y: usize| f64::from(frame.at(x, y) - dark.at(x, y));
        let (width, height) = (frame.width(), frame.height());
        // Means of 3 × 3: a hot pixel is no dot.
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
        (mass > 0.0).then(|| BrightSpot {
            centre: [sum[0] / mass, sum[1] / mass],
            height: peak,
            whole,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that sees the middle of the panel and delivers every frame `late` pictures late.
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
    fn frames_that_are_all_late_are_no_geometry() {
        for late in 1..4 {
            let found = find_marks(place(), Size::new(240, 180), &mut camera(late));
            let Err(RigError::NoMarks { what }) = found else { panic!("{late} late: {found:?}") };
            assert!(what.contains("no five of them lie as on a flat panel"), "{late} late: {what}");
        }
    }
}
