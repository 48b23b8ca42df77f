//! The calibration procedure on a rig: show, capture, fit, check.
//!
//! | step | captures (× `captures-averaged`, except trials) | yields |
//! |---|---|---|
//! | trials | 2 black, 1 white | checks of exposure, view and settle time; black level |
//! | linearity | 13 (if `linearity` and the exposure can be set) | camera curve and its check |
//! | response pattern | 8 black, `response-flats` at 224 (each once) | response of sites |
//! | geometry | locator, checkerboard, again | Work ↔ panel; check of focus |
//! | dark corner | 3 flats at 128 | ratio surfaces |
//! | cross-channel | 3 gradations per channel | C, response curves |
//! | centring | grey, 5 patterns of coarse squares, twice | centroids, folded into the geometry |
//! | lens functions | grey, `patterns` | lens functions |
//! | broad light | grey, 4 patterns of large squares (if `broad-term`) | halos |
//! | checks | 2 gradations, 1 pattern again, chart, dominant picture | noise, rest, errors, norms |
//!
//! A one-to-one rig skips geometry and centring. A panel that moves meanwhile is followed; if it
//! moves too far or too fast, the calibration fails (`motion.rs`). The caller stores the result
//! ([`crate::calibration::store`]); after an error the stored calibration stays.

mod board;
mod error;
mod judge;
mod lens;
mod linearity;
mod motion;
mod photometric;
mod series;
mod session;
mod sites;

pub use error::CalibrateError;
pub use session::{CalibrationProgress, to_the_end};

use std::ops::ControlFlow;

use crate::calibration::geometric::Geometry;
use crate::calibration::surface::Surface;
use crate::calibration::{
    Calibration, CameraCurve, CrossChannel, Layout, Noise, OperatorNorms, ResponseCurve,
    ResponsePattern,
};
use crate::config;
use crate::deconvolution::lens_model::LensFunctions;
use crate::deconvolution::method::WAVELET_LEVELS;
use crate::frame::{Codes, Frame, SensorSpace};
use crate::rig::exposure::Devices;
use crate::rig::frame_mark::MarkPlace;
use session::Session;

/// Calibrates `rig`, described by `config`; the result's generation follows that of `previous`.
/// `watch` is called after each capture and cancels the calibration by [`ControlFlow::Break`].
///
/// # Errors
/// When a check, a fit or a capture fails, or the calibration is cancelled.
pub fn calibrate(
    rig: &mut Devices,
    config: &config::RigFile,
    previous: Option<&Calibration>,
    watch: &mut dyn FnMut(CalibrationProgress) -> ControlFlow<()>,
) -> Result<Calibration, CalibrateError> {
    let mut session = Session::new(rig, config, watch, captures(config));
    let mut black = trials(&mut session)?;
    if config.calibration.linearity {
        session.curve = linearity::measure(&mut session, &black)?;
        for plane in black.planes_mut() {
            plane.data_mut().iter_mut().for_each(|count| *count = session.curve.count(*count));
        }
    }
    let flats = sites::expose(&mut session)?;
    let (geometry, board) = board::geometry(&mut session, &black)?;
    let mut calibration = blank(config, geometry);
    calibration.camera_curve = session.curve.clone();
    calibration.generation = previous.map_or(1, |p| p.generation.wrapping_add(1));
    photometric::black(&session, &mut calibration, &black)?;
    if let Some(flats) = &flats {
        sites::pattern(&session, &mut calibration, flats)?;
    }
    photometric::dark_corner(&mut session, &mut calibration, &black)?;
    photometric::cross_channel(&mut session, &mut calibration, &black)?;
    lens::measure(&mut session, &mut calibration, board.as_ref())?;
    calibration.captures = session.captures();
    Ok(calibration)
}

/// Number of captures of a calibration of `config`.
pub fn captures(config: &config::RigFile) -> u32 {
    let asked = &config.calibration;
    let only_if = |needed: bool, captures: usize| if needed { captures } else { 0 };
    let has_board = asked.geometry == config::Alignment::Checkerboard;
    let centring = lens::CENTRINGS * (1 + lens::CENTRING_PATTERNS);
    let averaged = only_if(has_board, 3 + centring)
        + (3 + 3 * photometric::GRADATIONS + 1 + asked.patterns)
        + only_if(asked.broad_term, 1 + series::BROAD_PATTERNS)
        + 5;
    let once = 3
        + only_if(asked.linearity, linearity::CAPTURES)
        + only_if(asked.response_flats > 0, sites::DARKS + asked.response_flats);
    (once + averaged * asked.captures_averaged.max(1)) as u32
}

/// A calibration with `geometry` and neutral values.
fn blank(config: &config::RigFile, geometry: Geometry) -> Calibration {
    let domain = Layout::of(config).domain();
    let one = || Surface::constant(domain, 1.0);
    Calibration {
        rig: config.identity,
        generation: 0,
        photo: config.photo.size(),
        margin_px: config.canvas.margin_px,
        geometry,
        dark_corner: [one(), one(), one()],
        cross_channel: CrossChannel::IDENTITY,
        camera_curve: CameraCurve::straight(),
        curves: [ResponseCurve::linear(), ResponseCurve::linear(), ResponseCurve::linear()],
        black: [one(), one(), one()],
        counts_per_level: [1.0; 3],
        pattern: ResponsePattern::default(),
        noise: [Noise { at_black: 0.0, per_level: 0.0 }; 3],
        functions: LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 1,
            taps: [vec![1.0], vec![1.0], vec![1.0]],
        },
        broad: [Vec::new(), Vec::new(), Vec::new()],
        norms: OperatorNorms::uniform(WAVELET_LEVELS, 1.0),
        at_sites: None,
        focuses: Vec::new(),
        norm_squared_seen: 1.0,
        operator_error: [0.0; 3],
        captures: 0,
    }
}

/// Captures black and white, checks exposure, view and settle time, and returns black.
fn trials(session: &mut Session<'_>) -> Result<Frame<SensorSpace>, CalibrateError> {
    session.step("trials");
    let panel = session.layout.panel;
    let first = session.raw(&Codes::filled(panel, 0))?;
    let white = session.raw(&Codes::filled(panel, 255))?;
    let marks = MarkPlace::of(session.config);
    let is_used = |row: usize| !marks.is_some_and(|marks| marks.reserves(row));
    judge::exposure(&white, &first, session.layout.saturated, &is_used)?;
    let second = session.raw(&Codes::filled(panel, 0))?;
    judge::settled(&white, [&first, &second], &is_used)?;
    let mut black = Frame::from_fn(|c| first.plane(c).map(f32::from));
    black.update(&second, |black, count| *black = (*black + f32::from(count)) / 2.0);
    Ok(black)
}
