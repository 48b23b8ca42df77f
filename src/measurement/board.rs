//! Geometry of each channel from checkerboards, and the check that the rig has not moved.

use super::motion::{self, PanelPlace};
use super::session::{Session, difference};
use super::{CalibrateError, judge};
use crate::calibration::checkerboard::{self, Affine};
use crate::calibration::geometric::{Geometry, Pair};
use crate::config;
use crate::frame::{Channel, Frame, Plane, SensorSpace};
use crate::patterns;

/// The green checkerboard as found, for the later check.
pub(super) struct Board {
    near: Affine,
    corners: Vec<Pair>,
    /// Number of its capture.
    capture: u32,
    black: Plane,
}

/// The error for spots that give no affine map.
fn in_line() -> CalibrateError {
    let found = "the three spots are in a line: the panel is seen edge-on or in a reflection";
    CalibrateError::NotInView(found.to_owned())
}

/// Measures Work ↔ panel for each channel; also returns the green board.
pub(super) fn geometry(
    session: &mut Session<'_>,
    black: &Frame<SensorSpace>,
) -> Result<([Geometry; 3], Option<Board>), CalibrateError> {
    let (layout, domain) = (session.layout, session.layout.domain());
    if session.config.calibration.geometry == config::Alignment::OneToOne {
        let one = Geometry::one_to_one(domain, layout.photo_x_px as f64, layout.photo_y_px as f64);
        return Ok(([one.clone(), one.clone(), one], None));
    }
    session.step("geometry");
    let locator = session.counts(&patterns::locator(layout.panel))?;
    let mut spots = [(0.0, 0.0); 3];
    for c in Channel::ALL {
        // A spot is white of one channel, whose brightness was checked before.
        let allowed = 0.02 * f64::from(layout.saturated);
        let over = difference(locator.plane(c), black.plane(c));
        spots[c.index()] = checkerboard::spot(&over, c.name(), allowed).map_err(judge::board)?;
    }
    let near = Affine::through(patterns::locator_spots(layout.panel), spots).ok_or_else(in_line)?;
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
            let capture = session.captures();
            green = Some(Board { near, corners, capture, black: black.plane(c).clone() });
        }
    }
    if let Some(board) = &green {
        check_place(session, board)?;
    }
    match <[Geometry; 3]>::try_from(found) {
        Ok(geometry) => Ok((geometry, green)),
        Err(_) => Err(in_line()),
    }
}

/// Captures the checkerboard in `channel` and finds its corners, (sensor, panel).
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

/// Checks how far the green board has moved.
///
/// # Errors
/// [`CalibrateError::Moving`] if it moved too far or too fast.
pub(super) fn check_place(session: &mut Session<'_>, board: &Board) -> Result<(), CalibrateError> {
    let again = corners(session, &board.near, Channel::Green, &board.black)?;
    let at_px = judge::displacement(&board.corners, &again);
    let then = PanelPlace { capture: board.capture, at_px: (0.0, 0.0) };
    motion::check(&[then, PanelPlace { capture: session.captures(), at_px }])
}
