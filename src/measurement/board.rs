//! Geometry from a checkerboard, and the check that the rig has not moved.

use super::motion::{self, PanelPlace};
use super::session::{Session, difference};
use super::{CalibrateError, judge};
use crate::calibration::checkerboard::{self, Affine};
use crate::calibration::geometric::{Geometry, Pair};
use crate::config;
use crate::frame::{Channel, Frame, Plane, SensorSpace};
use crate::patterns;

/// The checkerboard as found, with which the rig is checked later.
pub(super) struct Board {
    near: Affine,
    corners: Vec<Pair>,
    /// Number of the capture that shows the checkerboard.
    capture: u32,
    black: Plane,
}

/// The error for spots that do not define an affine map.
fn in_line() -> CalibrateError {
    let found = "the three spots are in a line: the panel is seen edge-on or in a reflection";
    CalibrateError::NotInView(found.to_owned())
}

/// Measures Work ↔ panel in green; also returns the board.
pub(super) fn geometry(
    session: &mut Session<'_>,
    black: &Frame<SensorSpace>,
) -> Result<(Geometry, Option<Board>), CalibrateError> {
    let (layout, domain) = (session.layout, session.layout.domain());
    if session.config.calibration.geometry == config::Alignment::OneToOne {
        let (left, top) = (layout.photo_x_px as f64, layout.photo_y_px as f64);
        return Ok((Geometry::one_to_one(domain, left, top), None));
    }
    session.step("geometry");
    let locator = session.counts(&patterns::locator(layout.panel))?;
    let mut spots = [(0.0, 0.0); 3];
    for c in Channel::ALL {
        // Each spot is white in one channel; the brightness of white was checked before.
        let allowed = 0.02 * f64::from(layout.saturated);
        let over = difference(locator.plane(c), black.plane(c));
        spots[c.index()] =
            checkerboard::spot(&over, c.name(), allowed).map_err(CalibrateError::NotInView)?;
    }
    let near = Affine::through(patterns::locator_spots(layout.panel), spots).ok_or_else(in_line)?;
    let black = black.plane(Channel::Green).clone();
    let corners = corners(session, &near, &black)?;
    let capture = session.captures();
    let on_work = |p: &Pair| Pair {
        from: (p.from.0 - layout.photo_x_px as f64, p.from.1 - layout.photo_y_px as f64),
        to: p.to,
    };
    let pairs: Vec<Pair> = corners.iter().map(on_work).collect();
    let geometry = Geometry::fit(domain, &pairs)
        .map_err(|source| CalibrateError::Fit { step: "geometry", source })?;
    judge::on_panel(&geometry, layout.panel)?;
    let board = Board { near, corners, capture, black };
    check_place(session, &board)?;
    Ok((geometry, Some(board)))
}

/// Captures the checkerboard in green and finds its corners, as pairs (sensor, panel).
fn corners(
    session: &mut Session<'_>,
    near: &Affine,
    black: &Plane,
) -> Result<Vec<Pair>, CalibrateError> {
    let (layout, square_px) = (session.layout, session.config.calibration.checker_square_px);
    let shown = patterns::checkerboard(layout.panel, square_px, Channel::Green);
    let over = difference(session.counts(&shown)?.plane(Channel::Green), black);
    let corners = checkerboard::corners(&over, layout.panel, square_px, near).map_err(|found| {
        CalibrateError::WrongFocus(found, "blur narrower than half a square".to_owned())
    })?;
    let expected = checkerboard::in_view(layout.sensor, layout.panel, square_px, near);
    judge::corners(corners.len(), expected)?;
    Ok(corners)
}

/// Checks that the board has moved neither too far nor too fast.
pub(super) fn check_place(session: &mut Session<'_>, board: &Board) -> Result<(), CalibrateError> {
    let again = corners(session, &board.near, &board.black)?;
    let at_px = judge::displacement(&board.corners, &again);
    let then = PanelPlace { capture: board.capture, at_px: (0.0, 0.0) };
    motion::check(&[then, PanelPlace { capture: session.captures(), at_px }])
}
