//! Photometry: black level, dark corner, mixing of channels and response curves.

use super::CalibrateError;
use super::session::{Session, difference, rim_px, smooth};
use crate::calibration::cross_channel::{self, BlockReading};
use crate::calibration::{Calibration, CrossChannel, dark_corner as surfaces, response};
use crate::frame::{Channel, Frame, Plane, Rect, SensorSpace, Size};
use crate::patterns::{self, Gradation, GradationBlock};

/// Gradations in each channel, each with its own shuffle. Measured, see tests/tables/constants.md.
pub(super) const GRADATIONS: usize = 3;
/// Number of levels of a gradation: every fifth code, with seven blocks each on the default rig.
const LEVELS: usize = 52;

pub(super) fn black(
    session: &Session<'_>,
    calibration: &mut Calibration,
    black: &Frame<SensorSpace>,
) -> Result<(), CalibrateError> {
    for c in Channel::ALL {
        calibration.black[c.index()] = smooth(black.plane(c), &session.layout, 0, "black level")?;
    }
    Ok(())
}

/// Fits the dark corner to flats at code 128, one channel at a time (paper §3). Counts per level
/// refer to code 128 until the response curve is known.
pub(super) fn dark_corner(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    black: &Frame<SensorSpace>,
) -> Result<(), CalibrateError> {
    session.step("dark corner");
    let photo = Rect { x: 0, y: 0, size: calibration.photo };
    for c in Channel::ALL {
        let flat = session.counts(&patterns::flat_of(session.layout.panel, c, 128))?;
        let over = difference(flat.plane(c), black.plane(c));
        let surface = smooth(&over, &session.layout, rim_px(session.config), "dark corner")?;
        let (ratio, counts) = surfaces::normalised(&surface, photo);
        if !counts.is_finite() || counts <= 0.0 {
            let found = format!("code 128 gives {counts:.1} counts over black");
            return Err(CalibrateError::Response(c, found));
        }
        calibration.dark_corner[c.index()] = ratio;
        calibration.counts_per_level[c.index()] = counts as f32;
    }
    Ok(())
}

/// Fits C and the response curves to gradations, one channel at a time (paper Eq. 13).
pub(super) fn cross_channel(
    session: &mut Session<'_>,
    calibration: &mut Calibration,
    black: &Frame<SensorSpace>,
) -> Result<(), CalibrateError> {
    session.step("cross-channel");
    let mut c_matrix = [[0.0; 3]; 3];
    for c in Channel::ALL {
        let i = c.index();
        let mut readings = Vec::new();
        for n in 0..GRADATIONS {
            let seed = (GRADATIONS * i + n) as u64;
            let gradation = gradation(session, calibration, SUPPORTS_WIDE, seed);
            let seen = session.counts(&gradation.in_channel(c))?;
            let over = Frame::from_fn(|k| difference(seen.plane(k), black.plane(k)));
            readings.extend(read(session, calibration, c, &gradation, &over));
        }
        let refuse = |found: String| CalibrateError::Response(c, found);
        c_matrix[i] = cross_channel::row(i, &readings)
            .ok_or_else(|| refuse("gradations show no contrast".to_owned()))?;
        let curve = response::among_neighbours(i, &readings).map_err(|e| refuse(e.to_string()))?;
        calibration.counts_per_level[i] /= curve.light(128);
        calibration.curves[i] = curve;
    }
    calibration.cross_channel = CrossChannel { c: c_matrix };
    Ok(())
}

/// Width of a gradation's blocks, and half width of the part read at their centres, both in widths
/// of a lens function. From other blocks, only glare reaches that part.
const SUPPORTS_WIDE: f64 = 1.5;
const SUPPORTS_READ: f64 = 0.25;
/// Block width and half width for noise ([`flat_places`]), which small motions must not affect.
pub(super) const SUPPORTS_APART: f64 = 3.0;
const SUPPORTS_FLAT: f64 = 0.75;

/// A gradation whose blocks are `supports` lens functions wide.
pub(super) fn gradation(
    session: &Session<'_>,
    calibration: &Calibration,
    supports: f64,
    seed: u64,
) -> Gradation {
    let map = &calibration.geometry.work_to_panel;
    let (a, b) = (map.at(0.0, 0.0), map.at(1.0, 0.0));
    let panel_px_per_work_px = (b.0 - a.0).hypot(b.1 - a.1);
    let wide = supports * support_px(session) * panel_px_per_work_px;
    Gradation::new(
        session.layout.panel,
        wide.ceil() as usize,
        &Gradation::levels(LEVELS),
        patterns::nth_seed(51, seed),
    )
}

/// Reads the blocks on the canvas, each over the middle third of its width.
fn read(
    session: &Session<'_>,
    calibration: &Calibration,
    channel: Channel,
    gradation: &Gradation,
    over: &Frame<SensorSpace>,
) -> Vec<BlockReading> {
    let layout = &session.layout;
    let dark = &calibration.dark_corner[channel.index()];
    let reach = (SUPPORTS_READ * support_px(session)).floor();
    let reading = |(block, (x, y)): (GradationBlock, (f64, f64))| {
        let sensor = (x + layout.photo_x_px as f64, y + layout.photo_y_px as f64);
        let share = dark.at(x, y);
        let (u, v) =
            (2.0 * x / layout.photo.width as f64 - 1.0, 2.0 * y / layout.photo.height as f64 - 1.0);
        BlockReading {
            code: block.code,
            around: block.around,
            field: (u * u + v * v) / 2.0,
            counts: [0, 1, 2].map(|k| mean(&over.planes()[k], sensor, reach) / share),
        }
    };
    middles(session, calibration, gradation, reach).map(reading).collect()
}

/// Blocks whose middles lie on the canvas, with their centres in photo pixels.
fn middles<'a>(
    session: &Session<'_>,
    calibration: &'a Calibration,
    gradation: &'a Gradation,
    reach: f64,
) -> impl Iterator<Item = (GradationBlock, (f64, f64))> + use<'a> {
    let domain = session.layout.domain();
    let map = &calibration.geometry.panel_to_work;
    gradation.blocks().filter_map(move |block| {
        let (x, y) = map.at(block.centre.0, block.centre.1);
        let inside = x - reach >= domain.left
            && x + reach <= domain.right
            && y - reach >= domain.top
            && y + reach <= domain.bottom;
        inside.then_some((block, (x, y)))
    })
}

/// Places of the middles of a wide gradation's blocks on the canvas.
pub(super) fn flat_places(
    session: &Session<'_>,
    calibration: &Calibration,
    gradation: &Gradation,
) -> Vec<Rect> {
    let reach = (SUPPORTS_FLAT * support_px(session)).floor().max(1.0);
    let margin = session.layout.margin_px as f64;
    let first = |at: f64| (at + margin - reach).round().max(0.0) as usize;
    let side = 2 * reach as usize + 1;
    let area = |(_, (x, y))| Rect { x: first(x), y: first(y), size: Size::new(side, side) };
    middles(session, calibration, gradation, reach).map(area).collect()
}

fn support_px(session: &Session<'_>) -> f64 {
    session.config.calibration.function_support_px as f64
}

/// Mean of `plane` over the square within `reach` of (`x`, `y`).
fn mean(plane: &Plane, (x, y): (f64, f64), reach: f64) -> f64 {
    let range = |at: f64, limit: usize| {
        let first = (at - reach).round().max(0.0) as usize;
        let past = ((at + reach).round().max(0.0) as usize + 1).min(limit);
        first.min(past)..past
    };
    let (columns, rows) = (range(x, plane.width()), range(y, plane.height()));
    let count = (columns.len() * rows.len()).max(1) as f64;
    rows.map(|y| plane.row(y)[columns.clone()].iter().map(|&v| f64::from(v)).sum::<f64>())
        .sum::<f64>()
        / count
}
