//! Linearity of the camera: one gradation from black to white at one, two and three times the
//! exposure, hence under one, two and three times the light. A gamma or a knee goes unnoticed in
//! every flat and distorts blur. All levels are in one picture, so a backlight's flicker between
//! captures affects them alike.

use super::session::Session;
use super::{CalibrateError, judge};
use crate::calibration::CameraCurve;
use crate::calibration::camera_curve::Exposures;
use crate::frame::{Channel, Frame, Plane, SensorSpace, Size};
use crate::patterns::{self, Gradation};

/// Multiples of the exposure at which the gradation is captured.
const TIMES: [f64; 3] = [1.0, 2.0, 3.0];
/// Captures of the gradation at each exposure; two halve the variance of flicker.
const CAPTURES_EACH: usize = 2;
/// Number of blocks of the gradation across the panel: they are wide against any workable blur.
const BLOCKS: usize = 12;
/// Number of levels of the gradation, as for a panel's response.
const LEVELS: usize = 52;
/// Side of a cell whose mean is read, sensor pixels.
const CELL_PX: usize = 8;
/// Largest range of counts within a cell, as a share of its mean plus a sixteenth of full scale;
/// above it the cell lies on a border between blocks. Guess: noise stays below it, even in the
/// dark.
const EVEN_SHARE: f32 = 0.2;
const GRADATION_SEED: u64 = 77;
/// Number of groups of cells of one channel, by brightness; each group gives one light.
const GROUPS: usize = 40;
/// Share of full scale; a cell with a pixel above it may be partly clipped.
const CLIPPED_SHARE: f32 = 0.97;
/// Share of full scale at the longest exposure up to which linearity is judged: below a sensor's
/// knee.
const JUDGED_SHARE: f64 = 0.75;
/// Largest bend of a curve that counts as straight, as a share of full scale: one code of an 8-bit
/// photo, and more than the error from 0.3 % of flicker.
const STRAIGHT_MAX: f32 = 0.004;
/// Largest relative deviation of counts from the multiple of the exposure: twice that of a sensor's
/// knee near its full well, a third of that of a webcam's gamma. Guess.
pub(super) const BENT_MAX: f64 = 0.1;

/// Captures of the measurement: two of black and two of the gradation at each exposure, and one
/// after restoring the exposure. The first capture after a change may have the previous exposure.
pub(super) const CAPTURES: usize = TIMES.len() * (2 + CAPTURES_EACH) + 1;

/// The first multiple of the exposure at which the `counts` over black of one light, at [`TIMES`]
/// the exposure, deviate too much, with their ratio to the first.
fn bend(counts: [f64; 3]) -> Option<(f64, f64)> {
    let mut ratios = TIMES.into_iter().zip(counts.map(|count| count / counts[0]));
    let allowed = 1.0 - BENT_MAX..=1.0 + BENT_MAX;
    // Negated so that NaN deviates too.
    ratios.find(|(times, found)| !allowed.contains(&(found / times)))
}

/// Measures the camera's curve, given the counts of a `black` panel. The curve is straight if the
/// exposure cannot be set. Counts that bend more than a sensor's are an error.
pub(super) fn measure(
    session: &mut Session<'_>,
    black: &Frame<SensorSpace>,
) -> Result<CameraCurve, CalibrateError> {
    session.step("linearity");
    let Some(lights) = lights(session)? else {
        log::debug!("the exposure cannot be set: counts are taken as linear in light");
        return Ok(CameraCurve::straight());
    };
    let black = black.planes().iter().map(Plane::mean).sum::<f64>() / 3.0;
    let full = f64::from(session.layout.saturated) - black;
    for (c, lights) in Channel::ALL.into_iter().zip(&lights) {
        judge::straight(c, bend(brightest(lights, full).ok_or_else(judge::no_curve)?))?;
    }
    let curve = CameraCurve::fit(&lights.concat(), black, full).ok_or_else(judge::no_curve)?;
    log::debug!("the camera's counts bend by {:.4} of full scale: {curve:?}", curve.bend());
    Ok(if curve.bend() <= STRAIGHT_MAX { CameraCurve::straight() } else { curve })
}

/// Measures the lights of each channel at [`TIMES`] the exposure, then restores the exposure.
/// `None` if the exposure cannot be set.
fn lights(session: &mut Session<'_>) -> Result<Option<[Vec<Exposures>; 3]>, CalibrateError> {
    if !session.expose_times(1.0)? {
        return Ok(None);
    }
    let cells = capture_cells(session);
    session.expose_times(1.0)?;
    session.raw(&patterns::flat(session.layout.panel, [0; 3]))?;
    Ok(Some(cells?.map(group)))
}

/// Counts of the brightest light that stays below the knee of a sensor with `full` counts.
fn brightest(lights: &[Exposures], full: f64) -> Option<[f64; 3]> {
    let complete = lights
        .iter()
        .rev()
        .filter_map(|light| <[(f64, f64); 3]>::try_from(light.readings.as_slice()).ok());
    let mut counts = complete.map(|readings| readings.map(|(_, count)| count));
    counts.find(|counts| counts[2] <= JUDGED_SHARE * full)
}

/// Mean counts over black of a cell at each exposure; `None` where they are clipped or uneven.
type CellReading = [Option<f64>; 3];

/// Reads the cells of each channel that are evenly lit at the first exposure.
fn capture_cells(session: &mut Session<'_>) -> Result<[Vec<CellReading>; 3], CalibrateError> {
    let panel = session.layout.panel;
    let black = patterns::flat(panel, [0; 3]);
    let wide = panel.width.div_ceil(BLOCKS);
    let gradation = Gradation::new(panel, wide, &Gradation::levels(LEVELS), GRADATION_SEED).grey();
    let mut all: [Vec<CellReading>; 3] = Default::default();
    for (n, times) in TIMES.into_iter().enumerate() {
        session.expose_times(times)?;
        session.raw(&black)?;
        let dark = session.raw(&black)?;
        for readings in &mut all {
            readings.resize(cells(dark.size()).count(), [Some(0.0); 3]);
        }
        for _ in 0..CAPTURES_EACH {
            let light = session.raw(&gradation)?;
            for (c, readings) in Channel::ALL.into_iter().zip(&mut all) {
                let (light, dark) = (light.plane(c), dark.plane(c));
                for (cell, place) in readings.iter_mut().zip(cells(light.size())) {
                    let seen = over_black(light, dark, place, session.layout.saturated, n == 0);
                    cell[n] =
                        cell[n].zip(seen).map(|(sum, seen)| sum + seen / CAPTURES_EACH as f64);
                }
            }
        }
    }
    for readings in &mut all {
        readings.retain(|cell| cell[0].is_some_and(|count| count > 0.0));
    }
    Ok(all)
}

/// Left and top of each cell on a sensor of `size`.
fn cells(size: Size) -> impl Iterator<Item = (usize, usize)> {
    let (columns, rows) = (size.width / CELL_PX, size.height / CELL_PX);
    (0..columns * rows).map(move |n| (n % columns * CELL_PX, n / columns * CELL_PX))
}

/// Mean counts of a cell over `dark`; `None` if some are clipped, or if they are uneven although
/// `even` is required.
fn over_black(
    light: &Plane<u16>,
    dark: &Plane<u16>,
    (x, y): (usize, usize),
    saturated: u16,
    even: bool,
) -> Option<f64> {
    let (mut sum, mut least, mut most, mut top) = (0.0f64, f32::INFINITY, 0.0f32, 0u16);
    for row in y..y + CELL_PX {
        let counts = light.row(row)[x..x + CELL_PX].iter().zip(&dark.row(row)[x..x + CELL_PX]);
        for (&count, &dark) in counts {
            let over = f32::from(count) - f32::from(dark);
            (least, most, top) = (least.min(over), most.max(over), top.max(count));
            sum += f64::from(over);
        }
    }
    let mean = sum / (CELL_PX * CELL_PX) as f64;
    let clipped = f32::from(top) > CLIPPED_SHARE * f32::from(saturated);
    let uneven = even
        && f64::from(most - least) > f64::from(EVEN_SHARE) * (mean + f64::from(saturated) / 16.0);
    (!clipped && !uneven).then_some(mean)
}

/// Lights of one channel from dark to bright: means of cells of about equal brightness.
fn group(mut cells: Vec<CellReading>) -> Vec<Exposures> {
    cells.sort_by(|a, b| a[0].partial_cmp(&b[0]).unwrap_or(std::cmp::Ordering::Equal));
    let exposures = |group: &[CellReading]| {
        let mean = |n: usize| {
            let sum: Option<f64> = group.iter().map(|cell| cell[n]).sum();
            sum.map(|sum| (TIMES[n], sum / group.len() as f64))
        };
        Exposures { readings: (0..TIMES.len()).filter_map(mean).collect() }
    };
    cells.chunks(cells.len().div_ceil(GROUPS).max(1)).map(exposures).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_proportional_to_the_exposure_are_straight_and_a_gamma_is_not() {
        let bend = |gamma: f64| bend(TIMES.map(|times| 250.0 * times.powf(gamma)));
        for gamma in [0.95, 0.98, 1.0, 1.05] {
            assert!(bend(gamma).is_none(), "{gamma}");
        }
        for gamma in [0.45, 0.6, 0.8, 1.2, 2.2, f64::NAN] {
            assert!(bend(gamma).is_some(), "{gamma}");
        }
    }
}
