//! How a camera's counts bend: a gradation from black to white at one, two and three times the
//! exposure, which bring one, two and three times the light. A gamma or a knee passes every flat
//! and bends what a lens blurs. One picture holds all levels, so that a backlight's flicker between
//! captures is the same for all of them.

use super::session::Session;
use super::{CalibrateError, judge};
use crate::calibration::CameraCurve;
use crate::calibration::camera_curve::Exposures;
use crate::frame::{Channel, Frame, Plane, SensorSpace, Size};
use crate::patterns::{self, Gradation};

/// Multiples of the exposure.
const TIMES: [f64; 3] = [1.0, 2.0, 3.0];
/// Captures of the gradation at each: half the flicker's square.
const CAPTURES_EACH: usize = 2;
/// Blocks of the gradation across the panel: wide against any blur that can be worked with.
const BLOCKS: usize = 12;
/// Levels of it, as a panel's response takes them.
const LEVELS: usize = 52;
/// Sensor pixels across a cell whose mean is taken.
const CELL_PX: usize = 8;
/// A cell whose counts differ by more than this share of them lies on a border between blocks.
/// Guess: noise stays below it but in the dark, where nothing is left out.
const EVEN_SHARE: f32 = 0.2;
const GRADATION_SEED: u64 = 77;
/// Groups of cells of one channel, by brightness; each gives one light.
const GROUPS: usize = 40;
/// Share of full scale above which counts are clipped, or may be for a part of a cell.
const CLIPPED_SHARE: f32 = 0.97;
/// The camera is judged by the brightest light that brings at most this share of full scale at the
/// longest exposure: where a sensor's knee does not yet bend.
const JUDGED_SHARE: f64 = 0.75;
/// A curve that is nowhere farther from straight, as a share of full scale, is taken as straight:
/// one code of an 8-bit photo, and more than flicker of 0.3 % leaves of a fit.
const STRAIGHT_MAX: f32 = 0.004;

/// Captures it takes: three of black and two of the gradation at each exposure, and one once the
/// exposure is again what it was. The first capture after a change may still be of the exposure
/// before.
pub(super) const CAPTURES: usize = TIMES.len() * (2 + CAPTURES_EACH) + 1;

/// The camera's curve, where its exposure can be set; straight where it cannot. `black` is what a
/// black panel brings.
///
/// # Errors
/// Bent by more than a sensor is, or no captures.
pub(super) fn measure(
    session: &mut Session<'_>,
    black: &Frame<SensorSpace>,
) -> Result<CameraCurve, CalibrateError> {
    session.step("linearity");
    if !session.expose_times(1.0)? {
        log::debug!("the exposure cannot be set: counts are taken to be straight in light");
        return Ok(CameraCurve::straight());
    }
    let cells = exposed(session);
    session.expose_times(1.0)?;
    session.raw(&patterns::flat(session.layout.panel, [0; 3]))?;
    let black = black.planes().iter().map(Plane::mean).sum::<f64>() / 3.0;
    let full = f64::from(session.layout.saturated) - black;
    let mut lights = Vec::new();
    for (c, cells) in Channel::ALL.into_iter().zip(cells?) {
        let of_channel = grouped(cells);
        let judged = of_channel
            .iter()
            .filter_map(|light| <[(f64, f64); 3]>::try_from(light.readings.as_slice()).ok())
            .rfind(|readings| readings[2].1 <= JUDGED_SHARE * full);
        let counts = judged.ok_or_else(judge::no_curve)?.map(|(_, count)| count);
        log::debug!("{}: {counts:.1?} counts over black", c.name());
        judge::straight(c, TIMES, counts)?;
        lights.extend(of_channel);
    }
    let curve = CameraCurve::fit(&lights, black, full).ok_or_else(judge::no_curve)?;
    log::debug!("the camera's counts bend by {:.4} of full scale: {curve:?}", curve.bend());
    if curve.bend() <= STRAIGHT_MAX {
        return Ok(CameraCurve::straight());
    }
    Ok(curve)
}

/// Mean counts over black of a cell at each exposure; none where they are clipped.
type CellReading = [Option<f64>; 3];

/// The cells of each channel that are evenly lit at the first exposure.
fn exposed(session: &mut Session<'_>) -> Result<[Vec<CellReading>; 3], CalibrateError> {
    let panel = session.layout.panel;
    let black = patterns::flat(panel, [0; 3]);
    let wide = panel.width.div_ceil(BLOCKS);
    let gradation = Gradation::new(panel, wide, &Gradation::levels(LEVELS), GRADATION_SEED).grey();
    let mut all: [Vec<CellReading>; 3] = Default::default();
    for (n, times) in TIMES.into_iter().enumerate() {
        session.expose_times(times)?;
        session.raw(&black)?;
        let dark = session.raw(&black)?;
        for of_channel in &mut all {
            let count = cells(dark.size()).count();
            of_channel.resize(count, [Some(0.0); 3]);
        }
        for _ in 0..CAPTURES_EACH {
            let light = session.raw(&gradation)?;
            for (c, of_channel) in Channel::ALL.into_iter().zip(&mut all) {
                let (light, dark) = (light.plane(c), dark.plane(c));
                for (cell, place) in of_channel.iter_mut().zip(cells(light.size())) {
                    let seen = over_black(light, dark, place, session.layout.saturated, n == 0);
                    cell[n] =
                        cell[n].zip(seen).map(|(sum, seen)| sum + seen / CAPTURES_EACH as f64);
                }
            }
        }
    }
    for of_channel in &mut all {
        of_channel.retain(|cell| cell[0].is_some_and(|count| count > 0.0));
    }
    Ok(all)
}

/// The cells of a sensor of `size`, left and top.
fn cells(size: Size) -> impl Iterator<Item = (usize, usize)> {
    let (columns, rows) = (size.width / CELL_PX, size.height / CELL_PX);
    (0..columns * rows).map(move |n| (n % columns * CELL_PX, n / columns * CELL_PX))
}

/// Mean counts of a cell over `dark`; `None` where some are clipped, or where they differ and must
/// be `even`.
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

/// Lights of one channel, from dark to bright: means of cells that were about as bright.
fn grouped(mut cells: Vec<CellReading>) -> Vec<Exposures> {
    cells.sort_by(|a, b| a[0].partial_cmp(&b[0]).unwrap_or(std::cmp::Ordering::Equal));
    let of = |group: &[CellReading]| {
        let mean = |n: usize| {
            let sum: Option<f64> = group.iter().map(|cell| cell[n]).sum();
            sum.map(|sum| (TIMES[n], sum / group.len() as f64))
        };
        Exposures { readings: (0..TIMES.len()).filter_map(mean).collect() }
    };
    cells.chunks(cells.len().div_ceil(GROUPS).max(1)).map(of).collect()
}
