//! The procedure on a rig: show, see, fit, judge. No questions, no touching.
//!
//! | step | captures (times `captures-averaged`, but for the trials) | yields |
//! |---|---|---|
//! | trials | 2 black, 1 white | judgement of exposure and view; black level |
//! | geometry | locator, 3 checkerboards, 1 again | Work ↔ panel per channel; judgement of focus and rest |
//! | dark corner | 3 flats at 128 | ratio surfaces |
//! | cross-channel | 3 gradations a channel | C, response curves |
//! | centring | grey, 5 patterns of coarse squares, twice | centroids of the lens functions, folded into the geometry |
//! | lens functions | grey, `patterns` | lens functions, ‖K‖² |
//! | broad light | grey, 4 patterns of large squares, when `broad-term` is on | halos |
//! | checks | 2 gradations, 1 pattern again, chart, dominant picture | noise, rest, operator error, ‖K‖² seen |
//!
//! A one-to-one rig skips geometry and centring. The caller keeps the result
//! ([`crate::calibration::store`]); on any error what was kept before stays.

mod error;
mod judge;
mod lens;
mod photometric;
mod session;

pub use error::CalibrateError;

use crate::calibration::checkerboard::{self, Affine};
use crate::calibration::geometric::{Geometry, Pair};
use crate::calibration::surface::{Domain, Surface};
use crate::calibration::{Calibration, CrossChannel, Curve, Layout, Noise, dark_corner};
use crate::config;
use crate::deconvolution::lens_model::LensFunctions;
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::{Channel, Frame, Plane, Sensor};
use crate::patterns::{self, Trial};
use crate::rig::exposure::Rig;
use crate::rig::frame_mark::MarkPlace;
use session::{Session, difference, numbers};

/// How far a calibration is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// What is being measured.
    pub step: &'static str,
    /// Captures made.
    pub captures: u32,
    /// Captures there will be.
    pub total: u32,
}

/// Calibrates `rig`, which is described by `config`; the result's generation follows that of
/// `previous`.
///
/// # Errors
/// Which of panel not in view, over-exposed, too dark, moving, wrong focus it is, or that the rig
/// brought no captures.
pub fn calibrate(
    rig: &mut Rig,
    config: &config::Rig,
    previous: Option<&Calibration>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Calibration, CalibrateError> {
    let mut session = Session::new(rig, config, progress, captures(config));
    let black = trials(&mut session)?;
    let (geometry, board) = geometry(&mut session, &black)?;
    let mut calibration = blank(config, geometry);
    calibration.generation = previous.map_or(1, |p| p.generation.wrapping_add(1));
    photometric::black(&mut calibration, config, &black)?;
    photometric::dark_corner(&mut session, &mut calibration, &black)?;
    photometric::cross_channel(&mut session, &mut calibration, &black)?;
    lens::measure(&mut session, &mut calibration, board.as_ref())?;
    calibration.captures = session.captures();
    Ok(calibration)
}

/// Captures that a calibration of `config` takes.
pub fn captures(config: &config::Rig) -> u32 {
    let board = match config.calibration.geometry {
        config::Geometry::Checkerboard => {
            (1 + 3 + 1, lens::CENTRINGS * (1 + lens::CENTRING_PATTERNS))
        }
        config::Geometry::OneToOne => (0, 0),
    };
    let broad = if config.calibration.broad_term { 1 + lens::BROAD_PATTERNS } else { 0 };
    let averaged = broad
        + board.0
        + 3
        + 3 * photometric::GRADATIONS
        + board.1
        + 1
        + config.calibration.patterns
        + 5;
    (3 + averaged * config.calibration.captures_averaged.max(1)) as u32
}

/// The sizes that a [`crate::calibration::Correction`] for `config` needs.
pub fn layout(config: &config::Rig) -> Layout {
    Layout {
        panel: config.panel.size(),
        sensor: config.camera.size(),
        photo: config.photo.size(),
        photo_x_px: config.camera.photo_x_px,
        photo_y_px: config.camera.photo_y_px,
        margin_px: config.canvas.margin_px,
        saturated: config.camera.count_max(),
    }
}

/// The canvas in Work coordinates, centres of its outermost pixels.
fn canvas(layout: &Layout) -> Domain {
    let margin = layout.margin_px as f64;
    Domain {
        left: -margin,
        top: -margin,
        right: layout.photo.width as f64 - 1.0 + margin,
        bottom: layout.photo.height as f64 - 1.0 + margin,
    }
}

/// A calibration of which only the geometry is known.
fn blank(config: &config::Rig, geometry: [Geometry; 3]) -> Calibration {
    let domain = canvas(&layout(config));
    let one = || Surface::constant(domain, 1.0);
    Calibration {
        rig: config.identity,
        generation: 0,
        photo: config.photo.size(),
        margin_px: config.canvas.margin_px,
        geometry,
        dark_corner: [one(), one(), one()],
        cross_channel: CrossChannel::IDENTITY,
        curves: [Curve::linear(), Curve::linear(), Curve::linear()],
        black: [one(), one(), one()],
        counts_per_level: [1.0; 3],
        noise: [Noise { at_black: 0.0, per_level: 0.0 }; 3],
        functions: LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 1,
            taps: [vec![1.0], vec![1.0], vec![1.0]],
        },
        broad: [Vec::new(), Vec::new(), Vec::new()],
        norm_squared: [1.0; 3],
        level_norms: std::array::from_fn(|_| LevelNorms::uniform(config.restore.levels, 1.0)),
        norm_squared_seen: 1.0,
        operator_error: [0.0; 3],
        captures: 0,
    }
}

/// Black and white: judges exposure and view, and returns black.
fn trials(session: &mut Session<'_>) -> Result<Frame<Sensor>, CalibrateError> {
    session.step("trials");
    let panel = session.layout.panel;
    let first = session.raw(&patterns::trial(panel, Trial::Black))?;
    let white = session.raw(&patterns::trial(panel, Trial::White))?;
    let marks = MarkPlace::of(session.config);
    let seen = |row: usize| !marks.is_some_and(|marks| marks.keeps(row));
    judge::exposure(&white, &first, session.layout.saturated, &seen)?;
    let mut black = numbers(&first);
    let second = numbers(&session.raw(&patterns::trial(panel, Trial::Black))?);
    for (a, b) in black.planes_mut().iter_mut().zip(second.planes()) {
        a.data_mut().iter_mut().zip(b.data()).for_each(|(a, b)| *a = (*a + b) / 2.0);
    }
    Ok(black)
}

/// The green board as it was found, to see later whether it still is there.
struct Board {
    near: Affine,
    corners: Vec<Pair>,
    black: Plane,
}

/// Work ↔ panel of each channel, and the green board.
fn geometry(
    session: &mut Session<'_>,
    black: &Frame<Sensor>,
) -> Result<([Geometry; 3], Option<Board>), CalibrateError> {
    let (layout, domain) = (session.layout, canvas(&session.layout));
    if session.config.calibration.geometry == config::Geometry::OneToOne {
        let one = Geometry::one_to_one(domain, layout.photo_x_px as f64, layout.photo_y_px as f64);
        return Ok(([one.clone(), one.clone(), one], None));
    }
    session.step("geometry");
    let locator = session.counts(&patterns::trial(layout.panel, Trial::Locator))?;
    let mut spots = [(0.0, 0.0); 3];
    for c in Channel::ALL {
        // A spot is white of one channel: judged bright enough already, wherever it is seen.
        let allowed = 0.02 * f64::from(layout.saturated);
        let over = difference(locator.plane(c), black.plane(c));
        spots[c.index()] = checkerboard::spot(&over, c.name(), allowed).map_err(judge::board)?;
    }
    let near = Affine::through(patterns::locator_spots(layout.panel), spots)
        .ok_or(checkerboard::CheckerboardError::SpotsInLine)
        .map_err(judge::board)?;
    let mut found = Vec::new();
    let mut green = None;
    for c in Channel::ALL {
        let corners = corners(session, &near, c, black.plane(c))?;
        let pairs: Vec<Pair> = corners
            .iter()
            .map(|p| Pair {
                from: (p.from.0 - layout.photo_x_px as f64, p.from.1 - layout.photo_y_px as f64),
                to: p.to,
            })
            .collect();
        let fit = Geometry::fit(domain, &pairs);
        let (one, misfit) =
            fit.map_err(|source| CalibrateError::Fit { step: "geometry", source })?;
        log::debug!("{} corners in {}, misfit {misfit:.3} panel px", pairs.len(), c.name());
        judge::on_panel(&one, layout.panel)?;
        found.push(one);
        if c == Channel::Green {
            green = Some(Board { near, corners, black: black.plane(c).clone() });
        }
    }
    if let Some(board) = &green {
        still(session, board)?;
    }
    match <[Geometry; 3]>::try_from(found) {
        Ok(geometry) => Ok((geometry, green)),
        Err(_) => Err(judge::board(checkerboard::CheckerboardError::SpotsInLine)),
    }
}

/// The corners of the checkerboard in `channel`, (sensor, panel).
fn corners(
    session: &mut Session<'_>,
    near: &Affine,
    channel: Channel,
    black: &Plane,
) -> Result<Vec<Pair>, CalibrateError> {
    let (layout, square_px) = (session.layout, session.config.calibration.checker_square_px);
    let shown = patterns::checkerboard(layout.panel, square_px, channel);
    let over = difference(session.counts(&shown)?.plane(channel), black);
    let corners =
        checkerboard::corners(&over, layout.panel, square_px, near).map_err(judge::board)?;
    let expected = checkerboard::in_view(layout.sensor, layout.panel, square_px, near);
    judge::corners(corners.len(), expected)?;
    Ok(corners)
}

/// Judges whether the green board still is where it was.
fn still(session: &mut Session<'_>, board: &Board) -> Result<(), CalibrateError> {
    let again = corners(session, &board.near, Channel::Green, &board.black)?;
    judge::still(&board.corners, &again)
}

/// How far into the canvas a flat picture is dimmed by the dark beyond it: half a lens function
/// where the panel ends with the canvas, else not at all.
fn rim_px(config: &config::Rig) -> usize {
    if config.panel.size() == config.canvas_size() {
        config.calibration.function_support_px / 2
    } else {
        0
    }
}

/// The smooth surface through a capture of something flat, leaving out `rim_px` at the canvas's
/// border.
fn smooth(
    plane: &Plane,
    layout: &Layout,
    rim_px: usize,
    step: &'static str,
) -> Result<Surface, CalibrateError> {
    dark_corner::smooth(plane, (layout.photo_x_px, layout.photo_y_px), canvas(layout), rim_px)
        .map_err(|source| CalibrateError::Fit { step, source })
}
