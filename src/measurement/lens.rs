//! Measurement of the lens: functions, norms, noise and operator error, from linear light.

use std::sync::Arc;

use super::board::{self, Board};
use super::series::{
    BROAD_PATTERNS, GREY, Patterns, Series, on_grey, pattern, random, shoot, squares,
};
use super::session::{Session, difference};
use super::{CalibrateError, judge, motion, photometric};
use crate::calibration::lens_blur::{self, FunctionFit, FunctionGrid, LensBlurError};
use crate::calibration::{Calibration, Correction, noise};
use crate::config;
use crate::deconvolution::data_term::TRUSTED;
use crate::deconvolution::lens_model::{LensFunctions, LensModel};
use crate::deconvolution::method::WAVELET_LEVELS;
use crate::deconvolution::panel_beat;
use crate::deconvolution::registration::{Comparison, Registration};
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};
use crate::patterns;

/// Number of rough measurements whose centroids are folded into the geometry. A border function
/// represents a wide strip and moves slightly wrongly; the second round removes the rest.
pub(super) const CENTRINGS: usize = 2;
/// Number of patterns of each rough measurement.
pub(super) const CENTRING_PATTERNS: usize = 5;
/// Side of the pixels of centring patterns; captures are averaged to them. A centroid needs the
/// whole function, even where the rig file limits it to the middle, but no fine detail.
const CENTRING_PIXEL_PX: usize = 2;
/// Width of the functions during centring, in pixels of [`CENTRING_PIXEL_PX`], as a share of the
/// rig file's width: 1.7 times as wide on the sensor. Measured, see tests/tables/constants.md.
const CENTRING_SHARE: f64 = 0.85;
/// Rounds of conjugate gradients for centring, which fits many taps to few pixels.
const CENTRING_ROUNDS: usize = 8;
/// Rounds of conjugate gradients for the final functions.
const ROUNDS: usize = 12;
/// Largest number of further fits of the functions, each after the panel was followed.
const FOLLOWED_MAX: usize = 4;
/// Brightest level of the dominant picture shown to measure ‖K‖.
const DOMINANT_LEVEL: f32 = 220.0;

/// Measures functions, norm, noise and operator error, and folds green's centroids into the
/// geometry.
pub(super) fn measure(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    board: Option<&Board>,
) -> Result<(), CalibrateError> {
    if session.config.calibration.geometry == config::Alignment::Checkerboard {
        centre(session, calibration)?;
    }
    session.step("lens functions");
    let correction = correction(session, calibration)?;
    let asked = &session.config.calibration;
    let (count, support_px) = (asked.patterns, asked.function_support_px);
    let patterns = Patterns { count, nth: &random(200, 1), pixel_px: 1 };
    let mut series = shoot(session, &correction, patterns)?;
    let fit = FunctionRounds { rounds: ROUNDS, support_px, is_centred: board.is_some() };
    let mut functions = functions(session, &correction, &mut series, fit)?;
    lens_blur::normalise(&mut functions);
    calibration.functions = functions;
    if session.config.calibration.broad_term {
        session.step("broad light");
        broad_light(session, calibration, &correction)?;
    }
    session.step("checks");
    let model =
        calibration.lens_model().map_err(|e| CalibrateError::Lens(LensBlurError::Model(e)))?;
    measure_noise(session, calibration, &correction)?;
    check_rest(session, calibration, &correction, &series.first, board)?;
    measure_operator_error(session, calibration, &correction, &model)?;
    measure_norms(session, calibration, &correction, model)
}

/// Folds the centroids of green's roughly measured functions into the geometry.
fn centre(session: &mut Session<'_>, calibration: &mut Calibration) -> Result<(), CalibrateError> {
    session.step("centring");
    let layout = session.layout;
    let mut sides = [layout.photo.width, layout.photo.height, layout.margin_px].into_iter();
    let even = sides.all(|side| side.is_multiple_of(CENTRING_PIXEL_PX));
    let pixel_px = if even { CENTRING_PIXEL_PX } else { 1 };
    let written_px = session.config.calibration.function_support_px;
    let support_px = (CENTRING_SHARE * written_px as f64) as usize | 1;
    for round in 0..CENTRINGS {
        // Means of two by two pixels, since sites alone would bias a function towards themselves.
        let correction = correction(session, calibration)?.between_sites();
        let nth = random(100 + round as u64, pixel_px);
        let patterns = Patterns { count: CENTRING_PATTERNS, nth: &nth, pixel_px };
        let mut series = shoot(session, &correction, patterns)?;
        let fit = FunctionRounds { rounds: CENTRING_ROUNDS, support_px, is_centred: false };
        let functions = functions(session, &correction, &mut series, fit)?;
        recentre(session, calibration, &functions, pixel_px)?;
    }
    Ok(())
}

/// Measures light scattered beyond the support of the functions.
fn broad_light(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    correction: &Correction,
) -> Result<(), CalibrateError> {
    let beyond = calibration.beyond();
    let patterns = Patterns { count: BROAD_PATTERNS, nth: &squares, pixel_px: 1 };
    let mut series = shoot(session, correction, patterns)?;
    let model =
        calibration.lens_model().map_err(|e| CalibrateError::Lens(LensBlurError::Model(e)))?;
    series.follow(session, correction, &model, (0.0, 0.0))?;
    motion::check(&series.places)?;
    let support_px = calibration.functions.support_px;
    for c in Channel::ALL {
        let (shots, trusted) = (&series.shots[c.index()], series.trusted.plane(c));
        let halos = lens_blur::halos(support_px, c, shots, trusted, beyond);
        lens_blur::remove_halos(&mut calibration.functions, c, &halos);
        calibration.broad[c.index()] = halos;
    }
    Ok(())
}

/// RMS radius of green's sharpest function, pixels, since a lens may be poor in its corners;
/// infinite if no function has a radius.
fn sharpest_px(functions: &LensFunctions) -> f64 {
    (0..functions.rows * functions.columns)
        .map(|n| functions.function(Channel::Green, n / functions.columns, n % functions.columns))
        .map(|taps| lens_blur::moments(taps, functions.support_px).1)
        .fold(f64::INFINITY, f64::min)
}

fn correction(
    session: &Session<'_>,
    calibration: &Calibration,
) -> Result<Correction, CalibrateError> {
    Correction::new(calibration, session.layout).map_err(CalibrateError::Correction)
}

#[derive(Clone, Copy)]
struct FunctionRounds {
    rounds: usize,
    /// Width of the functions, in pixels of the series.
    support_px: usize,
    /// Whether the functions' centroids are at zero when the panel is in place.
    is_centred: bool,
}

/// Fits the lens functions to `series` while following the panel.
fn functions(
    session: &mut Session<'_>,
    correction: &Correction,
    series: &mut Series<'_>,
    fit: FunctionRounds,
) -> Result<LensFunctions, CalibrateError> {
    let asked = &session.config.calibration;
    let pixel_px = series.patterns.pixel_px;
    let photo = session.layout.photo;
    let grid = FunctionGrid {
        photo: Size::new(photo.width / pixel_px, photo.height / pixel_px),
        margin_px: session.layout.margin_px / pixel_px,
        columns: asked.function_columns,
        rows: asked.function_rows,
        support_px: fit.support_px,
    };
    let mut functions = fitted(session, series, grid, fit.rounds)?;
    // Far out of focus, places and centroids are mere noise, and a later fit would be blamed.
    let pixel = pixel_px as f64;
    let widest_px = pixel * fit.support_px as f64;
    judge::focus(pixel * sharpest_px(&functions), widest_px, asked.function_support_px)?;
    for _ in 0..FOLLOWED_MAX {
        let model = LensModel::new(grid.photo, grid.margin_px, &functions)
            .map_err(|e| CalibrateError::Lens(LensBlurError::Model(e)))?;
        let off_px = if fit.is_centred { off_centre(&functions, pixel_px) } else { (0.0, 0.0) };
        if !series.follow(session, correction, &model, off_px)? {
            break;
        }
        functions = fitted(session, series, grid, fit.rounds)?;
    }
    motion::check(&series.places)?;
    Ok(functions)
}

/// Fits the lens functions to the shots of `series` as they are.
fn fitted(
    session: &mut Session<'_>,
    series: &Series<'_>,
    grid: FunctionGrid,
    rounds: usize,
) -> Result<LensFunctions, CalibrateError> {
    let (shots, trusted) = (Arc::clone(&series.shots), Arc::clone(&series.trusted));
    let fit = move |c: Channel| {
        FunctionFit::new(grid, trusted.plane(c))?.taps(c, &shots[c.index()], rounds)
    };
    let fits = session.computed(move || Channel::each(fit))?;
    let [red, green, blue] = fits.map(|taps| taps.map_err(CalibrateError::Lens));
    let FunctionGrid { rows, columns, support_px, .. } = grid;
    Ok(LensFunctions { rows, columns, support_px, taps: [red?, green?, blue?] })
}

/// Mean centroid of green's `functions`, sensor pixels; their own pixels are `pixel_px` wide.
fn off_centre(functions: &LensFunctions, pixel_px: usize) -> (f64, f64) {
    let count = functions.rows * functions.columns;
    let taps = functions.taps[Channel::Green.index()].chunks(functions.support_px.pow(2));
    let centroids = taps.map(|taps| lens_blur::centroid(taps, functions.support_px));
    let (x, y) = centroids.fold((0.0, 0.0), |sum, at| (sum.0 + at.0, sum.1 + at.1));
    let share = pixel_px as f64 / count as f64;
    (share * x, share * y)
}

/// Folds the functions' centroids into the geometry: coma moves the saddle of a checkerboard corner
/// differently from a function's centroid, and it is the centroid that must be in place.
fn recentre(
    session: &Session<'_>,
    calibration: &mut Calibration,
    functions: &LensFunctions,
    pixel_px: usize,
) -> Result<(), CalibrateError> {
    let fit = |source| CalibrateError::Fit { step: "centring", source };
    let domain = session.layout.domain();
    let moved = lens_blur::displacement(functions, calibration.photo, domain, pixel_px);
    // Functions that do not exceed the noise have no centroid.
    let moved = moved.map_err(|_| {
        let found = "the lens functions are lost in the noise".to_owned();
        CalibrateError::WrongFocus(found, "functions above three times the noise".to_owned())
    })?;
    calibration.geometry = calibration.geometry.recentred(&moved).map_err(fit)?;
    Ok(())
}

/// Measures the noise of one capture, from two captures of the same gradation.
fn measure_noise(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    correction: &Correction,
) -> Result<(), CalibrateError> {
    let apart = photometric::SUPPORTS_APART;
    let gradation = photometric::gradation(session, calibration, apart, 99);
    let codes = gradation.grey();
    let pair = [correction.see(&session.raw(&codes)?), correction.see(&session.raw(&codes)?)];
    let flat = photometric::flat_places(session, calibration, &gradation);
    for c in Channel::ALL {
        let [first, second] = pair.each_ref().map(|seen| seen.light.plane(c));
        let refuse = || CalibrateError::Response(c, "its noise cannot be measured".to_owned());
        calibration.noise[c.index()] =
            noise::fit(first, second, pair[0].trusted.plane(c), &flat).ok_or_else(refuse)?;
    }
    Ok(())
}

/// Measures the misfit of the lens model on the chart, which no fit has used. The capture is
/// registered like every later one, as the panel may have drifted and flickered.
fn measure_operator_error(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    correction: &Correction,
    model: &LensModel,
) -> Result<(), CalibrateError> {
    let chart = chart(session);
    let mut seen = session.seen(correction, &chart)?;
    let margin = calibration.margin_px;
    let place = Rect { x: margin, y: margin, size: calibration.photo };
    let predicted_at = |at_px| {
        let by_perfect_lens = correction.by_perfect_lens(&Channel::ALL, &chart, at_px);
        model.seen(&Channel::ALL, &by_perfect_lens)
    };
    let register = |predicted: &Frame<Work>| {
        let comparison = Comparison {
            seen: &seen.light,
            predicted,
            mask: &seen.trusted,
            area: place,
            channels: &Channel::ALL,
        };
        Registration::fit(&comparison, calibration.functions.support_px)
    };
    // A panel that is seen elsewhere is sampled differently, so a shifted prediction would not do.
    let at_px = register(&predicted_at((0.0, 0.0))).shift_px;
    let predicted = predicted_at(at_px);
    register(&predicted).undo(&mut seen, &predicted, &Channel::ALL);
    let trust = Frame::filled(model.canvas(), TRUSTED);
    let (wave, mosaic) = (correction.column_wave(), session.layout.mosaic);
    panel_beat::remove_beats(&mut seen, &predicted, (&trust, place), &wave, mosaic, &Channel::ALL);
    for c in Channel::ALL {
        let (predicted, light) = (predicted.plane(c), seen.light.plane(c));
        calibration.operator_error[c.index()] =
            lens_blur::misfit(predicted, light, seen.trusted.plane(c), margin);
    }
    Ok(())
}

/// Computes the norms of the lens model, and measures ‖K‖² by the capture of its dominant picture.
fn measure_norms(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    correction: &Correction,
    model: LensModel,
) -> Result<(), CalibrateError> {
    let filters = session.layout.mosaic.is_some();
    let (mut measured, levels) = (calibration.clone(), WAVELET_LEVELS);
    let norms = move || {
        let picture = measured.measure_norms(&model, levels, filters);
        (measured, picture)
    };
    let (measured, picture) = session.computed(norms)?;
    *calibration = measured;
    // The dominant picture has one sign; the lens makes its capture brighter by the factor ‖K‖.
    let brightest = picture.data().iter().fold(0.0f32, |a, &v| a.max(v)).max(f32::MIN_POSITIVE);
    let shown = Frame::from_fn(|c| match c {
        Channel::Green => picture.map(|v| v.max(0.0) * (DOMINANT_LEVEL / brightest)),
        _ => Plane::zeros(picture.size()),
    });
    let seen = session.seen(correction, &shown)?;
    let shown = correction.by_perfect_lens(&[Channel::Green], &shown, (0.0, 0.0));
    let (shown, light) = (shown.plane(Channel::Green), seen.light.plane(Channel::Green));
    calibration.norm_squared_seen = (light.dot(light) / shown.dot(shown)) as f32;
    Ok(())
}

/// Checks that the rig is at rest: by the checkerboard if there is one, else by the first pattern.
fn check_rest(
    session: &mut Session<'_>,
    calibration: &Calibration,
    correction: &Correction,
    first: &Plane,
    board: Option<&Board>,
) -> Result<(), CalibrateError> {
    if let Some(board) = board {
        return board::check_place(session, board);
    }
    let again = session.seen(correction, &on_grey(&pattern(session, 200, 0, 1)))?;
    let change = difference(again.light.plane(Channel::Green), first).rms();
    let times = session.config.calibration.captures_averaged.max(1) as f32;
    let noise = calibration.noise[Channel::Green.index()].sigma(GREY) / times.sqrt();
    judge::repeats(change, f64::from(noise))
}

/// The chart on the canvas: photo-sized, with its border repeated over the margin.
fn chart(session: &Session<'_>) -> Frame<Work> {
    let (photo, margin) = (session.layout.photo, session.layout.margin_px);
    let chart = patterns::chart(photo);
    let at = |p: usize, limit: usize| p.saturating_sub(margin).min(limit - 1);
    let plane = Plane::from_fn(session.layout.canvas(), |x, y| {
        chart.at(at(x, photo.width), at(y, photo.height))
    });
    Frame::from_fn(|_| plane.clone())
}
