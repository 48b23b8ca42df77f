//! The lens: functions, norm, noise and the operator error, by pictures in light.

use rayon::prelude::*;

use super::board::{self, Board};
use super::session::{Session, difference, rim_px};
use super::{CalibrateError, judge, photometric};
use crate::calibration::lens_blur::{self, FunctionFit, FunctionGrid, LensBlurError, Shot};
use crate::calibration::{Calibration, Corrected, Correction, dark_corner, noise};
use crate::config;
use crate::deconvolution::data_term::TRUSTED;
use crate::deconvolution::forward_convolution::Seen;
use crate::deconvolution::lens_model::LensFunctions;
use crate::deconvolution::panel_beat::{self, PanelBeat, SeenChannel};
use crate::deconvolution::registration::Registration;
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};
use crate::patterns;

/// Rough measurements whose centroids are folded into the geometry. A border function stands for a
/// wide strip and so moves a little wrongly; the second round takes out what the first left.
pub(super) const CENTRINGS: usize = 2;
/// Patterns of each.
pub(super) const CENTRING_PATTERNS: usize = 5;
/// Pixels of the patterns for centring are this wide, and captures are averaged to them: a centroid
/// wants the whole function, also where the rig file asks for its middle only, and no fine detail.
const CENTRING_PIXEL_PX: usize = 2;
/// Width of the functions then, as a share of the rig file's, in such pixels: 1.7 times as wide a
/// piece of the sensor. Measured, see tests/tables/README.md.
const CENTRING_SHARE: f64 = 0.85;
/// Grey around which patterns go up and down.
const GREY: f32 = 127.5;
/// How far they go. The bicubic warp overshoots by up to 1.5; this stays within the panel's light.
const AMPLITUDE: f32 = 80.0;
/// Rounds of conjugate gradients for centring, where taps are many for the pixels there are.
const CENTRING_ROUNDS: usize = 8;
/// Rounds for the functions themselves.
const ROUNDS: usize = 12;
/// Squares for the broad light, in widths of a function: the last is held out. Guess.
const SQUARES: [usize; BROAD_PATTERNS] = [2, 4, 8, 3];
/// A capture farther from grey's brightness than this is left as it is. Guess: several times what a
/// backlight flickers.
const GAIN_MAX: f64 = 0.03;
/// Patterns of them.
pub(super) const BROAD_PATTERNS: usize = 4;

/// Measures functions, norm, noise and operator error, and folds centroids into the geometry.
pub(super) fn measure(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    board: Option<&Board>,
) -> Result<(), CalibrateError> {
    if session.config.calibration.geometry == config::Alignment::Checkerboard {
        session.step("centring");
        let layout = session.layout;
        let even = [layout.photo.width, layout.photo.height, layout.margin_px]
            .iter()
            .all(|side| side.is_multiple_of(CENTRING_PIXEL_PX));
        let pixel_px = if even { CENTRING_PIXEL_PX } else { 1 };
        let support_px =
            (CENTRING_SHARE * session.config.calibration.function_support_px as f64) as usize | 1;
        for round in 0..CENTRINGS {
            // Means over two by two pixels: sites alone would pull a function towards them.
            let correction = correction(session, calibration)?.between_sites();
            let series = shoot(
                session,
                &correction,
                CENTRING_PATTERNS,
                &random(100 + round as u64, pixel_px),
                pixel_px,
            )?;
            let functions = functions(session, series, CENTRING_ROUNDS, pixel_px, support_px)?;
            // Far out of focus centroids are noise, and whatever is fitted to them would be blamed
            // instead.
            let (pixel, support) =
                (pixel_px as f64, session.config.calibration.function_support_px);
            judge::focus(pixel * sharpest_px(&functions), pixel * support_px as f64, support)?;
            recentre(session, calibration, &functions, pixel_px)?;
        }
    }
    session.step("lens functions");
    let correction = correction(session, calibration)?;
    let series =
        shoot(session, &correction, session.config.calibration.patterns, &random(200, 1), 1)?;
    let support_px = session.config.calibration.function_support_px;
    let first = series.first.clone();
    let mut functions = functions(session, series, ROUNDS, 1, support_px)?;
    let sums = lens_blur::normalise(&mut functions);
    log::debug!("lens functions sum to {sums:?} before they are scaled to 1");
    judge::focus(sharpest_px(&functions), support_px as f64, support_px)?;
    calibration.functions = functions;
    if session.config.calibration.broad_term {
        session.step("broad light");
        broad_light(session, calibration, &correction)?;
    }
    session.step("checks");
    check(session, calibration, &correction, &first, board)
}

/// What the lens scatters wider than its functions reach.
fn broad_light(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    correction: &Correction,
) -> Result<(), CalibrateError> {
    let beyond = calibration.beyond();
    let series = shoot(session, correction, BROAD_PATTERNS, &|session, n| squares(session, n), 1)?;
    let support_px = calibration.functions.support_px;
    for c in Channel::ALL {
        let (shots, trusted) = (&series.shots[c.index()], &series.trusted[c.index()]);
        let halos = lens_blur::halos(support_px, c, shots, trusted, beyond);
        lens_blur::without_halos(&mut calibration.functions, c, &halos);
        calibration.broad[c.index()] = halos;
    }
    Ok(())
}

/// Large random squares, up to the canvas's border; the `n`-th of [`BROAD_PATTERNS`].
fn squares(session: &Session<'_>, n: usize) -> Frame<Work> {
    let size = session.layout.canvas();
    let widest = (size.width.min(size.height) / 2).max(1);
    let side =
        (SQUARES[n % BROAD_PATTERNS] * session.config.calibration.function_support_px).min(widest);
    Frame::from_fn(|c| {
        let seed = patterns::nth_seed(300, (3 * n + c.index()) as u64);
        let signs = patterns::pseudo_random(
            Size::new(size.width.div_ceil(side), size.height.div_ceil(side)),
            seed,
        );
        Plane::from_fn(size, |x, y| AMPLITUDE * signs.at(x / side, y / side))
    })
}

/// RMS radius of the sharpest function of the channel in focus: a lens may be bad in its corners.
/// Infinite when no function has a radius.
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

/// Width of the canvas's border that stays grey in a pattern: the panel goes on with the canvas's
/// border, so beyond it all is grey, and no light comes in that the model does not know.
const GREY_BORDER_PX: usize = 2;

/// The `n`-th pseudo-random pattern of a series, all channels with their own, in squares of
/// `pixel_px`, without the border.
fn pattern(session: &Session<'_>, series: u64, n: usize, pixel_px: usize) -> Frame<Work> {
    let size = session.layout.canvas();
    let coarse = Size::new(size.width / pixel_px, size.height / pixel_px);
    Frame::from_fn(|c| {
        let seed = patterns::nth_seed(series, (3 * n + c.index()) as u64);
        let signs = patterns::pseudo_random(coarse, seed);
        Plane::from_fn(size, |x, y| {
            let to_border = x.min(y).min(size.width - 1 - x).min(size.height - 1 - y);
            if to_border < GREY_BORDER_PX {
                0.0
            } else {
                AMPLITUDE * signs.at(x / pixel_px, y / pixel_px)
            }
        })
    })
}

/// The patterns of a series.
fn random(series: u64, pixel_px: usize) -> impl Fn(&Session<'_>, usize) -> Frame<Work> {
    move |session, n| pattern(session, series, n, pixel_px)
}

/// Means of `plane` over squares of `pixel_px`.
fn averaged(plane: &Plane, pixel_px: usize) -> Plane {
    let coarse = Size::new(plane.width() / pixel_px, plane.height() / pixel_px);
    Plane::from_fn(coarse, |x, y| {
        let rows = (0..pixel_px).map(|v| &plane.row(y * pixel_px + v)[x * pixel_px..][..pixel_px]);
        rows.flatten().sum::<f32>() / (pixel_px * pixel_px) as f32
    })
}

/// `picture` on grey.
fn on_grey(picture: &Frame<Work>) -> Frame<Work> {
    Frame::from_fn(|c| picture.plane(c).map(|v| GREY + v))
}

/// `picture` on grey as a perfect lens would see it on the panel, less the grey: what the lens
/// spreads.
fn on_panel(correction: &Correction, picture: &Frame<Work>) -> Frame<Work> {
    let seen = correction.by_perfect_lens(&Channel::ALL, &on_grey(picture));
    Frame::from_fn(|c| seen.plane(c).map(|v: f32| v - GREY))
}

/// What was seen of a series of patterns.
struct Series {
    /// Differences from grey, per channel, averaged to the pattern's squares.
    shots: [Vec<Shot>; 3],
    /// 1 where all captures can be trusted, per channel.
    trusted: [Plane<u8>; 3],
    /// Green light of the first pattern, as seen.
    first: Plane,
}

/// Shows `count` patterns, made of squares of `pixel_px`, and grey.
fn shoot(
    session: &mut Session<'_>,
    correction: &Correction,
    count: usize,
    nth: &dyn Fn(&Session<'_>, usize) -> Frame<Work>,
    pixel_px: usize,
) -> Result<Series, CalibrateError> {
    let size = session.layout.canvas();
    let mut grey = session.seen(correction, &Frame::filled(size, GREY))?;
    without_beat(session, correction, &mut grey, &Frame::zeros(size));
    let mut trusted = grey.trusted.clone();
    // What is seen of grey is smooth; without its noise it adds none to the patterns. Where the
    // panel ends with the canvas it falls off at the border, and is taken as it is.
    let margin = session.layout.margin_px;
    let mut flat = Vec::new();
    for c in Channel::ALL {
        if rim_px(session.config) > 0 {
            flat.push(grey.light.plane(c).clone());
            continue;
        }
        let surface =
            dark_corner::smooth(grey.light.plane(c), (margin, margin), session.layout.domain(), 0)
                .map_err(|source| CalibrateError::Fit { step: "grey", source })?;
        let mut plane = Plane::zeros(size);
        for y in 0..size.height {
            surface.row(y as f64 - margin as f64, -(margin as f64), 1.0, plane.row_mut(y));
        }
        flat.push(plane);
    }
    let scale = grey_scale(session, &grey, &flat);
    let mut shots = [Vec::new(), Vec::new(), Vec::new()];
    let (mut first, mut gains) = (None, (1.0f32, 1.0f32));
    for n in 0..count {
        let shown = nth(session, n);
        let mut seen = session.seen(correction, &on_grey(&shown))?;
        without_beat(session, correction, &mut seen, &shown);
        for (trusted, seen) in trusted.planes_mut().iter_mut().zip(seen.trusted.planes()) {
            trusted.data_mut().iter_mut().zip(seen.data()).for_each(|(a, &b)| *a &= b);
        }
        if first.is_none() {
            first = Some(seen.light.plane(Channel::Green).clone());
        }
        let gain = brightness(session, &seen, &shown, &flat);
        gains = (gain.min(gains.0), gain.max(gains.1));
        for (c, shown) in Channel::ALL.iter().zip(on_panel(correction, &shown).into_planes()) {
            let mut light = seen.light.plane(*c).clone();
            light.scale(1.0 / gain);
            let mut seen = difference(&light, &flat[c.index()]);
            seen.scale(1.0 / scale[c.index()]);
            shots[c.index()]
                .push(Shot { shown: averaged(&shown, pixel_px), seen: averaged(&seen, pixel_px) });
        }
    }
    log::debug!("patterns are {:.4} to {:.4} times as bright as grey", gains.0, gains.1);
    let first = first.unwrap_or_else(|| Plane::filled(size, GREY));
    let whole = trusted.planes().each_ref().map(|plane| {
        averaged(&plane.map(f32::from), pixel_px).map(|share| u8::from(share > 0.999))
    });
    Ok(Series { shots, trusted: whole, first })
}

/// Takes the beat of the panel's columns out of `seen`, the capture of a pattern on grey. No lens
/// is known yet: within large squares the light is what was `shown`, and patterns too fine for that
/// are but noise about the grey.
fn without_beat(
    session: &Session<'_>,
    correction: &Correction,
    seen: &mut Corrected,
    shown: &Frame<Work>,
) {
    let layout = correction.layout();
    let support_px = session.config.calibration.function_support_px;
    let margin = layout.margin_px;
    for c in Channel::ALL {
        let inside = lens_blur::within_a_square(shown.plane(c), support_px);
        let is_fine = !inside.data().contains(&1);
        let of = |light: f32| if is_fine { GREY } else { GREY + light };
        let (trusted, column) = (seen.trusted.plane(c), correction.panel_columns().plane(c));
        let beat = PanelBeat::of(&SeenChannel {
            light: seen.light.plane(c),
            predicted: &shown.plane(c).map(of),
            known: &|x, y| trusted.at(x, y) == TRUSTED && (is_fine || inside.at(x, y) == TRUSTED),
            photo: Rect { x: margin, y: margin, size: layout.photo },
            column,
            at_sites: layout.mosaic.is_some(),
        });
        if let Some(beat) = beat {
            beat.undo(seen.light.plane_mut(c), column);
        }
    }
}

/// How bright the capture of grey is in each channel, against what it was calibrated to be: else
/// a backlight's flicker would be taken for light that patterns lose. 1 where the panel ends with
/// the canvas, and where it is more than a backlight's unsteadiness.
fn grey_scale(session: &Session<'_>, grey: &Corrected, flat: &[Plane]) -> [f32; 3] {
    if rim_px(session.config) > 0 {
        return [1.0; 3];
    }
    Channel::ALL.map(|c| {
        let both = flat[c.index()].data().iter().zip(grey.trusted.plane(c).data());
        let (mut light, mut pixels) = (0.0f64, 0.0f64);
        for (&light_here, _) in both.filter(|(_, trusted)| **trusted > 0) {
            (light, pixels) = (light + f64::from(light_here), pixels + 1.0);
        }
        let scale = light / (pixels * f64::from(GREY));
        if (scale - 1.0).abs() <= GAIN_MAX { scale as f32 } else { 1.0 }
    })
}

/// How bright a capture of a pattern on grey is against the capture of that grey: a backlight
/// flickers. A lens moves light and keeps its sum, so the sums tell. 1 where the panel ends with
/// the canvas, for light is lost there, and where it is more than a backlight's unsteadiness.
fn brightness(session: &Session<'_>, seen: &Corrected, shown: &Frame<Work>, flat: &[Plane]) -> f32 {
    if rim_px(session.config) > 0 {
        return 1.0;
    }
    let border = session.config.calibration.function_support_px / 2;
    let size = session.layout.canvas();
    let (mut light, mut expected) = (0.0f64, 0.0f64);
    for (c, flat) in Channel::ALL.iter().zip(flat) {
        let (seen, trusted, shown) =
            (seen.light.plane(*c), seen.trusted.plane(*c), shown.plane(*c));
        for y in border..size.height.saturating_sub(border) {
            for x in border..size.width.saturating_sub(border) {
                if trusted.at(x, y) > 0 {
                    light += f64::from(seen.at(x, y));
                    expected += f64::from(flat.at(x, y) + shown.at(x, y));
                }
            }
        }
    }
    let gain = light / expected;
    // Written so that a number that is none fails too.
    if (gain - 1.0).abs() <= GAIN_MAX { gain as f32 } else { 1.0 }
}

/// The lens functions that explain `series`, on pixels of `pixel_px`.
fn functions(
    session: &mut Session<'_>,
    series: Series,
    rounds: usize,
    pixel_px: usize,
    support_px: usize,
) -> Result<LensFunctions, CalibrateError> {
    let asked = &session.config.calibration;
    let grid = FunctionGrid {
        photo: Size::new(
            session.layout.photo.width / pixel_px,
            session.layout.photo.height / pixel_px,
        ),
        margin_px: session.layout.margin_px / pixel_px,
        columns: asked.function_columns,
        rows: asked.function_rows,
        support_px,
    };
    let Series { shots, trusted, .. } = series;
    let fit = move |&c: &Channel| {
        FunctionFit::new(grid, &trusted[c.index()])?.taps(c, &shots[c.index()], rounds)
    };
    let fits = move || Channel::ALL.par_iter().map(fit).collect::<Result<Vec<_>, LensBlurError>>();
    let mut taps = session.computed(fits)?.map_err(CalibrateError::Lens)?.into_iter();
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
    pixel_px: usize,
) -> Result<(), CalibrateError> {
    let fit = |source| CalibrateError::Fit { step: "centring", source };
    let domain = session.layout.domain();
    for c in Channel::ALL {
        let moved = lens_blur::displacement(functions, c, calibration.photo, domain, pixel_px)
            .map_err(fit)?;
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
    first: &Plane,
    board: Option<&Board>,
) -> Result<(), CalibrateError> {
    let model =
        calibration.lens_model().map_err(|e| CalibrateError::Lens(LensBlurError::Model(e)))?;
    // Noise, of one capture: the same gradation twice.
    let gradation = photometric::wide_gradation(session, calibration);
    let codes = gradation.grey();
    let pair = [correction.see(&session.raw(&codes)?), correction.see(&session.raw(&codes)?)];
    for c in Channel::ALL {
        let flat = photometric::flat_places(session, calibration, c, &gradation);
        let [first, second] = pair.each_ref().map(|seen| seen.light.plane(c));
        let found = noise::fit(first, second, pair[0].trusted.plane(c), &flat);
        let refuse = || CalibrateError::Response {
            channel: c.name(),
            found: "no noise can be told".to_owned(),
        };
        calibration.noise[c.index()] = found.ok_or_else(refuse)?;
    }
    rest(session, calibration, correction, first, board)?;
    // The chart on its paper, held out of every fit.
    let chart = chart(session);
    let Corrected { light, trusted } = session.seen(correction, &chart)?;
    let mut seen = Seen { light, trusted };
    let on_panel = correction.by_perfect_lens(&Channel::ALL, &chart);
    let predicted = model.seen(&Channel::ALL, &on_panel);
    let margin = calibration.margin_px;
    let (photo, support_px) = (calibration.photo, calibration.functions.support_px);
    // As every later capture is, for the panel may have wandered and flickered.
    let trust = Frame::filled(model.canvas(), TRUSTED);
    let place = Rect { x: margin, y: margin, size: photo };
    let found = Registration::of(&seen, &predicted, &trust, place, &Channel::ALL, support_px);
    log::debug!("the chart's capture registered: {found:?}");
    found.undo(&mut seen, &predicted, &Channel::ALL);
    let (columns, mosaic) = (correction.panel_columns(), session.layout.mosaic);
    panel_beat::take_out(&mut seen, &predicted, (&trust, place), columns, mosaic, &Channel::ALL);
    for c in Channel::ALL {
        let (predicted, light) = (predicted.plane(c), seen.light.plane(c));
        calibration.operator_error[c.index()] =
            lens_blur::misfit(predicted, light, seen.trusted.plane(c), margin);
    }
    let filters = session.layout.mosaic.is_some();
    let (mut measured, levels) = (calibration.clone(), session.config.restore.levels);
    let norms = move || {
        let picture = measured.measure_norms(&model, levels, filters);
        (measured, picture)
    };
    let (measured, picture) = session.computed(norms)?;
    *calibration = measured;
    // The dominant picture has one sign; shown as bright as it can be, its light comes back
    // stretched by ‖K‖.
    let brightest = picture.data().iter().fold(0.0f32, |a, &v| a.max(v)).max(f32::MIN_POSITIVE);
    let shown = Frame::from_fn(|c| match c {
        Channel::Green => picture.map(|v| v.max(0.0) * (220.0 / brightest)),
        _ => Plane::zeros(picture.size()),
    });
    let seen = session.seen(correction, &shown)?;
    let shown = correction.by_perfect_lens(&[Channel::Green], &shown);
    let (shown, light) = (shown.plane(Channel::Green), seen.light.plane(Channel::Green));
    calibration.norm_squared_seen = (light.dot(light) / shown.dot(shown)) as f32;
    Ok(())
}

/// Judges whether the rig stood still all the while: the first pattern again, and the board.
fn rest(
    session: &mut Session<'_>,
    calibration: &Calibration,
    correction: &Correction,
    first: &Plane,
    board: Option<&Board>,
) -> Result<(), CalibrateError> {
    if let Some(board) = board {
        return board::still(session, board);
    }
    let again = session.seen(correction, &on_grey(&pattern(session, 200, 0, 1)))?;
    let change = difference(again.light.plane(Channel::Green), first).rms();
    let times = session.config.calibration.captures_averaged.max(1) as f32;
    let noise = calibration.noise[Channel::Green.index()].sigma(GREY) / times.sqrt();
    judge::repeats(change, f64::from(noise))
}

/// The chart in the photo's frame, its paper going on over the margin.
fn chart(session: &Session<'_>) -> Frame<Work> {
    let (photo, margin) = (session.layout.photo, session.layout.margin_px);
    let chart = patterns::chart(photo);
    let at = |p: usize, limit: usize| p.saturating_sub(margin).min(limit - 1);
    let plane = Plane::from_fn(session.layout.canvas(), |x, y| {
        chart.at(at(x, photo.width), at(y, photo.height))
    });
    Frame::from_fn(|_| plane.clone())
}
