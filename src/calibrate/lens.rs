//! The lens: functions, norm, noise and the operator error, by pictures in light.

use rayon::prelude::*;

use super::session::{Session, difference};
use super::{Board, CalibrateError, canvas, judge};
use crate::calibration::lens_blur::{self, Fit, Grid, LensBlurError, Shot};
use crate::calibration::{Calibration, Correction, dark_corner, noise};
use crate::config;
use crate::frame::{Channel, Frame, Plane, Work};
use crate::patterns;
use crate::restore::lens_model::{LensFunctions, LensModel};

/// Patterns of the first, rough measurement, which only has to give centroids.
pub(super) const CENTRING_PATTERNS: usize = 2;
/// Grey around which patterns go up and down.
const GREY: f32 = 127.5;
/// How far they go. The bicubic warp overshoots by up to 1.5; this stays within the panel's light.
const AMPLITUDE: f32 = 80.0;
/// Rounds of conjugate gradients: rough, and to a thousandth (measured).
const ROUNDS: (usize, usize) = (3, 6);
/// Rounds of the power method from grey, which nearly is the dominant picture.
const POWER_ROUNDS: usize = 12;

/// Measures functions, norm, noise and operator error, and folds centroids into the geometry.
pub(super) fn measure(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    board: Option<&Board>,
) -> Result<(), CalibrateError> {
    if session.config.calibration.geometry == config::Geometry::Checkerboard {
        session.step("centring");
        let correction = correction(session, calibration)?;
        let (shots, trusted) = shoot(session, &correction, CENTRING_PATTERNS, 100)?;
        let functions = functions(session, &shots, &trusted, ROUNDS.0)?;
        recentre(session, calibration, &functions)?;
    }
    session.step("lens functions");
    let correction = correction(session, calibration)?;
    let (shots, trusted) = shoot(session, &correction, session.config.calibration.patterns, 200)?;
    let mut functions = functions(session, &shots, &trusted, ROUNDS.1)?;
    let sums = lens_blur::normalise(&mut functions);
    log::debug!("lens functions sum to {sums:?} before they are scaled to 1");
    let widest = Channel::ALL
        .iter()
        .flat_map(|&c| (0..functions.rows * functions.columns).map(move |n| (c, n)))
        .map(|(c, n)| {
            let taps = functions.function(c, n / functions.columns, n % functions.columns);
            lens_blur::moments(taps, functions.support_px).1
        })
        .fold(0.0, f64::max);
    judge::focus(widest, functions.support_px)?;
    calibration.functions = functions;
    session.step("checks");
    check(session, calibration, &correction, &shots[1][0], board)
}

fn correction(session: &Session<'_>, calibration: &Calibration) -> Result<Correction, CalibrateError> {
    Correction::new(calibration, session.layout).map_err(CalibrateError::Correction)
}

/// The `n`-th pseudo-random pattern of a series, all channels with their own.
fn pattern(session: &Session<'_>, series: u64, n: usize) -> Frame<Work> {
    let size = session.layout.canvas();
    Frame::from_fn(|c| {
        let seed = patterns::nth_seed(series, (3 * n + c.index()) as u64);
        patterns::pseudo_random(size, seed).map(|v| AMPLITUDE * v)
    })
}

/// `picture` on grey.
fn on_grey(picture: &Frame<Work>) -> Frame<Work> {
    Frame::from_fn(|c| picture.plane(c).map(|v| GREY + v))
}

/// Shows `count` patterns of a `series`; differences from grey, per channel, and what can be trusted.
fn shoot(
    session: &mut Session<'_>,
    correction: &Correction,
    count: usize,
    series: u64,
) -> Result<([Vec<Shot>; 3], Plane<u8>), CalibrateError> {
    let size = session.layout.canvas();
    let grey = session.seen(correction, &Frame::filled(size, GREY))?;
    let mut trusted = grey.trusted.plane(Channel::Green).clone();
    // What is seen of grey is smooth; without its noise it adds none to the patterns.
    let margin = session.layout.margin_px;
    let mut flat = Vec::new();
    for c in Channel::ALL {
        let surface = dark_corner::smooth(grey.light.plane(c), (margin, margin), canvas(&session.layout))
            .map_err(|source| CalibrateError::Fit { step: "grey", source })?;
        let mut plane = Plane::zeros(size);
        for y in 0..size.height {
            surface.row(y as f64 - margin as f64, -(margin as f64), 1.0, plane.row_mut(y));
        }
        flat.push(plane);
    }
    let mut shots = [Vec::new(), Vec::new(), Vec::new()];
    for n in 0..count {
        let shown = pattern(session, series, n);
        let seen = session.seen(correction, &on_grey(&shown))?;
        let both = trusted.data_mut().iter_mut().zip(seen.trusted.plane(Channel::Green).data());
        both.for_each(|(a, &b)| *a &= b);
        for (c, shown) in Channel::ALL.iter().zip(shown.into_planes()) {
            let seen = difference(seen.light.plane(*c), &flat[c.index()]);
            shots[c.index()].push(Shot { shown, seen });
        }
    }
    Ok((shots, trusted))
}

/// The lens functions that explain `shots`.
fn functions(
    session: &Session<'_>,
    shots: &[Vec<Shot>; 3],
    trusted: &Plane<u8>,
    rounds: usize,
) -> Result<LensFunctions, CalibrateError> {
    let asked = &session.config.calibration;
    let grid = Grid {
        photo: session.layout.photo,
        margin_px: session.layout.margin_px,
        columns: asked.function_columns,
        rows: asked.function_rows,
        support_px: asked.function_support_px,
    };
    // On a one-to-one rig the panel ends where the canvas does.
    let closed = session.layout.panel == session.layout.canvas();
    let found: Result<Vec<Vec<f32>>, LensBlurError> = Channel::ALL
        .par_iter()
        .map(|&c| Fit::new(grid, trusted, closed)?.taps(c, &shots[c.index()], rounds))
        .collect();
    let mut taps = found.map_err(CalibrateError::Lens)?.into_iter();
    Ok(LensFunctions {
        rows: grid.rows,
        columns: grid.columns,
        support_px: grid.support_px,
        taps: std::array::from_fn(|_| taps.next().unwrap_or_default()),
    })
}

/// Folds the functions' centroids into the geometry: coma moves a corner's saddle otherwise than a
/// function's centroid, and it is the centroid that must be in its place.
fn recentre(
    session: &Session<'_>,
    calibration: &mut Calibration,
    functions: &LensFunctions,
) -> Result<(), CalibrateError> {
    let fit = |source| CalibrateError::Fit { step: "centring", source };
    let domain = canvas(&session.layout);
    for c in Channel::ALL {
        let moved = lens_blur::displacement(functions, c, calibration.photo, domain).map_err(fit)?;
        let geometry = &mut calibration.geometry[c.index()];
        *geometry = geometry.recentred(&moved).map_err(fit)?;
    }
    Ok(())
}

/// Noise, rest, norm and operator error.
fn check(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    correction: &Correction,
    first: &Shot,
    board: Option<&Board>,
) -> Result<(), CalibrateError> {
    let model = LensModel::new(calibration.photo, calibration.margin_px, &calibration.functions)
        .map_err(|e| CalibrateError::Lens(LensBlurError::Model(e)))?;
    // Noise, of one capture: the same gradation twice.
    let codes = super::photometric::gradation(session, calibration, 99).grey();
    let pair = [correction.see(&session.raw(&codes)?), correction.see(&session.raw(&codes)?)];
    for c in Channel::ALL {
        let found = noise::fit(pair[0].light.plane(c), pair[1].light.plane(c), pair[0].trusted.plane(c));
        let refuse =
            || CalibrateError::Response { channel: c.name(), found: "no noise can be told".to_owned() };
        calibration.noise[c.index()] = found.ok_or_else(refuse)?;
    }
    rest(session, calibration, correction, first, board)?;
    // The chart on its paper, held out of every fit.
    let chart = chart(session);
    let seen = session.seen(correction, &chart)?;
    let margin = calibration.margin_px;
    for c in Channel::ALL {
        let (shown, light, trusted) = (chart.plane(c), seen.light.plane(c), seen.trusted.plane(c));
        calibration.operator_error[c.index()] = lens_blur::misfit(&model, c, shown, light, trusted, margin);
    }
    let norms: Vec<(f32, Plane)> =
        Channel::ALL.par_iter().map(|&c| lens_blur::dominant(&model, c, POWER_ROUNDS)).collect();
    calibration.norm_squared = std::array::from_fn(|n| norms[n].0);
    // The dominant picture has one sign; shown as bright as it can be, its light comes back stretched by ‖K‖.
    let picture = &norms[Channel::Green.index()].1;
    let brightest = picture.data().iter().fold(0.0f32, |a, &v| a.max(v)).max(f32::MIN_POSITIVE);
    let shown = Frame::from_fn(|c| match c {
        Channel::Green => picture.map(|v| v.max(0.0) * (220.0 / brightest)),
        _ => Plane::zeros(picture.size()),
    });
    let seen = session.seen(correction, &shown)?;
    let (shown, light) = (shown.plane(Channel::Green), seen.light.plane(Channel::Green));
    calibration.norm_squared_seen = (light.dot(light) / shown.dot(shown)) as f32;
    Ok(())
}

/// Judges whether the rig stood still all the while: the first pattern again, and the board.
fn rest(
    session: &mut Session<'_>,
    calibration: &Calibration,
    correction: &Correction,
    first: &Shot,
    board: Option<&Board>,
) -> Result<(), CalibrateError> {
    if let Some(board) = board {
        return super::still(session, board);
    }
    let again = session.seen(correction, &on_grey(&pattern(session, 200, 0)))?;
    let light = again.light.plane(Channel::Green).map(|v| v - GREY);
    let change = difference(&light, &first.seen).rms();
    let times = session.config.calibration.captures_averaged.max(1) as f32;
    let noise = calibration.noise[Channel::Green.index()].sigma(GREY) / times.sqrt();
    judge::repeats(change, f64::from(noise))
}

/// The chart in the photo's frame, its paper going on over the margin.
fn chart(session: &Session<'_>) -> Frame<Work> {
    let (photo, margin) = (session.layout.photo, session.layout.margin_px);
    let chart = patterns::chart(photo);
    let at = |p: usize, limit: usize| p.saturating_sub(margin).min(limit - 1);
    let plane =
        Plane::from_fn(session.layout.canvas(), |x, y| chart.at(at(x, photo.width), at(y, photo.height)));
    Frame::from_fn(|_| plane.clone())
}
