//! Series of patterns about grey: shown, captured, and freed of flicker and the panel's beat.

use std::sync::Arc;

use super::CalibrateError;
use super::motion::{self, PanelPlace};
use super::session::{Session, difference, rim_px};
use crate::calibration::lens_blur::{self, Shot};
use crate::calibration::{Correction, dark_corner};
use crate::deconvolution::data_term::TRUSTED;
use crate::deconvolution::forward_convolution::Seen;
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::panel_beat::{PanelBeat, SeenChannel};
use crate::deconvolution::registration::{Comparison, Registration};
use crate::frame::{Channel, Frame, Plane, Rect, Size, Work};
use crate::patterns;

/// Grey level about which patterns oscillate.
pub(super) const GREY: f32 = 127.5;
/// Amplitude of the patterns, grey levels. The bicubic warp overshoots by a factor of up to 1.5,
/// which stays within the panel's range.
const AMPLITUDE: f32 = 80.0;
/// Number of patterns for the broad light.
pub(super) const BROAD_PATTERNS: usize = 4;
/// Sides of the squares for the broad light, in function widths; the last is held out. Guess.
const SQUARES: [usize; BROAD_PATTERNS] = [2, 4, 8, 3];
/// Largest deviation from 1 of a capture's gain that is corrected; a larger one is not flicker.
/// Guess: several times a backlight's flicker.
const GAIN_MAX: f64 = 0.03;
/// Width of the grey border of a pattern. The panel repeats the canvas's border, so everything
/// beyond it is grey, and no light enters that the lens model lacks.
const GREY_BORDER_PX: usize = 2;

/// The `n`-th of [`BROAD_PATTERNS`] patterns: large random squares, up to the canvas's border.
pub(super) fn squares(session: &Session<'_>, n: usize) -> Frame<Work> {
    let size = session.layout.canvas();
    let widest = (size.width.min(size.height) / 2).max(1);
    let side = SQUARES[n % BROAD_PATTERNS] * session.config.calibration.function_support_px;
    random_squares(size, 300, n, side.min(widest))
}

/// The `n`-th pattern of a series: random squares of `side_px`, different in each channel.
fn random_squares(size: Size, series: u64, n: usize, side_px: usize) -> Frame<Work> {
    let coarse = Size::new(size.width.div_ceil(side_px), size.height.div_ceil(side_px));
    Frame::from_fn(|c| {
        let seed = patterns::nth_seed(series, (3 * n + c.index()) as u64);
        let signs = patterns::pseudo_random(coarse, seed);
        Plane::from_fn(size, |x, y| AMPLITUDE * signs.at(x / side_px, y / side_px))
    })
}

/// The `n`-th pseudo-random pattern of a series: squares of `pixel_px`, different in each channel,
/// with a grey border.
pub(super) fn pattern(
    session: &Session<'_>,
    series: u64,
    n: usize,
    pixel_px: usize,
) -> Frame<Work> {
    let size = session.layout.canvas();
    let mut pattern = random_squares(size, series, n, pixel_px);
    let is_inside = |at: usize, side: usize| at >= GREY_BORDER_PX && at + GREY_BORDER_PX < side;
    for plane in pattern.planes_mut() {
        for (y, x) in (0..size.height).flat_map(|y| (0..size.width).map(move |x| (y, x))) {
            if !is_inside(x, size.width) || !is_inside(y, size.height) {
                plane.set(x, y, 0.0);
            }
        }
    }
    pattern
}

/// The generator of a series of pseudo-random patterns.
pub(super) fn random(series: u64, pixel_px: usize) -> impl Fn(&Session<'_>, usize) -> Frame<Work> {
    move |session, n| pattern(session, series, n, pixel_px)
}

#[derive(Clone, Copy)]
pub(super) struct Patterns<'a> {
    pub(super) count: usize,
    pub(super) nth: &'a dyn Fn(&Session<'_>, usize) -> Frame<Work>,
    /// Side of the patterns' squares, to which captures are averaged.
    pub(super) pixel_px: usize,
}

/// Means of `plane` over squares of `pixel_px`.
fn averaged(plane: &Plane, pixel_px: usize) -> Plane {
    let coarse = Size::new(plane.width() / pixel_px, plane.height() / pixel_px);
    Plane::from_fn(coarse, |x, y| {
        let rows = (0..pixel_px).map(|v| &plane.row(y * pixel_px + v)[x * pixel_px..][..pixel_px]);
        rows.flatten().sum::<f32>() / (pixel_px * pixel_px) as f32
    })
}

pub(super) fn on_grey(picture: &Frame<Work>) -> Frame<Work> {
    Frame::from_fn(|c| picture.plane(c).map(|v| GREY + v))
}

/// Light that a perfect lens would see if the panel, displaced by `at_px`, showed `picture` on
/// grey, minus grey: the input of the lens model.
fn on_panel(correction: &Correction, picture: &Frame<Work>, at_px: (f64, f64)) -> Frame<Work> {
    let seen = correction.by_perfect_lens(&Channel::ALL, &on_grey(picture), at_px);
    Frame::from_fn(|c| seen.plane(c).map(|v: f32| v - GREY))
}

/// Captures of a series of patterns.
pub(super) struct Series<'a> {
    pub(super) patterns: Patterns<'a>,
    /// Differences from grey, per channel, averaged to the pattern's squares.
    pub(super) shots: Arc<[Vec<Shot>; 3]>,
    /// 1 where all captures can be trusted, per channel.
    pub(super) trusted: Arc<Frame<Work, u8>>,
    /// Green light in the capture of the first pattern.
    pub(super) first: Plane,
    pub(super) places: Vec<PanelPlace>,
}

pub(super) fn shoot<'a>(
    session: &mut Session<'_>,
    correction: &Correction,
    patterns: Patterns<'a>,
) -> Result<Series<'a>, CalibrateError> {
    let Patterns { count, nth, pixel_px } = patterns;
    let mut places = Vec::new();
    let size = session.layout.canvas();
    let mut grey = session.seen(correction, &Frame::filled(size, GREY))?;
    remove_beat(session, correction, &mut grey, &Frame::zeros(size));
    let mut trusted = grey.trusted.clone();
    let flat = smooth_grey(session, &grey)?;
    let scale = grey_scale(session, &grey, &flat);
    let mut shots = [Vec::new(), Vec::new(), Vec::new()];
    let mut first = None;
    for n in 0..count {
        let shown = nth(session, n);
        let mut seen = session.seen(correction, &on_grey(&shown))?;
        places.push(PanelPlace { capture: session.captures(), at_px: (0.0, 0.0) });
        remove_beat(session, correction, &mut seen, &shown);
        trusted.update(&seen.trusted, |all, trusted| *all &= trusted);
        if first.is_none() {
            first = Some(seen.light.plane(Channel::Green).clone());
        }
        let gain = pattern_gain(session, &seen, &shown, &flat);
        let on_panel = on_panel(correction, &shown, (0.0, 0.0)).into_planes();
        for (c, shown) in Channel::ALL.iter().zip(on_panel) {
            let mut light = seen.light.plane(*c).clone();
            light.scale(1.0 / gain);
            let mut seen = difference(&light, flat.plane(*c));
            seen.scale(1.0 / scale[c.index()]);
            shots[c.index()]
                .push(Shot { shown: averaged(&shown, pixel_px), seen: averaged(&seen, pixel_px) });
        }
    }
    let first = first.unwrap_or_else(|| Plane::filled(size, GREY));
    let whole = trusted.planes().each_ref().map(|plane| {
        averaged(&plane.map(f32::from), pixel_px).map(|share| u8::from(share > 0.999))
    });
    let (shots, trusted) = (Arc::new(shots), Arc::new(Frame::from_planes(whole)));
    Ok(Series { patterns, shots, trusted, first, places })
}

impl Series<'_> {
    /// Registers each capture to its prediction by `model`, whose functions are off centre by
    /// `off_px`, and moves what was shown to the place found. Returns false if the panel was where
    /// it had been assumed.
    pub(super) fn follow(
        &mut self,
        session: &mut Session<'_>,
        correction: &Correction,
        model: &LensModel,
        off_px: (f64, f64),
    ) -> Result<bool, CalibrateError> {
        let pixel_px = self.patterns.pixel_px;
        let mut is_still = off_px.0.hypot(off_px.1) <= motion::STILL_PX;
        for n in 0..self.places.len() {
            session.go_on()?;
            let [seen, shown] = [|shot: &Shot| shot.seen.clone(), |shot: &Shot| shot.shown.clone()]
                .map(|plane| Frame::from_fn(|c| plane(&self.shots[c.index()][n])));
            let comparison = Comparison {
                seen: &on_grey(&seen),
                predicted: &on_grey(&model.seen(&Channel::ALL, &shown)),
                mask: &self.trusted,
                area: Rect { x: 0, y: 0, size: seen.size() },
                channels: &Channel::ALL,
            };
            // Registered pixel by pixel: means of random patterns over cells have little contrast.
            let (x, y) = Registration::fit(&comparison, 1).shift_px;
            let (x, y) = (pixel_px as f64 * x, pixel_px as f64 * y);
            is_still &= x.hypot(y) <= motion::STILL_PX;
            let at_px = &mut self.places[n].at_px;
            *at_px = (at_px.0 + x + off_px.0, at_px.1 + y + off_px.1);
        }
        if is_still {
            return Ok(false);
        }
        let shots = Arc::make_mut(&mut self.shots);
        for (n, place) in self.places.iter().enumerate() {
            session.go_on()?;
            let shown = on_panel(correction, &(self.patterns.nth)(session, n), place.at_px);
            for (c, shots) in Channel::ALL.into_iter().zip(shots.iter_mut()) {
                shots[n].shown = averaged(shown.plane(c), pixel_px);
            }
        }
        Ok(true)
    }
}

/// Removes the noise of a capture of grey by a smooth surface. Where the panel ends with the
/// canvas, grey falls off at the border, and the capture is returned unchanged.
fn smooth_grey(session: &Session<'_>, grey: &Seen) -> Result<Frame<Work>, CalibrateError> {
    let mut flat = grey.light.clone();
    if rim_px(session.config) > 0 {
        return Ok(flat);
    }
    let margin = session.layout.margin_px;
    for plane in flat.planes_mut() {
        let surface = dark_corner::smooth(plane, (margin, margin), session.layout.domain(), 0)
            .map_err(|source| CalibrateError::Fit { step: "grey", source })?;
        *plane = session.layout.on_canvas(&surface);
    }
    Ok(flat)
}

/// Removes the beat of the panel's columns from `seen`, the capture of the pattern `shown` on grey.
/// There is no lens model yet: within large squares the expected light equals what was shown, and
/// finer patterns count as noise about grey.
fn remove_beat(
    session: &Session<'_>,
    correction: &Correction,
    seen: &mut Seen,
    shown: &Frame<Work>,
) {
    let layout = correction.layout();
    let support_px = session.config.calibration.function_support_px;
    let (margin, wave) = (layout.margin_px, correction.column_wave());
    for c in Channel::ALL {
        let inside = lens_blur::within_a_square(shown.plane(c), support_px);
        let is_fine = !inside.data().contains(&1);
        let expected = |light: f32| if is_fine { GREY } else { GREY + light };
        let trusted = seen.trusted.plane(c);
        let beat = PanelBeat::estimate(&SeenChannel {
            light: seen.light.plane(c),
            predicted: &shown.plane(c).map(expected),
            valid: &|x, y| trusted.at(x, y) == TRUSTED && (is_fine || inside.at(x, y) == TRUSTED),
            photo: Rect { x: margin, y: margin, size: layout.photo },
            wave: &wave,
            at_sites: layout.mosaic.is_some(),
        });
        if let Some(beat) = beat {
            beat.remove(seen.light.plane_mut(c), &wave);
        }
    }
}

/// Gain of the capture of grey in each channel against the calibrated brightness: flicker of a
/// backlight must not count as light lost by patterns. 1 where the panel ends with the canvas.
fn grey_scale(session: &Session<'_>, grey: &Seen, flat: &Frame<Work>) -> [f32; 3] {
    if rim_px(session.config) > 0 {
        return [1.0; 3];
    }
    let size = session.layout.canvas();
    let predicted = Frame::filled(size, GREY);
    Channel::ALL.map(|c| {
        let comparison = Comparison {
            seen: flat,
            predicted: &predicted,
            mask: &grey.trusted,
            area: Rect { x: 0, y: 0, size },
            channels: &[c],
        };
        Registration::fit_gain(&comparison, GAIN_MAX) as f32
    })
}

/// Gain of the capture of a pattern on grey against that of grey alone, by sums of light, which a
/// lens preserves. 1 where the panel ends with the canvas, as light is lost there.
fn pattern_gain(
    session: &Session<'_>,
    seen: &Seen,
    shown: &Frame<Work>,
    flat: &Frame<Work>,
) -> f32 {
    if rim_px(session.config) > 0 {
        return 1.0;
    }
    let border = session.config.calibration.function_support_px / 2;
    let canvas = session.layout.canvas();
    let inner = |side: usize| side.saturating_sub(2 * border);
    let mut predicted = flat.clone();
    predicted.update(shown, |light, shown| *light += shown);
    let comparison = Comparison {
        seen: &seen.light,
        predicted: &predicted,
        mask: &seen.trusted,
        area: Rect {
            x: border,
            y: border,
            size: Size::new(inner(canvas.width), inner(canvas.height)),
        },
        channels: &Channel::ALL,
    };
    Registration::fit_gain(&comparison, GAIN_MAX) as f32
}
